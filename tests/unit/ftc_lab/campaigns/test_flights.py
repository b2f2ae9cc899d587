"""From a flight to its row: outcomes, figures, and flights that cannot be computed."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from campaign_flights import planned

from ftc_lab.campaigns.again import check_same, chosen_rows, keep_flights, scenario_of_row
from ftc_lab.campaigns.engine import missing_rows
from ftc_lab.campaigns.flights import Flights, Row, figures_of, fly_rows, outcome_of
from ftc_lab.campaigns.folder import default_folder, open_folder
from ftc_lab.campaigns.model import Kept
from ftc_lab.campaigns.plan import row_of, rows_of
from ftc_lab.campaigns.store import OUTCOMES, append_results, read_results
from gcs.console.errors import BadInput, GcsError
from gcs.fleet.in_process import fly_in_process
from gcs.results.figures import FlightSummary
from gcs.results.quantities import PAPER_ORDER
from gcs.results.summary import summarise
from gcs.results.summary_parts import ControlFailure
from gcs.scenario.model import Scenario, load_scenario
from mavlink_defs.config.models import ConfigError


@pytest.fixture(scope="module")
def summary() -> FlightSummary:
    campaign = planned()
    scenario = campaign.flights.scenario(row_of(campaign.draws, 0))
    return summarise(fly_in_process(scenario), scenario)


def lost(summary: FlightSummary, **times: dict[int, Any]) -> FlightSummary:
    """The same flight with times of loss, and other figures, by UAV."""
    uavs: Any = summary.uavs
    for name, at in times.items():
        uavs = tuple(dataclasses.replace(uav, **{name: at.get(uav.id)}) for uav in uavs)
    return dataclasses.replace(summary, uavs=uavs)


def test_the_outcome_is_the_worst_that_applies(summary: FlightSummary) -> None:
    heading = lost(summary, heading_lost_at_s={2: 3.0, 3: 2.0})
    attitude = lost(summary, heading_lost_at_s={2: 3.0}, attitude_lost_at_s={1: 4.0})
    left = dataclasses.replace(attitude, loss="UAV 1 was lost", completed=False)
    ground = lost(left, lowest_altitude_m={1: -0.01, 2: 3.0})
    failed = lost(ground, control_failure={2: ControlFailure(0.5, {"rudder": 2})})
    cases = (summary, heading, attitude, ground, left, failed)
    found = [outcome_of(case) for case in cases]
    assert [outcome for outcome, _ in found] == list(OUTCOMES[:6])
    assert [reason for _, reason in found] == [
        "",
        "UAV 3 was more than 90° off in yaw at 2 s",
        "UAV 1 was more than 90° off in roll or pitch at 4 s",
        *["UAV 1 was lost"] * 3,
    ]


def test_every_figure_has_a_column_and_every_column_a_figure(summary: FlightSummary) -> None:
    plan = planned()
    (row,) = fly_rows(plan.flights, [row_of(plan.draws, 0)]).to_pylist()
    figures = figures_of(summary)
    own = {*plan.draws.schema.names, "outcome", "reason", "version", "digest"}
    assert set(row) - own == set(figures)
    assert {**row, **figures, "wall_s": 0.0} == {**row, "wall_s": 0.0}
    assert row["uav3.events"] == sum(row[f"uav3.events_{name}"] for name in PAPER_ORDER)
    assert row["digest"] == plan.mark.digest


def test_a_drawn_aircraft_that_the_law_cannot_fly_is_refused_with_the_reason() -> None:
    rudder = {
        f"aircraft.coefficients.{name}": {"draw": {"kind": "choice", "values": [0.0]}}
        for name in ("cl_dr", "cn_dr")
    }
    changes = {"duration_s": 0.01, "controller": {"kind": "surviving"}}
    with pytest.raises(ConfigError, match=r"draw 0 of variant surviving: .* by its rudder"):
        planned(factors=rudder, variants={"surviving": changes})


class Hopeless(Flights):
    """Flights of which one cannot be computed."""

    def scenario(self, row: Row) -> Scenario:
        if row["row"] == 1:
            raise MemoryError("too long")
        return super().scenario(row)


def test_a_flight_that_cannot_be_computed_is_a_row() -> None:
    plan = planned(draws=3)
    ours = plan.flights
    flights = Hopeless(ours.campaign, ours.file, ours.trees, ours.filled, ours.schema)
    rows = fly_rows(flights, list(rows_of(plan.draws))).to_pylist()
    assert [row["outcome"] for row in rows] == ["completed", "failed", "completed"]
    assert rows[1]["reason"] == "MemoryError: too long"
    assert rows[1]["saving"] is None


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign that is flown but for its last row."""
    at = tmp_path_factory.mktemp("campaign") / "out"
    variants = {"a": {"duration_s": 0.01}, "b": {"duration_s": 0.02}}
    plan = planned(draws=4, variants=variants)
    open_folder(at, plan)
    append_results(at, fly_rows(plan.flights, list(rows_of(plan.draws))[:-1]))
    return at


