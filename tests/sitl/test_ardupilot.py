"""`gcs ardupilot` over UDP, flown by a peer that is written from ArduPilot's published protocol."""

import contextlib
import json
import math
import random
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flying import (
    assert_one_message,
    bound_ports,
    run,
    scenario_tree,
    start,
    summary_of,
    table_of,
    wait_until,
    write_scenario,
)
from json_peer import Answer, Autopilot, into_earth, read_as_json, servo_packet

from mavlink_defs.endpoint import UdpAddress, bind_udp, free_ports

pytestmark = pytest.mark.sitl

STUCK = {"uav": 1, "actuator": "aileron", "stuck_deg": -15.0, "start_s": 1.0}
FREE_FALL = [1500, 1500, 1060, 1500, *[1500] * 12]


class Served:
    """A ``gcs ardupilot`` that waits for ArduPilots."""

    def __init__(self, process: "subprocess.Popen[str]", ports: list[int], folder: Path) -> None:
        self.process, self.ports, self.folder = process, ports, folder

    @property
    def port(self) -> int:
        return self.ports[0]

    def end(self) -> tuple[int, str, str]:
        """Wait for its end: exit status, standard output and error."""
        out, error = self.process.communicate(timeout=300.0)
        assert self.process.returncode is not None
        return self.process.returncode, out, error


@contextlib.contextmanager
def served(folder: Path, *arguments: str, uavs: int = 1, **changes: Any) -> Iterator[Served]:
    """The plant of scenario 1 without faults, on free ports 10 apart."""
    tree = scenario_tree(faults=[]) | changes
    tree["uavs"] = tree["uavs"][:uavs]
    edges = [{"between": [1, i], "weight": 1.0} for i in range(2, uavs + 1)]
    tree["network"] = {"leader_access": {1: 1.0}, "edges": edges}
    out = folder / "run"
    ports = free_ports(10 * uavs)[::10]
    options = ["--port", str(ports[0]), "--out", str(out), *arguments]
    process = start("gcs", "ardupilot", write_scenario(folder, tree), *options)
    try:
        wait_until(lambda: set(ports) <= bound_ports(), "all ports are bound")
        yield Served(process, ports, out)
    finally:
        process.kill()
        process.communicate()


@pytest.mark.parametrize("channels", [16, 32])
def test_a_flight_from_the_first_frame_to_the_end(tmp_path: Path, channels: int) -> None:
    with (
        served(tmp_path, "--json", "--record", "full", duration_s=3.0) as plant,
        Autopilot(plant.port, rate_hz=500, channels=channels) as peer,
    ):
        peer.bank = math.radians(10.0)
        peer.fly(1500)
        status, out, error = plant.end()
    assert status == 0, error
    summary = json.loads(out)
    assert summary == summary_of(plant.folder)
    assert (summary["completed"], summary["steps"], summary["duration_s"]) == (True, 3000, 3.0)
    (frames,) = summary["ardupilot"]
    assert (frames["channels"], frames["frames"], frames["rate_hz"]) == (channels, 1500, 500)
    assert (frames["repeated"], frames["missing"], frames["dropped"]) == (0, 0, {})
    assert peer.answers[-1]["timestamp"] == 3.0
    assert math.degrees(peer.answers[-1]["attitude"][0]) == pytest.approx(10.0, abs=2.0)
    check_counts(summary, plant.folder)
    check_answers(peer)


def check_counts(summary: Answer, folder: Path) -> None:
    """The events are the changes of the recorded commands, and the saving is against 1 kHz."""
    recorded = table_of(folder / "trajectory.arrows")
    motion = summary["ardupilot"][0]["motion"]
    for name, values in (
        ("roll_deg", np.degrees(recorded["roll"])),
        ("pitch_deg", np.degrees(recorded["pitch"])),
        ("altitude_m", -recorded["down"]),
        ("airspeed_m_s", recorded["V"]),
    ):
        assert motion[name] == pytest.approx([min(values), max(values)], rel=1e-6), name
    (uav,) = summary["uavs"]
    for name, channel in uav["channels"].items():
        changes = np.count_nonzero(np.diff(recorded[f"held_{name}"]))
        assert channel["events"] == 1 + changes
        assert channel["events"] > 10
    events = table_of(folder / "events.arrows")
    assert len(events["step"]) == sum(one["events"] for one in uav["channels"].values())
    assert uav["actuator_messages"] == len(np.unique(events["step"]))
    assert summary["saving"] == pytest.approx(1.0 - len(events["step"]) / (4 * 3000))


