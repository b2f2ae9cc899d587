from typing import Any

import numpy as np
import pytest

from gcs.scenario.model import Scenario
from sitl_plant.air.disturbance import disturbance_table, disturbances
from sitl_plant.airframe.aerodynamics import aerodynamics
from sitl_plant.airframe.rigid_body import (
    R1,
    R2,
    STILL_AIR,
    load_state,
    state_derivative,
    store_state,
)

CASES = range(12)
NONE = (0.0, 0.0, 0.0)


def close(ours: object, expected: object) -> bool:
    """Agreement to 1e-9 relative, of the largest element where it is an array."""
    expected = np.asarray(expected)
    scale = max(float(np.max(np.abs(expected))), 1e-12)
    return bool(np.max(np.abs(np.asarray(ours) - expected)) <= 1e-9 * scale)


@pytest.fixture(params=CASES)
def case(request: pytest.FixtureRequest, vectors: dict[str, Any]) -> Any:
    return vectors["plant"][request.param]


@pytest.fixture
def aircraft(case: Any, nominal: np.void) -> np.void:
    record = nominal.copy()
    record["per_rad_s"] = case["rate_derivatives"] == "per_rad_s"
    return record


def test_aerodynamics_agree_with_the_worked_values(case: Any, aircraft: np.void) -> None:
    _, v, _, omega = load_state(np.array(case["state"]))
    air = aerodynamics(v, omega, aircraft)
    assert close(air.V, case["expect"]["airspeed"])
    assert close(air.F, case["expect"]["aero_force_n"])
    assert close(air.N, case["expect"]["aero_moment_nm"])
    assert close(air.C, case["expect"]["control_matrix"])


def test_rotation_matrices_agree_with_the_worked_values(case: Any) -> None:
    _, _, phi, _ = load_state(np.array(case["state"]))
    assert close(R1(phi), case["expect"]["R1"])
    assert close(R2(phi), case["expect"]["R2"])


@pytest.mark.parametrize("disturbed", [True, False])
def test_state_derivative_agrees_with_the_worked_values(
    case: Any, aircraft: np.void, scenario1: Scenario, disturbed: bool
) -> None:
    table = disturbance_table(scenario1.disturbance)
    d_v, d_omega = disturbances(table, case["time_s"]) if disturbed else (NONE, NONE)
    derivative = np.zeros(12)
    state = load_state(np.array(case["state"]))
    surfaces = tuple(case["surfaces_rad"])
    store_state(
        state_derivative(state, case["thrust_n"], surfaces, d_v, d_omega, STILL_AIR, aircraft),
        derivative,
    )
    key = "state_derivative" if disturbed else "state_derivative_no_disturbance"
    assert close(derivative, case["expect"][key])
