"""The aerodynamic model: one file knows its coefficients, and its linearisations are its slopes."""

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcs.scenario.aircraft_file import load_aircraft
from sitl_plant.airframe.aerodynamics import (
    FLOW,
    R3,
    Aerodynamics,
    aerodynamics,
    balanced_alpha,
    carried,
    carried_linearly,
    control_effectiveness,
    correct_derivatives,
    drag,
    flow_of,
    force,
    lateral,
    longitudinal,
    moment,
    note_flow,
    noted_flow,
    rate_damping,
)
from sitl_plant.airframe.aircraft import COEFFICIENTS, aircraft_record
from sitl_plant.vec3 import Vec3

ROOT = Path(__file__).parents[4]
PACKAGES = ("mavlink_defs", "sitl_plant", "ftc_autopilot", "gcs", "ftc_lab", "benchmarks")
KNOWING = {"sitl_plant/airframe/aerodynamics.py", "sitl_plant/airframe/config.py"}
"""The model itself, and the configuration that declares its keys."""
V, H = 45.0, 1e-6


def flown(
    any_aircraft: np.void, beta: float = 0.0, alpha: float = 0.0, omega: Vec3 = (0.0, 0.0, 0.0)
) -> Aerodynamics:
    """The model at 45 m/s."""
    along, side, down = math.cos(alpha) * math.cos(beta), math.sin(beta), math.sin(alpha)
    return aerodynamics((V * along, V * side, V * down * math.cos(beta)), omega, any_aircraft)


