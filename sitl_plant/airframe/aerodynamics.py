"""Aerodynamics: force, moment and control matrix, eqs. (7) to (10) of the paper, and what follows.

No other module reads a coefficient: another aerodynamic model is another file like this one.
Linearised, it is `lateral` and `longitudinal`; level flight and balance have functions of their
own. The control matrix is the moment's derivative by the deflections, here exact.

Coefficients are linear in the angle of attack and in the angle of sideslip, of lift and drag with a
stall if the aircraft has one; linearisations are for attached flow.
"""

import math
from typing import NamedTuple

import numpy as np

from mavlink_defs.runtime.jit import compiled, inlined
from sitl_plant.airframe.aircraft import AircraftRecord
from sitl_plant.vec3 import Mat3, Vec3, add, mul, mul_t, norm, scale, vec3

STILL_M_S = 1e-9
"""An airspeed below this one counts as this one: there are no forces [m/s]."""


class Aerodynamics(NamedTuple):
    """Airspeed, aerodynamic force, moment and control matrix."""

    V: float  # airspeed [m/s]
    F: Vec3  # force without control surfaces, body axes [N]
    N: Vec3  # moment without control surfaces, body axes [N m]
    C: Mat3  # moment per aileron, elevator, rudder deflection [N m/rad]
    B: Mat3  # force per aileron, elevator, rudder deflection [N/rad]
    D: Vec3  # force per squared elevator deflection [N/rad²]


@compiled
def R3(alpha: float, beta: float) -> Mat3:
    """Return the rotation from body to wind axes, eq. (9); angle of attack and sideslip in rad."""
    ca, sa, cb, sb = math.cos(alpha), math.sin(alpha), math.cos(beta), math.sin(beta)
    return (ca * cb, sb, sa * cb), (-ca * sb, cb, -sa * sb), (-sa, 0.0, ca)


class Flow(NamedTuple):
    """The motion through the air as the equations take it."""

    V: float  # airspeed [m/s]
    alpha: float  # angle of attack [rad]
    beta: float  # angle of sideslip [rad]
    wind_axes: Mat3  # rotation from body to wind axes


FLOW = np.dtype([("v", "f8", (3,)), ("flow", "f8", (12,))])
"""A velocity through the air [m/s], and its `Flow`."""


@compiled
def flow_of(v: Vec3) -> Flow:
    """Return what follows of a velocity through the air, body axes [m/s]."""
    V = max(norm(v), STILL_M_S)
    alpha = math.atan2(v[2], v[0])
    beta = math.asin(v[1] / V)
    return Flow(V, alpha, beta, R3(alpha, beta))


@compiled
def note_flow(v: Vec3, memory: np.void) -> Flow:
    """Return the same, and note it in a record of dtype `FLOW`: a step asks for it twice."""
    flow = flow_of(v)
    noted, axes = memory["flow"], flow.wind_axes
    noted[0], noted[1], noted[2] = flow.V, flow.alpha, flow.beta
    for k in range(3):
        memory["v"][k] = v[k]
        noted[3 + k], noted[6 + k], noted[9 + k] = axes[0][k], axes[1][k], axes[2][k]
    return flow


@compiled
def noted_flow(v: Vec3, memory: np.void) -> Flow:
    """Return what is noted of this very velocity, or what follows of it."""
    before, noted = memory["v"], memory["flow"]
    if v[0] != before[0] or v[1] != before[1] or v[2] != before[2] or noted[0] == 0.0:
        return flow_of(v)
    axes = vec3(noted[3:6]), vec3(noted[6:9]), vec3(noted[9:12])
    return Flow(noted[0], noted[1], noted[2], axes)


@compiled
def aerodynamics(v: Vec3, omega: Vec3, aircraft: AircraftRecord) -> Aerodynamics:
    """Evaluate eqs. (7) to (10).

    Args:
        v: Velocity through the air, body axes [m/s].
        omega: Angular velocity, body axes [rad/s].
        aircraft: The aircraft.
    """
    return aerodynamics_in(flow_of(v), omega, aircraft)


