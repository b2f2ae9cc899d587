"""Commands to the whole fleet while a member of it is not there: nothing is done by halves."""

import contextlib
import json
import os
import signal
import socket
import subprocess
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from flying import BIN, TIMEOUT_S, environment, free_links, process_of, run, write_scenario
from station import ACCEPTED, NO_ANSWER, SOMEDAY, Up, failed, status_when, up

from mavlink_defs import dialect
from mavlink_defs.framing.frames import FramePacker

pytestmark = pytest.mark.sitl

COMMANDS = {
    "start": ("start",),
    "mode": ("mode", "guided"),
    "fault": ("fault", "set", "rudder", "--effectiveness", "0.5", *SOMEDAY),
    "param": ("param", "set", "TRIG_B2_DEG", "0.5"),
    "profile": ("profile", "upload", "profiles/cruise"),
    "arm": ("arm",),
}
"""Commands that change something, and none of which stops the fleet."""


@contextlib.contextmanager
def stopped(fleet: Up, uav: int) -> Iterator[None]:
    """Give an autopilot's process no processor time."""
    pid = process_of(fleet.folder, f"uav{uav}")
    os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(pid, signal.SIGCONT)


def held(fleet: Up) -> list[Any]:
    """What commands could have changed of UAVs 1 and 2, which are heard."""
    chosen = ("--uav", "1,2")

    def complete(states: list[dict[str, Any]]) -> bool:
        return not any(state["not_heard"] for state in states)

    keys = ("armed", "mode", "faults", "profile")
    states = status_when(fleet, complete, *chosen)["vehicles"]
    params = fleet.gcs_json("param", "get", "TRIG_B2_DEG", *chosen)
    return [*({key: state[key] for key in keys} for state in states), *params]


def test_a_stopped_member_is_named_and_the_others_are_left_alone(tmp_path: Path) -> None:
    with up(tmp_path / "fleet") as fleet:
        before = held(fleet)
        with stopped(fleet, 3):
            waiting = [fleet.begin(*command, "--timeout", "2") for command in COMMANDS.values()]
            for popen in waiting:
                texts = popen.communicate(timeout=TIMEOUT_S)
                done = subprocess.CompletedProcess(popen.args, popen.returncode, *texts)
                assert "UAV 3 of the fleet not heard within 2 s" in failed(done, NO_ANSWER)
                assert "no command was sent; --uav 1,2 chooses" in done.stderr
                assert done.stdout == ""
            assert held(fleet) == before
            done = fleet.gcs("status")
            assert done.returncode == NO_ANSWER
            _, *lines = done.stdout.splitlines()
            assert [line.split()[0] for line in lines[:2]] == ["1", "2"]
            assert "UAV 3 of the fleet not heard" in lines[2:]  # and what the others did not report
            assert fleet.gcs("status", "--uav", "1,2").returncode == ACCEPTED
            assert fleet.gcs("mode", "guided", "--uav", "1,2").returncode == ACCEPTED
        for command in COMMANDS.values():
            answers = fleet.gcs_json(*command)
            assert [a["uav"] for a in answers if a["outcome"] == "accepted"] == [1, 2, 3]
        assert held(fleet) != before


def test_members_that_are_not_yet_started_are_named(tmp_path: Path) -> None:
    """As on several hosts: processes started one by one, without a hub."""
    links = free_links()
    fleet, connect = tmp_path / "fleet", f"udpin:127.0.0.1:{links['gcs_port']}"
    path = write_scenario(tmp_path, faults=[], links=links)
    assert run("gcs", "config", path, "--out", fleet).returncode == ACCEPTED
    with contextlib.ExitStack() as stack:

        def begin(program: str, name: str) -> None:
            command = [BIN / program, fleet / f"{name}.yaml"]
            popen = stack.enter_context(
                subprocess.Popen(command, stderr=subprocess.DEVNULL, env=environment())
            )
            stack.callback(popen.kill)

        begin("sitl-plant", "plant")
        begin("ftc-autopilot", "uav2")
        done = run("gcs", "profile", "upload", path, "--uav", "2", "--connect", connect)
        assert done.returncode == ACCEPTED, done.stderr
        done = run("gcs", "profile", "upload", path, "--connect", connect, "--timeout", "2")
        assert "UAV 1, 3 of the fleet not heard" in failed(done, NO_ANSWER)
        begin("ftc-autopilot", "uav1")
        begin("ftc-autopilot", "uav3")
        everyone = ("--uav", "1,2,3", "--timeout", str(TIMEOUT_S))
        assert run("gcs", "status", *everyone, "--connect", connect).returncode == ACCEPTED
        done = run("gcs", "profile", "upload", path, "--connect", connect)
        assert done.returncode == ACCEPTED, done.stderr
        assert [line[:5] for line in done.stdout.splitlines()] == ["UAV 1", "UAV 2", "UAV 3"]


@contextlib.contextmanager
def heartbeats(system: int) -> Iterator[str]:
    """A vehicle of someone's that sends HEARTBEATs and answers nothing; yields where to bind."""
    (over, frame) = threading.Event(), FramePacker(system, 1)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        address = probe.getsockname()

    def send() -> None:
        message = dialect.MAVLink_heartbeat_message(1, 12, 0, 0, dialect.MAV_STATE_ACTIVE, 3)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            while not over.wait(0.2):
                sock.sendto(frame.pack(message), address)

    thread = threading.Thread(target=send)
    thread.start()
    try:
        yield f"udpin:127.0.0.1:{address[1]}"
    finally:
        over.set()
        thread.join()


def test_what_a_silent_vehicle_does_not_tell_is_said() -> None:
    with heartbeats(9) as connect:
        done = run("gcs", "status", "--connect", connect)
        assert done.returncode == ACCEPTED, done.stderr
        _, row, line = done.stdout.splitlines()
        assert row.split()[:3] == ["9", "up", "no"]
        assert row.split()[-3:] == ["-", "-", "?"]
        assert line == "UAV 9 sends HEARTBEATs, and answered nothing"
        status = json.loads(run("gcs", "status", "--json", "--connect", connect).stdout)
        assert status["not_heard"] == []
        (vehicle,) = status["vehicles"]
        assert {"attitude", "events", "faults"} <= set(vehicle["not_heard"])
        done = run("gcs", "arm", "--connect", connect, "--timeout", "1")
        assert "UAV 9 did not answer" in failed(done, NO_ANSWER)
