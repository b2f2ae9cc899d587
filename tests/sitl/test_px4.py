"""Flights with a PX4 beside autopilots of ours: a peer that checks its simulator as PX4 does."""

import contextlib
import itertools
import json
import os
import random
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from flying import (
    TIMEOUT_S,
    assert_one_message,
    run,
    scenario_tree,
    start,
    summary_of,
    table_of,
    wait_until,
)
from flying import write_scenario as written

from mavlink_defs import dialect
from mavlink_defs.framing.frames import FramePacker

pytestmark = pytest.mark.sitl

HELPERS = Path(__file__).parents[1] / "helpers"
ATTACKS, LEAST = (
    100_000,
    2_000,
)  # until the flight is over; how many there are depends on the machine
_HOSTS = itertools.count(1)


def build(folder: Path, script: str = "") -> str:
    """Return the program of a peer, in a folder as PX4's build has it."""
    for name in ("bin", "etc/init.d-posix"):
        (folder / "px4" / name).mkdir(parents=True)
    (folder / "px4/etc/init.d-posix/rcS").write_text("#!/bin/sh\n")
    program = folder / "px4/bin/px4"
    report = f"PEER_REPORT={folder / 'report'} PEER_OF={program}"
    default = f'exec env {report} {sys.executable} {HELPERS / "px4_peer.py"} "$@"'
    program.write_text(f"#!/bin/sh\n{script or default}\n")
    program.chmod(0o755)
    return str(program)


def a_host() -> str:
    """Return an address of this machine that no other test has: a PX4's port is always 4560."""
    number = os.getpid() * 16 + next(_HOSTS)
    return f"127.{100 + number // 64516 % 100}.{1 + number // 254 % 254}.{1 + number % 254}"


def autopilot(binary: str, host: str = "", **changes: Any) -> dict[str, Any]:
    return {"kind": "px4", "binary": binary, "simulator_host": host or a_host()} | changes


def fleet(
    folder: Path, autopilots: dict[int, Any], duration_s: float = 1.0, **changes: Any
) -> Path:
    """Return scenario 1 without faults, with these autopilots."""
    tree = scenario_tree(faults=[], duration_s=duration_s) | changes
    for uav in tree["uavs"]:
        if uav["id"] in autopilots:
            uav["autopilot"] = autopilots[uav["id"]]
    return written(folder, tree)


def fly_options(folder: Path) -> tuple[str, ...]:
    return ("--out", str(folder / "run"), "--free-ports", "--quiet", "--record", "full")


def flown(folder: Path, scenario: Path) -> "subprocess.CompletedProcess[str]":
    return run("gcs", "fly", str(scenario), *fly_options(folder))


def report_of(folder: Path, uav: int) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / f"report-{uav - 1}.json").read_text())
    return found


def recorded(folder: Path) -> tuple[bytes, bytes]:
    names = "trajectory.arrows", "events.arrows"
    first, second = ((folder / "run" / name).read_bytes() for name in names)
    return first, second


def children_of(binary: str) -> list[int]:
    """Return the processes that a program of `build` has become."""
    found = []
    for one in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if f"PEER_OF={binary}".encode() in (one / "environ").read_bytes().split(b"\0"):
                found.append(int(one.name))
    return found


def test_px4_finds_nothing_wrong_with_its_simulator(tmp_path: Path) -> None:
    binary = build(tmp_path)
    done = flown(tmp_path, fleet(tmp_path, {3: autopilot(binary)}, duration_s=2.0))
    assert done.returncode == 0, done.stderr
    found = report_of(tmp_path, 3)
    assert found["wrong"] == []
    counts, seconds = found["counts"], found["seconds"]
    assert seconds > 4.0, "its launcher, the launch and the flight"
    for name, rate in (
        ("accel 0", 250), ("gyro 0", 250), ("accel 1", 250), ("mag 0", 100), ("baro 0", 50),
        ("diff_press 0", 100), ("HIL_GPS", 10), ("HIL_STATE_QUATERNION", 250), ("HEARTBEAT", 1),
    ):  # fmt: skip
        assert counts[name] == pytest.approx(rate * seconds, abs=5), name
    assert {b - a for a, b in itertools.pairwise(found["truth_us"])} == {4000}
    assert found["mode"] == 4 << 16 | 2 << 24, "AUTO.TAKEOFF"
    assert 400 in found["commands"]
    own = summary_of(tmp_path / "run")["uavs"][2]
    assert own["attitude_lost_at_s"] is None
    assert 250 < own["actuator_messages"] <= 501, "a frame of PX4 is four control periods"
    assert not children_of(binary)


