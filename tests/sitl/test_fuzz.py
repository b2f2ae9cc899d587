"""Whole processes under a hail of datagrams from a socket that is none of theirs."""

import contextlib
import functools
import os
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from random import Random
from socket import AF_INET, SOCK_DGRAM, socket
from typing import Any

import numpy as np
import pytest
from flying import (
    TIMEOUT_S,
    arrays_of,
    flying,
    process_of,
    processes_of,
    wait_until,
    write_scenario,
)
from station import up

from fuzzing.frames import MESSAGES, damaged, message_frame, noise
from gcs.fleet.in_process import fly_in_process
from gcs.results.recording import event_table
from gcs.scenario.model import load_scenario

pytestmark = pytest.mark.sitl

IDS = sorted(MESSAGES)
PROCESSES = ("plant", "uav1", "uav2", "uav3")
NOBODY = (99, 1)
NO_AUTOPILOT = 191  # component
PAUSE_S = 0.005
ENOUGH_QUEUED = 30_000  # [bytes] of a receive buffer: none of the flight's may be lost


def udp_ports(pid: int) -> set[int]:
    """The UDP ports that a process has (Linux)."""
    inodes = set()
    for entry in Path(f"/proc/{pid}/fd").iterdir():
        with contextlib.suppress(FileNotFoundError):  # closed meanwhile
            link = os.readlink(entry)
            if link.startswith("socket:["):
                inodes.add(link[8:-1])
    rows = [row.split() for row in Path("/proc/net/udp").read_text().splitlines()[1:]]
    return {int(row[1].split(":")[1], 16) for row in rows if row[9] in inodes}


def queued() -> dict[int, int]:
    """Return what waits in the receive buffers [bytes], by UDP port (Linux)."""
    rows = [row.split() for row in Path("/proc/net/udp").read_text().splitlines()[1:]]
    return {int(row[1].split(":")[1], 16): int(row[4].split(":")[1], 16) for row in rows}


class Hail(threading.Thread):
    """Sends noise, damaged frames and, to the plant, good frames of every system, to all ports."""

    def __init__(self, ports: set[int], plant_port: int) -> None:
        super().__init__(daemon=True)
        self._ports, self._plant_port = sorted(ports), plant_port
        self._closing = threading.Event()
        self.sent = dict.fromkeys(self._ports, 0)

    def __enter__(self) -> "Hail":
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._closing.set()
        self.join()

    def run(self) -> None:
        random = Random(2)
        with socket(AF_INET, SOCK_DGRAM) as sock:
            while not self._closing.wait(PAUSE_S):
                waiting = queued()
                for port in self._ports:
                    if waiting.get(port, 0) > ENOUGH_QUEUED:
                        continue  # its process has not had the processor for a while
                    datagrams = datagrams_to(port == self._plant_port)
                    sock.sendto(random.choice(datagrams), ("127.0.0.1", port))
                    self.sent[port] += 1


@functools.cache
def datagrams_to(plant: bool) -> list[bytes]:
    random = Random(1)
    return [_datagram(random, plant) for _ in range(500)]


def _datagram(random: Random, to_plant: bool) -> bytes:
    kind = random.randrange(3)
    if kind == 0:
        return noise(random)
    # what is whole and says that a vehicle sent it is believed elsewhere: there are no keys. The
    # plant would believe an autopilot, too, once the one it knows has had no processor for a second
    component = NO_AUTOPILOT if kind == 1 else 1
    sender = (random.randint(1, 3), component)
    frame = message_frame(random, random.choice(IDS), sender, NOBODY)
    return frame if kind == 1 and to_plant else damaged(random, frame)


def ports_of(folder: Path) -> Iterator[int]:
    for name in PROCESSES:
        yield from udp_ports(process_of(folder, name))


def test_a_lockstep_flight_is_the_same_bit_for_bit(tmp_path: Path) -> None:
    scenario = write_scenario(tmp_path, duration_s=10.0)  # each step waits for a busy machine
    for plant in (True, False):
        datagrams_to(plant)  # made before the flight: it is short
    expected = event_table(fly_in_process(load_scenario(scenario)))
    folder = tmp_path / "run"
    with flying(folder, scenario, "--quiet", "--record=npz") as popen:
        (plant_port,) = udp_ports(process_of(folder, "plant"))
        ports = {*ports_of(folder), *udp_ports(popen.pid)}
        assert len(ports) == 1 + 3 * 3 + 1
        with Hail(ports, plant_port) as hail:
            wait_until(lambda: popen.poll() is not None or not processes_of(folder), "the end")
        assert popen.wait(TIMEOUT_S) == 0, popen.communicate()
    assert min(hail.sent.values()) > 50
    flown = arrays_of(folder / "events.npz")
    assert flown.keys() == expected.keys()
    for name, values in expected.items():
        assert np.array_equal(flown[name], values), name


def test_status_shows_what_was_dropped_and_why(tmp_path: Path) -> None:
    with up(tmp_path, "--start") as fleet:
        (plant_port,) = udp_ports(process_of(fleet.folder, "plant"))
        hub_port = int(fleet.hub.rpartition(":")[2])
        with Hail({*ports_of(fleet.folder), hub_port}, plant_port) as hail:
            wait_until(lambda: min(hail.sent.values()) > 100, "much is sent")
            pid = process_of(fleet.folder, "uav1")
            os.kill(pid, signal.SIGSTOP)  # as a busy machine does
            time.sleep(2.0)
            os.kill(pid, signal.SIGCONT)
            wait_until(lambda: min(hail.sent.values()) > 300, "enough is sent")
        wait_until(
            lambda: _all_report(fleet.gcs_json("status")["vehicles"]), "every drop is reported"
        )
        lines = ("dropped by UAV 1: gcs link ", "dropped by the plant: ", "wrong checksum")

        def shown() -> bool:
            text = fleet.gcs("status").stdout
            assert text.count("dropped by the plant: ") <= 1
            return all(line in text for line in lines)

        wait_until(shown, "all is shown")
        assert len(processes_of(fleet.folder)) == 5
        status, stderr = fleet.stop()
        assert status == 0
        assert stderr.startswith("hub: dropped ")
        assert all(line.startswith("hub: dropped ") for line in stderr.splitlines())


def _all_report(states: list[dict[str, Any]]) -> bool:
    reported = [state["link"]["drops"] or {} for state in states]
    return len(reported) == 3 and all(
        drops.get("gcs", {}).get("wrong sender", 0) > 0
        and drops.get("formation", {}).get("truncated", 0) > 0
        and drops.get("plant", {}).get("wrong sender", 0) > 0
        for drops in reported
    )
