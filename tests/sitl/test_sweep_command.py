"""``gcs sweep`` from outside: exit status, outputs, and going on after any end."""

import contextlib
import csv
import json
import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from campaign_flights import rows_by_number
from flying import (
    TIMEOUT_S,
    assert_one_message,
    environment,
    run,
    scenario_tree,
    start,
    wait_until,
    write_scenario,
)

from ftc_lab.campaigns.store import read_results

pytestmark = pytest.mark.sitl

CAMPAIGN = {"request.yaml", "scenario.yaml", "draws.parquet", "results"}
OUTPUTS = CAMPAIGN | {"table.csv", "table.md", "sweep.png", "sweep.svg"}
LONG_S = 150.0
"""Of flights that are not all over when the first are stored, after 2 s."""
FLIGHTS = 24
MANY = ("--set", f"trigger.b2_deg={','.join(str(0.1 * k) for k in range(1, FLIGHTS + 1))}")


def sweep(*arguments: str | Path, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    return run("gcs", "sweep", *arguments, env=environment(), cwd=cwd)


def rows_of(folder: Path) -> list[dict[str, str]]:
    with (folder / "table.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def kept(folder: Path) -> dict[int, dict[str, Any]]:
    """Stored flights by row, and without their wall times."""
    return rows_by_number(read_results(folder))


@contextlib.contextmanager
def sweeping(folder: Path, *arguments: str | Path) -> Iterator[subprocess.Popen[str]]:
    """A sweep that has stored some of its flights and flies on; in the end it is killed."""
    popen = start("gcs", "sweep", *arguments, "--out", folder)
    try:
        wait_until(lambda: any(folder.glob("results/part-*.parquet")), "flights are stored")
        yield popen
    finally:
        popen.kill()
        popen.communicate(timeout=TIMEOUT_S)


def test_every_point_is_in_the_tables(tmp_path: Path) -> None:
    """Flown, lost, and impossible ones."""
    tree = scenario_tree(duration_s=2.0)
    tree["aircraft"]["thrust_limit_n"] = 1e5  # beyond 300 m/s, where the model ends
    tree["faults"] = [{"uav": 2, "actuator": "throttle", "stuck_n": 900.0, "start_s": 0.5}]
    scenario = write_scenario(tmp_path, tree)
    folder = tmp_path / "out"
    arguments = (
        scenario,
        "--set",
        "faults[0].stuck_n=900,100000,-1",
        "--set",
        "trigger.mode=per_channel, periodic",
        "--out",
        folder,
    )
    done = sweep(*arguments)
    assert done.returncode == 0, done.stderr
    assert_one_message(done.stdout)
    assert {entry.name for entry in folder.iterdir()} == OUTPUTS
    rows = rows_of(folder)
    assert len(rows) == 4 * 3 + 2
    by_value = {
        value: [row for row in rows if row["faults[0].stuck_n"] == value]
        for value in ("900", "100000", "-1")
    }
    assert {(row["outcome"], row["reason"]) for row in by_value["900"]} == {("completed", "")}
    for row in by_value["100000"]:
        assert row["outcome"] == "lost"
        assert "UAV 2 was lost" in row["reason"]
        assert 0.5 < float(row["duration_s"]) < 2.0
    for row in by_value["-1"]:
        assert row["outcome"] == "invalid"
        assert "faults[0].stuck_n" in row["reason"]
        assert row["saving"] == ""
    assert {row["saving"] for row in by_value["900"] if row["trigger.mode"] == "periodic"} == {
        "0.0"
    }
    table = (folder / "table.md").read_text()
    assert table.count("| lost | - | - |") == table.count("UAV 2 was lost") == 2
    assert "UAV 2" in done.stdout
    assert done.stdout.count(" lost  ") == 2

    before = {path: path.stat().st_mtime_ns for path in (folder / "results").iterdir()}
    quiet = sweep(*arguments, "--quiet", "--uav", "1")
    assert (quiet.returncode, quiet.stderr) == (0, "")
    assert {path: path.stat().st_mtime_ns for path in (folder / "results").iterdir()} == before
    number = next(row["row"] for row in rows if row["faults[0].stuck_n"] == "900")
    again = ("fly", "--campaign", folder, "--row", number, "--out", tmp_path / "run")
    flown = run("gcs", *again, "--in-process", "--quiet")
    assert flown.returncode == 0, flown.stderr


def test_flights_equal_gcs_fly(tmp_path: Path) -> None:
    scenario = write_scenario(tmp_path, duration_s=4.5)  # the first step of the profile is at 4 s
    done = sweep(scenario, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    flown = run("gcs", "fly", scenario, "--in-process", "--json", "--out", tmp_path / "run")
    summary = json.loads(flown.stdout)
    for row, uav in zip(rows_of(tmp_path / "out"), summary["uavs"], strict=True):
        assert float(row["saving"]) == summary["saving"]
        assert float(row["uav_saving"]) == uav["saving"]
        for quantity, unit in (("airspeed", "m"), ("roll", "deg_s"), ("yaw", "deg_s")):
            assert float(row[f"iae_{quantity}_{unit}"]) == uav["iae"][quantity]
        gaps = [channel["min_interval_s"] for channel in uav["channels"].values()]
        assert float(row["min_interval_s"]) == min(gaps)
        for name, channel in uav["channels"].items():
            assert int(row[f"events_{name}"]) == channel["events"]


def test_killed_in_the_middle(tmp_path: Path) -> None:
    scenario, folder = write_scenario(tmp_path, duration_s=LONG_S), tmp_path / "out"
    with sweeping(folder, scenario, *MANY, "--jobs", "1") as popen:
        os.kill(popen.pid, signal.SIGKILL)
        popen.wait(TIMEOUT_S)
    before = kept(folder)
    assert 1 <= len(before) < FLIGHTS
    assert not (folder / "table.csv").exists()
    done = sweep(scenario, *MANY, "--out", folder)
    assert done.returncode == 0, done.stderr
    assert f"{len(before)} of {FLIGHTS} flights already flown" in done.stderr
    after = kept(folder)
    assert len(after) == FLIGHTS
    assert {name: after[name] for name in before} == before
    assert len(rows_of(folder)) == FLIGHTS * 3
    assert not list(folder.rglob("*.part"))


def test_interrupt(tmp_path: Path) -> None:
    scenario, folder = write_scenario(tmp_path, duration_s=LONG_S), tmp_path / "out"
    with sweeping(folder, scenario, *MANY, "--quiet", "--jobs", "1") as popen:
        os.kill(popen.pid, signal.SIGINT)
        _, text = popen.communicate(timeout=TIMEOUT_S)
    assert popen.returncode == 130
    assert_one_message(text)
    before = kept(folder)
    assert f"{len(before)} of {FLIGHTS} flights in {folder}" in text
    assert "same command" in text
    assert sweep(scenario, *MANY, "--out", folder).returncode == 0
    after = kept(folder)
    assert len(after) == FLIGHTS
    assert {name: after[name] for name in before} == before


def test_default_folder_is_found_again(tmp_path: Path) -> None:
    write_scenario(tmp_path, duration_s=0.1)
    arguments = ("scenario.yaml", "--set", "trigger.b2_deg=1,2", "--quiet")
    for _ in range(2):
        assert sweep(*arguments, cwd=tmp_path).returncode == 0
        (folder,) = (tmp_path / "runs").iterdir()
        assert list(kept(folder)) == [0, 1]
    write_scenario(tmp_path, duration_s=0.2)  # other flights, another table
    done = sweep(*arguments, "--out", folder, cwd=tmp_path)
    assert done.returncode == 2
    assert "belongs to another campaign:\n" in done.stderr
    assert sweep(*arguments, cwd=tmp_path).returncode == 0
    (other,) = set((tmp_path / "runs").iterdir()) - {folder}
    assert {row["duration_s"] for row in rows_of(other)} == {"0.2"}


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--set", "trigger.b2_deq=1,2"], "did you mean 'b2_deg'"),
        (["--set", "trigger.b2_deg"], "KEY=VALUE"),
        (["--set", "trigger.b1=0.1", "--set", "trigger.b1=0.2"], "given twice"),
        (["--uav", "9"], "1, 2, 3"),
        (["--jobs", "0"], "--jobs"),
    ],
)
def test_mistake_is_refused_before_any_flight(
    tmp_path: Path, arguments: list[str], reason: str
) -> None:
    done = sweep(write_scenario(tmp_path), *arguments, "--out", tmp_path / "out")
    assert done.returncode == 2, done.stderr
    assert_one_message(done.stderr)
    assert reason in done.stderr
    assert not (tmp_path / "out").exists()


def test_folder_of_something_else(tmp_path: Path) -> None:
    scenario = write_scenario(tmp_path)
    done = sweep(scenario, "--out", tmp_path)
    assert done.returncode == 2
    assert "not a campaign or sweep" in done.stderr
    assert list(tmp_path.iterdir()) == [scenario]


def test_missing_scenario(tmp_path: Path) -> None:
    done = sweep(tmp_path / "no.yaml", "--out", tmp_path / "out")
    assert done.returncode == 2
    assert str(tmp_path / "no.yaml") in done.stderr
