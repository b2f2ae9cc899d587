"""Flights with an ArduPlane beside autopilots of ours: a peer by its published protocols.

If the environment names one in FTC_ARDUPLANE, a real ArduPlane flies, too.
"""

import contextlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flying import (
    assert_one_message,
    hexagon_tree,
    run,
    scenario_tree,
    start,
    summary_of,
    table_of,
    wait_until,
)
from flying import write_scenario as written
from needs import ARDUPLANE

from ftc_lab.campaigns.store import read_results
from mavlink_defs.endpoint import free_ports

pytestmark = pytest.mark.sitl

HELPERS = Path(__file__).parents[1] / "helpers"


def peer(folder: Path, **environment: str) -> str:
    """Return the program of a peer with these settings."""
    path = folder / "arduplane"
    environment["PEER_OF"] = str(path)
    settings = " ".join(f"{name}='{value}'" for name, value in environment.items())
    script = f"exec {sys.executable} {HELPERS / 'arduplane_peer.py'}"
    path.write_text(f'#!/bin/sh\nPYTHONPATH={HELPERS} {settings} {script} "$@"\n')
    path.chmod(0o755)
    return str(path)


def mixed(
    folder: Path,
    binary: str,
    duration_s: float = 1.0,
    ready_within_s: float = 60.0,
    **changes: Any,
) -> Path:
    """Return a scenario of two UAVs of ours and one of an ArduPlane."""
    tree = scenario_tree(faults=[], duration_s=duration_s) | changes
    if "mission" in tree:
        del tree["profile"]
    keys = {"binary": binary, "ready_within_s": ready_within_s}
    tree["uavs"][2]["autopilot"] = {"kind": "ardupilot", **keys}
    return written(folder, tree)


def in_formation(folder: Path, binary: str, duration_s: float, **changes: Any) -> Path:
    """Return three Aerosondes in V formation, of which an ArduPlane flies one, 8 m behind it."""
    tree = scenario_tree() | hexagon_tree()
    keys = ("formation", "mission", "profile", "faults", "network", "uavs")
    tree = {"extends": "airframes/aerosonde_designed"} | {key: tree[key] for key in keys}
    tree |= {"duration_s": duration_s, "guidance": {"cruise_m_s": 25.0}} | changes
    for uav in tree["uavs"]:
        uav["initial"] |= {"airspeed_m_s": 25.0, "pitch_deg": 3.0}
    own = tree["uavs"][2]
    own["initial"]["north_m"] -= 8.0
    own["autopilot"] = {"kind": "ardupilot", "binary": binary, "ready_within_s": 60.0}
    return written(folder, tree)


def flown(folder: Path, scenario: Path, *options: str) -> "subprocess.CompletedProcess[str]":
    out = ("--out", str(folder / "run"), "--free-ports", "--quiet")
    return run("gcs", "fly", str(scenario), *out, *options)


def children_of(binary: str) -> list[int]:
    """Return the processes that a program of `peer` has become."""
    found = []
    for one in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if f"PEER_OF={binary}".encode() in (one / "environ").read_bytes().split(b"\0"):
                found.append(int(one.name))
    return found


def test_it_flies_beside_ours_in_lockstep_twice_the_same(tmp_path: Path) -> None:
    """Also if packets are lost: what it asks for again is answered again, and flown once."""
    recorded = []
    for name, settings in (("first", {}), ("second", {"PEER_TWICE": "1"})):
        folder = tmp_path / name
        folder.mkdir()
        done = flown(folder, mixed(folder, peer(folder, **settings)), "--record", "full")
        assert done.returncode == 0, done.stderr
        summary = summary_of(folder / "run")
        assert (summary["completed"], summary["steps"]) == (True, 1000)
        own = summary["uavs"][2]
        assert (own["active_steps"], own["missing_steps"]) == (1000, 0)
        assert 4 < own["actuator_messages"] <= 500, "a frame of the peer has two control periods"
        table = table_of(folder / "run" / "trajectory.arrows")
        of_it = table["uav"] == 3
        for channel, counted in own["channels"].items():
            held = table[f"held_{channel}"][of_it]
            assert counted["events"] == 1 + np.count_nonzero(np.diff(held))
        recorded.append((folder / "run" / "trajectory.arrows").read_bytes())
        assert not children_of(str(folder / "arduplane"))
    assert recorded[0] == recorded[1]


