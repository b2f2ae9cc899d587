"""`gcs up` under attack: a flood at its hub, a run folder that is lost, a disk that is full."""

import os
import resource
import shutil
import signal
import socket
import threading
from pathlib import Path

import pytest
from flying import process_of, processes_of, wait_until
from station import ALL, Up, status_when, up

from gcs.console.errors import BadInput
from gcs.results.store import EVENTS, TRAJECTORY, batches
from mavlink_defs import dialect
from mavlink_defs.capture.tlog import read_tlog
from mavlink_defs.framing.frames import FramePacker

pytestmark = pytest.mark.sitl


def flies_on(fleet: Up, *uavs: int) -> None:
    """All of these advance in simulated time."""
    chosen = ("--uav", ",".join(map(str, uavs)))
    first = status_when(fleet, lambda states: all(s["time_s"] for s in states), *chosen)
    before = {s["uav"]: s["time_s"] for s in first["vehicles"]}
    status_when(fleet, lambda states: all(s["time_s"] > before[s["uav"]] for s in states), *chosen)


def is_recorded(fleet: Up) -> None:
    """The first batches of events and trajectory are on disk."""

    def has_batches(name: str) -> bool:
        try:
            return bool(list(batches(fleet.folder / name)))
        except BadInput:  # its schema is being written
            return False

    wait_until(lambda: has_batches(TRAJECTORY) and has_batches(EVENTS), "a recording")


def test_a_flood_at_the_hub_keeps_no_other_station_from_commanding(tmp_path: Path) -> None:
    request = dialect.MAVLink_command_long_message(1, 1, 512, 0, 30, 0, 0, 0, 0, 0, 0)
    frame, over = FramePacker(200, 190).pack(request), threading.Event()
    with up(tmp_path, "--start", "--speed", "0.2") as fleet:
        host, port = fleet.hub.removeprefix("udpout:").split(":")
        sent = 0

        def flood() -> None:
            nonlocal sent
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
                while not over.wait(0.001):
                    for _ in range(40):
                        sock.sendto(frame, (host, int(port)))
                    sent += 40

        flooder = threading.Thread(target=flood)
        flooder.start()
        try:
            for value in ("0.5", "0.7"):
                done = fleet.gcs("param", "set", "TRIG_B2_DEG", value, *ALL)
                assert done.returncode == 0, done.stderr
        finally:
            over.set()
            flooder.join()
        assert sent > 5000
        assert "hub: dropped" in fleet.stop()[1]


def test_a_lost_run_folder_costs_the_recording_and_no_aircraft(tmp_path: Path) -> None:
    with up(tmp_path, "--start") as fleet:
        is_recorded(fleet)
        assert any(m.get_type() == "HEARTBEAT" for _, m in read_tlog(fleet.folder / "flight.tlog"))
        second = process_of(fleet.folder, "uav2")
        shutil.rmtree(fleet.folder)
        os.kill(second, signal.SIGKILL)
        flies_on(fleet, 1, 3)
        status_when(fleet, lambda states: len(states) == 3)  # uav2 was started again
        status, text = fleet.stop()
        assert status == 0, text
        assert text.count("recording ended: cannot write") == 1
        assert "started again, without its checkpoint" in text.replace("\n", " ")


def test_a_full_disk_costs_the_recording_and_no_aircraft(tmp_path: Path) -> None:
    with up(tmp_path, "--start") as fleet:
        is_recorded(fleet)
        for process in (fleet.popen.pid, *processes_of(fleet.folder)):
            resource.prlimit(process, resource.RLIMIT_FSIZE, (0, 0))
        flies_on(fleet, 1, 2, 3)
        status, text = fleet.stop()
        assert status == 0, text
        assert text.count("recording ended: cannot write") == 1