def test_two_of_them_twice_the_same_whatever_noise_is_between_their_messages(
    tmp_path: Path,
) -> None:
    flights = []
    for name, parameters in (("clean", {}), ("noisy", {"PEER_NOISE": 1, "PEER_TWICE": 1})):
        folder = tmp_path / name
        folder.mkdir()
        binary, host = build(folder), a_host()
        two = {n: autopilot(binary, host, parameters=parameters) for n in (2, 3)}
        done = flown(folder, fleet(folder, two))
        assert done.returncode == 0, done.stderr
        for uav in two:
            assert report_of(folder, uav)["wrong"] == []
        flights.append(recorded(folder))
    assert flights[0] == flights[1]


def attack(folder: Path, binary: str, host: str) -> Iterator[int]:
    """Send damaged, strange and spoofed datagrams to the ports of a flight, without end."""
    configs = [yaml.safe_load(f.read_text()) for f in (folder / "processes").glob("*.yaml")]
    (links,) = (c for c in configs if c.get("autopilot", {}).get("kind") == "px4")
    plant = "127.0.0.1", int(links["plant"].rpartition(":")[2])
    script = Path(f"/proc/{children_of(binary)[0]}/cwd/startup/px4-rc.mavlink").read_text()
    at, port = script.partition("-t ")[2].split(" -o ")
    side = at, int(port)
    chance, packer = random.Random(1), FramePacker(3, 1)
    controls = dialect.MAVLink_hil_actuator_controls_message(2**60, [1.0] * 16, 129, 1)
    beat = dialect.MAVLink_heartbeat_message(1, 12, 0, 0, 3, 3)
    done = dialect.MAVLink_ftc_step_done_message(0, 1)
    spoofed = [packer.pack(one) for one in (controls, beat, done)]
    count = 0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        while True:
            frame = bytearray(chance.choice(spoofed))
            if count % 3:
                frame[chance.randrange(len(frame))] ^= 1 << chance.randrange(8)
            data = chance.randbytes(chance.randrange(100)) if count % 7 == 0 else bytes(frame)
            if count % 500 == 0:
                with contextlib.suppress(OSError), socket.create_connection((host, 4562)) as tcp:
                    tcp.sendall(spoofed[1] + spoofed[0] + data)
            with contextlib.suppress(OSError):
                sock.sendto(data, (plant, side)[count % 2])
            count += 1
            yield count


def test_nobody_else_changes_a_bit_of_the_flight(tmp_path: Path) -> None:
    flights = []
    for name, attacks in (("alone", 0), ("attacked", ATTACKS)):
        folder = tmp_path / name
        folder.mkdir()
        fly_under_attack(folder, attacks)
        assert report_of(folder, 3)["wrong"] == []
        flights.append(recorded(folder))
    assert flights[0] == flights[1]


def fly_under_attack(folder: Path, attacks: int) -> None:
    binary, host = build(folder), a_host()
    scenario = fleet(folder, {3: autopilot(binary, host)}, duration_s=8.0)
    flight = start("gcs", "fly", str(scenario), *fly_options(folder))
    log = folder / "run" / "processes" / "plant.log"
    try:
        wait_until(lambda: log.exists() and "all armed" in log.read_text(), "it flies")
        if attacks:
            attacking, sent = attack(folder / "run", binary, host), 0
            while sent < attacks and flight.poll() is None:
                sent = max(itertools.islice(attacking, 100))
                time.sleep(0.01)  # more than a socket's buffer holds is lost, ours among it
            assert sent >= min(attacks, LEAST), "the flight was too short"
        _, error = flight.communicate(timeout=TIMEOUT_S)
        assert flight.returncode == 0, error
    finally:
        flight.kill()


@pytest.mark.parametrize(
    ("parameters", "text"),
    [
        ({"PEER_STOPS_S": 0.4}, "PX4 has not answered a frame for 5 s before the flight"),
        ({"PEER_STOPS_FLY": 5.0}, "PX4 has not answered a frame for 5 s at "),
        ({"PEER_CLOSES_S": 0.4}, "PX4 ended with status 0 before the flight"),
        ({"PEER_CLOSES_FLY": 5.0}, "PX4 ended with status 0 at "),
        ({"PEER_NO_LOCKSTEP": 1}, "built without lockstep before the flight"),
        ({"PEER_AHEAD_US": 4000}, "another simulator sets it, too before the flight"),
        ({"PEER_READY_S": 1e6}, "PX4 is not ready to be armed after 5 s of its time"),
    ],
)
def test_what_goes_wrong_is_one_line(
    tmp_path: Path, parameters: dict[str, float], text: str
) -> None:
    binary = build(tmp_path)
    own = autopilot(binary, parameters=parameters, answers_within_s=5.0, ready_within_s=5.0)
    done = flown(tmp_path, fleet(tmp_path, {3: own}, duration_s=60.0))
    assert (done.returncode, text in done.stderr) == (1, True), done.stderr
    assert not children_of(binary)


