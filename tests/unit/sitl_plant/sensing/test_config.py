"""Configuration of the sensors that an autopilot navigates by."""

import re
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from gcs.scenario.model import Scenario
from mavlink_defs.constants import GNSS, PITOT
from sitl_plant.config import PlantConfig
from sitl_plant.sensing.config import NavigationSensors, Sensors
from sitl_plant.sensing.observability import navigation_problems, observability_warnings
from sitl_plant.sensing.true_state import new_sensors
from sitl_plant.sensing.units import units_of

PAGE = Path(__file__).parents[4] / "docs/explanation/sensors.md"
NOT_ERRORS = {"fitted", "rate_hz", "latency_s", "hdop", "vdop", "satellites"}


def problems(sensors: dict[str, Any], step_us: int = 1000) -> dict[str, str]:
    found = navigation_problems(Sensors.model_validate(sensors), step_us)
    return {".".join(map(str, loc)): text for loc, text in found}


def test_a_grade_fills_in_what_is_not_given() -> None:
    tactical = NavigationSensors.model_validate({"grade": "tactical"})
    consumer = NavigationSensors()
    for name in ("gyro", "accelerometer", "magnetometer", "barometer", "pitot", "gnss"):
        assert getattr(tactical, name) != getattr(consumer, name)
    part = NavigationSensors.model_validate({"grade": "tactical", "gyro": {"rate_hz": 500.0}})
    assert part.gyro == tactical.gyro.model_copy(update={"rate_hz": 500.0})
    assert NavigationSensors.model_validate(part.model_dump()) == part


def test_the_default_set_can_navigate() -> None:
    assert not problems({})


@pytest.mark.parametrize("step_us", [1000, 2000, 5000, 10_000])
def test_a_rate_within_one_percent_is_whole_control_periods_as_well(step_us: int) -> None:
    for share, is_near in ((0.992, True), (1.008, True), (0.985, False), (1.015, False)):
        found = problems({"navigation": {"pitot": {"rate_hz": 1e6 / step_us * share}}}, step_us)
        assert (not found) == is_near


@pytest.mark.parametrize(
    ("step_us", "pitot", "gnss", "late"), [(4000, 2, 25, 50), (7000, 1, 14, 29)]
)
def test_default_rates_and_latencies_become_the_nearest(
    step_us: int, pitot: int, gnss: int, late: int
) -> None:
    assert not problems({}, step_us)
    units = {unit.kind: unit for unit in units_of(NavigationSensors(), step_us)}
    assert units[PITOT].every == pitot
    assert (units[GNSS].every, units[GNSS].late) == (gnss, late)


@pytest.mark.parametrize("step_us", [1000, 2000, 5000, 10_000])
def test_a_rate_is_whole_control_periods(step_us: int) -> None:
    assert not problems({}, step_us)
    found = problems({"navigation": {"magnetometer": {"rate_hz": 75.0}}}, step_us)
    assert list(found) == ["navigation.magnetometer.rate_hz"]
    assert f"control periods of {step_us} us" in found["navigation.magnetometer.rate_hz"]
    late = problems({"navigation": {"gnss": {"latency_s": 0.20003}}}, step_us)
    assert "got 0.20003 s" in late["navigation.gnss.latency_s"]


def test_what_is_not_fitted_needs_no_rate() -> None:
    off = {"fitted": False, "rate_hz": 75.0}
    assert not problems({"navigation": {"magnetometer": off}})


def test_errors_of_the_true_state_are_refused_beside_an_estimated_one() -> None:
    found = problems({"gyro_deg_s": {"bias": 1.0}, "airspeed_m_s": {"noise_rms": 0.2}})
    assert list(found) == ["gyro_deg_s", "airspeed_m_s"]
    assert "sensors.navigation" in found["gyro_deg_s"]


def test_a_set_that_cannot_observe_is_refused_by_name() -> None:
    nothing = {"gnss": {"fitted": False}, "magnetometer": {"fitted": False}}
    assert "heading" in problems({"navigation": nothing})["navigation.gnss.fitted"]
    del nothing["magnetometer"]
    text = problems({"navigation": nothing})["navigation.gnss.fitted"]
    assert "position" in text
    assert "heading" not in text


def test_a_set_that_observes_at_times_is_warned_of() -> None:
    assert not list(observability_warnings(NavigationSensors()))
    off = {"magnetometer": {"fitted": False}}
    (loc, text), *rest = observability_warnings(NavigationSensors.model_validate(off))
    assert loc == ("magnetometer", "fitted")
    assert "at rest" in text
    assert not rest


def test_they_change_nothing_of_a_flight_by_the_true_state(scenario1: Scenario) -> None:
    tree = scenario1.plant_config().model_dump()
    navigation = {"gyro": {"turn_on_bias_deg_s": 5.0}, "magnetometer": {"rate_hz": 75.0}}
    config = PlantConfig.model_validate(tree | {"sensors": {"navigation": navigation}})
    assert new_sensors(config.sensors, [1], config.seed, config.step_us)["ideal"].all()
    with pytest.raises(ValidationError):
        PlantConfig.model_validate(config.model_dump() | {"navigation": "estimated"})


def test_the_page_has_the_numbers_of_each_grade() -> None:
    rows = re.findall(r"^\| `(\w+)\.(\w+)` \| (\S+) \| (\S+) \|", PAGE.read_text(), re.MULTILINE)
    found = {(sensor, key): (float(a), float(b)) for sensor, key, a, b in rows}
    grades = [NavigationSensors.model_validate({"grade": g}) for g in ("consumer", "tactical")]
    consumer, tactical = ({**grade.model_dump()} for grade in grades)
    expected = {
        (sensor, key): (values[key], tactical[sensor][key])
        for sensor, values in consumer.items()
        if isinstance(values, dict)
        for key in values.keys() - NOT_ERRORS
    }
    assert found == expected