def slopes(any_aircraft: np.void, name: str, axis: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of force and moment by one argument, by central differences."""
    ends = []
    for step in (H, -H):
        value: Any = tuple((step * np.eye(3)[axis]).tolist()) if name == "omega" else step
        ends.append(flown(any_aircraft, **{name: value}))
    F, N = (np.subtract(getattr(ends[0], what), getattr(ends[1], what)) for what in "FN")
    return F / (2.0 * H), N / (2.0 * H)


def test_a_noted_flow_is_that_of_its_own_velocity_only() -> None:
    memory, v = np.zeros(1, FLOW)[0], (41.0, 2.0, -3.0)
    assert noted_flow((0.0, 0.0, 0.0), memory) == flow_of((0.0, 0.0, 0.0))  # nothing is noted
    assert note_flow(v, memory) == flow_of(v)
    assert noted_flow(v, memory) == flow_of(v)
    memory["flow"] += 1.0
    assert noted_flow(v, memory) != flow_of(v)
    for other in ((42.0, 2.0, -3.0), (41.0, 3.0, -3.0), (41.0, 2.0, -2.0)):
        assert noted_flow(other, memory) == flow_of(other)


def test_no_other_module_names_a_coefficient() -> None:
    word = re.compile(rf"""["'.]({"|".join(COEFFICIENTS)})\b""")
    files = [path for package in PACKAGES for path in (ROOT / package).rglob("*.py")]
    named = {str(path.relative_to(ROOT)): word.findall(path.read_text()) for path in files}
    assert len(files) > 250
    assert not {name: words for name, words in named.items() if words and name not in KNOWING}


def test_the_lateral_model_is_the_models_slope(any_aircraft: np.void) -> None:
    air, still = lateral(V, any_aircraft), flown(any_aircraft)
    side, by_beta = slopes(any_aircraft, "beta")
    _, by_p = slopes(any_aircraft, "omega", 0)
    _, by_r = slopes(any_aircraft, "omega", 2)
    by_rates = [slopes(any_aircraft, "omega", axis)[0][1] for axis in (0, 2)]
    found = [side[1], *by_rates, still.B[1][0], still.B[1][2]]
    assert list(air.side[1:]) == pytest.approx(found, rel=1e-5, abs=1e-6)
    assert air.side.bias == pytest.approx(still.F[1], abs=1e-9)
    for axis, part in ((0, air.rolling), (2, air.yawing)):
        found = [by_beta[axis], by_p[axis], by_r[axis], still.C[axis][0], still.C[axis][2]]
        assert air.scale * np.array(part[1:]) == pytest.approx(found, rel=1e-5)
        assert air.scale * part.bias == pytest.approx(still.N[axis], abs=1e-9)


def test_the_longitudinal_model_is_the_models_slope(any_aircraft: np.void) -> None:
    air = longitudinal(V, 0.0, any_aircraft)
    force, by_alpha = slopes(any_aircraft, "alpha")
    _, by_p = slopes(any_aircraft, "omega", 0)
    force_by_q, by_q = slopes(any_aircraft, "omega", 1)
    still = flown(any_aircraft)
    assert air.drag == pytest.approx(-still.F[0])
    assert -air.lift_by_alpha - air.drag == pytest.approx(force[2], rel=1e-5)
    lift = -still.F[2]  # turned forward by α
    assert lift - air.drag_by_alpha == pytest.approx(force[0], rel=1e-5)
    assert -air.lift_by_q == pytest.approx(force_by_q[2], rel=1e-5, abs=1e-6)
    slower = longitudinal(V, 0.1, any_aircraft).drag - longitudinal(V, -0.1, any_aircraft).drag
    assert slower == pytest.approx(0.2 * air.drag_by_alpha)
    assert air.moment_by_alpha == pytest.approx(by_alpha[1], rel=1e-5)
    assert air.moment_by_q == pytest.approx(by_q[1], rel=1e-5)
    assert rate_damping(V, any_aircraft) == pytest.approx((by_p[0], by_q[1]), rel=1e-5)


def test_the_effect_of_the_surfaces_grows_with_the_square_of_the_airspeed(
    any_aircraft: np.void,
) -> None:
    per_V2 = control_effectiveness(any_aircraft)
    for omega, beta in (((0.0, 0.0, 0.0), 0.0), ((0.5, -0.3, 0.2), 0.1)):
        air, still = flown(any_aircraft, beta, 0.1, omega), flown(any_aircraft, beta, 0.1)
        assert any_aircraft["J_inv"] @ np.array(air.C) == pytest.approx(V**2 * per_V2)
        turned = np.subtract(moment(still, (0.1, -0.2, 0.3)), still.N)
        assert any_aircraft["J_inv"] @ turned == pytest.approx(V**2 * per_V2 @ (0.1, -0.2, 0.3))


def test_an_elevator_has_its_balanced_angle_of_attack(any_aircraft: np.void) -> None:
    air = flown(any_aircraft, alpha=balanced_alpha(0.05, any_aircraft))
    assert moment(air, (0.0, 0.05, 0.0))[1] == pytest.approx(0.0, abs=1e-9)


def test_lift_and_thrust_carry_together(any_aircraft: np.void) -> None:
    """The thrust, along the body, balances the drag; what both make across is `carried`."""
    alpha, qS = 0.2, 0.5 * any_aircraft["rho"] * V**2 * any_aircraft["S"]
    ca, sa, air = math.cos(alpha), math.sin(alpha), flown(any_aircraft, alpha=alpha)
    force = np.array([air.F[0] + drag(qS, alpha, any_aircraft) / ca, air.F[2]])
    assert force @ (ca, sa) == pytest.approx(0.0, abs=1e-9)
    assert force @ (sa, -ca) == pytest.approx(qS * carried(alpha, any_aircraft))
    at_zero, by_alpha = carried_linearly(any_aircraft)
    assert at_zero == carried(0.0, any_aircraft)
    assert by_alpha == pytest.approx(
        (carried(H, any_aircraft) - carried(-H, any_aircraft)) / (2.0 * H)
    )


def test_a_model_is_corrected_by_relative_errors(any_aircraft: np.void) -> None:
    model = any_aircraft.copy()
    correct_derivatives(any_aircraft, 0.1, -0.2, 0.3, model)
    omega = (0.0, 0.4, 0.0)
    right, wrong = flown(model, omega=omega), flown(any_aircraft, omega=omega)
    still = flown(any_aircraft)
    assert right.C[0][0] == pytest.approx(1.1 * wrong.C[0][0])
    assert right.C[1][1] == pytest.approx(1.3 * wrong.C[1][1])
    assert right.N[1] - still.N[1] == pytest.approx(0.8 * (wrong.N[1] - still.N[1]))


def test_surfaces_have_forces_along_the_axes_of_the_wind(general: np.void) -> None:
    alpha, beta = 0.1, 0.05
    air, qS = flown(general, beta, alpha), 0.5 * general["rho"] * V**2 * general["S"]
    delta = (0.2, -0.3, 0.1)
    by_wind = np.array(R3(alpha, beta)) @ np.subtract(force(air, delta), air.F) / qS
    c = general
    drag_side_lift = (
        -(c["cD_de"] * delta[1] + c["cD_de2"] * delta[1] ** 2),
        c["cY_da"] * delta[0] + c["cY_dr"] * delta[2],
        -c["cL_de"] * delta[1],
    )
    assert by_wind == pytest.approx(drag_side_lift)


def test_drag_by_alpha_is_the_polar_s_slope(any_aircraft: np.void) -> None:
    qS, alpha = 0.5 * any_aircraft["rho"] * V**2 * any_aircraft["S"], 0.2
    slope = (drag(qS, alpha + H, any_aircraft) - drag(qS, alpha - H, any_aircraft)) / (2.0 * H)
    found = longitudinal(V, alpha, any_aircraft).drag_by_alpha
    assert found == pytest.approx(slope, rel=1e-5, abs=1e-6)


def stalling(any_aircraft: np.void, stall_deg: float = 15.0, sharpness: float = 50.0) -> np.void:
    record = any_aircraft.copy()
    record["stall"], record["stall_sharpness"] = math.radians(stall_deg), sharpness
    return record


@given(alpha=st.floats(-math.pi, math.pi), V=st.floats(5.0, 80.0))
def test_far_beyond_the_stall_the_wing_is_a_flat_plate(alpha: float, V: float) -> None:
    """No force along it, 2 sin² α across it, whatever the attached flow would give."""
    aircraft = stalling(aircraft_record(load_aircraft("aerosonde")))
    attached, limit = aircraft.copy(), math.radians(15.0)
    attached["stall"] = 0.0
    v = (V * math.cos(alpha), 0.0, V * math.sin(alpha))
    F = np.array(aerodynamics(v, (0.0, 0.0, 0.0), aircraft).F)
    without = np.array(aerodynamics(v, (0.0, 0.0, 0.0), attached).F)
    qS = 0.5 * aircraft["rho"] * V * V * aircraft["S"]
    plate = qS * np.array([0.0, 0.0, -2.0 * math.sin(alpha) * abs(math.sin(alpha))])
    far = math.exp(-50.0 * abs(abs(alpha) - limit))  # what is left of the other one, about
    nearer = plate if abs(alpha) > limit else without
    assert np.abs(F - nearer).max() <= 2.0 * far * np.abs(plate - without).max() + 1e-9 * qS


def test_at_the_stall_half_of_each_is_left() -> None:
    aircraft, stall = stalling(aircraft_record(load_aircraft("aerosonde"))), math.radians(15.0)
    attached = aircraft.copy()
    attached["stall"] = 0.0
    for alpha in (stall, -stall):
        v = (V * math.cos(alpha), 0.0, V * math.sin(alpha))
        F = aerodynamics(v, (0.0, 0.0, 0.0), aircraft).F
        without = aerodynamics(v, (0.0, 0.0, 0.0), attached).F
        qS = 0.5 * aircraft["rho"] * V * V * aircraft["S"]
        plate = np.array([0.0, 0.0, -2.0 * qS * math.sin(alpha) * abs(math.sin(alpha))])
        assert pytest.approx(0.5 * (np.array(without) + plate), rel=1e-5) == list(F)


def test_lift_has_its_maximum_at_the_stall() -> None:
    aircraft = stalling(aircraft_record(load_aircraft("aerosonde")))
    alphas = np.radians(np.linspace(0.0, 30.0, 301))
    lift = []
    for alpha in alphas:
        air = aerodynamics((V * math.cos(alpha), 0.0, V * math.sin(alpha)), (0.0,) * 3, aircraft)
        lift.append(air.F[0] * math.sin(alpha) - air.F[2] * math.cos(alpha))
    best = math.degrees(alphas[int(np.argmax(lift))])
    assert 10.0 < best < 15.0
    assert lift[-1] < 0.6 * max(lift)