def test_a_program_that_is_no_px4_is_told_apart(tmp_path: Path) -> None:
    binary = build(tmp_path, script="echo I am none; exec sleep 1000")
    own = autopilot(binary, connects_within_s=1.0)
    done = flown(tmp_path, fleet(tmp_path, {3: own}))
    assert done.returncode == 1
    assert "no PX4 has connected for 1 s: I am none" in done.stderr
    assert "is autopilot.binary a PX4 built for SITL?" in done.stderr


def test_bad_input_is_one_message(tmp_path: Path) -> None:
    binary, host = build(tmp_path), a_host()
    cases: list[tuple[dict[str, Any], dict[str, Any], str]] = [
        ({"data": str(tmp_path)}, {}, "there is no init.d-posix/rcS in"),
        ({"parameters": {"lower": 1.0}}, {}, "capital letters, digits and _, 16 at most"),
        ({"outputs": {"throttle": {"output": 8}}}, {}, "another one than the throttle's"),
        ({}, {"navigation": "estimated"}, "navigation: true_state"),
    ]
    for changes, top, text in cases:
        scenario = fleet(tmp_path, {3: autopilot(binary, host, **changes)}, **top)
        done = flown(tmp_path, scenario)
        assert (done.returncode, text in done.stderr) == (2, True), done.stderr
        assert_one_message(done.stderr)


def test_a_port_that_is_taken_is_named(tmp_path: Path) -> None:
    host = a_host()
    with socket.create_server((host, 4562)):
        done = flown(tmp_path, fleet(tmp_path, {3: autopilot(build(tmp_path), host)}))
    assert done.returncode != 0
    assert f"TCP port 4562 on {host} is in use" in done.stderr


def test_faults_act_on_it_and_outputs_are_its_own(tmp_path: Path) -> None:
    stuck = {"uav": 3, "actuator": "rudder", "stuck_deg": 15.0, "start_s": 0.3, "end_s": 0.6}
    scenario = fleet(tmp_path, {3: autopilot(build(tmp_path))}, faults=[stuck])
    done = flown(tmp_path, scenario)
    assert done.returncode == 0, done.stderr
    table = table_of(tmp_path / "run" / "trajectory.arrows")
    applied = table["applied_rudder"][table["uav"] == 3]
    assert abs(applied[301:600] - 0.2617993877991494).max() < 1e-6
    assert abs(applied[:300] - 0.2617993877991494).min() > 1e-3


def test_one_that_is_killed_in_flight_is_started_again(tmp_path: Path) -> None:
    binary = build(tmp_path)
    scenario = fleet(tmp_path, {3: autopilot(binary)}, duration_s=15.0)
    flight = start("gcs", "fly", str(scenario), *fly_options(tmp_path), "--restart", "on-failure")
    log = tmp_path / "run" / "processes" / "plant.log"
    wait_until(lambda: log.exists() and "all armed" in log.read_text(), "it flies")
    for child in children_of(binary):
        os.kill(child, signal.SIGKILL)
    _, error = flight.communicate(timeout=TIMEOUT_S)
    assert flight.returncode == 0, error
    summary = summary_of(tmp_path / "run")
    own = summary["uavs"][2]
    assert (summary["completed"], own["restarts"], own["missing_steps"]) == (True, 1, 0)
    found = report_of(tmp_path, 3)
    assert found["wrong"] == []
    assert found["mode"] == 4 << 16 | 2 << 24, "AUTO.TAKEOFF, as it was told before"
    assert not children_of(binary)


def test_a_sensor_fault_acts_on_what_it_is_sent(tmp_path: Path) -> None:
    biased = {"uav": 3, "sensor": "gyro", "instance": 1, "bias_deg_s": 20.0, "start_s": 0.3}
    held = []
    for name, faults in (("with", [biased]), ("without", [])):
        folder = tmp_path / name
        folder.mkdir()
        scenario = fleet(folder, {3: autopilot(build(folder))}, faults=faults)
        done = flown(folder, scenario)
        assert done.returncode == 0, done.stderr
        table = table_of(folder / "run" / "trajectory.arrows")
        held.append(table["held_aileron"][table["uav"] == 3])
    differs = np.flatnonzero(held[0] != held[1])
    assert 300 < differs[0] <= 308, "a frame of PX4 has four control periods"
