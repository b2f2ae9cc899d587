"""Adaptive fault-tolerant speed controller, eqs. (33) to (36) of the paper."""

import math
from typing import NamedTuple

import numpy as np

from ftc_autopilot.control.inversion import speed_terms
from ftc_autopilot.control.step import Step
from mavlink_defs.runtime.jit import inlined
from sitl_plant.airframe.aircraft import AircraftRecord
from sitl_plant.vec3 import dot, square


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


@inlined
def speed_law(
    now: Step, basis: float, aircraft: AircraftRecord, gains: np.void, estimates: np.void
) -> SpeedLaw:
    """Evaluate eqs. (33) to (36).

    Args:
        now: The present step, with the relative threshold a1 of the thrust trigger (25).
        basis: ςᵀς.
        aircraft: Nominal aircraft.
        gains: Parameters, record made of `ftc_autopilot.control.laws.proposed.Proposed`.
        estimates: Φ̂_v, ĝ_v, β̂_v, record of dtype `Proposed.STATE`; read only.
    """
    v, V = now.motion.v, now.motion.V
    lam, V_tp = now.errors.lambda_v, now.errors.V_tilde_prime
    Phi_v, g_v, beta_v = estimates["Phi_v"], estimates["g_v"], estimates["beta_v"]
    h1_sq = square(gains["h_v1"])
    eps = gains["eps_v"]

    r_v, known, zeta_v = speed_terms(now, aircraft)
    vXi = V_tp * basis * dot(v, v) / V  # vᵀΞ_v
    approximation = vXi / (2.0 * h1_sq * V)
    alpha_v = gains["c_v"] * V_tp + lam * (
        known + Phi_v * approximation + V_tp / (2.0 * square(gains["h_v2"]))
    )
    drive = (alpha_v - r_v) * beta_v
    B_v = drive * math.tanh(V_tp * drive / eps) + g_v * zeta_v * math.tanh(
        V_tp * g_v * zeta_v / eps
    )
    return SpeedLaw(
        T_hat=-(1.0 + now.thresholds.a[0]) * B_v / zeta_v,  # (33)
        Phi_v_dot=lam * gains["gamma_v1"] * V_tp * approximation
        - gains["sigma_v1"] * Phi_v,  # (34)
        g_v_dot=gains["gamma_v2"] * abs(V_tp) * zeta_v - gains["sigma_v2"] * g_v,  # (35)
        beta_v_dot=gains["gamma_v3"] * V_tp * (alpha_v - r_v) - gains["sigma_v3"] * beta_v,  # (36)
        alpha_v=alpha_v,
        r_v=r_v,
        zeta_v=zeta_v,
        B_v=B_v,
    )
