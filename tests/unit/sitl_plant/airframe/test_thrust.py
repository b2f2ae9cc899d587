"""Thrust by airspeed, with lag and moments, in the plant and in the nominal model: one model."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from ftc_autopilot.control.laws.tube.prediction import PredictionStart, ServoModel, predict
from gcs.scenario.model import Scenario
from mavlink_defs.constants import THROTTLE
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.config import Aircraft
from sitl_plant.airframe.rigid_body import STILL_AIR, State, load_state, state_derivative
from sitl_plant.loop.fleet import PlantState, fly, new_plant_state, observe

NONE = (0.0, 0.0, 0.0)
STEP_US, STEPS = 1000, 600
DELTA = np.array([0.02, 0.05, 0.1])


def plant_of(scenario: Scenario, aircraft: Aircraft, **keys: Any) -> PlantState:
    tree = scenario.model_dump() | {"disturbance": {}, "faults": (), "uncertainty": {}}
    tree |= {"aircraft": aircraft.model_dump(), **keys}
    return new_plant_state(Scenario.model_validate(tree).plant_config())


def most_at(V: float) -> float:
    """The table of `conftest.PROPULSION`, below the limit of the paper's aircraft."""
    return min(float(np.interp(V, [20.0, 40.0, 60.0], [2600.0, 1400.0, 600.0])), 2000.0)


@given(
    V=st.floats(10.0, 80.0),
    thrust=st.floats(0.0, 2000.0),
    alpha=st.floats(-0.1, 0.2),
    beta=st.floats(-0.2, 0.2),
)
def test_a_thrust_pushes_and_turns_as_far_as_the_airspeed_permits(
    V: float, thrust: float, alpha: float, beta: float, propelled: np.void
) -> None:
    v = (
        V * math.cos(alpha) * math.cos(beta),
        V * math.sin(beta),
        V * math.sin(alpha) * math.cos(beta),
    )
    state: State = (NONE, v, (0.1, 0.2, 0.3), (0.1, -0.2, 0.05))

    def slope(T: float) -> State:
        found: State = state_derivative(
            state, T, (0.01, 0.02, 0.03), NONE, NONE, STILL_AIR, propelled
        )
        return found

    made = min(thrust, most_at(float(np.linalg.norm(v))))
    pushed, still = slope(thrust), slope(0.0)
    by_thrust = np.subtract(pushed[1], still[1])
    assert by_thrust == pytest.approx([made / propelled["m"], 0.0, 0.0], abs=1e-9)
    turned = np.subtract(pushed[3], still[3])
    expected = np.linalg.solve(propelled["J"], made * np.array([-0.05, 0.1, 0.03]))
    assert turned == pytest.approx(expected, abs=1e-9)


