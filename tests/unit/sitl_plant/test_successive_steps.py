"""What the plant remembers, over two successive steps: nothing stands still, or moves twice."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gcs.scenario.model import Scenario
from mavlink_defs.faults.actuators import ACTUATOR_FAULTS
from mavlink_defs.faults.table import no_faults
from sitl_plant.actuators.config import ActuatorServos
from sitl_plant.actuators.servo import (
    begin_period,
    end_period,
    new_servos,
    positions,
    sent_commands,
)
from sitl_plant.air.config import Dryden
from sitl_plant.air.gaussian import normal
from sitl_plant.air.turbulence import advance_turbulence, new_turbulence, start_turbulence
from sitl_plant.airframe.rigid_body import STILL_AIR, load_state, state_derivative
from sitl_plant.loop.fleet import fly, new_plant_state, observe

STEP_US, DT = 4000, 4e-3
CONTROLS = np.array([0.05, -0.04, 0.3, 800.0])
NONE = (0.0, 0.0, 0.0)


def exactly(expected: Any) -> Any:
    return pytest.approx(expected, rel=1e-10, abs=1e-13)


def plant_with(scenario: Scenario, **changes: Any) -> Any:
    keys = {"faults": (), "disturbance": {}, "step_us": STEP_US} | changes
    return new_plant_state(Scenario.model_validate(scenario.model_dump() | keys).plant_config())


def test_the_motion_of_an_aircraft(scenario1: Scenario) -> None:
    """Against an integration of the same derivative by scipy, to its last digits."""
    plant = plant_with(scenario1)
    plant.uavs["controls"][:] = CONTROLS
    plant.uavs[0]["state"][9:12] = 0.4, -0.2, 0.1
    aircraft = plant.uavs[0]["aircraft"]

    def slope(_: float, x: np.ndarray) -> np.ndarray:
        surfaces = (0.05, -0.04, 0.3)
        derivative = state_derivative(
            load_state(x), 800.0, surfaces, NONE, NONE, STILL_AIR, aircraft
        )
        return np.ravel(derivative)

    start = plant.uavs[0]["state"].copy()
    for k in range(2):
        assert fly(plant, k, STEP_US) < 0
        until = (k + 1) * DT
        exact = solve_ivp(slope, (0.0, until), start, rtol=1e-12, atol=1e-13).y[:, -1]
        moved = np.abs(exact - start)
        assert np.all(moved > 1e-8)
        assert np.all(np.abs(plant.uavs[0]["state"] - exact) <= 1e-6 * moved + 1e-9)


def test_the_lag_and_the_limit_of_servos() -> None:
    """Of a command of 1 rad from rest: exponential, at a limited rate, after a dead time."""
    config = ActuatorServos.model_validate(
        {
            "aileron": {"lag_s": 0.02},
            "elevator": {"rate_limit_deg_s": 90.0},
            "rudder": {"lag_s": 0.02, "dead_time_s": 0.004},
        }
    )
    servos = new_servos(config, STEP_US)
    sent, faults = sent_commands(np.array([servos])), no_faults(ACTUATOR_FAULTS, 1)[0]
    begin_period(servos, sent[0], np.zeros(4), faults, 0, 0.0, True)
    end_period(servos, DT)
    for k in (1, 2):
        begin_period(servos, sent[0], np.ones(4), faults, k, k * DT, True)
        end_period(servos, DT)
        lagged = 1.0 - math.exp(-k * DT / 0.02)
        late = 1.0 - math.exp(-(k - 1) * DT / 0.02)
        expected = (lagged, k * DT * math.radians(90.0), late, 1.0)
        assert list(servos["shaft"]) == exactly(expected)
        assert positions(servos, 0.0) == exactly(expected)


def test_the_lags_of_turbulence() -> None:
    """Each first lag of white noise, and the one of p: decay, and what its random numbers add."""
    model = Dryden(
        sigma_u_m_s=1.0, sigma_v_m_s=1.0, sigma_w_m_s=1.0,
        length_u_m=20.0, length_v_m=30.0, length_w_m=10.0,
    )  # fmt: skip
    air, V, seed, aircraft = new_turbulence(model, 2.0), 40.0, 3, 1
    start_turbulence(air, V, seed, aircraft)
    decay = np.exp(-V * DT / np.array([20.0, 30.0, 10.0]))
    first, roll = np.array(air["first"]), float(air["roll"])
    slower = math.exp(-math.pi * V * DT / 8.0)
    for step in (1, 2):
        advance_turbulence(air, V, DT, seed, aircraft, step)
        drawn = np.array([normal(seed, aircraft, 200 + 2 * axis, step) for axis in range(3)])
        first = decay * first + np.sqrt(0.5 * (1.0 - decay**2)) * drawn
        roll = slower * roll + math.sqrt(1.0 - slower**2) * normal(seed, aircraft, 201, step)
        assert np.array(air["first"]) == exactly(first)
        assert air["roll"] == exactly(roll)
        assert air["velocity"][0] == exactly(math.sqrt(2.0) * first[0])


def test_the_drift_of_a_sensor(scenario1: Scenario) -> None:
    gyro = {"bias_drift": 0.5, "bias": 0.1}
    plant = plant_with(scenario1, sensors={"gyro_deg_s": gyro}, seed=9)
    drift = np.zeros(3)
    for step in range(3):
        observe(plant, 0, step, STEP_US)
        if step > 0:
            draws = [normal(9, 1, 100 + axis, step) for axis in range(3)]
            drift += math.radians(0.5) * math.sqrt(DT) * np.array(draws)
        assert np.array(plant.uavs[0]["sensors"]["drift"][:3]) == exactly(drift)
        away = np.array(plant.uavs[0]["message"]["rates"]) - plant.uavs[0]["state"][9:12]
        assert away == pytest.approx(drift + math.radians(0.1), abs=1e-7)  # a float32
