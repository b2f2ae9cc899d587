"""Flights with an ArduPlane that somebody starts by hand, by the line that is printed.

If the environment names one in FTC_ARDUPLANE, a real ArduPlane flies, too.
"""

import contextlib
import os
import shlex
import subprocess
import sys
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
    write_scenario,
)
from json_peer import Answer, into_earth, read_as_json, read_by_text
from needs import ARDUPLANE

from mavlink_defs.endpoint import UdpAddress, bind_udp, free_ports

pytestmark = pytest.mark.sitl

HELPERS = Path(__file__).parents[1] / "helpers"
PEER = (sys.executable, str(HELPERS / "arduplane_peer.py"))
WAITS = "UAV 3 waits for an ArduPlane: arduplane "


def by_hand(folder: Path, duration_s: float = 1.0, **keys: Any) -> Path:
    """Return a scenario of two UAVs of ours and one whose ArduPlane is started by hand."""
    tree = scenario_tree(faults=[], duration_s=duration_s)
    port = free_ports(2)[0] - 20  # of UAV 1
    tree["uavs"][2]["autopilot"] = {"kind": "ardupilot", "port": port, **keys}
    return write_scenario(folder, tree)


class Flight:
    """A `gcs fly` that waits for an ArduPlane, and what is started for it."""

    def __init__(self, folder: Path, *options: str, **keys: Any) -> None:
        self.folder, self.log = folder / "run", folder / "run" / "processes" / "uav3.log"
        out = ("--out", str(self.folder), "--free-ports", "--no-figures")
        self.process = start("gcs", "fly", str(by_hand(folder, **keys)), *out, *options)
        wait_until(lambda: self.log.exists() and WAITS in self.log.read_text(), "it waits")
        self.line = next(one for one in self.log.read_text().splitlines() if WAITS in one)
        self.arguments = shlex.split(self.line.partition(WAITS)[2])
        self._started: list[subprocess.Popen[bytes]] = []

    def start(self, *program: str, **settings: str) -> "subprocess.Popen[bytes]":
        own = self.folder.parent  # where a real one leaves its files
        command = [*program, *self.arguments]
        started = subprocess.Popen(command, env=os.environ | settings, cwd=own)
        self._started.append(started)
        return started

    def end(self) -> tuple[int, str, str]:
        """Wait for its end: exit status, standard output and error."""
        out, error = self.process.communicate(timeout=TIMEOUT_S)
        assert self.process.returncode is not None
        return self.process.returncode, out, error

    def close(self) -> None:
        for one in self._started:
            one.kill()
            one.wait()
        self.process.kill()
        self.process.communicate()
        Path(self.arguments[-1]).unlink()


@contextlib.contextmanager
def waiting(folder: Path, *options: str, **keys: Any) -> Iterator[Flight]:
    flight = Flight(folder, *options, **keys)
    with contextlib.closing(flight):
        yield flight


def test_it_flies_by_the_line_that_is_printed(tmp_path: Path) -> None:
    """The first one is started again before the flight; frames of 2.5 periods have two."""
    settings = {"PEER_CHANNELS": "32", "PEER_RATE_HZ": "400", "PEER_GARBAGE": "1"}
    settings |= {"PEER_READY_S": "2.5", "PEER_ANSWERS": str(tmp_path / "answers")}
    with waiting(tmp_path, "--record", "full") as flight:
        first = tmp_path / "first"
        early = flight.start(*PEER, PEER_READY_S="1e9", PEER_ANSWERS=str(first))
        wait_until(lambda: first.exists() and first.stat().st_size > 10_000, "it is held")
        early.kill()
        flight.start(*PEER, **settings)
        status, out, error = flight.end()
        log = flight.log.read_text()
        said = flight.line.partition(": ")[2]
    assert status == 0, error
    assert said in error, "its arguments are printed"
    assert "Motion, least and greatest" in out
    summary = summary_of(flight.folder)
    assert (summary["completed"], summary["steps"]) == (True, 1000)
    assert "frames of 32 channels at 400 Hz, 0 repeated, 0 missing" in log
    for problem in ("length other than 40 or 72 bytes", "wrong magic number"):
        assert f"dropped 1 datagrams: {problem}" in log
    assert log.count("(SIM_RATE_HZ 400) and gets 2000 us") == 1
    plant = yaml.safe_load((flight.folder / "processes" / "plant.yaml").read_text())
    assert plant["silence_timeout_s"] > 60.0, "the plant waits as long as the bridge"
    recorded = table_of(flight.folder / "trajectory.arrows")
    check_motion(summary, {name: values[recorded["uav"] == 3] for name, values in recorded.items()})
    lines = (tmp_path / "answers").read_bytes().splitlines()[-490:]
    check_answers([read_as_json(line) for line in lines])
    assert read_as_json(lines[-1]) == read_by_text(b"\n" + lines[-1] + b"\n")


