"""`gcs reproduce` as a user runs it, on the paper's scenarios cut short."""

import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest
from flying import SCENARIO_1, assert_one_message, run
from typer.testing import CliRunner

from ftc_lab import reproduce
from ftc_lab.baselines.combinations import combinations, rivals
from ftc_lab.reproduce import FILES
from gcs.commands.cli import app
from gcs.console.errors import FlightLost
from gcs.scenario.model import load_scenario

pytestmark = pytest.mark.sitl

FIGURES = [*(f"fig{number}" for number in range(5, 12)), "combinations"]


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The paper's scenario files, 0.4 s long; in the last one the throttle of UAV 3 runs wild."""
    folder = tmp_path_factory.mktemp("scenarios")
    for file in FILES:
        base = SCENARIO_1.with_name(f"{file}.yaml")
        text = f"extends: {base}\nduration_s: 0.4\n"
        if file == "scenario3_mode4":
            text += "aircraft: {thrust_limit_n: 100000}\n"
            text += "faults: [{uav: 3, actuator: throttle, stuck_n: 100000, start_s: 0.1}]\n"
        (folder / f"{file}.yaml").write_text(text)
    return folder


@pytest.fixture(scope="module")
def out(short: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("reproduced")
    done = run("gcs", "reproduce", "--scenarios", short, "--out", out)
    assert done.returncode == 1, done.stderr
    assert_one_message(done.stderr)
    listed = combinations(load_scenario(short / "scenario1.yaml"))
    flights = len(FILES) + len(listed) + len(rivals(listed))
    assert f"{flights} flights, {len(FILES)} of them the paper's, in " in done.stdout
    assert "fault mode 4: UAV 3 was lost" in done.stderr
    return out


def test_everything_is_there(out: Path) -> None:
    assert {path.name for path in out.iterdir()} == {"report.html", "report.md", "figures", "data"}
    drawn = {path.name for path in (out / "figures").iterdir()}
    assert drawn == {f"{name}.{suffix}" for name in FIGURES for suffix in ("png", "svg")}
    for file in FILES:
        written = {path.name for path in (out / "data" / file).iterdir()}
        assert written == {
            "summary.json",
            "events.npz",
            "events.arrows",
            "events.csv",
            "trajectory.npz",
            "trajectory.arrows",
            "trajectory.csv",
        }


def test_the_page_needs_no_other_file(out: Path) -> None:
    page = (out / "report.html").read_text()
    assert page.count("data:image/png;base64,") == len(FIGURES)
    assert not re.findall(r'(?:src|href)="(?!data:)', page)


def test_the_report_shows_what_was_flown(out: Path) -> None:
    report = (out / "report.md").read_text()
    summary = json.loads((out / "data" / "scenario2_proposed" / "summary.json").read_text())
    follower = summary["uavs"][2]
    row = next(line for line in report.splitlines() if line.startswith("| proposed | 17.8"))
    assert f"17.8 / {follower['iae']['airspeed']:.2f} /" in row
    row = next(line for line in report.splitlines() if line.startswith("| proposed | 2146"))
    assert f"2575 / {follower['channels']['rudder']['events']} /" in row
    assert "**Lost flights: Paper, scenario 3, fault mode 4: UAV 3 was lost" in report
    for text in (
        "Where ours differs",
        "Smallest interval",
        "Residual sets",
        "(53), (69)",
        "What each inequality gives away",
    ):
        assert text in report


def test_laws_and_triggers_come_from_the_files(out: Path) -> None:
    with (out / "data" / "summary.csv").open() as file:
        rows = {row["scenario"]: row for row in csv.DictReader(file) if row["uav"] == "3"}
    assert set(rows) == set(FILES)
    for name in ("scenario2_periodic", "scenario2_backstepping", "scenario2_pid"):
        assert rows[name]["events_rudder"] == "400"
    assert int(rows["scenario2_proposed"]["events_rudder"]) < 400
    errors = {}
    for name in FILES:
        with np.load(out / "data" / name / "trajectory.npz") as arrays:
            errors[name] = arrays["error"]
    assert np.array_equal(errors["scenario1"], errors["scenario2_proposed"])
    assert not np.allclose(errors["scenario2_backstepping"], errors["scenario2_pid"])


def test_every_law_is_flown_with_every_trigger(out: Path) -> None:
    with (out / "data" / "combinations.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["uav"] == "3"]
    flown = {(row["aircraft"], row["law"], row["trigger"]): row for row in rows}
    assert len(flown) == len(rows)
    report = (out / "report.md").read_text()
    for (_, law, trigger), row in flown.items():
        assert f"{law}, {trigger}" in report
        if trigger == "periodic":
            assert row["transmissions"] == "1600"
            equal = row["slowest_equal_transmissions"]  # none: nobody tracks as well every 20 ms
            assert not equal or int(equal) <= 1600
    summary = json.loads((out / "data" / "scenario1" / "summary.json").read_text())
    own = flown["ideal", "proposed", "per_channel"]
    assert float(own["iae_yaw_deg_s"]) == summary["uavs"][2]["iae"]["yaw"]


def test_theory_stands_in_a_file(out: Path) -> None:
    theory = json.loads((out / "data" / "theory.json").read_text())
    assert set(theory) == set(FILES)
    speed = theory["scenario1"]["uavs"][2]["proofs"]["speed"]
    assert speed["verdict"] == "held"
    assert speed["certificate"]["slack"]["(51)"]["mean"] > 0.0
    assert theory["scenario3_mode4"]["uavs"][2]["proofs"]["speed"]["verdict"] != "held"
    assert theory["scenario2_pid"]["uavs"][2]["proofs"] == {}


def test_over_the_wire_it_is_the_same(
    out: Path, short: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of the paper's flights: the second chapter's are always flown in process."""
    monkeypatch.setattr(reproduce, "_second_chapter", lambda *_: "")
    monkeypatch.setattr(reproduce, "_draw", lambda *_: None)
    monkeypatch.setattr(reproduce, "html_of", lambda *_: "")  # it would look for the figures
    options = ("--scenarios", str(short), "--out", str(tmp_path / "wire"))
    done = CliRunner().invoke(app, ["reproduce", "--over-wire", *options])
    assert isinstance(done.exception, FlightLost), done.output
    ours, theirs = (folder / "data" / "summary.csv" for folder in (out, tmp_path / "wire"))
    assert ours.read_text() == theirs.read_text()
    assert (tmp_path / "wire" / "wire" / "scenario1" / "flight.tlog").stat().st_size > 0


def test_a_folder_without_scenarios_is_refused(tmp_path: Path) -> None:
    done = run("gcs", "reproduce", "--scenarios", tmp_path / "none", "--out", tmp_path / "out")
    assert done.returncode == 2
    assert "there is no folder" in done.stderr
    assert "--scenarios" in done.stderr
    assert not (tmp_path / "out").exists()


def test_a_missing_scenario_is_refused(tmp_path: Path) -> None:
    done = run("gcs", "reproduce", "--scenarios", tmp_path, "--out", tmp_path / "out")
    assert done.returncode == 2
    assert f"there is no file {tmp_path / 'scenario1.yaml'}" in done.stderr
