"""The equations of the filter against independent computations with matrices."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ftc_autopilot.estimation.config import EstimatorConfig, parameters_of
from ftc_autopilot.estimation.fuse import LARGE_TURN, correct, innovation_variance
from ftc_autopilot.estimation.measurements import past_travel
from ftc_autopilot.estimation.predict import predict
from ftc_autopilot.estimation.receiver import FIX
from ftc_autopilot.estimation.resets import (
    doubt_magnetometer,
    doubt_wind,
    place_first,
    reset_height,
    reset_to_fix,
)
from ftc_autopilot.estimation.state import (
    FILTER,
    FORCE_BIAS,
    GYRO_BIAS,
    PHI,
    POS,
    VEL,
    WIND,
    N,
    euler,
    rotation,
    set_euler,
    turn_body,
    turn_world,
)
from gcs.scenario.model import Scenario
from sitl_plant.airframe.rigid_body import R1

_ANGLE = st.floats(-1.4, 1.4)
_SMALL = st.tuples(*(st.floats(-0.5, 0.5),) * 3)


def parameters(scenario: Scenario) -> np.void:
    plant = scenario.plant_config(speed=None)
    aircraft = scenario.aircraft_of(scenario.uavs[0].id)
    config = EstimatorConfig(plant.sensors.navigation, plant.origin, scenario.step_us, aircraft)
    record: np.void = parameters_of(config)[0]
    return record


def random_filter(seed: int) -> np.void:
    """Return a filter with any attitude and a covariance that is positive definite."""
    random = np.random.default_rng(seed)
    record: np.void = np.zeros(1, FILTER)[0]
    set_euler(record["quaternion"], *random.uniform(-1.0, 1.0, 3))
    record["x"][VEL : VEL + 3] = random.normal(0.0, 20.0, 3)
    root = random.normal(0.0, 0.1, (N, N))
    record["P"] = root @ root.T + 0.01 * np.eye(N)
    return record


@given(roll=_ANGLE, pitch=_ANGLE, yaw=st.floats(-3.1, 3.1))
def test_a_quaternion_turns_as_euler_angles_do(roll: float, pitch: float, yaw: float) -> None:
    q = np.zeros(4)
    set_euler(q, roll, pitch, yaw)
    assert np.allclose(rotation(q), R1((roll, pitch, yaw)), atol=1e-12)
    assert euler(rotation(q)) == pytest.approx((roll, pitch, yaw), abs=1e-9)


@given(angle=_SMALL, roll=_ANGLE, yaw=st.floats(-3.1, 3.1))
def test_turns_multiply_from_their_side(
    angle: tuple[float, float, float], roll: float, yaw: float
) -> None:
    size = math.hypot(*angle)
    axis = np.array(angle) / size if size > 0.0 else np.zeros(3)
    K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    turn = np.eye(3) + math.sin(size) * K + (1.0 - math.cos(size)) * K @ K  # Rodrigues
    q = np.zeros(4)
    set_euler(q, roll, 0.3, yaw)
    before = np.array(rotation(q))
    turn_body(q, angle)
    assert np.allclose(rotation(q), before @ turn, atol=1e-12)
    set_euler(q, roll, 0.3, yaw)
    turn_world(q, angle)
    assert np.allclose(rotation(q), turn @ before, atol=1e-12)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_scalar_update_is_the_kalman_update(seed: int) -> None:
    random = np.random.default_rng(seed)
    record = random_filter(seed)
    h = np.where(random.random(N) < 0.3, random.normal(0.0, 1.0, N), 0.0)
    record["h"] = h
    P, x, before = record["P"].copy(), record["x"].copy(), np.array(rotation(record["quaternion"]))
    S = innovation_variance(record, 0.04)
    assert pytest.approx(h @ P @ h + 0.04) == S
    correct(record, 0.01, S)
    K = P @ h / S
    joseph = (np.eye(N) - np.outer(K, h)) @ P @ (np.eye(N) - np.outer(K, h)).T
    joseph += 0.04 * np.outer(K, K)
    u, v, w = 0.005 * K[:3]  # half of the correction
    assert 2.0 * (abs(u) + abs(v) + abs(w)) > LARGE_TURN
    G = np.eye(N)
    G[:3, :3] += [[0, -w, v], [w, 0, -u], [-v, u, 0]]  # Solà, section 6.3
    assert np.allclose(record["P"], G @ joseph @ G.T, atol=1e-12)
    assert np.allclose(record["P"], record["P"].T, rtol=0.0, atol=1e-15)
    assert np.allclose(record["x"][3:], (x + 0.01 * K)[3:])
    turned = np.array(rotation(record["quaternion"])) @ before.T
    assert turned[2, 1] == pytest.approx(0.01 * K[0], abs=1e-4)
    assert turned[0, 2] == pytest.approx(0.01 * K[1], abs=1e-4)
    assert turned[1, 0] == pytest.approx(0.01 * K[2], abs=1e-4)


def test_the_covariance_follows_what_errors_of_the_state_become(scenario1: Scenario) -> None:
    """Ten steps from states that differ a little: differences are F times the first ones."""
    assumed = parameters(scenario1)
    rates, force = (0.4, -0.2, 0.3), (1.0, -2.0, -9.0)
    nominal = random_filter(5)
    nominal["P"] = np.diag(np.linspace(1.0, 2.0, N))
    P, ends = nominal["P"].copy(), {}
    size = 1e-5
    starts = {k: nominal.copy() for k in range(-1, N)}
    for k, record in starts.items():
        if k in range(PHI, PHI + 3):
            turn = [0.0, 0.0, 0.0]
            turn[k] = size
            turn_world(record["quaternion"], (turn[0], turn[1], turn[2]))
        elif k >= 0:
            record["x"][k] += size
        for _ in range(10):
            predict(record, rates, force, assumed)
        ends[k] = record
    base = np.array(rotation(ends[-1]["quaternion"]))
    F = np.zeros((N, N))
    for k in range(N):
        turned = np.array(rotation(ends[k]["quaternion"])) @ base.T
        F[:, k] = (ends[k]["x"] - ends[-1]["x"]) / size
        F[:3, k] = np.array([turned[2, 1], turned[0, 2], turned[1, 0]]) / size
    noise = ends[-1]["P"] - F @ P @ F.T
    for block in (PHI, VEL, POS, GYRO_BIAS, FORCE_BIAS, WIND):
        rows = slice(block, block + 3)
        off = noise[rows] - np.diag(np.diag(noise))[rows]
        assert np.abs(off).max() < 1e-3  # second order in 10 ms
    assert (np.diag(noise) > -1e-3).all()


def test_integrals_of_the_past_are_found_between_entries() -> None:
    times = np.arange(0.0, 0.4, 0.01)
    curves = np.stack([np.sin(times), times**2, times, times, times, times, times], axis=1)
    history = np.roll(curves, 7, axis=0)  # a ring
    past = np.zeros(7)
    past_travel(history, curves[-1], curves[-1, 6] - 0.1234, past)
    assert past[6] == pytest.approx(0.1234)
    assert past[0] == pytest.approx(math.sin(0.1234), abs=1e-5)
    assert past[1] == pytest.approx(0.1234**2, abs=1e-4)


def test_before_its_memory_an_aircraft_went_straight_on() -> None:
    """A sample of before the first entry is none of the first entry's time."""
    history = np.zeros((30, 7))
    history[:, 6] = np.arange(30) * 0.01
    history[:, 0] = 5.0 * history[:, 6]  # accelerates northwards, from 0 s on
    now, past = history[-1].copy(), np.zeros(7)
    gap = past_travel(history, now, now[6] + 0.15, past)
    assert gap == pytest.approx(0.15)
    assert past[6] == pytest.approx(-0.15)
    assert past[0] == history[0, 0]
    assert past_travel(history, now, 0.1, past) == 0.0


