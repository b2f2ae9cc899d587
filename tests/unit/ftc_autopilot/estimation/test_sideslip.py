"""Aircraft that fly with sideslip, in gusts and in strong wind: neither turns the attitude."""

import numpy as np
import pytest

from benchmarks.sensor_attacks import headed
from benchmarks.sensor_flights import errors_of, times_claimed, watched
from ftc_autopilot.estimation.config import EstimatorConfig, parameters_of
from gcs.scenario.changes import with_changes
from gcs.scenario.model import Scenario, load_scenario
from sitl_plant.airframe.aerodynamics import lateral
from sitl_plant.airframe.aircraft import aircraft_record


def assumed_of(scenario: Scenario) -> np.ndarray:
    plant, aircraft = scenario.plant_config(), scenario.aircraft_of(1)
    sensors = plant.sensors.navigation
    return parameters_of(EstimatorConfig(sensors, plant.origin, scenario.step_us, aircraft))


@pytest.mark.parametrize(
    ("name", "flown"),
    [
        ("pc7", 0.16),
        ("c172p", 0.44),
        ("minisgs", 0.68),
        ("aerosonde", 0.78),
        ("skywalker_x8", 0.92),
    ],
)
def test_surfaces_take_a_share_of_the_side_force(name: str, flown: float) -> None:
    """What is left of it in flights by the true state is what the derivatives say."""
    scenario = load_scenario(f"airframes/{name}")
    aircraft, assumed = scenario.aircraft_of(1), assumed_of(scenario)[0]
    V = aircraft.design_airspeed
    free = lateral(V, aircraft_record(aircraft)).side.beta / aircraft.mass_kg
    free /= 0.5 * aircraft.air_density_kg_m3 * V * V
    assert assumed["side"] / free == pytest.approx(flown, abs=0.06)
    assert assumed["side_error"] > 1.0 - flown


def test_a_side_force_that_no_surface_has_is_all_of_the_sideslip(scenario1: Scenario) -> None:
    assert assumed_of(scenario1)[0]["side_error"] == pytest.approx(0.3)  # the parameter


@pytest.mark.slow
@pytest.mark.parametrize(("turbulence", "wind_m_s"), [("light", 11.0), ("none", 32.0)])
def test_gusts_and_strong_wind_do_not_turn_the_attitude(turbulence: str, wind_m_s: float) -> None:
    """It heads away from its path, and so turns with 12° of sideslip in the first seconds."""
    wind = {"turbulence": turbulence, "steady": {"north_m_s": wind_m_s}}
    values = {"wind": wind, "uavs": headed("paper/scenario1", -83.0), "duration_s": 20.0}
    scenario = with_changes("paper/scenario1", ["surviving", "estimated"], values)
    watch = watched(scenario)
    assert not watch.exclusions
    errors = errors_of(watch.steps, scenario.step_us, settled_s=5.0)
    assert errors.tilt_deg < 1.5
    assert errors.yaw_deg < 2.5
    assert times_claimed(watch, scenario, 5.0) < 3.0