def test_a_row_flies_again_to_the_last_bit(folder: Path) -> None:
    scenario = scenario_of_row(folder, 5)
    assert scenario.duration_s == 0.02
    summary = summarise(fly_in_process(scenario), scenario)
    check_same(folder, 5, summary)
    with pytest.raises(GcsError, match=r"row 3 of .* was flown otherwise"):
        check_same(folder, 3, summary)
    with pytest.raises(GcsError, match="not flown yet"):
        check_same(folder, 7, summary)
    with pytest.raises(BadInput, match="--row is 8, expected 0 to 7"):
        scenario_of_row(folder, 8)


def test_missing_rows(folder: Path) -> None:
    assert missing_rows(folder, 8).tolist() == [7]


def test_the_worst_flights_of_each_variant_are_chosen(folder: Path) -> None:
    figure = "uav1.iae_airspeed"
    rows = read_results(folder, ["row", "variant", figure]).to_pylist()
    expected = {
        max((row for row in rows if row["variant"] == name), key=lambda row: row[figure])["row"]
        for name in "ab"
    }
    assert set(chosen_rows(folder, Kept(worst=1, figures=(figure,)))) == expected
    assert chosen_rows(folder, Kept(share=1.0)) == list(range(7))
    assert chosen_rows(folder, Kept(failures=3)) == []


def test_a_random_share_is_the_same_every_time(folder: Path) -> None:
    some = chosen_rows(folder, Kept(share=0.5))
    assert some == chosen_rows(folder, Kept(share=0.5))
    assert 0 < len(some) < 7


def test_a_kept_flight_is_the_one_of_the_table(folder: Path) -> None:
    variants = {"a": {"duration_s": 0.01}, "b": {"duration_s": 0.02}}
    ours = planned(draws=4, variants=variants, keep={"share": 1.0}).flights
    exchanged = {"a": ours.trees["b"], "b": ours.trees["a"]}
    with pytest.raises(GcsError, match=r"row 0 of .* was flown otherwise"):
        list(keep_flights(folder, dataclasses.replace(ours, trees=exchanged)))
    assert not (folder / "flights").exists()
    assert list(keep_flights(folder, ours)) == [(done, 7) for done in range(8)]
    kept = np.load(folder / "flights" / "3" / "trajectory.npz")
    assert np.array_equal(kept["state"], fly_in_process(scenario_of_row(folder, 3)).states)
    assert load_scenario(folder / "flights" / "3" / "scenario.yaml") == scenario_of_row(folder, 3)


def test_another_campaign_or_other_code_needs_another_folder(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    variants = {"a": {"duration_s": 0.01}, "b": {"duration_s": 0.02}}
    with pytest.raises(BadInput, match="to another campaign"):
        open_folder(folder, planned(draws=4, variants=variants | {"a": {"duration_s": 0.03}}))
    same = planned(draws=4, variants=variants)
    open_folder(folder, same)
    other = dataclasses.replace(same, mark=dataclasses.replace(same.mark, digest="other"))
    with pytest.raises(BadInput, match=rf"{same.mark.digest}; this is .* with other"):
        open_folder(folder, other)
    assert default_folder(same.mark) != default_folder(other.mark)


def test_a_folder_is_taken_over_only_if_nothing_in_it_is_somebodys(tmp_path: Path) -> None:
    """What a beginning that was killed has left is ours; a scenario alone is not."""
    plan = planned()
    scenario = tmp_path / "scenario.yaml"
    scenario.write_text("precious")
    with pytest.raises(BadInput, match="not a campaign or sweep"):
        open_folder(tmp_path, plan)
    assert scenario.read_text() == "precious"
    (tmp_path / "request.yaml.part").write_text("schema: ")
    open_folder(tmp_path, plan)
    assert scenario_of_row(tmp_path, 0).duration_s == 0.01
    assert {path.name for path in tmp_path.iterdir()} == {
        "request.yaml",
        "scenario.yaml",
        "draws.parquet",
    }


def test_a_folder_that_began_may_lack_its_draws(tmp_path: Path) -> None:
    plan = planned()
    open_folder(tmp_path, plan)
    (tmp_path / "draws.parquet").unlink()
    open_folder(tmp_path, plan)
    assert missing_rows(tmp_path, 8).tolist() == list(range(8))
