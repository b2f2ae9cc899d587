"""The aerodynamic model: one file knows its coefficients, and its linearisations are its slopes."""

import re
from pathlib import Path

import numpy as np
import pytest

from sitl_plant.aerodynamics import (
    aerodynamics,
    balanced_alpha,
    carried,
    carried_linearly,
    drag,
    lateral,
    longitudinal,
    moment,
    rate_damping,
)
from sitl_plant.aircraft import COEFFICIENTS

ROOT = Path(__file__).parents[3]
PACKAGES = ("mavlink_defs", "sitl_plant", "ftc_autopilot", "gcs", "benchmarks")
KNOWING = {"sitl_plant/aerodynamics.py", "sitl_plant/config.py"}
"""The model itself, and the configuration that declares its keys."""
V, H = 45.0, 1e-6


def read(
    beta: float = 0.0, alpha: float = 0.0, omega: tuple[float, ...] = (0.0, 0.0, 0.0)
) -> tuple:
    """Arguments of `aerodynamics` at 45 m/s."""
    v = np.array([np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)])
    return tuple(V * v), omega


def slope(nominal: np.void, what: str, **step: object) -> np.ndarray:
    """Derivative of force or moment by one argument, by a central difference."""
    ((name, axis),) = step.items()
    ends = []
    for sign in (1.0, -1.0):
        value = tuple(sign * H * np.eye(3)[axis]) if name == "omega" else sign * H
        ends.append(np.array(getattr(aerodynamics(*read(**{name: value}), nominal), what)))
    return (ends[0] - ends[1]) / (2.0 * H)


@pytest.mark.parametrize("name", COEFFICIENTS)
def test_no_other_module_names_a_coefficient(name: str) -> None:
    word = re.compile(rf"""["'.]{name}\b""")
    files = [path for package in PACKAGES for path in (ROOT / package).rglob("*.py")]
    naming = {str(path.relative_to(ROOT)) for path in files if word.search(path.read_text())}
    assert len(files) > 250
    assert naming <= KNOWING


def test_the_lateral_model_is_the_models_slope(nominal: np.void) -> None:
    air = lateral(V, nominal)
    assert air.side == pytest.approx(slope(nominal, "F", beta=0)[1], rel=1e-5)
    by_beta = slope(nominal, "N", beta=0)
    by_p, by_r = slope(nominal, "N", omega=0), slope(nominal, "N", omega=2)
    C = np.array(aerodynamics(*read(), nominal).C)
    for axis, part in ((0, air.rolling), (2, air.yawing)):
        slopes = [by_beta[axis], by_p[axis], by_r[axis], C[axis, 0], C[axis, 2]]
        assert air.scale * np.array(part[1:]) == pytest.approx(slopes, rel=1e-5)
        bias = aerodynamics(*read(), nominal).N[axis]
        assert air.scale * part.bias == pytest.approx(bias, abs=1e-9)


def test_the_longitudinal_model_is_the_models_slope(nominal: np.void) -> None:
    air, still = longitudinal(V, nominal), aerodynamics(*read(), nominal)
    assert air.drag == pytest.approx(-still.F[0])
    assert -air.lift_by_alpha - air.drag == pytest.approx(slope(nominal, "F", alpha=0)[2], rel=1e-5)
    assert air.moment_by_alpha == pytest.approx(slope(nominal, "N", alpha=0)[1], rel=1e-5)
    assert air.moment_by_q == pytest.approx(slope(nominal, "N", omega=1)[1], rel=1e-5)
    damping = slope(nominal, "N", omega=0)[0], air.moment_by_q
    assert rate_damping(V, nominal) == pytest.approx(damping, rel=1e-5)


def test_an_elevator_has_its_balanced_angle_of_attack(nominal: np.void) -> None:
    alpha = balanced_alpha(0.05, nominal)
    air = aerodynamics(*read(alpha=alpha), nominal)
    assert moment(air, (0.0, 0.05, 0.0))[1] == pytest.approx(0.0, abs=1e-9)


def test_lift_and_thrust_carry_together(nominal: np.void) -> None:
    """The thrust, along the body, balances the drag; what both make across is `carried`."""
    alpha = 0.2
    air = aerodynamics(*read(alpha=alpha), nominal)
    qS = 0.5 * nominal["rho"] * V**2 * nominal["S"]
    along, across = (
        np.array([np.cos(alpha), np.sin(alpha)]),
        np.array([np.sin(alpha), -np.cos(alpha)]),
    )
    thrust = drag(qS, nominal) / np.cos(alpha)
    force = np.array([air.F[0] + thrust, air.F[2]])
    assert along @ force == pytest.approx(0.0, abs=1e-9)
    assert across @ force == pytest.approx(qS * carried(alpha, nominal))
    at_zero, by_alpha = carried_linearly(nominal)
    assert at_zero == carried(0.0, nominal)
    assert by_alpha == pytest.approx((carried(H, nominal) - carried(-H, nominal)) / (2.0 * H))
