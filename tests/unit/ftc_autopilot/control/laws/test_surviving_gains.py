"""The gains of the reconfigured loops, against a model derived from the plant's equations."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import linalg, optimize

from ftc_autopilot.control.laws.surviving import gains
from ftc_autopilot.control.laws.surviving.gains import (
    AIRSPEEDS,
    LoopWeights,
    gain_at,
    gains_of,
    lateral_gain,
    longitudinal_gain,
    riccati,
)
from gcs.scenario.aircraft_file import load_aircraft
from gcs.scenario.model import Scenario
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.config import Aircraft
from sitl_plant.airframe.rigid_body import STILL_AIR, state_derivative

NONE = (0.0, 0.0, 0.0)


def slopes(V: float, x: np.ndarray, u: np.ndarray, aircraft: np.void) -> np.ndarray:
    """Derivatives of V, α, q, θ, β, p, r, φ; u is thrust [N], aileron, elevator, rudder."""
    speed, alpha, q, theta, beta, p, r, phi = x
    wind = (np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta))
    v = tuple(speed * np.array(wind))
    state = ((0.0, 0.0, 0.0), v, (phi, theta, 0.0), (p, q, r))
    _, v_dot, phi_dot, omega_dot = state_derivative(
        state, u[0], (u[1], u[2], u[3]), NONE, NONE, STILL_AIR, aircraft
    )
    speed_dot = np.dot(v, v_dot) / speed
    alpha_dot = (v[0] * v_dot[2] - v[2] * v_dot[0]) / (v[0] ** 2 + v[2] ** 2)
    beta_dot = (v_dot[1] - v[1] * speed_dot / speed) / (speed * np.cos(beta))
    longitudinal = (speed_dot, alpha_dot, omega_dot[1], phi_dot[1])
    return np.array([*longitudinal, beta_dot, omega_dot[0], omega_dot[2], phi_dot[0]])


def level(V: float, aircraft: np.void) -> tuple[np.ndarray, np.ndarray]:
    """State and controls of straight, level flight; the lateral moments are not balanced."""

    def rest(unknown: np.ndarray) -> np.ndarray:
        alpha, thrust, elevator = unknown
        x = np.array([V, alpha, 0.0, alpha, 0.0, 0.0, 0.0, 0.0])
        return slopes(V, x, np.array([1e3 * thrust, 0.0, elevator, 0.0]), aircraft)[:3]

    alpha, thrust, elevator = optimize.fsolve(rest, [0.1, 1.0, 0.0], xtol=1e-12)
    x = np.array([V, alpha, 0.0, alpha, 0.0, 0.0, 0.0, 0.0])
    return x, np.array([1e3 * thrust, 0.0, elevator, 0.0])


def jacobian(V: float, aircraft: np.void) -> tuple[np.ndarray, np.ndarray]:
    """A and B of the eight states and four controls, by central differences."""
    x, u = level(V, aircraft)
    A, B = np.zeros((8, 8)), np.zeros((8, 4))
    for i in range(8):
        h = np.eye(8)[i] * 1e-5
        A[:, i] = (slopes(V, x + h, u, aircraft) - slopes(V, x - h, u, aircraft)) / 2e-5
    for i in range(4):
        h = np.eye(4)[i] * 1e-5
        B[:, i] = (slopes(V, x, u + h, aircraft) - slopes(V, x, u - h, aircraft)) / 2e-5
    return A, B


def lqr(A: np.ndarray, B: np.ndarray, Q: np.ndarray, R: float) -> np.ndarray:
    """Gains from the stable subspace of the Hamiltonian matrix."""
    n = len(A)
    hamiltonian = np.block([[A, -B @ B.T / R], [-Q, -A.T]])
    _, vectors, count = linalg.schur(hamiltonian, output="complex", sort="lhp")
    assert count == n
    P = np.real(vectors[n:, :n] @ linalg.inv(vectors[:n, :n]))
    return np.asarray((B.T @ P)[0] / R)


@pytest.mark.parametrize("V", [25.0, 37.5, 50.0, 62.5, 80.0])
@pytest.mark.parametrize("derivatives", ["nondimensional", "per_rad_s"])
def test_the_rudder_gains_are_optimal_on_the_plants_model(
    scenario1: Scenario, V: float, derivatives: str
) -> None:
    aircraft = Aircraft.model_validate(
        scenario1.aircraft.model_dump() | {"rate_derivatives": derivatives}
    )
    A, B = jacobian(V, aircraft_record(aircraft))
    lateral = [4, 5, 6, 7]
    A4 = A[np.ix_(lateral, lateral)]
    A4[0, 1] = 0.0  # the model leaves out sin α p; and uses cos α = 1
    A4[0, 2], A4[0, 3] = -1.0, 9.8 / V
    A4[3, 2] = 0.0
    D = 0.5 * 1.29 * V * V * 1.37 * 0.5
    A4[0, 0] = 0.5 * 1.29 * V * 1.37 * -0.1 / 20.64 - D / (20.64 * V)
    expected = lqr(A4, B[np.ix_(lateral, [3])] * [[0.0], [1.0], [1.0], [1.0]], _q("lateral"), 1.0)
    assert lateral_gain(aircraft, V) == pytest.approx(expected, rel=2e-3, abs=2e-3)


def _q(which: str) -> np.ndarray:
    return np.diag([0.0, 0.02, 0.0, 4.0] if which == "lateral" else [5e-4, 0.0, 0.02, 6.0, 4.0])


def test_the_rudder_gains_of_the_papers_aircraft(scenario1: Scenario) -> None:
    """Worked once by hand-written matrices, at 50 m/s."""
    expected = [2.10, -0.089, -0.459, -1.92]
    assert lateral_gain(scenario1.aircraft, 50.0) == pytest.approx(expected, abs=0.006)


@pytest.mark.parametrize("V", [25.0, 37.5, 50.0, 62.5, 80.0])
def test_the_thrust_gains_are_optimal_on_the_plants_model(scenario1: Scenario, V: float) -> None:
    A, B = jacobian(V, aircraft_record(scenario1.aircraft))
    A5, B5 = np.zeros((5, 5)), np.zeros((5, 1))
    A5[:4, :4], B5[:4, 0] = A[:4, :4], B[:4, 0]
    A5[4, 3] = 1.0
    A5[2, 0] = 0.0  # the elevator is stuck where it trims: q̇ does not depend on V there
    expected = lqr(A5, B5, _q("longitudinal"), 1e-6)
    assert longitudinal_gain(scenario1.aircraft, V) == pytest.approx(expected, rel=1e-3)


def test_forces_of_rates_surfaces_and_drag_count(general_aircraft: Aircraft) -> None:
    """The gains of what the plant's own model says at 45 m/s, but for its small terms."""
    A, B = jacobian(45.0, aircraft_record(general_aircraft))
    A4, B4 = A[4:, 4:], B[4:, 3:]
    expected = lqr(A4, B4, _q("lateral"), 1.0)
    assert lateral_gain(general_aircraft, 45.0) == pytest.approx(expected, rel=0.1, abs=0.05)
    A5, B5 = np.zeros((5, 5)), np.zeros((5, 1))
    A5[:4, :4], B5[:4, 0] = A[:4, :4], B[:4, 0]
    A5[4, 3], A5[2, 0] = 1.0, 0.0
    expected = lqr(A5, B5, _q("longitudinal"), 1e-6)
    assert longitudinal_gain(general_aircraft, 45.0) == pytest.approx(expected, rel=0.1)


