from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from theory_flights import DT, scenario_with, synthetic

from ftc_lab.theory.dwell import dwell_times, in_force
from gcs.fleet.in_process import fly_in_process
from gcs.results.recording import Recording
from gcs.scenario.model import Scenario
from mavlink_defs.constants import THROTTLE
from sitl_plant.airframe.stops import share_of

pytestmark = pytest.mark.slow


def with_thrust(demand: list[float], events: list[int]) -> Recording:
    recording = synthetic(len(demand))
    recording.signals["demand"][:, 0, THROTTLE] = demand
    recording.signals["events"][events, 0] = 1 << THROTTLE
    return recording


def test_interval_and_bound_of_a_known_command(scenario1: Scenario) -> None:
    recording = with_thrust([0.0, 0.2, 0.4, 0.6, 0.7, 0.9, 1.1], [0, 3, 6])
    throttle = dwell_times(recording, 0, scenario1)["throttle"]
    assert throttle["events"] == 3
    assert throttle["min_interval_s"] == pytest.approx(3 * DT)
    assert throttle["intervals"] == 2
    assert throttle["intervals_of_one_period"] == 0
    assert throttle["mu_n_s"] == pytest.approx(200.0)
    assert throttle["threshold_n"] == 0.5  # a2 up to 14 s
    assert throttle["bound_s"] == pytest.approx(0.5 / 200.0)
    assert throttle["bound_below_period"] is False
    assert throttle["held"] is True


def test_rate_is_taken_of_the_saturated_command(scenario1: Scenario) -> None:
    throttle = dwell_times(with_thrust([0.0, -5e3, 1.0], [0]), 0, scenario1)["throttle"]
    assert throttle["mu_n_s"] == pytest.approx(1e3)
    assert throttle["mu_unsaturated_n_s"] == pytest.approx(5001e3)


def test_a_trigger_that_fires_too_early_is_caught(scenario1: Scenario) -> None:
    throttle = dwell_times(with_thrust([0.0, 0.2, 0.4, 0.6], [0, 1, 3]), 0, scenario1)["throttle"]
    assert throttle["intervals_below_bound"] == 2
    assert throttle["held"] is False


def test_each_interval_meets_the_threshold_in_force_at_its_end() -> None:
    scenario = scenario_with(trigger={"a2_n": [{"until_s": 0.003, "value": 0.5}, {"value": 1.0}]})
    ramp = [0.25 * k for k in range(8)]
    throttle = dwell_times(with_thrust(ramp, [0, 2, 6]), 0, scenario)["throttle"]
    assert throttle["held"] is True
    throttle = dwell_times(with_thrust(ramp, [0, 2, 4]), 0, scenario)["throttle"]
    assert throttle["intervals_below_bound"] == 1


def test_joint_surfaces_share_the_fastest_rate() -> None:
    scenario = scenario_with(trigger={"mode": "joint"})
    recording = synthetic(3)
    recording.signals["demand"][:, 0, 0] = np.radians([0.0, 2.0, 4.0])
    recording.signals["events"][:, 0] = 0b111
    dwell = dwell_times(recording, 0, scenario)
    assert dwell["rudder"]["mu_deg_s"] == 0.0
    assert dwell["rudder"]["bound_s"] == pytest.approx(0.5 * DT)
    assert dwell["rudder"]["held"] is True


def test_without_a_trigger_there_is_no_bound() -> None:
    scenario = scenario_with(trigger={"mode": "periodic"})
    throttle = dwell_times(with_thrust([0.0, 1.0], [0, 1]), 0, scenario)["throttle"]
    assert throttle["min_interval_s"] == pytest.approx(DT)
    assert throttle["bound_s"] is throttle["held"] is None


@pytest.mark.parametrize(
    ("trigger", "bounded"),
    [
        ({"mode": "per_channel"}, True),
        ({"mode": "dynamic"}, True),
        ({"mode": "periodic_event", "check_s": 0.003}, True),
        ({"mode": "scaled"}, True),
        ({"mode": "self"}, False),
        ({"mode": "periodic", "period_s": 0.004}, False),
    ],
)
def test_flown_intervals_keep_the_bound_of_their_trigger(
    trigger: dict[str, Any], bounded: bool
) -> None:
    scenario = scenario_with(trigger=trigger, duration_s=0.3, faults=[])
    flight = fly_in_process(scenario)
    shortest = {"periodic_event": 0.003, "self": 0.004, "periodic": 0.004}
    for i in range(len(flight.uav_ids)):
        for channel in dwell_times(flight, i, scenario).values():
            assert channel["held"] in ({True, None} if bounded else {None})
            if channel["events"] > 1:
                assert channel["min_interval_s"] >= shortest.get(trigger["mode"], DT) - 1e-9


@given(st.lists(st.floats(-50.0, 3000.0), min_size=1, max_size=60))
def test_no_working_trigger_beats_its_bound(scenario1: Scenario, demand: list[float]) -> None:
    limit = scenario1.aircraft.thrust_limit_n
    held, events = 0.0, []
    for k, command in enumerate(demand):
        if k == 0 or abs(min(max(command, 0.0), limit) - held) >= 0.01 * held + 0.5:
            held = float(share_of(command, 0.0, limit)) * limit
            events.append(k)
    throttle = dwell_times(with_thrust(demand, events), 0, scenario1)["throttle"]
    assert throttle["held"] in {True, None}


def test_schedule_windows_include_their_last_instant(scenario1: Scenario) -> None:
    times = np.array([0.0, 14.0, 14.001, 24.0])
    assert in_force(scenario1.trigger.a2_n, times).tolist() == [0.5, 0.5, 1.0, 1.0]


def test_a_command_is_saturated_by_what_there_is_at_its_airspeed(scenario1: Scenario) -> None:
    """The demand jumps beyond 1000 N, of which there are 400 N at 50 m/s."""
    rows = [{"airspeed_m_s": 40.0, "thrust_n": 600.0}, {"airspeed_m_s": 60.0, "thrust_n": 200.0}]
    tree = scenario1.model_dump()
    tree["aircraft"]["propulsion"] = {"thrust": rows}
    weak, recording = Scenario.model_validate(tree), with_thrust([0.0, 1e3, 1e3], [0])
    recording.signals["V"] = 50.0
    assert dwell_times(recording, 0, scenario1)["throttle"]["mu_n_s"] == pytest.approx(1e6)
    assert dwell_times(recording, 0, weak)["throttle"]["mu_n_s"] == pytest.approx(4e5)
