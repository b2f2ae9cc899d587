"""A flight of ours that was lost, as a log: the fault is found, flown again, and survived."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from ftc_lab.commands.replay_fault import replay_fault as command
from ftc_lab.fault_replay.found import check_commands, fault_of, with_wind
from ftc_lab.fault_replay.replay import LogMotion, ServoTimes, errors_of
from ftc_lab.fault_replay.replayed import read_fault
from ftc_lab.flight_diagnosis.by_model import flown_run
from gcs import fly
from gcs.console.errors import BadInput
from gcs.results.logs.read import read_flight
from gcs.results.logs.table import FlightTable
from gcs.results.ulog_export import to_ulg
from gcs.scenario.aircraft_file import load_aircraft
from gcs.scenario.model import load_scenario

FAULT_S = 8.0
LAW = "proposed"


@pytest.fixture(scope="module")
def lost(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The aileron of UAV 1 sticks at 20 deg under a law that does not see it: it is lost."""
    folder = tmp_path_factory.mktemp("flight") / "run"
    fault = {"uav": 1, "actuator": "aileron", "stuck_deg": 20.0, "start_s": FAULT_S}
    changes = {"duration_s": 20.0, "controller.kind": LAW, "faults": [fault]}
    assert fly("paper/scenario1", changes, out=folder).loss is not None
    return folder


def _log(run: Path, uav: int) -> FlightTable:
    return flown_run(run, read_flight(run, uav), uav)


def test_fault_time_and_value_are_found_and_the_model_then_crashes_as_it_did(lost: Path) -> None:
    read = read_fault(lost, None, 1, None, identify=True)
    assert read.fault.actuator == "aileron"
    assert read.fault.onset_s == pytest.approx(FAULT_S, abs=0.3)
    assert read.fault.values == {"stuck_deg": pytest.approx(20.0, abs=0.5)}
    begin = read.log.index(FAULT_S - 1.0)
    errors = errors_of(read.log, begin, begin + 400, read.fault)
    assert errors.confirms
    assert errors.faulty["roll"][0] < 0.2 * errors.healed["roll"][0]


@pytest.mark.parametrize(
    ("fault", "value"),
    [
        ({"actuator": "rudder", "effectiveness": 0.3}, {"effectiveness": 0.3}),
        ({"actuator": "elevator", "bias_deg": 3.0}, {"bias_deg": 3.0}),
    ],
)
def test_losses_and_biases_are_told_apart(
    fault: dict[str, object], value: dict[str, float], tmp_path: Path
) -> None:
    faults = [{"uav": 1, "start_s": FAULT_S, **fault}]
    fly("paper/scenario1", {"duration_s": 14.0, "faults": faults}, out=tmp_path / "run")
    found = fault_of(_log(tmp_path / "run", 1), load_aircraft("paper"))
    assert found is not None
    assert found.actuator == fault["actuator"]
    assert set(found.values) == set(value)
    for key, one in value.items():
        assert found.values[key] == pytest.approx(one, rel=0.15)


def _run(*arguments: str) -> tuple[int, str]:
    app = typer.Typer()
    app.command()(command)
    done = CliRunner().invoke(app, [*arguments])
    if isinstance(done.exception, BadInput):
        return 2, str(done.exception)
    return done.exit_code, done.stdout


def test_another_law_lives_and_the_page_has_all_three(lost: Path, tmp_path: Path) -> None:
    out = tmp_path / "again"
    laws = ("--controller.kind", "surviving", "--controller.kind", LAW)
    status, printed = _run(str(lost), "--uav", "1", *laws, "--out", str(out), "--json")
    said = json.loads(printed)
    assert status == 0
    assert said["laws"]["surviving"]["loss"] is None
    assert "ground" in said["laws"][LAW]["loss"]
    assert said["model"]["confirms_the_fault"]
    page = (out / "report.md").read_text(encoding="utf-8")
    for text in ("the log", "the model under the recorded commands", "surviving", "LOST"):
        assert f"| {text}" in page or text in page
    assert "data:image/png" in (out / "report.html").read_text(encoding="utf-8")
    scenario = load_scenario(out / "surviving.yaml")
    assert scenario.actuator_faults[0].actuator == "aileron"
    assert fly(out / "surviving.yaml").loss is None


def test_the_log_of_another_autopilot_is_flown_from_before_its_fault(
    lost: Path, tmp_path: Path
) -> None:
    path = to_ulg(lost, tmp_path)[0]
    out = tmp_path / "again"
    status, printed = _run(
        str(path), "--aircraft", "paper", "--as-given", "--out", str(out), "--json"
    )
    said = json.loads(printed)
    assert status == 0
    assert said["fault"]["actuator"] == "aileron"
    assert said["fault"]["values"]["stuck_deg"] == pytest.approx(20.0, abs=1.0)
    scenario = load_scenario(out / "surviving.yaml")
    assert scenario.uavs[0].initial.airspeed_m_s == pytest.approx(45.0, abs=3.0)
    assert scenario.actuator_faults[0].start_s == pytest.approx(2.0, abs=0.1)


def test_a_flight_without_a_fault_and_a_folder_in_use_are_refused(
    lost: Path, tmp_path: Path
) -> None:
    status, text = _run(str(lost), "--uav", "2", "--out", str(tmp_path / "again"))
    assert status == 2
    assert "nothing failed" in text
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "file").touch()
    status, text = _run(str(lost), "--out", str(tmp_path / "mine"))
    assert status == 2
    assert "expected a new or an empty folder" in text
    status, text = _run(str(lost), "--controller.kind", "none", "--out", str(tmp_path / "again"))
    assert "--controller.kind is 'none'" in text


def test_without_commands_it_is_said_what_the_log_shows(lost: Path) -> None:
    flight = read_flight(lost, 1)
    kept = {name: one for name, one in flight.channels.items() if not name.startswith("held_")}
    with pytest.raises(BadInput, match=r"cannot be flown again: it has no commands of aileron"):
        check_commands(replace(flight, channels=kept), load_aircraft("paper"))


def test_a_steady_wind_is_found_by_airspeeds(lost: Path) -> None:
    flight, aircraft = read_flight(lost, 2), load_aircraft("paper")
    kept = {name: one for name, one in flight.channels.items() if not name.startswith("wind_")}
    found, text = with_wind(replace(flight, channels=kept), aircraft)
    assert "steady one" in text
    assert np.abs(found["wind_north"].values).max() < 0.5
    log = LogMotion(found, aircraft, ServoTimes())
    begin = log.index(4.0)
    off = log.flown(begin, begin + 100, None).less(log.recorded(begin, begin + 100))
    assert off.largest("pitch", 1.0) < 1.5
