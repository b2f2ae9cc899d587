"""How a flight says that it hit the ground, or that a law failed: figures, outcome, reason."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ftc_lab.campaigns.conditions import happened
from ftc_lab.campaigns.flights import figures_of, outcome_of
from gcs.fleet.in_process import fly_in_process, fly_in_steps
from gcs.reports.flight import flight_tables
from gcs.results.figures import FlightSummary
from gcs.results.summary import summarise, summary_of
from gcs.results.tally import Tally
from gcs.scenario.model import Scenario
from gcs.testing.results import FlightResult

HUGE = {"kind": "pid", "speed_p_n_s_m": 1e308}  # its thrust is infinite when it is 2 m/s off


def tree_of(scenario: Scenario, **changes: Any) -> dict[str, Any]:
    return scenario.model_dump() | {"duration_s": 0.5, "faults": ()} | changes


def diving(scenario: Scenario, system: int, altitude_m: float, pitch_deg: float) -> Scenario:
    """The scenario with one UAV that starts low, nose down."""
    tree = tree_of(scenario)
    for uav in tree["uavs"]:
        if uav["id"] == system:
            uav["initial"] |= {"altitude_m": altitude_m, "pitch_deg": pitch_deg}
    return Scenario.model_validate(tree)


@settings(max_examples=15)
@given(
    system=st.sampled_from([1, 2, 3]),
    altitude_m=st.floats(0.0, 5.0),
    pitch_deg=st.floats(-60.0, 0.0),
)
def test_nothing_flies_below_the_ground(
    system: int, altitude_m: float, pitch_deg: float, scenario1: Scenario
) -> None:
    scenario = diving(scenario1, system, altitude_m, pitch_deg)
    flight = fly_in_process(scenario)
    summary = summarise(flight, scenario)
    height = -flight.states[:, :, 2]
    for i, uav in enumerate(summary.uavs):
        assert uav.lowest_altitude_m == height[:, i].min()
        assert uav.hit_ground == (height[:, i].min() < 0.0)
    assert (height[:-1] >= 0.0).all()
    outcome, reason = outcome_of(summary)
    if not summary.hit_ground:
        assert outcome == "completed"
        return
    assert outcome == "ground"
    assert summary.uavs[system - 1].hit_ground
    assert not summary.completed
    assert f"UAV {system} was lost" in reason
    assert "hit the ground" in reason
    assert not happened("success", np.array([outcome], dtype=object)).any()
    with pytest.raises(AssertionError, match="hit the ground"):
        FlightResult(scenario, flight).assert_attitude_kept()


def test_the_tables_of_a_flight_have_its_lowest_altitude(scenario1: Scenario) -> None:
    scenario = diving(scenario1, 2, 1.0, -30.0)
    summary = summarise(fly_in_process(scenario), scenario)
    shown = [str(line) for line in flight_tables(summary, scenario)]
    assert any("lowest altitude 0.00 m above the ground, of UAV 2" in line for line in shown)
    assert figures_of(summary)["uav2.lowest_altitude_m"] == summary.uavs[1].lowest_altitude_m


def test_a_start_below_the_ground_is_refused(scenario1: Scenario) -> None:
    with pytest.raises(ValueError, match="altitude_m"):
        diving(scenario1, 1, -1.0, 0.0)


def failing(scenario: Scenario) -> FlightSummary:
    """A flight in which the PID law's thrust is not finite, in chunks as `gcs fly` takes it."""
    tree = tree_of(scenario, controller=HUGE)
    tree["uavs"][1]["initial"]["airspeed_m_s"] = 45.0
    scenario = Scenario.model_validate(tree)
    tally = Tally(scenario)
    return summary_of(tally, fly_in_steps(scenario, tally.add), scenario)


def test_a_law_that_fails_is_the_outcome(scenario1: Scenario) -> None:
    summary = failing(scenario1)
    failures = [uav.control_failure for uav in summary.uavs if uav.control_failure is not None]
    assert summary.uavs[1].control_failure in failures
    assert {tuple(failure.steps) for failure in failures} == {("throttle",)}
    first = min(failure.time_s for failure in failures)
    outcome, reason = outcome_of(summary)
    assert outcome == "control_failed"
    assert not summary.completed
    assert f"no finite command of throttle at {first:g} s" in reason
    assert any("failed first at" in str(line) for line in flight_tables(summary, scenario1))
    times = [value for name, value in figures_of(summary).items() if "control_failed" in name]
    assert first in times


def test_a_summary_of_an_earlier_version_is_read(scenario1: Scenario) -> None:
    tree = failing(scenario1).to_json()
    assert FlightSummary.from_json(tree).to_json() == tree
    for uav in tree["uavs"]:
        del uav["lowest_altitude_m"], uav["control_failure"]
    earlier = FlightSummary.from_json(tree)
    assert not earlier.hit_ground
    assert not earlier.control_failed
