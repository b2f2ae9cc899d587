"""The loops of the healthy aircraft, down to the commanded angular acceleration."""

import math

import numpy as np

from ftc_autopilot.control.attitude import filtered_derivative
from ftc_autopilot.control.step import Step
from mavlink_defs.runtime.jit import inlined
from sitl_plant.airframe.rigid_body import R2
from sitl_plant.vec3 import Vec3, clamp, mul, scale, square, sub, vec3

_MIN_PITCH = -0.75  # of the pitch reference [rad]
_NEAR = math.radians(3.0)  # of the limit of the angle of attack


@inlined
def commanded_rates(now: Step, gains: np.void, state: np.void) -> Vec3:
    """Return the Euler angle rates that errors and reference ask for [rad/s].

    φ̇_d = -K1 e'/λ', within limits, + φ̇_r + Σ a_ij λ4 ė_j/λ'; K1 shrinks with airspeed below
    `full_gain_airspeed_m_s`. Above the limit of the angle of attack, the pitch reference is lowered
    at `pitch_lowering_1_s` times (α - limit), and the pitch rate is at most -`pitch_rate_1_s` times
    that.
    """
    motion, errors, K1 = now.motion, now.errors, gains["K1"]
    limits = gains["rate_limit_rad_s"]
    over = math.atan2(motion.v[2], motion.v[0]) - gains["alpha_limit_rad"]
    if over > 0.0 or state["pitch_lowered"] < 0.0:
        lowered = state["pitch_lowered"] - gains["pitch_lowering_1_s"] * now.dt * over
        state["pitch_lowered"] = clamp(lowered, _MIN_PITCH, 0.0)
    e = scale(1.0 / errors.lambda_omega, errors.e_prime)
    e = (e[0], e[1] - state["pitch_lowered"], e[2])
    share = clamp(motion.V / gains["full_gain_airspeed_m_s"], 0.3, 1.0)
    roll = clamp(-share * K1[0] * e[0], -limits[0], limits[0])
    pitch = clamp(-share * K1[1] * e[1], -limits[1], limits[1])
    yaw = clamp(-share * K1[2] * e[2], -limits[2], limits[2])
    pitch += now.reference.phi_dot[1]
    if over > -_NEAR:
        pitch = min(pitch, -gains["pitch_rate_1_s"] * over)
    others = scale(1.0 / errors.lambda_omega, errors.e_dot_sum)
    return (
        roll + now.reference.phi_dot[0] + others[0],
        pitch + others[1],
        yaw + now.reference.phi_dot[2] + others[2],
    )


@inlined
def commanded_acceleration(now: Step, rates: Vec3, gains: np.void, state: np.void) -> Vec3:
    """Return the commanded angular acceleration ω̇_d - K2 (ω - ω_d), body axes [rad/s²].

    ω_d = R2 φ̇_d; its derivative comes from a filter. K2 shrinks with V² below
    `full_gain_airspeed_m_s`, as the surfaces' moments do.

    Args:
        now: The present step.
        rates: Commanded Euler angle rates φ̇_d [rad/s].
        gains: Parameters, record made of `Surviving`.
        state: Record of dtype `Surviving.STATE`, updated in place.
    """
    omega_d = mul(R2(now.motion.phi), rates)
    K2 = gains["K2"]
    slope = filtered_derivative(now, omega_d, gains["tau_omega_d_s"], state["omega_d_filtered"])
    share = clamp(square(now.motion.V / gains["full_gain_airspeed_m_s"]), 0.25, 1.0)
    e = sub(now.motion.omega, omega_d)
    a, b, c = vec3(gains["acceleration_limit_rad_s2"])
    return (
        clamp(slope[0], -a, a) - share * K2[0] * e[0],
        clamp(slope[1], -b, b) - share * K2[1] * e[1],
        clamp(slope[2], -c, c) - share * K2[2] * e[2],
    )
