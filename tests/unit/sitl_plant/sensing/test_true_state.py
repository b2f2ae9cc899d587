"""Sensors: what a state message carries when the true motion is known."""

from typing import Any

import numpy as np
import pytest

from gcs.scenario.model import Scenario, scenario_of
from sitl_plant.config import PlantConfig
from sitl_plant.loop.fleet import PlantState, fly, new_plant_state, observe

FIELDS = {"gyro_deg_s": "rates", "accelerometer_m_s2": "specific_force", "attitude_deg": "attitude"}


def config_of(scenario1: Scenario, sensors: dict[str, Any], **more: Any) -> PlantConfig:
    calm = {"disturbance": {}, "sensors": sensors}
    tree = scenario1.model_dump() | calm | more
    return scenario_of("sensors", tree).plant_config()


def measured(
    config: PlantConfig, field: str, steps: int, i: int = 1, beside: tuple[int, ...] = ()
) -> np.ndarray:
    """What aircraft i measures, after those beside it, while all stand still: (steps, 3)."""
    fleet = new_plant_state(config)
    values = []
    for step in range(steps):
        for k in (*beside, i):
            observe(fleet, k, step, config.step_us)
        values.append(fleet.uavs[i]["message"][field].copy())
    return np.array(values)


def true_flight(fleet: PlantState, step_us: int, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """True and measured angular velocity of a flight without commands, each (steps, 3)."""
    true, reported = [], []
    for step in range(steps):
        observe(fleet, 0, step, step_us)
        true.append(fleet.uavs[0]["state"][9:12].copy())
        reported.append(fleet.uavs[0]["message"]["rates"].copy())
        fly(fleet, step, step_us)
    return np.array(true), np.array(reported)


@pytest.mark.parametrize("sensor", FIELDS)
def test_noise_bias_and_their_unit(scenario1: Scenario, sensor: str) -> None:
    exact = measured(config_of(scenario1, {}), FIELDS[sensor], 1)[0]
    config = config_of(scenario1, {sensor: {"noise_rms": 0.3, "bias": -2.0}})
    error = measured(config, FIELDS[sensor], 4000) - exact
    unit = 1.0 if sensor == "accelerometer_m_s2" else np.radians(1.0)
    assert error.mean(axis=0) == pytest.approx([-2.0 * unit] * 3, abs=0.3 * unit * 4 / 63)
    assert error.std(axis=0) == pytest.approx([0.3 * unit] * 3, rel=0.05)
    assert np.abs(np.corrcoef(error.T)[np.triu_indices(3, 1)]).max() < 4 / 63
    for other in FIELDS.values():
        if other != FIELDS[sensor]:
            exact = measured(config_of(scenario1, {}), other, 1)
            assert np.array_equal(measured(config, other, 1), exact)


def test_the_bias_walks_as_the_root_of_time(scenario1: Scenario) -> None:
    config = config_of(scenario1, {"gyro_deg_s": {"bias_drift": 0.5, "rate_hz": 250.0}})
    walk = np.degrees(measured(config, "rates", 4001))
    steps = np.diff(walk[::4], axis=0)
    assert steps.std() == pytest.approx(0.5 * np.sqrt(0.004), rel=0.05)
    assert walk[0] == pytest.approx([0.0] * 3)


def test_samples_are_rounded_held_and_late(scenario1: Scenario) -> None:
    sensor = {"resolution": 0.25, "rate_hz": 100.0, "latency_s": 0.02}
    config = config_of(scenario1, {"gyro_deg_s": sensor})
    true, reported = true_flight(new_plant_state(config), config.step_us, 200)
    taken = np.maximum(np.arange(200) // 10 * 10 - 20, 0)
    expected = np.round(np.degrees(true[taken]) / 0.25) * 0.25
    assert np.degrees(reported) == pytest.approx(expected, abs=1e-9)
    assert np.ptp(reported, axis=0).max() > 0.0


def test_airspeed_has_its_own_error(scenario1: Scenario) -> None:
    """The velocity over ground stays; the one through the air gets another length."""
    wind = {"steady": {"north_m_s": 3.0, "east_m_s": -4.0}}
    config = config_of(scenario1, {"airspeed_m_s": {"bias": 1.5, "resolution": 0.25}}, wind=wind)
    fleet = new_plant_state(config)
    observe(fleet, 1, 0, config.step_us)
    v, reported = fleet.uavs[1]["state"][3:6], fleet.uavs[1]["message"]
    through = v - fleet.uavs[1]["air"][:3]
    assert np.linalg.norm(through) == pytest.approx(40.5)
    assert np.array_equal(reported["velocity"], v)
    assert reported["velocity"] - reported["wind"] == pytest.approx(through / 40.5 * 42.0)


def test_an_instant_is_measured_once(scenario1: Scenario) -> None:
    config = config_of(scenario1, {"gyro_deg_s": {"noise_rms": 1.0, "bias_drift": 1.0}})
    fleet, again = new_plant_state(config), new_plant_state(config)
    for step in range(5):
        observe(fleet, 0, step, config.step_us)
        for _ in range(3):
            observe(again, 0, step, config.step_us)
    assert fleet.uavs[0]["message"] == again.uavs[0]["message"]


def test_noise_depends_on_seed_and_aircraft_and_not_on_the_rest_of_the_fleet(
    scenario1: Scenario,
) -> None:
    noisy = {"gyro_deg_s": {"noise_rms": 1.0}}
    config = config_of(scenario1, noisy)
    first, second = (measured(config, "rates", 3, i, (1 - i, 2)) for i in (0, 1))
    assert not np.isclose(first, second).any()
    other = config_of(scenario1, noisy, seed=2)
    assert not np.isclose(measured(other, "rates", 3), second).any()
    alone = config.model_copy(update={"uavs": config.uavs[1:2]})
    assert np.array_equal(measured(alone, "rates", 3, 0), second)


def test_drift_and_noise_are_independent(scenario1: Scenario) -> None:
    noisy = {"noise_rms": 1.0}
    noise = measured(config_of(scenario1, {"gyro_deg_s": noisy}), "rates", 2000)
    both = measured(
        config_of(scenario1, {"gyro_deg_s": {**noisy, "bias_drift": 1.0}}), "rates", 2000
    )
    steps = np.diff(both - noise, axis=0)
    for axis in range(3):
        assert abs(np.corrcoef(steps[:, axis], noise[1:, axis])[0, 1]) < 4 / np.sqrt(2000)
