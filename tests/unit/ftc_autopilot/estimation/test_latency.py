"""How late a receiver is, each filter learns by itself, and no faster than it can know."""

from typing import Any

import numpy as np
import pytest

from ftc_autopilot.estimation.state import DELAY, WIND
from gcs.fleet.in_process import begin, fly_on
from gcs.results.recording import Steps
from gcs.scenario.model import scenario_of, scenario_tree
from mavlink_defs.config.inherit import merged

LATE_S = 0.3


def filters_after(name: str, **changes: Any) -> np.ndarray:
    """Return the filters of all aircraft, dtype `FILTER`, shape (n, imus)."""
    tree = merged(scenario_tree(name), {"navigation": "estimated", "faults": [], **changes})
    scenario = scenario_of(name, tree)
    flight = begin(scenario)
    steps = Steps.room(scenario.steps, len(scenario.uavs), estimated=True)
    assert fly_on(scenario, flight, steps.part, first=0).loss is None
    filters: np.ndarray = flight.estimates.estimators["filters"][:, :2].copy()
    return filters


def headed(name: str, yaw_deg: float) -> list[Any]:
    """Return the aircraft of a scenario, turned."""
    uavs = scenario_tree(name)["uavs"]
    return [merged(uav, {"initial": {"yaw_deg": yaw_deg}}) for uav in uavs]


def off_by(filters: np.ndarray, late_s: float) -> np.ndarray:
    """Return errors of the latency over their standard deviations."""
    deviations = np.sqrt(filters["P"][:, :, DELAY, DELAY])
    off: np.ndarray = np.abs(filters["x"][:, :, DELAY] - late_s) / deviations
    return off


@pytest.mark.parametrize("duration_s", [1.0, 2.0, 6.0])
def test_every_filter_knows_how_well_it_knows_a_latency(duration_s: float) -> None:
    filters = filters_after(
        "paper/scenario1", duration_s=duration_s, wind={"turbulence": "moderate"}
    )
    assert (off_by(filters, 0.0) < 4.0).all()
    if duration_s > 5.0:
        assert (np.abs(filters["x"][:, :, DELAY]) < 0.05).all()


def test_a_storm_across_at_the_start_teaches_no_latency() -> None:
    """The parts of a fix come one after the other, and a fix to one filter after the other."""
    changes = {"wind": {"steady": {"north_m_s": 6.5, "east_m_s": 37.0}}, "step_us": 2000}
    uavs = headed("paper/scenario1", -34.0)
    filters = filters_after("paper/scenario1", duration_s=3.0, seed=910124, uavs=uavs, **changes)
    assert (off_by(filters, 0.0) < 10.0).all()  # 60 if a filter took another one's for its own


@pytest.mark.slow
def test_a_latency_that_a_receiver_does_not_say_is_learned_in_turns() -> None:
    late = [{"uav": 1, "sensor": "gps", "start_s": 0.0, "end_s": 40.0, "delayed_s": LATE_S}]
    filters = filters_after("airframes/aerosonde_mission", duration_s=40.0, faults=late)
    assert (np.abs(filters["x"][:, :, DELAY] - LATE_S) < 0.03).all()
    assert (off_by(filters, LATE_S) < 4.0).all()


@pytest.mark.slow
def test_a_wind_of_a_wrong_first_heading_does_not_stay() -> None:
    """24 m/s across at the start look like a bank, and a wind of 100 m/s."""
    uavs = headed("airframes/pc7", 128.0)
    wind = {"steady": {"north_m_s": -14.6, "east_m_s": -19.4}, "turbulence": "none"}
    filters = filters_after("airframes/pc7", duration_s=6.0, wind=wind, uavs=uavs)
    off = filters["x"][:, 0, WIND : WIND + 2] - (-14.6, -19.4)
    assert (np.abs(off) < 12.0).all()
