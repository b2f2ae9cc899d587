"""Inversion of the nominal model: deflections for a moment, thrust for an acceleration."""

import numpy as np

from ftc_autopilot.common.motion import MeasuredMotion
from ftc_autopilot.control.step import Step
from mavlink_defs.constants import RUDDER, SURFACES
from mavlink_defs.runtime.jit import compiled, inlined
from sitl_plant.airframe.aerodynamics import control_effectiveness, force
from sitl_plant.airframe.aircraft import AircraftRecord, aircraft_record
from sitl_plant.airframe.config import Aircraft
from sitl_plant.airframe.stops import has_actuator
from sitl_plant.vec3 import Mat3, Vec3, add, dot, mat3, mul, scale, square

_MIN_EFFECT = 1e-3
"""Least effect of the weakest combination of the surfaces, relative to the strongest one.

Below it, what a degree of the one does takes more than 1000° of the other.
"""
_CONCERNED = 0.3  # share of a surface in that combination from which on it is named


def inversion_problem(aircraft: Aircraft, *, needs_rudder: bool = True) -> str | None:
    """Return why deflections for a moment cannot be computed for an aircraft; None if they can.

    The control effectiveness is judged by its singular values, since the airspeed only scales it.

    Args:
        aircraft: The aircraft.
        needs_rudder: Whether an aircraft without a rudder is none that can be flown.
    """
    if needs_rudder and not aircraft.has("rudder"):
        return "the aircraft has no rudder to hold the heading"
    with np.errstate(all="ignore"):
        effect = control_effectiveness(aircraft_record(aircraft))
    if not np.isfinite(effect).all():
        return "the effect of its surfaces is too large for a float"
    surfaces = [name for name in SURFACES if name != "rudder" or aircraft.has(name)]
    _, sizes, combinations = np.linalg.svd(effect[:, : len(surfaces)])
    if sizes[-1] >= _MIN_EFFECT * sizes[0] > 0.0:
        return None
    names = zip(surfaces, np.abs(combinations[-1]), strict=True)
    weak = " and ".join(name for name, part in names if part > _CONCERNED)
    ratio = sizes[-1] / sizes[0] if sizes[0] > 0.0 else 0.0
    return (
        f"no moment can be made by its {weak}: ratio of least to largest effect of the surfaces is "
        f"{ratio:.3g}, expected >= {_MIN_EFFECT:g}"
    )


@compiled
def surfaces_for(moment: Vec3, C: Mat3) -> Vec3:
    """Return deflections [rad] with C δ = moment [N m]; C as (10): the elevator stands alone."""
    determinant = C[0][0] * C[2][2] - C[0][2] * C[2][0]
    return (
        (moment[0] * C[2][2] - moment[2] * C[0][2]) / determinant,
        moment[1] / C[1][1],
        (moment[2] * C[0][0] - moment[0] * C[2][0]) / determinant,
    )


@compiled
def deflections_for(moment: Vec3, C: Mat3, aircraft: AircraftRecord) -> Vec3:
    """Return deflections [rad] that make a moment [N m], or without a rudder come nearest to it.

    The aileron alone makes what it can of rolling and yawing, in the least squares of the angular
    acceleration.

    Args:
        moment: The moment.
        C: Of (10).
        aircraft: Nominal aircraft.
    """
    if has_actuator(aircraft, RUDDER):
        return surfaces_for(moment, C)
    J_inv = mat3(aircraft["J_inv"])
    asked = mul(J_inv, (moment[0], 0.0, moment[2]))
    made = mul(J_inv, (C[0][0], 0.0, C[2][0]))
    aileron = (asked[0] * made[0] + asked[2] * made[2]) / (square(made[0]) + square(made[2]))
    return aileron, moment[1] / C[1][1], 0.0


@inlined
def acceleration_without_thrust(
    motion: MeasuredMotion, delta: Vec3, aircraft: AircraftRecord
) -> float:
    """Return what V̇ would be without thrust: vᵀ(R1ᵀg + F0/m)/V [m/s²].

    Args:
        motion: Present motion.
        delta: Deflections of aileron, elevator, rudder [rad]: F0 has their forces.
        aircraft: Nominal aircraft.
    """
    specific = add(motion.gravity, scale(1.0 / aircraft["m"], force(motion.air, delta)))
    return dot(motion.v, specific) / motion.V


@inlined
def thrust_for(
    V_dot: float, motion: MeasuredMotion, delta: Vec3, aircraft: AircraftRecord
) -> float:
    """Return the thrust [N] that makes a derivative of the airspeed [m/s²].

    Args:
        V_dot: The derivative.
        motion: Present motion.
        delta: Deflections of aileron, elevator, rudder [rad].
        aircraft: Nominal aircraft.
    """
    by_thrust = V_dot - acceleration_without_thrust(motion, delta, aircraft)
    thrust: float = aircraft["m"] * by_thrust * motion.V / motion.v[0]
    return thrust


@inlined
def speed_terms(now: Step, aircraft: AircraftRecord) -> tuple[float, float, float]:
    """Return r_v [m/s²], V̇ without thrust [m/s²] and ζ_v [1/kg] of (33)."""
    motion, errors = now.motion, now.errors
    lam = errors.lambda_v
    r_v = lam * now.reference.V_dot + errors.V_tilde_dot_sum
    known = acceleration_without_thrust(motion, now.held[:3], aircraft)
    return r_v, known, motion.v[0] * lam / (aircraft["m"] * motion.V)


@inlined
def thrust_for_speed(now: Step, aircraft: AircraftRecord, c_v: float) -> float:
    """Return the thrust [N] that makes the speed error (31) decay at c_v [1/s]."""
    r_v, known, zeta_v = speed_terms(now, aircraft)
    errors = now.errors
    return (r_v - errors.lambda_v * known - c_v * errors.V_tilde_prime) / zeta_v