def check_answers(peer: Autopilot) -> None:
    """Both readers find the same; motion, attitude and sensors agree with each other in time."""
    for line, answer in zip(peer.lines, peer.answers, strict=True):
        assert read_as_json(line) == answer
    t, position, velocity, attitude, gyro, felt = (
        np.array([answer[name] for answer in peer.answers])
        for name in ("timestamp", "position", "velocity", "attitude", "imu/gyro", "imu/accel_body")
    )
    dt = np.diff(t)[:, None]
    assert dt == pytest.approx(np.full_like(dt, 0.002))
    middle = (velocity[1:] + velocity[:-1]) / 2.0
    assert np.diff(position, axis=0) / dt == pytest.approx(middle, abs=0.01)
    in_earth = np.array([into_earth(*pair) for pair in zip(felt, attitude, strict=True)])
    gravity = np.array([0.0, 0.0, 9.8])
    acceleration = np.diff(velocity, axis=0)[500:] / dt[500:]
    expected = ((in_earth + gravity)[1:] + (in_earth + gravity)[:-1])[500:] / 2.0
    assert acceleration == pytest.approx(expected, abs=0.3)
    roll, pitch, _ = attitude.T
    p, q, r = gyro.T
    turning = p + np.tan(pitch) * (q * np.sin(roll) + r * np.cos(roll))
    middle_turning = (turning[1:] + turning[:-1]) / 2.0
    assert np.diff(roll) / dt[:, 0] == pytest.approx(middle_turning, abs=0.02)


def test_lost_packets_are_asked_for_again_and_flown_once(tmp_path: Path) -> None:
    """What the peer flies does not depend on how often it has to ask: the flight repeats."""
    answers = []
    for name, lossy in (("clean", False), ("lossy", True)):
        folder = tmp_path / name
        folder.mkdir()
        chance = random.Random(1)
        with served(folder, duration_s=1.0) as plant, Autopilot(plant.port) as peer:
            for _ in range(1000):
                copies = 2 if lossy and chance.random() < 0.1 and peer.answers else 1
                peer.exchange(peer.outputs(0.4), copies if len(peer.answers) < 999 else 1)
            assert plant.end()[0] == 0
        (frames,) = summary_of(plant.folder)["ardupilot"]
        assert (frames["repeated"] > 50) == lossy
        assert frames["frames"] == 1000
        answers.append(peer.answers)
    assert answers[0] == answers[1]


def test_a_fault_shows_in_the_motion(tmp_path: Path) -> None:
    turned = []
    for name, faults in (("healthy", []), ("stuck", [STUCK])):
        folder = tmp_path / name
        folder.mkdir()
        changes: dict[str, Any] = {"duration_s": 2.0, "faults": faults}
        with served(folder, **changes) as plant, Autopilot(plant.port, rate_hz=250) as peer:
            peer.fly(500)
            assert plant.end()[0] == 0
        turned.append(np.array([answer["imu/gyro"][0] for answer in peer.answers]))
    healthy, stuck = turned
    assert (healthy[:250] == stuck[:250]).all(), "the fault begins at 1 s"
    assert (stuck[255:300] > healthy[255:300] + 0.1).all(), "it rolls to the right"


def test_a_ground_station_sets_faults_in_flight(tmp_path: Path) -> None:
    (port,) = free_ports(1)
    to = ("--connect", f"udpout:127.0.0.1:{port}")
    with (
        served(tmp_path, "--faults-port", str(port), "--record", "full", duration_s=0.4) as plant,
        Autopilot(plant.port) as peer,
    ):
        peer.fly(100)
        stuck = run("gcs", "fault", "set", "rudder", "--stuck-deg", "-20", "--for-s", "0.2", *to)
        assert stuck.returncode == 0, stuck.stderr
        listed = run("gcs", "fault", "list", "--uav", "1", "--json", *to)
        (fault,) = json.loads(listed.stdout)[0]["faults"]
        assert (fault["actuator"], fault["end_s"]) == ("rudder", pytest.approx(0.3))
        refused = run("gcs", "arm", *to)
        assert refused.returncode == 3, "ArduPilot is armed by its own ground station"
        peer.fly(300)
        assert plant.end()[0] == 0
    rudder = table_of(plant.folder / "trajectory.arrows")["applied_rudder"]
    stands = np.isclose(rudder, math.radians(-20.0), atol=1e-6)
    assert stands[100:300].all()
    assert not stands[:100].any()
    assert not stands[300:].any()


def test_garbage_is_counted_and_told(tmp_path: Path) -> None:
    with served(tmp_path, duration_s=0.05) as plant, Autopilot(plant.port) as peer:
        for garbage in (b"", b"GET / HTTP/1.0\r\n\r\n", servo_packet(0, [1500] * 16, magic=18457)):
            peer.send(garbage)
        peer.send(servo_packet(0, [1500] * 32) + bytes(3000))
        peer.fly(50)
        status, out, error = plant.end()
    assert status == 0, error
    (frames,) = summary_of(plant.folder)["ardupilot"]
    assert frames["dropped"] == {"length other than 40 or 72 bytes": 3, "wrong magic number": 1}
    assert "dropped 3 datagrams: length other than 40 or 72 bytes" in out