@inlined
def aerodynamics_in(flow: Flow, omega: Vec3, aircraft: AircraftRecord) -> Aerodynamics:
    """Evaluate the same for a flow that is known."""
    V, alpha, beta, wind_axes = flow
    b, c_bar = aircraft["b"], aircraft["c_bar"]
    qS = 0.5 * aircraft["rho"] * V * V * aircraft["S"]

    if aircraft["per_rad_s"]:
        p, q, r = omega
    else:
        p = omega[0] * b / (2.0 * V)
        q = omega[1] * c_bar / (2.0 * V)
        r = omega[2] * b / (2.0 * V)

    C_L, C_D = lift_coefficient(alpha, aircraft), drag_coefficient(alpha, aircraft)
    if aircraft["stall"] > 0.0:
        C_L, C_D = _stalled(alpha, C_L, C_D, aircraft)
    C_D += (aircraft["cD_beta"] + aircraft["cD_beta2"] * beta) * beta
    C_Y = aircraft["cY0"] + aircraft["cY_beta"] * beta + aircraft["cY_p"] * p + aircraft["cY_r"] * r
    C_L += aircraft["cL_q"] * q
    C_l = aircraft["cl0"] + aircraft["cl_beta"] * beta + aircraft["cl_p"] * p + aircraft["cl_r"] * r
    C_M = aircraft["cm0"] + aircraft["cm_alpha"] * alpha + aircraft["cm_q"] * q
    C_n = aircraft["cn0"] + aircraft["cn_beta"] * beta + aircraft["cn_p"] * p + aircraft["cn_r"] * r

    F = scale(qS, mul_t(wind_axes, (-C_D, C_Y, -C_L)))  # (7)
    N = scale(qS, (b * C_l, c_bar * C_M, b * C_n))  # (8)
    qSb, qSc = qS * b, qS * c_bar
    C = (  # (10)
        (qSb * aircraft["cl_da"], 0.0, qSb * aircraft["cl_dr"]),
        (0.0, qSc * aircraft["cm_de"], 0.0),
        (qSb * aircraft["cn_da"], 0.0, qSb * aircraft["cn_dr"]),
    )
    drag_axis, side_axis, lift_axis = wind_axes
    by_aileron = scale(qS * aircraft["cY_da"], side_axis)
    by_elevator = add(
        scale(-qS * aircraft["cD_de"], drag_axis), scale(-qS * aircraft["cL_de"], lift_axis)
    )
    by_rudder = scale(qS * aircraft["cY_dr"], side_axis)
    B = (
        (by_aileron[0], by_elevator[0], by_rudder[0]),
        (by_aileron[1], by_elevator[1], by_rudder[1]),
        (by_aileron[2], by_elevator[2], by_rudder[2]),
    )
    return Aerodynamics(V, F, N, C, B, scale(-qS * aircraft["cD_de2"], drag_axis))


@compiled
def _stalled(alpha: float, C_L: float, C_D: float, aircraft: AircraftRecord) -> tuple[float, float]:
    """Blend lift and drag of attached flow with a flat plate's, C_N = 2 sin² α.

    The blend is the one of R. W. Beard, T. W. McLain, Small Unmanned Aircraft, eqs. (4.9), (4.10):
    half of each at the stall angle, on both sides.

    Args:
        alpha: Angle of attack [rad].
        C_L: Lift coefficient of attached flow.
        C_D: Drag coefficient of attached flow.
        aircraft: The aircraft, with a stall.
    """
    M, stall = aircraft["stall_sharpness"], aircraft["stall"]
    above, below = math.exp(-M * (alpha - stall)), math.exp(M * (alpha + stall))
    share = (1.0 + above + below) / ((1.0 + above) * (1.0 + below))
    if abs(alpha) > 0.5 * math.pi:
        share = 1.0
    normal = 2.0 * math.sin(alpha) * abs(math.sin(alpha))
    return (
        (1.0 - share) * C_L + share * normal * math.cos(alpha),
        (1.0 - share) * C_D + share * normal * math.sin(alpha),
    )