RESETS: dict[str, Callable[[np.void, np.void, np.ndarray, np.void], None]] = {
    "to a fix": lambda kalman, fix, past, own: reset_to_fix(kalman, fix, past, 0.0, own),
    "height": lambda kalman, _fix, _past, own: reset_height(kalman, 20.0, own),
    "magnetometer": lambda kalman, _fix, _past, own: doubt_magnetometer(kalman, own),
    "wind": lambda kalman, _fix, _past, own: doubt_wind(kalman, 1000.0, own),
    "first place": lambda kalman, fix, past, own: place_first(
        kalman, fix, past, 0.0, True, True, own
    ),
    "first place without a compass": lambda kalman, fix, past, own: place_first(
        kalman, fix, past, 0.0, False, True, own
    ),
    "first place without a tube": lambda kalman, fix, past, own: place_first(
        kalman, fix, past, 0.0, True, False, own
    ),
    "first place without both": lambda kalman, fix, past, own: place_first(
        kalman, fix, past, 0.0, False, False, own
    ),
}


@pytest.mark.parametrize("name", RESETS)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_what_is_reset_leaves_a_covariance(scenario1: Scenario, name: str, seed: int) -> None:
    """A variance that is made smaller alone would leave errors that go together by more than 1."""
    record, fix = random_filter(seed), np.zeros(1, FIX)[0]
    record["P"] -= 0.009 * np.eye(N)  # errors that nearly go together
    fix["velocity"] = 30.0, 5.0, 0.0
    RESETS[name](record, fix, record["travel"].copy(), parameters(scenario1))
    P, size = record["P"], np.sqrt(np.diag(record["P"]))
    assert np.linalg.eigvalsh(P / np.outer(size, size)).min() > 0.0