@pytest.mark.parametrize("V", [37.5, 62.5])
def test_the_moment_of_the_thrust_counts(scenario1: Scenario, V: float) -> None:
    """Of a thrust below the centre of gravity; the air's moment that balances it grows with V²."""
    tree = scenario1.aircraft.model_dump() | {"propulsion": {"pitch_arm_m": 0.1}}
    aircraft = Aircraft.model_validate(tree)
    A, B = jacobian(V, aircraft_record(aircraft))
    A5, B5 = np.zeros((5, 5)), np.zeros((5, 1))
    A5[:4, :4], B5[:4, 0] = A[:4, :4], B[:4, 0]
    A5[4, 3] = 1.0
    assert B5[2, 0] == pytest.approx(0.1 / 7.51, rel=1e-2)
    expected = lqr(A5, B5, _q("longitudinal"), 1e-6)
    assert longitudinal_gain(aircraft, V) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("V", [25.0, 50.0, 80.0])
@pytest.mark.parametrize("name", ["paper", "general"])
def test_both_loops_are_stable_on_the_whole_model(
    scenario1: Scenario, general_aircraft: Aircraft, name: str, V: float
) -> None:
    aircraft = {"paper": scenario1.aircraft, "general": general_aircraft}[name]
    A, B = jacobian(V, aircraft_record(aircraft))
    K = np.zeros((4, 8))
    K[0, :4] = longitudinal_gain(aircraft, V)[:4]
    K[3, 4:] = lateral_gain(aircraft, V)
    assert np.linalg.eigvals(A - B @ K).real.max() < -0.2


BUNDLED = sorted(path.stem for path in (Path(__file__).parents[5] / "aircraft").glob("*.yaml"))


@pytest.mark.parametrize("name", BUNDLED)
def test_gains_are_scipys_to_their_last_digit(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """What another solver gives is recorded by no flight: gains have nine digits."""
    pairs = []

    def both(model: np.ndarray, Q: np.ndarray, R: float) -> np.ndarray:
        A, B = model[:, :-1], model[:, -1:]
        P = linalg.solve_continuous_are(A, B, Q, [[R]])
        scipys = [float(f"{gain:.9g}") for gain in (B.T @ P)[0] / R]
        found = riccati(model, Q, R)
        pairs.append((found.tolist(), scipys))
        return found

    monkeypatch.setattr(gains, "riccati", both)
    gains_of.__wrapped__(load_aircraft(name), LoopWeights())
    assert len(pairs) >= AIRSPEEDS
    assert all(ours == scipys for ours, scipys in pairs)


@pytest.mark.parametrize("column", [0.0, 1e-9])
def test_a_loop_that_its_surface_cannot_hold_has_no_gains(column: float) -> None:
    unstable = np.array([[1.0, 0.0, column], [0.0, -1.0, 1.0]])
    with pytest.raises(np.linalg.LinAlgError):
        riccati(unstable, np.eye(2), 1.0)


@given(st.floats(0.0, 200.0))
def test_gains_are_linear_between_airspeeds(V: float) -> None:
    airspeeds, gains = np.array([25.0, 50.0, 75.0]), np.array([[1.0, 0.0], [2.0, 5.0], [-1.0, 7.0]])
    for i in range(2):
        expected = np.interp(V, airspeeds, gains[:, i])
        assert gain_at(airspeeds, gains, V, i) == pytest.approx(expected)
