"""Invariants of the rigid body, by property, and NESC's tumbling brick."""

import csv
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mavlink_defs.faults.actuators import ACTUATOR_FAULTS
from mavlink_defs.faults.table import no_faults
from sitl_plant.actuators.config import ActuatorServos
from sitl_plant.actuators.servo import new_servos
from sitl_plant.air.config import Wind
from sitl_plant.air.turbulence import TURBULENCE
from sitl_plant.air.wind import new_wind
from sitl_plant.airframe.aerodynamics import FLOW
from sitl_plant.airframe.aircraft import AIRCRAFT
from sitl_plant.airframe.contact import GEAR
from sitl_plant.airframe.rigid_body import R1, R2, R2_inv, load_state
from sitl_plant.loop.period import Environment, rk4_step
from sitl_plant.vec3 import Vec3

DATA = Path(__file__).parents[3] / "data" / "nesc_tumbling_brick.csv"
SLUG_FT2 = 1.3558179483  # kg m²
UNDISTURBED = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
STILL, NO_EDDIES = new_wind(Wind()), np.zeros(1, TURBULENCE)
NO_GEAR, NO_FLOW = np.zeros(1, GEAR)[0], np.zeros(1, FLOW)[0]
IDLE = new_servos(ActuatorServos(), step_us=1000)

angle = st.floats(-math.pi, math.pi)
pitch = st.floats(-1.5, 1.5)
attitude = st.tuples(angle, pitch, angle)
rate = st.floats(-2.0, 2.0)


def in_vacuum(J: np.ndarray) -> np.void:
    """A body on which neither air nor gravity acts."""
    record = np.zeros(1, AIRCRAFT)[0]
    record["m"] = record["S"] = record["b"] = record["c_bar"] = 1.0
    record["J"], record["J_inv"] = J, np.linalg.inv(J)
    record["stops"], record["thrust_limit"] = (-1.0, 1.0), 1.0
    return record


def tumble(omega: Vec3, J: np.ndarray, steps: int, dt: float) -> np.ndarray:
    """Angular velocity at each step of a torque-free tumble, shape (steps + 1, 3)."""
    body, faults = in_vacuum(J), no_faults(ACTUATOR_FAULTS, 1)[0]
    x = np.zeros(12)
    x[3] = 1.0  # the aerodynamics need an airspeed
    x[9:12] = omega
    state = load_state(x)
    rates = [state[3]]
    for k in range(steps):
        state = rk4_step(
            state,
            k * dt,
            dt,
            (UNDISTURBED, UNDISTURBED, UNDISTURBED),
            Environment(IDLE, faults, STILL[0], NO_EDDIES[0], body, NO_GEAR, NO_FLOW),
            k * dt,
            (0.0, 0.0, 0.0, 0.0),
            False,
        )
        # only the rotation is looked at: keep the velocity and the attitude where they began
        state = (load_state(x)[0], load_state(x)[1], load_state(x)[2], state[3])
        rates.append(state[3])
    return np.array(rates)


@st.composite
def inertias(draw: st.DrawFn) -> np.ndarray:
    """A physical inertia: principal moments that fulfil the triangle inequality, turned in x-z."""
    a, b, c = (draw(st.floats(0.5, 2.0)) for _ in range(3))
    principal = np.diag([b + c, a + c, a + b])
    turn = draw(st.floats(-0.5, 0.5))
    c_, s_ = math.cos(turn), math.sin(turn)
    R = np.array([[c_, 0.0, s_], [0.0, 1.0, 0.0], [-s_, 0.0, c_]])
    return np.asarray(R @ principal @ R.T)


@given(attitude)
def test_R1_is_a_rotation(phi: Vec3) -> None:
    R = np.array(R1(phi))
    assert np.allclose(R @ R.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(R) == pytest.approx(1.0, abs=1e-14)


@given(attitude)
def test_R2_inv_is_the_inverse_of_R2(phi: Vec3) -> None:
    product = np.array(R2(phi)) @ np.array(R2_inv(phi))
    assert np.allclose(product, np.eye(3), atol=1e-13)


@settings(max_examples=30)
@given(st.tuples(rate, rate, rate), inertias())
def test_torque_free_tumbling_conserves_energy_and_angular_momentum(
    omega: Vec3,
    J: np.ndarray,
) -> None:
    """Over 2 s at 1 ms, to 1e-10 relative."""
    rates = tumble(omega, J, steps=2000, dt=1e-3)
    energy = np.einsum("ki,ij,kj->k", rates, J, rates)
    momentum = np.linalg.norm(rates @ J, axis=1)
    assert np.allclose(energy, energy[0], rtol=1e-10, atol=1e-300)
    assert np.allclose(momentum, momentum[0], rtol=1e-10, atol=1e-150)


def test_the_integrator_converges_with_fourth_order() -> None:
    J = np.array([[1.607, 0.0, -0.59], [0.0, 7.51, 0.0], [-0.59, 0.0, 7.18]])
    omega = (1.5, -1.0, 2.0)
    truth = tumble(omega, J, 4096, 2.0 / 4096)[-1]
    errors = [np.linalg.norm(tumble(omega, J, n, 2.0 / n)[-1] - truth) for n in (16, 32, 64, 128)]
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert np.all(np.abs(orders - 4.0) < 0.4), orders


def test_tumbling_brick_agrees_with_nesc_to_1e_6_deg_per_second() -> None:
    """NESC 6-DOF check case 2, Atmos_02, simulation 04: body rates over 30 s."""
    with DATA.open() as file:
        rows = [{k: float(v) for k, v in row.items()} for row in csv.DictReader(file)]
    J = np.diag([0.001894220, 0.006211019, 0.007194665]) * SLUG_FT2
    omega = (math.radians(10.0), math.radians(20.0), math.radians(30.0))
    ours = np.degrees(tumble(omega, J, 30_000, 1e-3))
    for row in rows:
        expected = [row["p_deg_s"], row["q_deg_s"], row["r_deg_s"]]
        assert ours[round(row["time_s"] * 1000)] == pytest.approx(expected, abs=1e-6)
