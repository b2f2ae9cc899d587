"""A figure of a UAV is one row of a table: whatever lists figures has a further row, too."""

import csv
import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from campaign_flights import planned
from sweeping import swept

from ftc_lab.baselines.combinations import Combination
from ftc_lab.campaigns.flights import fly_rows
from ftc_lab.campaigns.plan import row_of
from ftc_lab.reports.combinations import combinations_csv
from ftc_lab.reports.sweep import write_csv
from ftc_lab.reproduce import write_summaries
from gcs.fleet.in_process import fly_in_process
from gcs.results.figures import UAV_FIGURES, Figure, FlightSummary, UavSummary
from gcs.results.run_folder import read_summary, save_summary
from gcs.results.summary import summarise
from gcs.scenario.model import Scenario, load_scenario
from gcs.testing.results import FlightResult

SCENARIO = Path(__file__).parents[4] / "scenarios" / "paper" / "scenario1.yaml"


@pytest.fixture
def name() -> Iterator[str]:
    """The name of a figure that the table has during a test: twice a UAV's id."""
    row: Figure[UavSummary] = Figure("twice_its_id", "m", lambda uav: 2.0 * uav.id, derived=True)
    UAV_FIGURES.append(row)
    yield row.name
    UAV_FIGURES.remove(row)


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load_scenario(SCENARIO).model_copy(update={"duration_s": 0.01})


@pytest.fixture(scope="module")
def summary(scenario: Scenario) -> FlightSummary:
    return summarise(fly_in_process(scenario), scenario)


def test_summary_json(name: str, summary: FlightSummary, tmp_path: Path) -> None:
    save_summary(summary, tmp_path)
    uavs = json.loads((tmp_path / "summary.json").read_text())["uavs"]
    assert [uav[name] for uav in uavs] == [2.0, 4.0, 6.0]
    assert read_summary(tmp_path) == summary


def test_results_of_a_campaign(name: str) -> None:
    plan = planned()
    (row,) = fly_rows(plan.flights, [row_of(plan.draws, 0)]).to_pylist()
    assert row[f"uav3.{name}"] == 6.0


def test_csv_files(name: str, scenario: Scenario, summary: FlightSummary, tmp_path: Path) -> None:
    points = swept([SCENARIO], ["duration_s=0.01"], tmp_path / "sweep")
    write_csv(points, tmp_path / "table.csv")
    write_summaries(tmp_path / "summary.csv", {"one": summary})
    one = Combination("ideal", "proposed", "per_channel", scenario, summary)
    (tmp_path / "combinations.csv").write_text(combinations_csv([one]))
    for file in ("table.csv", "summary.csv", "combinations.csv"):
        with (tmp_path / file).open(newline="") as lines:
            assert [row[name] for row in csv.DictReader(lines)] == ["2.0", "4.0", "6.0"], file


def test_results_in_tests(name: str, scenario: Scenario) -> None:
    uav = FlightResult(scenario, fly_in_process(scenario)).uav(2)
    assert uav.figures[name] == uav.summary[name] == 4.0