@compiled
def force(air: Aerodynamics, delta: Vec3) -> Vec3:
    """Return the force [N], body axes, under deflections [rad] of aileron, elevator, rudder."""
    return add(add(air.F, mul(air.B, delta)), scale(delta[1] * delta[1], air.D))


@compiled
def moment(air: Aerodynamics, delta: Vec3) -> Vec3:
    """Return the moment [N m], body axes, under deflections [rad] of aileron, elevator, rudder."""
    return add(air.N, mul(air.C, delta))


def control_effectiveness(aircraft: AircraftRecord) -> np.ndarray:
    """Return J⁻¹C at V = 1 m/s, angular acceleration per deflection, shape (3, 3).

    C of (10) grows with the square of the airspeed, and depends on neither α nor β.
    """
    C = aerodynamics((1.0, 0.0, 0.0), (0.0, 0.0, 0.0), aircraft).C
    effectiveness: np.ndarray = aircraft["J_inv"] @ np.array(C)
    return effectiveness


class Moment(NamedTuple):
    """Coefficient of a rolling or yawing moment: without any motion, and its derivatives."""

    bias: float
    beta: float  # by sideslip [1/rad]
    p: float  # by roll rate [s/rad]
    r: float  # by yaw rate [s/rad]
    aileron: float  # 1/rad
    rudder: float  # 1/rad


class Side(NamedTuple):
    """Side force: without any motion, and its derivatives."""

    bias: float  # N
    beta: float  # by sideslip, with the drag that this turns sideways [N/rad]
    p: float  # by roll rate [N s/rad]
    r: float  # by yaw rate [N s/rad]
    aileron: float  # N/rad
    rudder: float  # N/rad


class Lateral(NamedTuple):
    """Lateral force and moments at small α, linear in sideslip, rates and surfaces."""

    side: Side
    scale: float  # q S b: moments by their coefficients [N m]
    rolling: Moment
    yawing: Moment


@compiled
def lateral(V: float, aircraft: AircraftRecord) -> Lateral:
    """Linearise lateral force and moments at an airspeed V [m/s]."""
    a = aircraft
    qS = 0.5 * a["rho"] * V * V * a["S"]
    k = 1.0 if a["per_rad_s"] != 0 else a["b"] / (2.0 * V)
    return Lateral(
        Side(
            qS * a["cY0"],
            qS * (a["cY_beta"] - a["cD0"]),
            qS * a["cY_p"] * k,
            qS * a["cY_r"] * k,
            qS * a["cY_da"],
            qS * a["cY_dr"],
        ),
        qS * a["b"],
        Moment(a["cl0"], a["cl_beta"], a["cl_p"] * k, a["cl_r"] * k, a["cl_da"], a["cl_dr"]),
        Moment(a["cn0"], a["cn_beta"], a["cn_p"] * k, a["cn_r"] * k, a["cn_da"], a["cn_dr"]),
    )


class Longitudinal(NamedTuple):
    """Lift, drag and pitching moment, linear in angle of attack and pitch rate."""

    drag: float  # N
    drag_by_alpha: float  # N/rad
    lift_by_alpha: float  # N/rad
    lift_by_q: float  # N s/rad
    moment_by_alpha: float  # N m/rad
    moment_by_q: float  # N m s/rad


