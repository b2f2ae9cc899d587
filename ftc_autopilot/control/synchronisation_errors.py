"""Tracking and synchronisation errors within the formation, eqs. (31) and (32) of the paper."""

from typing import NamedTuple

import numpy as np

from ftc_autopilot.common.angles import wrap
from ftc_autopilot.common.motion import MeasuredMotion
from ftc_autopilot.control.reference import Reference
from mavlink_defs.dialect import FTC_NEIGHBOUR_FRAME_REFERENCE
from mavlink_defs.runtime.jit import compiled, inlined
from sitl_plant.vec3 import Vec3, add, clamp, clamp_each, scale, sub, vec3


class FormationErrors(NamedTuple):
    """Errors of one UAV against the reference and against its neighbours."""

    V_tilde: float  # Ṽ [m/s]
    e: Vec3  # attitude error, each angle in (-π, π] [rad]
    V_tilde_prime: float  # Ṽ', eq. (31) [m/s]
    e_prime: Vec3  # e', eq. (32) [rad]
    lambda_v: float  # λ = λ1 + λ2 Σ a_ij
    lambda_omega: float  # λ' = λ3 + λ4 Σ a_ij
    V_tilde_dot_sum: float  # λ2 Σ a_ij Ṽ̇_j [m/s²], for r_v
    e_dot_sum: Vec3  # λ4 Σ a_ij ė_j [rad/s], for eq. (57)


@inlined
def formation_errors(
    motion: MeasuredMotion,
    reference: Reference,
    edges: np.ndarray,
    weighting: np.void,
) -> FormationErrors:
    """Evaluate eqs. (31) and (32) and the neighbours' sums that r_v and (57) need.

    Angles and their differences are taken the short way round, so that whole turns of the own
    aircraft or a neighbour change nothing. Differences to a neighbour count only up to limits: a
    degraded one has little influence. A neighbour's errors are against its own reference if its
    message holds them, else against the own one.

    Args:
        motion: Own motion.
        reference: Filtered reference.
        edges: What is known of each neighbour, dtype `ftc_autopilot.control.edges.EDGE`, shape
            (degree,).
        weighting: Record made of `ftc_autopilot.control.laws.base.LawParameters`.
    """
    V_tilde = motion.V - reference.V
    e = _difference(motion.phi, reference.phi)
    V_sum, a_sum, V_dot_sum = 0.0, 0.0, 0.0
    e_sum, e_dot_sum = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    speed, angle = weighting["neighbour_speed_limit_m_s"], weighting["neighbour_angle_limit_rad"]
    acceleration = weighting["neighbour_acceleration_limit_m_s2"]
    rate = weighting["neighbour_rate_limit_rad_s"]
    for j in range(len(edges)):
        a = edges[j]["weight"]
        if a == 0.0:
            continue
        other = edges[j]["known"]
        V_j, V_dot_j = other["airspeed"], other["airspeed_rate"]
        e_j, e_dot_j = vec3(other["attitude"]), vec3(other["attitude_rate"])
        if other["frame"] != FTC_NEIGHBOUR_FRAME_REFERENCE:
            V_j, V_dot_j = V_j - reference.V, V_dot_j - reference.V_dot
            e_j, e_dot_j = _difference(e_j, reference.phi), sub(e_dot_j, reference.phi_dot)
        a_sum += a
        V_sum += a * clamp(V_tilde - V_j, -speed, speed)
        V_dot_sum += a * clamp(V_dot_j, -acceleration, acceleration)
        e_sum = add(e_sum, scale(a, clamp_each(_difference(e, e_j), angle)))
        e_dot_sum = add(e_dot_sum, scale(a, clamp_each(e_dot_j, rate)))
    lambda1, lambda2 = weighting["lambda1"], weighting["lambda2"]
    lambda3, lambda4 = weighting["lambda3"], weighting["lambda4"]
    return FormationErrors(
        V_tilde=V_tilde,
        e=e,
        V_tilde_prime=lambda1 * V_tilde + lambda2 * V_sum,  # (31)
        e_prime=add(scale(lambda3, e), scale(lambda4, e_sum)),  # (32)
        lambda_v=lambda1 + lambda2 * a_sum,
        lambda_omega=lambda3 + lambda4 * a_sum,
        V_tilde_dot_sum=lambda2 * V_dot_sum,
        e_dot_sum=scale(lambda4, e_dot_sum),
    )


@compiled
def _difference(phi: Vec3, other: Vec3) -> Vec3:
    """Return differences of roll, pitch and yaw, each the short way round [rad]."""
    return wrap(phi[0] - other[0]), wrap(phi[1] - other[1]), wrap(phi[2] - other[2])
