"""What each actuator did, by a model: from recordings of our own, whole and as an exported log."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from ftc_lab.commands.diagnose import diagnose
from ftc_lab.flight_diagnosis.by_model import relations_by_model
from ftc_lab.flight_diagnosis.relations import relations_of
from gcs import fly
from gcs.console.errors import BadInput
from gcs.results.logs.read import read_flight
from gcs.results.logs.table import FlightTable
from gcs.results.ulog_export import to_ulg
from gcs.scenario.aircraft_file import load_aircraft

FAULT_S = 6.0


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """UAV 3 has its aileron stuck from 6 s on, and flies by a law that makes up for it."""
    folder = tmp_path_factory.mktemp("flight") / "run"
    fault = {"uav": 3, "actuator": "aileron", "stuck_deg": 4.0, "start_s": FAULT_S}
    changes = {"duration_s": 10.0, "controller.kind": "surviving", "faults": [fault]}
    fly("paper/scenario1", changes, out=folder)
    return folder


def test_measured_is_what_was_commanded_while_all_is_well(run: Path) -> None:
    relations = relations_by_model(read_flight(run, 1), load_aircraft("paper"))
    assert [one.surface for one in relations.relations] == [
        "aileron",
        "elevator",
        "rudder",
        "engine",
    ]
    for one, most in zip(relations.relations, [*[np.radians(0.5)] * 3, 5.0], strict=True):
        assert np.nanstd(one.measured) < most
        assert one.response is not None
        assert np.isfinite(one.response[10:]).all()


def _judged(*arguments: str) -> tuple[int, dict[str, object]]:
    app = typer.Typer()
    app.command()(diagnose)
    done = CliRunner().invoke(app, [*arguments, "--json"])
    return done.exit_code, json.loads(done.stdout)


def test_a_run_folder_is_judged_by_the_aircraft_that_was_flown(run: Path) -> None:
    status, found = _judged(str(run), "--uav", "3")
    finding = found["finding"]
    assert isinstance(finding, dict)
    assert status == 1
    assert finding["surface"] == "aileron"
    assert FAULT_S <= finding["alarm_s"] < FAULT_S + 1.0
    assert finding["onset_s"] == pytest.approx(FAULT_S, abs=0.4)
    status, found = _judged(str(run), "--uav", "1")
    assert status == 0
    assert found["finding"] is None


def test_its_export_says_the_same(run: Path, tmp_path: Path) -> None:
    paths = to_ulg(run, tmp_path)
    status, found = _judged(str(paths[-1]), "--aircraft", "paper")
    finding = found["finding"]
    assert isinstance(finding, dict)
    assert status == 1
    assert finding["surface"] == "aileron"
    assert finding["onset_s"] == pytest.approx(FAULT_S, abs=0.4)


def test_on_the_ground_nothing_is_judged_and_by_hand_all(run: Path) -> None:
    flight = read_flight(run, 1)
    taxiing = {
        name: replace(one, values=np.where(one.time_s < 4.0, 0.02 * one.values, one.values))
        for name, one in flight.channels.items()
        if name in {"u", "V"}
    }
    grounded = replace(flight, channels={**flight.channels, **taxiing}, modes=((0.0, "MANUAL"),))
    relations = relations_by_model(grounded, load_aircraft("paper"))
    for one in relations.relations:
        assert np.isnan(one.measured[relations.time_s < 5.9]).all()
        assert np.isfinite(one.measured[relations.time_s > 6.4]).all()


@pytest.mark.parametrize("missing", ["held_aileron", "wind_u", "p"])
def test_what_a_model_needs_is_named(run: Path, missing: str) -> None:
    flight = read_flight(run, 1)
    kept = {name: one for name, one in flight.channels.items() if name != missing}
    with pytest.raises(BadInput, match="cannot be diagnosed by a model: the log has no"):
        relations_by_model(FlightTable(flight.title, flight.kind, kept), load_aircraft("paper"))


def test_of_ten_seconds_a_log_teaches_nothing_by_itself(run: Path) -> None:
    flight = read_flight(run, 1)
    with pytest.raises(BadInput, match=r"nothing of .* can be judged"):
        relations_of(FlightTable(flight.title, flight.kind, {"roll": flight["roll"]}))