@compiled
def longitudinal(V: float, alpha: float, aircraft: AircraftRecord) -> Longitudinal:
    """Linearise lift, drag and pitching moment at an airspeed V [m/s] and α [rad]."""
    a = aircraft
    qS = 0.5 * a["rho"] * V * V * a["S"]
    k = 1.0 if a["per_rad_s"] != 0 else a["c_bar"] / (2.0 * V)
    qSc = qS * a["c_bar"]
    return Longitudinal(
        drag(qS, alpha, a),
        qS * (a["cD_alpha"] + 2.0 * a["cD_alpha2"] * alpha),
        qS * a["cL_alpha"],
        qS * a["cL_q"] * k,
        qSc * a["cm_alpha"],
        qSc * a["cm_q"] * k,
    )


@compiled
def rate_damping(V: float, aircraft: AircraftRecord) -> tuple[float, float]:
    """Return rolling moment by roll rate and pitching moment by pitch rate [N m s/rad]."""
    qS = 0.5 * aircraft["rho"] * V * V * aircraft["S"]
    b, c_bar = aircraft["b"], aircraft["c_bar"]
    per_rad_s = aircraft["per_rad_s"] != 0
    return (
        qS * b * aircraft["cl_p"] * (1.0 if per_rad_s else b / (2.0 * V)),
        qS * c_bar * aircraft["cm_q"] * (1.0 if per_rad_s else c_bar / (2.0 * V)),
    )


@compiled
def lift_coefficient(alpha: float, aircraft: AircraftRecord) -> float:
    """Return C_L of attached flow at α [rad], without rotation and with the elevator at rest."""
    C_L: float = aircraft["cL0"] + aircraft["cL_alpha"] * alpha
    return C_L


@compiled
def drag_coefficient(alpha: float, aircraft: AircraftRecord) -> float:
    """Return C_D of attached flow at α [rad], without sideslip and with the elevator at rest."""
    C_D: float = aircraft["cD0"] + (aircraft["cD_alpha"] + aircraft["cD_alpha2"] * alpha) * alpha
    return C_D


@compiled
def drag(qS: float, alpha: float, aircraft: AircraftRecord) -> float:
    """Return the drag [N] at a dynamic pressure by the reference area q S [N], and α [rad]."""
    return qS * drag_coefficient(alpha, aircraft)


@compiled
def carried(alpha: float, aircraft: AircraftRecord) -> float:
    """Return the force across the flight path by q S, at α [rad], of lift and of thrust.

    The thrust, along the body, balances the drag, and has a part across: C_L + C_D tan α.
    """
    lift = lift_coefficient(alpha, aircraft)
    return lift + drag_coefficient(alpha, aircraft) * math.tan(alpha)


@compiled
def carried_linearly(aircraft: AircraftRecord) -> tuple[float, float]:
    """Return `carried` at α = 0, and its slope there [1/rad]."""
    return aircraft["cL0"], aircraft["cL_alpha"] + aircraft["cD0"]


@compiled
def balanced_alpha(elevator: float, aircraft: AircraftRecord, others: float = 0.0) -> float:
    """Return α [rad] at which an elevator deflection [rad] leaves no pitching moment.

    Args:
        elevator: The deflection.
        aircraft: The aircraft.
        others: Coefficient of the pitching moment of what is no air.
    """
    a = aircraft
    alpha: float = -(a["cm0"] + a["cm_de"] * elevator + others) / a["cm_alpha"]
    return alpha


@compiled
def correct_derivatives(
    aircraft: AircraftRecord,
    aileron: float,
    pitch_damping: float,
    elevator: float,
    model: AircraftRecord,
) -> None:
    """Write derivatives with relative errors to a model of the same aircraft.

    Args:
        aircraft: The aircraft.
        aileron: Error of the rolling moment by aileron.
        pitch_damping: Error of the pitching moment by pitch rate.
        elevator: Error of the pitching moment by elevator.
        model: Record of the same dtype, written.
    """
    model["cl_da"] = aircraft["cl_da"] * (1.0 + aileron)
    model["cm_q"] = aircraft["cm_q"] * (1.0 + pitch_damping)
    model["cm_de"] = aircraft["cm_de"] * (1.0 + elevator)
