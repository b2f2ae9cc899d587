"""Adaptive fault-tolerant speed controller, eqs. (33) to (36) of the paper."""

import math
from typing import NamedTuple

import numpy as np

from ftc_autopilot.common.motion import Motion
from ftc_autopilot.control.reference import Reference
from ftc_autopilot.control.synchronisation_errors import FormationErrors
from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import add, dot, scale


class SpeedLaw(NamedTuple):
    """The speed controller's command, the rates of its estimates, and what they came from."""

    T_hat: float  # thrust asked for, before saturation [N]
    Phi_v_dot: float
    g_v_dot: float
    beta_v_dot: float
    alpha_v: float
    r_v: float
    zeta_v: float
    B_v: float


@compiled
def speed_law(
    errors: FormationErrors,
    motion: Motion,
    reference: Reference,
    basis: float,
    Phi_v: float,
    g_v: float,
    beta_v: float,
    a1: float,
    m: float,
    gains: np.void,
) -> SpeedLaw:
    """Evaluate eqs. (33) to (36).

    Args:
        errors: Formation errors.
        motion: Own motion, with the nominal aerodynamic force F0.
        reference: Filtered reference.
        basis: ςᵀς.
        Phi_v: Estimate Φ̂_v.
        g_v: Estimate ĝ_v.
        beta_v: Estimate β̂_v.
        a1: Relative threshold of the thrust trigger (25).
        m: Nominal mass [kg].
        gains: Parameters, record made of `ftc_autopilot.control.laws.proposed.Proposed`.
    """
    v, V = motion.v, motion.V
    lam = errors.lambda_v
    V_tp = errors.V_tilde_prime
    h1_sq = gains["h_v1"] ** 2
    eps = gains["eps_v"]

    known = dot(v, add(motion.gravity, scale(1.0 / m, motion.air.F))) / V
    zeta_v = v[0] * lam / (m * V)
    r_v = lam * reference.V_dot + errors.V_tilde_dot_sum
    vXi = V_tp * basis * dot(v, v) / V  # vᵀΞ_v
    approximation = vXi / (2.0 * h1_sq * V)
    alpha_v = gains["c_v"] * V_tp + lam * (
        known + Phi_v * approximation + V_tp / (2.0 * gains["h_v2"] ** 2)
    )
    drive = (alpha_v - r_v) * beta_v
    B_v = drive * math.tanh(V_tp * drive / eps) + g_v * zeta_v * math.tanh(
        V_tp * g_v * zeta_v / eps
    )
    return SpeedLaw(
        -(1.0 + a1) * B_v / zeta_v,  # (33)
        lam * gains["gamma_v1"] * V_tp * approximation - gains["sigma_v1"] * Phi_v,  # (34)
        gains["gamma_v2"] * abs(V_tp) * zeta_v - gains["sigma_v2"] * g_v,  # (35)
        gains["gamma_v3"] * V_tp * (alpha_v - r_v) - gains["sigma_v3"] * beta_v,  # (36)
        alpha_v,
        r_v,
        zeta_v,
        B_v,
    )