def test_it_keeps_its_slot_beside_ours_twice_the_same(tmp_path: Path) -> None:
    """It hears the same at the same times, 5 times a second, and flies by it."""
    recorded, heard = [], []
    for name in ("first", "second"):
        folder = tmp_path / name
        folder.mkdir()
        binary = peer(folder, PEER_HEARD=str(folder / "heard"))
        done = flown(folder, in_formation(folder, binary, 6.0), "--record", "full")
        assert done.returncode == 0, done.stderr
        recorded.append((folder / "run" / "trajectory.arrows").read_bytes())
        heard.append((folder / "heard").read_text().splitlines())
    assert recorded[0] == recorded[1]
    assert heard[0] == heard[1]
    assert sum(line.startswith("height") for line in heard[0]) == 30
    assert "mode 15" in heard[0]
    table = table_of(tmp_path / "first" / "run" / "trajectory.arrows")
    behind = (table["north"][table["uav"] == 1] - table["north"][table["uav"] == 3])[-1] - 20.0
    assert abs(behind) < 4.0, "it was 8 m behind"
    assert np.allclose(table["slot_right"][table["uav"] == 3][100:], -20.0)
    summary = summary_of(tmp_path / "first" / "run")
    assert summary["uavs"][2]["active_steps"] == summary["steps"]


def test_a_fault_of_the_scenario_acts_on_it(tmp_path: Path) -> None:
    stuck = {"uav": 3, "actuator": "rudder", "stuck_deg": 15.0, "start_s": 0.3, "end_s": 0.6}
    done = flown(tmp_path, mixed(tmp_path, peer(tmp_path), faults=[stuck]), "--record", "full")
    assert done.returncode == 0, done.stderr
    table = table_of(tmp_path / "run" / "trajectory.arrows")
    stands = np.isclose(np.degrees(table["applied_rudder"][table["uav"] == 3]), 15.0, atol=1e-4)
    assert stands[301:600].all()
    assert not stands[:300].any()
    assert not stands[601:].any()


def test_a_sensor_fault_acts_on_what_it_is_shown(tmp_path: Path) -> None:
    biased = {"uav": 3, "sensor": "gyro", "bias_deg_s": 20.0, "axis": "x"}
    held = []
    for name, faults in (("with", [biased | {"start_s": 0.3}]), ("without", [])):
        folder = tmp_path / name
        folder.mkdir()
        done = flown(folder, mixed(folder, peer(folder), faults=faults), "--record", "full")
        assert done.returncode == 0, done.stderr
        table = table_of(folder / "run" / "trajectory.arrows")
        held.append(table["held_aileron"][table["uav"] == 3])
    differs = np.flatnonzero(held[0] != held[1])
    assert 300 < differs[0] <= 304, "a frame of the peer has two control periods"


def test_stations_set_faults_that_it_does_not_hear_of(tmp_path: Path) -> None:
    (port,) = free_ports(1)
    to = ("--connect", f"udpout:127.0.0.1:{port}", "--uav", "3")
    options = ("--out", str(tmp_path / "run"), "--free-ports", "--hub-port", str(port), "--start")
    uavs = scenario_tree()["uavs"]
    uavs[2]["initial"]["altitude_m"] = 3000.0  # a slow machine takes its time, and it descends
    scenario = mixed(tmp_path, peer(tmp_path), uavs=uavs)
    up = start("gcs", "up", str(scenario), *options, "--speed", "0.3")
    try:
        wait_until(lambda: run("gcs", "status", *to).returncode == 0, "it is heard")
        set_one = run(
            "gcs", "fault", "set", "rudder", "--effectiveness", "0.9", "--for-s", "60", *to
        )
        assert set_one.returncode == 0, set_one.stderr
        listed = run("gcs", "fault", "list", "--json", *to)
        (fault,) = json.loads(listed.stdout)[0]["faults"]
        assert fault["actuator"] == "rudder"
        sensor = ("gcs", "fault", "sensor", "set")
        later = ("--start-s", "2000", "--end-s", "2060")
        set_one = run(*sensor, "gyro", "--failure", "stuck", *later, *to)
        assert set_one.returncode == 0, set_one.stderr
        refused = run(*sensor, "barometer", "--failure", "stuck", *to)
        assert refused.returncode == 3
        assert "ArduPlane makes its barometer itself" in refused.stderr
        listed = run("gcs", "fault", "list", "--json", *to)
        _, fault = json.loads(listed.stdout)[0]["faults"]
        assert fault["sensor"] == "gyro"
        assert run("gcs", "fault", "clear", *to).returncode == 0
        listed = run("gcs", "fault", "list", "--json", *to)
        assert json.loads(listed.stdout)[0]["faults"] == []
    finally:
        up.terminate()
        _, error = up.communicate(timeout=600)
    assert not children_of(str(tmp_path / "arduplane")), error