def flown(plant: PlantState, thrusts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """States and applied controls of each step under commands of thrust [N]."""
    states, applied = np.zeros((len(thrusts), 12)), np.zeros((len(thrusts), 4))
    for step, thrust in enumerate(thrusts):
        states[step] = plant.uavs[0]["state"]
        plant.uavs[0]["controls"] = [*DELTA, thrust]
        assert fly(plant, step, STEP_US) < 0
        applied[step] = plant.uavs[0]["applied"]
    return states, applied


def test_what_the_plant_reports_is_what_it_applies(
    scenario1: Scenario, propelled_aircraft: Aircraft
) -> None:
    free = propelled_aircraft.model_copy(update={"propulsion": None})
    plant, other = (plant_of(scenario1, one) for one in (propelled_aircraft, free))
    states, applied = flown(plant, np.full(300, 1900.0))
    airspeeds = np.linalg.norm(states[:, 3:6], axis=1)
    assert applied[:, THROTTLE] == pytest.approx([most_at(V) for V in airspeeds])
    assert applied[:, THROTTLE].max() < 1900.0
    assert flown(other, np.full(300, 1900.0))[1][:, THROTTLE] == pytest.approx(1900.0)
    observe(plant, 0, 300, STEP_US)
    observe(other, 0, 300, STEP_US)
    V = float(np.linalg.norm(plant.uavs[0]["state"][3:6]))
    other.uavs[0]["state"] = plant.uavs[0]["state"]
    observe(other, 0, 300, STEP_US)
    less = plant.uavs[0]["message"]["specific_force"] - other.uavs[0]["message"]["specific_force"]
    expected = (most_at(V) - 1900.0) / propelled_aircraft.mass_kg
    assert less == pytest.approx([expected, 0.0, 0.0], abs=1e-5)


def test_plant_and_nominal_model_move_alike(
    scenario1: Scenario, propelled_aircraft: Aircraft
) -> None:
    """Under jumps of the thrust beyond what can be made: an independent integrator, and `tube`'s.

    The lag is that of the aircraft alone: the scenario has no servos.
    """
    plant = plant_of(scenario1, propelled_aircraft)
    nominal = aircraft_record(propelled_aircraft)
    plant.uavs[0]["state"][3:6] = 45.0, 1.0, 3.0
    begin = plant.uavs[0]["state"].copy()
    thrusts = np.where(np.arange(STEPS) < 1, 500.0, 1990.0)
    plant.uavs["message"]["actuator_time_usec"] = 0  # a command has been received
    states, _ = flown(plant, thrusts)

    def slope(t: float, x: np.ndarray) -> np.ndarray:
        thrust = 1990.0 - 1490.0 * math.exp(-max(t - 1e-3, 0.0) / 0.3)
        delta = (float(DELTA[0]), float(DELTA[1]), float(DELTA[2]))
        parts = state_derivative(load_state(x), thrust, delta, NONE, NONE, STILL_AIR, nominal)
        return np.concatenate([*parts])

    at = 1e-3 * np.arange(STEPS)
    exact = solve_ivp(slope, (0.0, at[-1]), begin, t_eval=at, rtol=1e-9, atol=1e-9, max_step=1e-3)
    assert states == pytest.approx(exact.y.T, abs=1e-4)
    airspeeds = np.linalg.norm(states[:, 3:6], axis=1)
    asked = 1990.0 - 1490.0 * np.exp(-at / 0.3)
    assert (asked > [most_at(V) for V in airspeeds]).any()

    start = PredictionStart(
        load_state(states[1]), np.array([*DELTA, 500.0]), ServoModel(0.0, math.inf, 0.3),
        np.zeros(6), np.zeros(6), 0.1,
    )  # fmt: skip
    outputs = np.empty((4, 100))
    predict(start, np.array([*DELTA, 1990.0]), 0.005, 100, nominal, outputs)
    rows = states[6:502:5][:99]
    assert outputs[0, :99] == pytest.approx(np.linalg.norm(rows[:, 3:6], axis=1), abs=2e-3)
    assert outputs[1:, :99] == pytest.approx(rows[:, 6:9].T, abs=2e-3)


@pytest.mark.parametrize(("given_s", "counts_s"), [(0.0, 0.3), (0.1, 0.3), (0.5, 0.5)])
def test_of_two_lags_the_larger_one_counts(
    scenario1: Scenario, propelled_aircraft: Aircraft, given_s: float, counts_s: float
) -> None:
    """For the plant, and for a law that knows the servos."""
    tree = scenario1.model_dump() | {
        "aircraft": propelled_aircraft.model_dump(),
        "servos": {"throttle": {"lag_s": given_s}},
        "controller": {"kind": "surviving"},
        "trigger": {"mode": "per_channel"},
    }
    scenario = Scenario.model_validate(tree)
    for uav in scenario.plant_config().uavs:
        assert uav.servos.throttle.lag_s == counts_s
    law: Any = scenario.autopilot_config(scenario.uavs[0].id).controller
    assert law.diagnosis.throttle.lag_s == counts_s
