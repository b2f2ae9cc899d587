"""The battery of flights by sensors: what counts as blame, and what its families fly."""

import math
from typing import Any

import pytest

from benchmarks.sensor_attacks import (
    FAMILIES,
    back_s,
    cases_of,
    is_due,
    noticed_s,
    scenario_of_case,
)
from benchmarks.sensor_flights import Exclusion
from gcs.scenario.model import Scenario
from gcs.scenario.sections import ScenarioSensorFault


def fault(**changes: Any) -> ScenarioSensorFault:
    known = {"uav": 1, "sensor": "gps", "start_s": 10.0, "end_s": 20.0, "failure": "off"}
    return ScenarioSensorFault(**{**known, **changes})


def out(time_s: float, sensor: str, uav: int = 1, excluded: bool = True) -> Exclusion:
    return Exclusion(time_s, uav, sensor, excluded)


@pytest.mark.parametrize(
    ("one", "due"),
    [
        (out(10.1, "gps"), True),
        (out(12.0, "gps height"), True),
        (out(25.0, "gps"), True),  # it has ten seconds to be well again
        (out(9.9, "gps"), False),
        (out(31.0, "gps"), False),
        (out(12.0, "barometer"), False),
        (out(12.0, "gps", uav=2), False),
    ],
)
def test_what_is_blamed_is_what_has_no_fault(one: Exclusion, due: bool) -> None:
    assert is_due(one, [fault()]) == due


@pytest.mark.parametrize(("instance", "other"), [(1, False), (0, True)])
def test_a_fault_of_all_imus_is_one_of_each(instance: int, other: bool) -> None:
    one = fault(sensor="gyro", instance=instance)
    assert is_due(out(12.0, "imu 1"), [one])
    assert is_due(out(12.0, "imu 2"), [one]) == other


def test_what_never_comes_back_is_slower_than_anything(scenario1: Scenario) -> None:
    flight = scenario1.model_copy(update={"duration_s": 60.0})
    seen = [out(10.5, "gps"), out(10.6, "gps height"), out(22.0, "gps", excluded=False)]
    assert noticed_s(fault(), seen) == pytest.approx(0.5)
    assert noticed_s(fault(uav=2), seen) is None
    assert back_s(fault(), seen, flight) == math.inf
    well = [*seen, out(24.0, "gps height", excluded=False)]
    assert back_s(fault(), well, flight) == pytest.approx(4.0)
    assert back_s(fault(end_s=60.0), seen, flight) == 0.0  # it lasts


@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.__name__)
def test_cases_can_be_flown_and_are_the_same_of_a_seed(family: Any) -> None:
    some = cases_of(family, 4, 3)
    assert some == cases_of(family, 4, 3)
    assert some != cases_of(family, 4, 4)
    for case in some:
        assert scenario_of_case(case).navigation == "estimated"