def test_a_restart_begins_a_new_flight_and_nobody_else_can(tmp_path: Path) -> None:
    with served(tmp_path, duration_s=0.3) as plant:
        with Autopilot(plant.port) as first, Autopilot(plant.port) as stranger:
            first.fly(100)
            stranger.send(servo_packet(0, stranger.pwm))
            first.fly(100)
        with Autopilot(plant.port) as second:
            second.take_over()
            second.fly(298)
        status, _, error = plant.end()
    assert status == 0
    assert error.count("started again: the flight begins again") == 1
    assert second.answers[:200] == first.answers
    summary = summary_of(plant.folder)
    assert (summary["steps"], summary["ardupilot"][0]["restarts"]) == (300, 1)
    assert summary["ardupilot"][0]["dropped"]["another sender than the ArduPilot that flies"] >= 1
    assert len(np.unique(table_of(plant.folder / "trajectory.arrows")["time_s"])) == 15
    before = plant.folder / "before-restart-1"
    assert str(before) in error
    assert summary_of(before)["steps"] == 200
    exported = run("gcs", "export", "--to", "csv", before)
    assert exported.returncode == 0, exported.stderr
    assert len(np.unique(table_of(before / "trajectory.arrows")["time_s"])) == 10


def test_a_fleet_is_in_lockstep(tmp_path: Path) -> None:
    with (
        served(tmp_path, uavs=2, duration_s=0.1) as plant,
        Autopilot(plant.ports[0]) as first,
        Autopilot(plant.ports[1]) as second,
    ):
        for n in range(100):
            for peer in (first, second):
                peer.send(servo_packet(n, FREE_FALL))
            lines = [peer.receive() for peer in (first, second)]
            times = {read_as_json(line)["timestamp"] for line in lines}
            assert times == {(n + 1) / 1000.0}
        status, out, error = plant.end()
    assert status == 0, error
    assert "least separation" in out


def test_it_says_how_to_start_and_gives_up_when_nobody_comes(tmp_path: Path) -> None:
    with served(tmp_path, "--patience", "0.5", uavs=2) as plant:
        status, out, error = plant.end()
    assert (status, out) == (4, "")
    assert_one_message(error)
    for k, port in enumerate(plant.ports):
        assert f"arduplane --model JSON:127.0.0.1 --sim-port-out {port} -I {k}" in error
    assert "no ArduPilot has come for UAV 1 for 0.5 s" in error
    assert not plant.folder.exists()


def test_silence_in_flight_ends_it_with_what_was_recorded(tmp_path: Path) -> None:
    with (
        served(tmp_path, "--patience", "0.5", duration_s=9.0) as plant,
        Autopilot(plant.port) as peer,
    ):
        peer.fly(500)
        status, _, error = plant.end()
    assert status == 1
    assert_one_message(error)
    assert "the ArduPilot of UAV 1 has been silent for 0.5 s at 0.500 s" in error
    assert summary_of(plant.folder)["steps"] == 500


def test_ctrl_c_keeps_what_was_flown(tmp_path: Path) -> None:
    with served(tmp_path, duration_s=9.0) as plant, Autopilot(plant.port) as peer:
        peer.fly(100)
        plant.process.send_signal(signal.SIGINT)
        status, out, error = plant.end()
    assert status == 130
    assert "interrupted at 0.1 s" in error
    assert "Transmissions in 100 control periods" in out
    assert summary_of(plant.folder)["loss"] == "stopped at 0.1 s of 9 s"


def test_bad_input_is_one_message(tmp_path: Path) -> None:
    scenario = write_scenario(tmp_path)
    (port,) = free_ports(1)
    with bind_udp(UdpAddress("127.0.0.1", port), "another program"):
        taken = run("gcs", "ardupilot", scenario, "--port", str(port))
    attempts = {
        f"UDP port {port} on 127.0.0.1 is in use": taken,
        "the last of 3 UAVs would have port 65540": run(
            "gcs", "ardupilot", scenario, "--port", "65520"
        ),
        "expected UAVs of the scenario, 1, 2, 3, got 4": run(
            "gcs", "ardupilot", scenario, "--uav", "4"
        ),
        "step_us is 100000 us": run("gcs", "ardupilot", scenario, "--set", "step_us=100000"),
        "links.impairments": run(
            "gcs", "ardupilot", scenario, "--set", "links.impairments={plant: {}}"
        ),
        "ardupilot.aileron.channel": run(
            "gcs", "ardupilot", scenario, "--set", "ardupilot.aileron.channel=40"
        ),
    }
    for text, done in attempts.items():
        assert done.returncode == 2, done.stderr
        assert text in done.stderr
        assert_one_message(done.stderr)