def test_its_slot_is_ordered_as_those_of_ours(tmp_path: Path) -> None:
    (port,) = free_ports(1)
    to = ("--connect", f"udpout:127.0.0.1:{port}", "--uav", "3")
    options = ("--out", str(tmp_path / "run"), "--free-ports", "--hub-port", str(port), "--start")
    heard = tmp_path / "heard"
    scenario = in_formation(tmp_path, peer(tmp_path, PEER_HEARD=str(heard)), 600.0)

    def heights() -> list[float]:
        lines = heard.read_text().splitlines() if heard.exists() else []
        return [float(line.split()[1]) for line in lines if line.startswith("height")]

    up = start("gcs", "up", str(scenario), *options, "--speed", "1")
    try:
        wait_until(lambda: bool(heights()), "it is steered")
        planned = heights()[0]
        done = run("gcs", "formation", "slot", "-20", "-20", "10", *to)
        assert done.returncode == 0, done.stderr
        wait_until(lambda: heights()[-1] > planned + 5.0, "it is told to fly higher")
        refused = run("gcs", "formation", "slot", "5000", "0", "0", *to)
        assert refused.returncode == 3
        assert "Slot: ahead is 5000 m, must be -1000 to 1000 m" in refused.stderr
        done = run("gcs", "formation", "slot", "--planned", *to)
        assert done.returncode == 0, done.stderr
        wait_until(lambda: heights()[-1] < planned + 3.0, "it is told to come back")
    finally:
        up.terminate()
        _, error = up.communicate(timeout=600)
    assert not children_of(str(tmp_path / "arduplane")), error


@pytest.mark.parametrize(
    ("settings", "status", "text"),
    [
        ({"PEER_READY_S": "1e9"}, 1, "not ready to be armed after 15 s of its time"),
        ({"PEER_REFUSES": "Compass not healthy"}, 3, "Arm: Compass not healthy"),
        ({"PEER_DIES_S": "0.5"}, 1, "ArduPlane ended with status 3 before the flight: panic: the"),
        ({"PEER_DIES_S": "9"}, 1, "UAV 3: ArduPlane ended with status 3 at "),
    ],
)
def test_what_goes_wrong_is_one_line(
    tmp_path: Path, settings: dict[str, str], status: int, text: str
) -> None:
    binary = peer(tmp_path, **settings)
    done = flown(tmp_path, mixed(tmp_path, binary, duration_s=30.0, ready_within_s=15.0))
    assert (done.returncode, text in done.stderr) == (status, True), done.stderr
    assert not children_of(binary)


def test_a_killed_child_ends_the_flight(tmp_path: Path) -> None:
    binary = peer(tmp_path)
    scenario = mixed(tmp_path, binary, duration_s=60.0)
    options = ("--out", str(tmp_path / "run"), "--free-ports", "--quiet", "--speed", "1")
    flight = start("gcs", "fly", str(scenario), *options)
    log = tmp_path / "run" / "processes" / "plant.log"
    wait_until(lambda: log.exists() and "all armed" in log.read_text(), "it flies")
    for child in children_of(binary):
        os.kill(child, signal.SIGKILL)
    _, error = flight.communicate(timeout=600)
    assert flight.returncode == 1
    assert "UAV 3: ArduPlane was ended by signal 9 at " in error