def check_motion(summary: Answer, recorded: dict[str, Any]) -> None:
    *ours, own = (uav["motion"] for uav in summary["uavs"])
    assert ours == [None, None]
    for name, values in (
        ("roll_deg", np.degrees(recorded["roll"])),
        ("pitch_deg", np.degrees(recorded["pitch"])),
        ("altitude_m", -recorded["down"]),
        ("airspeed_m_s", recorded["V"]),
    ):
        assert own[name] == pytest.approx([min(values), max(values)], rel=1e-6), name


def check_answers(answers: list[Answer]) -> None:
    """Motion, attitude and sensors agree with each other in time."""
    t, position, velocity, attitude, gyro, felt = (
        np.array([answer[name] for answer in answers])
        for name in ("timestamp", "position", "velocity", "attitude", "imu/gyro", "imu/accel_body")
    )
    dt = np.diff(t)[:, None]
    assert dt == pytest.approx(np.full_like(dt, 0.002))
    middle = (velocity[1:] + velocity[:-1]) / 2.0
    assert np.diff(position, axis=0) / dt == pytest.approx(middle, abs=0.01)
    in_earth = np.array([into_earth(*pair) for pair in zip(felt, attitude, strict=True)])
    gravity = np.array([0.0, 0.0, 9.8])
    acceleration = np.diff(velocity, axis=0) / dt
    expected = ((in_earth + gravity)[1:] + (in_earth + gravity)[:-1]) / 2.0
    assert acceleration == pytest.approx(expected, abs=0.3)
    roll, pitch, _ = attitude.T
    p, q, r = gyro.T
    turning = p + np.tan(pitch) * (q * np.sin(roll) + r * np.cos(roll))
    middle_turning = (turning[1:] + turning[:-1]) / 2.0
    assert np.diff(roll) / dt[:, 0] == pytest.approx(middle_turning, abs=0.02)


def test_one_that_is_started_again_in_flight_ends_it(tmp_path: Path) -> None:
    with waiting(tmp_path, "--speed", "1", "--quiet", duration_s=60.0) as flight:
        first = flight.start(*PEER)
        plant = flight.folder / "processes" / "plant.log"
        wait_until(lambda: "all armed" in plant.read_text(), "it flies")
        first.kill()
        flight.start(*PEER)
        status, _, error = flight.end()
    assert status == 1
    assert "UAV 3: ArduPlane was started again at " in error


def test_it_gives_up_when_nobody_comes(tmp_path: Path) -> None:
    with waiting(tmp_path, "--quiet", answers_within_s=0.5) as flight:
        status, out, error = flight.end()
    assert (status, out) == (1, "")
    assert_one_message(error)
    assert "ArduPlane has been silent for 0.5 s before the flight; no frame has come" in error


def test_a_port_that_is_taken_is_named(tmp_path: Path) -> None:
    scenario = by_hand(tmp_path)
    port = yaml.safe_load(scenario.read_text())["uavs"][2]["autopilot"]["port"] + 20
    options = ("--out", str(tmp_path / "run"), "--free-ports", "--quiet")
    with bind_udp(UdpAddress("127.0.0.1", port), "another program"):
        done = run("gcs", "fly", str(scenario), *options)
    assert done.returncode == 2, done.stderr
    assert_one_message(done.stderr)
    assert f"UDP port {port} on 127.0.0.1 is in use" in done.stderr
    assert "autopilot.port" in done.stderr


@pytest.mark.real_arduplane
def test_a_real_one_flies(tmp_path: Path) -> None:
    with waiting(tmp_path, duration_s=10.0) as flight:
        flight.start(str(Path(ARDUPLANE).resolve()), "--speedup", "100")
        status, _, error = flight.end()
    assert status == 0, error
    own = summary_of(flight.folder)["uavs"][2]
    assert own["attitude_lost_at_s"] is None
    assert own["actuator_messages"] > 100
