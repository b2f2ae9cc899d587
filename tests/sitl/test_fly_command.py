"""``gcs fly`` from outside: exit status, output, run folder."""

import contextlib
import itertools
import json
import os
import socket
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flying import (
    BIN,
    CHANNELS,
    FIGURES,
    RESULTS,
    SCENARIO_1,
    TIMEOUT_S,
    assert_one_message,
    fly,
    fly_well,
    free_links,
    processes_of,
    run,
    scenario_tree,
    summary_of,
    table_of,
    write_scenario,
)

pytestmark = pytest.mark.sitl

SUMMARY_KEYS = {
    "scenario",
    "completed",
    "loss",
    "duration_s",
    "steps",
    "wall_s",
    "real_time_factor",
    "mode",
    "saving",
    "uavs",
}
UAV_KEYS = {
    "id",
    "active_steps",
    "missing_steps",
    "saving",
    "channels",
    "actuator_messages",
    "iae",
    "iae_filtered",
    "max_error",
    "final_error",
    "attitude_lost_at_s",
    "heading_lost_at_s",
}
QUANTITIES = {"airspeed", "roll", "pitch", "yaw"}


def refuse_duplicates(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    assert len({key for key, _ in pairs}) == len(pairs)
    return dict(pairs)


def refuse_constant(text: str) -> None:
    raise AssertionError(f"{text} is not JSON")


def strict_json(text: str) -> Any:
    return json.loads(text, object_pairs_hook=refuse_duplicates, parse_constant=refuse_constant)


@contextlib.contextmanager
def port_taken() -> Iterator[int]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        yield int(sock.getsockname()[1])


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Run folder and standard output of a short flight with --json."""
    folder = tmp_path_factory.mktemp("flown")
    scenario = write_scenario(folder, duration_s=2.0)
    arguments = ("--json", "--free-ports", "--out", folder / "run")
    done = fly_well(scenario, *arguments, FTC_SITL_NO_FIGURES="0")
    assert "Traceback" not in done.stderr
    return folder / "run", done.stdout


def test_json_is_the_summary_and_nothing_else(flown: tuple[Path, str]) -> None:
    folder, stdout = flown
    assert strict_json(stdout) == strict_json((folder / "summary.json").read_text())


def test_summary_has_the_promised_keys(flown: tuple[Path, str]) -> None:
    summary = strict_json(flown[1])
    assert summary.keys() >= SUMMARY_KEYS
    assert summary["scenario"] == "Paper, scenario 1"
    assert summary["completed"] is True
    assert (summary["duration_s"], summary["steps"]) == (2.0, 2000)
    assert summary["mode"] == "lockstep"
    assert summary["real_time_factor"] == pytest.approx(2.0 / summary["wall_s"])
    assert [uav["id"] for uav in summary["uavs"]] == [1, 2, 3]
    for uav in summary["uavs"]:
        assert uav.keys() >= UAV_KEYS
        assert set(uav["channels"]) == set(CHANNELS)
        for channel in uav["channels"].values():
            assert channel.keys() >= {"events", "repeats", "min_interval_s"}
        for figure in ("iae", "iae_filtered", "max_error", "final_error"):
            assert set(uav[figure]) == QUANTITIES


def test_summary_agrees_with_the_event_file(flown: tuple[Path, str]) -> None:
    folder, _ = flown
    summary, events = summary_of(folder), table_of(folder / "events.arrows")
    total = 0
    for uav in summary["uavs"]:
        mine = events["uav"] == uav["id"]
        assert uav["actuator_messages"] == len(set(events["step"][mine].tolist()))
        for name in ("aileron", "elevator", "rudder", "throttle"):
            steps = events["step"][mine & (events["actuator"] == name)]
            total += len(steps)
            assert uav["channels"][name]["events"] == len(steps)
            shortest = min(b - a for a, b in itertools.pairwise(steps.tolist()))
            assert uav["channels"][name]["min_interval_s"] == pytest.approx(shortest / 1000)
    assert summary["saving"] == pytest.approx(1 - total / (2000 * 4 * 3))


def test_run_folder_holds_the_results(flown: tuple[Path, str]) -> None:
    folder, _ = flown
    assert {entry.name for entry in folder.iterdir()} >= RESULTS | FIGURES
    assert (folder / "flight.png").read_bytes().startswith(b"\x89PNG\r\n\x1a\n")
    assert (folder / "flight.svg").read_text().startswith("<?xml")
    trajectory = table_of(folder / "trajectory.arrows")
    assert len(trajectory["time_s"]) == 100 * 3
    assert set(np.diff(trajectory["time_s"][::3]).round(9)) == {0.02}
    assert not processes_of(folder)


def test_mavlogdump_reads_the_log(flown: tuple[Path, str]) -> None:
    done = run("mavlogdump.py", flown[0] / "flight.tlog")
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    types = {line.split(": ", 1)[1].split(" ", 1)[0] for line in done.stdout.splitlines()}
    assert types >= {"HEARTBEAT", "MISSION_ITEM_INT", "MISSION_ACK", "COMMAND_LONG", "COMMAND_ACK"}
    assert "BAD_DATA" not in types


def test_results_go_to_standard_output_and_quiet_says_nothing(tmp_path: Path) -> None:
    scenario = write_scenario(tmp_path, duration_s=0.1)
    done = fly_well(scenario, "--in-process", "--out", tmp_path / "loud")
    assert "Transmissions" in done.stdout
    assert "Transmissions" not in done.stderr
    assert str(tmp_path / "loud") in done.stdout
    done = fly_well(scenario, "--in-process", "--quiet", "--out", tmp_path / "quiet")
    assert (done.stdout, done.stderr) == ("", "")


def test_default_run_folder(tmp_path: Path) -> None:
    scenario = write_scenario(tmp_path, duration_s=0.1)
    arguments = ("--in-process", "--quiet", "--no-figures")
    done = run("gcs", "fly", scenario, *arguments, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (folder,) = (tmp_path / "runs").iterdir()
    assert {entry.name for entry in folder.iterdir()} == RESULTS - {"flight.tlog"}


def test_one_uav_alone(tmp_path: Path) -> None:
    tree = scenario_tree(duration_s=0.5, faults=[])
    tree["uavs"] = tree["uavs"][:1]
    tree["network"] = {"leader_access": {1: 1.0}}
    done = fly_well(
        write_scenario(tmp_path, tree), "--json", "--free-ports", "--out", tmp_path / "run"
    )
    assert [uav["id"] for uav in strict_json(done.stdout)["uavs"]] == [1]


def test_real_time(tmp_path: Path) -> None:
    scenario = write_scenario(tmp_path, duration_s=2.0)
    folder = tmp_path / "run"
    fly_well(scenario, "--quiet", "--free-ports", "--speed", "2", "--out", folder)
    summary = summary_of(folder)
    assert summary["completed"] is True
    assert summary["mode"] == "real_time"
    assert {entry.name for entry in folder.iterdir()} >= RESULTS
    assert not processes_of(folder)


@pytest.mark.parametrize("how", ["--free-ports", "--in-process"])
def test_lost_flight(tmp_path: Path, how: str) -> None:
    tree = scenario_tree(duration_s=6.0)
    tree["aircraft"]["thrust_limit_n"] = 1e5  # beyond 300 m/s, where the model ends
    tree["faults"] = [{"uav": 2, "actuator": "throttle", "stuck_n": 1e5, "start_s": 0.5}]
    scenario = write_scenario(tmp_path, tree)
    folder = tmp_path / "run"
    done = fly(scenario, how, "--json", "--out", folder)
    assert done.returncode == 1, done.stderr
    assert_one_message(done.stderr)
    assert done.stderr.count("UAV 2") == 1
    assert str(folder) in done.stderr
    summary = summary_of(folder)
    assert summary == strict_json(done.stdout)
    assert summary["completed"] is False
    assert 500 < summary["steps"] < 6000
    trajectory = table_of(folder / "trajectory.arrows")
    assert len(trajectory["time_s"]) == 3 * -(-summary["steps"] // 20)
    assert not processes_of(folder)


def assert_refused(folder: Path, *arguments: str | Path) -> str:
    """Exit status 2, one message, and nothing started; gives the message."""
    done = fly(*arguments)
    assert done.returncode == 2, done.stderr
    assert_one_message(done.stderr)
    assert done.stdout == ""
    assert not processes_of(folder)
    return done.stderr


def test_missing_scenario(tmp_path: Path) -> None:
    missing = tmp_path / "no.yaml"
    assert str(missing) in assert_refused(tmp_path, missing, "--out", tmp_path / "run")
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("text", ["", "name: [", "- 1\n- 2\n", "\0"])
def test_file_that_is_no_scenario(tmp_path: Path, text: str) -> None:
    scenario = tmp_path / "bad.yaml"
    scenario.write_text(text)
    assert str(scenario) in assert_refused(tmp_path, scenario, "--out", tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_occupied_run_folder_is_left_alone(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / "mine").write_text("keep")
    message = assert_refused(tmp_path, SCENARIO_1, "--free-ports", "--out", folder)
    assert str(folder) in message
    assert "not empty" in message
    assert [entry.name for entry in folder.iterdir()] == ["mine"]


def test_run_folder_that_is_a_file(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("keep")
    assert str(file) in assert_refused(tmp_path, SCENARIO_1, "--free-ports", "--out", file)
    assert file.read_text() == "keep"


def test_unknown_option(tmp_path: Path) -> None:
    message = assert_refused(tmp_path, SCENARIO_1, "--sped", "2", "--out", tmp_path / "run")
    assert "--sped" in message


@pytest.mark.parametrize("key", ["gcs_port", "plant_port", "formation_base_port"])
def test_port_in_use(tmp_path: Path, key: str) -> None:
    links = free_links()
    with port_taken() as port:
        links[key] = port - 2 if key == "formation_base_port" else port
        scenario = write_scenario(tmp_path, duration_s=0.5, links=links)
        message = assert_refused(tmp_path, scenario, "--out", tmp_path / "run")
    assert str(port) in message
    assert "in use" in message


def test_disconnected_graph(tmp_path: Path) -> None:
    tree = scenario_tree()
    del tree["network"]["edges"][1]
    message = assert_refused(tmp_path, write_scenario(tmp_path, tree), "--out", tmp_path / "run")
    assert "network" in message
    assert "3" in message


def test_all_problems_of_a_file_are_named_at_once(tmp_path: Path) -> None:
    tree = scenario_tree()
    tree["duration_s"] = -1.0
    tree["colour"] = "red"
    tree["aircraft"]["mass_kg"] = "heavy"
    tree["uavs"][1]["initial"]["airspeed_m_s"] = float("nan")
    del tree["trigger"]["a1"]
    tree["trigger"]["b1"] = -1.0
    message = assert_refused(tmp_path, write_scenario(tmp_path, tree), "--out", tmp_path / "run")
    for key in ("duration_s", "colour", "mass_kg", "uavs[1].initial.airspeed_m_s", "trigger.b1"):
        assert key in message


def test_sections_that_do_not_fit_are_named_at_once(tmp_path: Path) -> None:
    tree = scenario_tree(links={"plant_port": 14550})
    tree["faults"][0]["uav"] = 7
    tree["profile"][1]["start_s"] = 20.0
    tree["uavs"][0]["initial"]["airspeed_m_s"] = 100.0
    message = assert_refused(tmp_path, write_scenario(tmp_path, tree), "--out", tmp_path / "run")
    for key in ("faults[0].uav", "profile[2]", "uavs[0].initial.airspeed_m_s", "links.plant_port"):
        assert key in message


def test_reader_that_goes_away(tmp_path: Path) -> None:
    """`gcs fly --json | head -0` ends without a traceback."""
    scenario = write_scenario(tmp_path, duration_s=0.1)
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run(
        [BIN / "gcs", "fly", scenario, "--in-process", "--json", "--out", tmp_path / "run"],
        stdout=writing,
        stderr=subprocess.PIPE,
        text=True,
        timeout=TIMEOUT_S,
        check=False,
    )
    os.close(writing)
    assert "Traceback" not in done.stderr
    assert "Exception ignored" not in done.stderr
    assert (tmp_path / "run" / "summary.json").exists()