def test_bad_input_is_one_message(tmp_path: Path) -> None:
    plain = tmp_path / "plain"
    plain.write_text("no program\n")
    not_one = tmp_path / "not_one"
    not_one.write_bytes(b"\x7fELF, but not much of it")
    not_one.chmod(0o755)
    good = peer(tmp_path)
    attempts: list[tuple[str, dict[str, Any], tuple[str, ...], str]] = [
        (str(tmp_path / "none"), {}, (), "there is no such file"),
        (str(plain), {}, (), "it cannot be executed"),
        (str(not_one), {}, (), "no program for this machine"),
        (good, {}, ("--in-process",), "a flight in process has none"),
        (good, {"navigation": "estimated"}, (), "navigation: true_state"),
    ]
    for binary, changes, options, text in attempts:
        done = flown(tmp_path, mixed(tmp_path, binary, **changes), *options)
        assert done.returncode == 2, done.stderr
        assert text in done.stderr
        assert_one_message(done.stderr)


def test_a_slot_that_nobody_tells_it_of_is_refused(tmp_path: Path) -> None:
    alone = {"leader_access": {1: 1.0}, "edges": [{"between": [1, 2], "weight": 1.0}]}
    done = flown(tmp_path, in_formation(tmp_path, peer(tmp_path), 1.0, network=alone))
    assert done.returncode == 2, done.stderr
    text = "network.edges: expected an edge of UAV 3, which keeps a slot, to a UAV of ours"
    assert text in done.stderr
    assert_one_message(done.stderr)


@pytest.mark.real_arduplane
@pytest.mark.parametrize("of", [mixed, in_formation])
def test_a_real_one_flies_twice_the_same(of: Callable[..., Path], tmp_path: Path) -> None:
    recorded = []
    for name in ("first", "second"):
        folder = tmp_path / name
        folder.mkdir()
        done = flown(folder, of(folder, ARDUPLANE, duration_s=10.0), "--record", "full")
        assert done.returncode == 0, done.stderr
        own = summary_of(folder / "run")["uavs"][2]
        assert own["attitude_lost_at_s"] is None
        assert own["actuator_messages"] > 100
        recorded.append((folder / "run" / "trajectory.arrows").read_bytes())
    assert recorded[0] == recorded[1]


def test_a_campaign_flies_it_beside_our_laws(tmp_path: Path) -> None:
    scenario = written(tmp_path, scenario_tree(faults=[], duration_s=0.5))
    theirs = {"kind": "ardupilot", "binary": "nowhere", "ready_within_s": 60.0}
    ours = {"controller": {"kind": "pid"}, "trigger": {"mode": "periodic"}}
    drawn = {"kind": "uniform", "low": 0.1, "high": 0.3}
    tree = {
        "name": "both",
        "scenario": scenario.name,
        "draws": 1,
        "faults": {"one": {"uavs": [3], "kinds": {"loss": drawn}, "start_s": drawn}},
        "variants": {"theirs": {"autopilot": theirs}, "pid": ours},
        "keep": {"share": 1.0},
    }
    file = tmp_path / "campaign.yaml"
    file.write_text(json.dumps(tree))
    out = ("--out", str(tmp_path / "campaign"), "--jobs", "1", "--quiet")
    bad = {
        (): "nowhere",
        ("--autopilot", "px4=x"): "autopilot.kind: px4",
        ("--autopilot", "x"): "KIND=PATH",
    }
    for options, named in bad.items():
        refused = run("gcs", "campaign", str(file), *out, *options)
        assert refused.returncode == 2
        assert named in refused.stderr
        assert_one_message(refused.stderr)
    done = run("gcs", "campaign", str(file), *out, "--autopilot", f"ardupilot={peer(tmp_path)}")
    assert done.returncode == 0, done.stderr
    rows = {row["variant"]: row for row in read_results(tmp_path / "campaign").to_pylist()}
    assert {row["outcome"] for row in rows.values()} == {"completed"}
    kept = [one.name for one in (tmp_path / "campaign" / "flights").iterdir()]
    assert kept == [str(rows["pid"]["row"])], "a program may fly otherwise each time"
    counted = {name: row["uav3.messages"] for name, row in rows.items()}
    assert counted["pid"] == 500
    assert 0 < counted["theirs"] <= 250, "a frame of the peer has two control periods"
    assert not children_of(str(tmp_path / "arduplane"))
