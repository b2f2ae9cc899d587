"""The loops of the healthy aircraft: wanted angular acceleration, and thrust by airspeed."""

import math

import numpy as np

from ftc_autopilot.control.inversion import acceleration_without_thrust
from ftc_autopilot.control.laws.base import Instant
from mavlink_defs.runtime.jit import compiled
from sitl_plant.rigid_body import R2
from sitl_plant.vec3 import Vec3, mul, scale, sub, vec3

_ACCELERATION_LIMITS = (20.0, 20.0, 10.0)  # of the wanted rates' derivative [rad/s²]
_LOWERING_1_S, _LOWEST = 2.0, -0.75  # of the pitch reference [1/s, rad]
_NEAR = math.radians(3.0)  # of the limit of the angle of attack
_PITCH_RATE_GAIN = 3.0  # below the limit of the angle of attack [1/s]


@compiled
def wanted_rates(now: Instant, gains: np.void, state: np.void) -> Vec3:
    """Return the Euler angle rates that errors and reference ask for [rad/s].

    φ̇_d = -K1 e'/λ', within limits, + φ̇_r + Σ a_ij λ4 ė_j/λ'; K1 shrinks with airspeed below
    `full_gain_airspeed_m_s`. Above the limit of the angle of attack, the pitch reference is lowered
    at 2 (α - limit) rad/s, and the pitch rate is at most -3 (α - limit).
    """
    motion, errors, K1 = now.motion, now.errors, gains["K1"]
    limits = gains["rate_limit_rad_s"]
    over = math.atan2(motion.v[2], motion.v[0]) - gains["alpha_limit_rad"]
    if over > 0.0 or state["pitch_lowered"] < 0.0:
        lowered = state["pitch_lowered"] - _LOWERING_1_S * now.dt * over
        state["pitch_lowered"] = min(max(lowered, _LOWEST), 0.0)
    e = scale(1.0 / errors.lambda_omega, errors.e_prime)
    e = (e[0], e[1] - state["pitch_lowered"], e[2])
    share = min(max(motion.V / gains["full_gain_airspeed_m_s"], 0.3), 1.0)
    roll = min(max(-share * K1[0] * e[0], -limits[0]), limits[0])
    pitch = min(max(-share * K1[1] * e[1], -limits[1]), limits[1])
    yaw = min(max(-share * K1[2] * e[2], -limits[2]), limits[2])
    pitch += now.reference.phi_dot[1]
    if over > -_NEAR:
        pitch = min(pitch, -_PITCH_RATE_GAIN * over)
    others = scale(1.0 / errors.lambda_omega, errors.e_dot_sum)
    return (
        roll + now.reference.phi_dot[0] + others[0],
        pitch + others[1],
        yaw + now.reference.phi_dot[2] + others[2],
    )


@compiled
def wanted_acceleration(now: Instant, rates: Vec3, gains: np.void, state: np.void) -> Vec3:
    """Return the wanted angular acceleration ω̇_d - K2 (ω - ω_d), body axes [rad/s²].

    ω_d = R2 φ̇_d; its derivative comes from a filter. K2 shrinks with V² below
    `full_gain_airspeed_m_s`, as the surfaces' moments do.

    Args:
        now: The present step.
        rates: Wanted Euler angle rates φ̇_d [rad/s].
        gains: Parameters, record made of `Surviving`.
        state: Record of dtype `Surviving.STATE`, updated in place.
    """
    omega_d = mul(R2(now.motion.phi), rates)
    filtered, K2 = state["omega_d_filtered"], gains["K2"]
    if now.first:
        for i in range(3):
            filtered[i] = omega_d[i]
    slope = scale(1.0 / gains["tau_omega_d_s"], sub(omega_d, vec3(filtered)))
    for i in range(3):
        filtered[i] += now.dt * slope[i]
    share = min(max((now.motion.V / gains["full_gain_airspeed_m_s"]) ** 2, 0.25), 1.0)
    e = sub(now.motion.omega, omega_d)
    a, b, c = _ACCELERATION_LIMITS
    return (
        min(max(slope[0], -a), a) - share * K2[0] * e[0],
        min(max(slope[1], -b), b) - share * K2[1] * e[1],
        min(max(slope[2], -c), c) - share * K2[2] * e[2],
    )


@compiled
def thrust_for_speed(now: Instant, aircraft: np.void, gains: np.void) -> float:
    """Return the thrust [N] that makes the speed error (31) decay at c_v, by nominal inversion."""
    motion, errors = now.motion, now.errors
    lam = errors.lambda_v
    r_v = lam * now.reference.V_dot + errors.V_tilde_dot_sum
    zeta_v = motion.v[0] * lam / (aircraft["m"] * motion.V)
    known = acceleration_without_thrust(motion, aircraft)
    thrust: float = (r_v - lam * known - gains["c_v"] * errors.V_tilde_prime) / zeta_v
    return thrust
