"""The Lyapunov functions of the paper's proofs along a flight: (48) with (53), (64) with (69).

The paper's ideal weights W* are no known quantities. Its proofs hold for any W*, so W* = 0 is
taken: Φ = W*ᵀW* = 0, and all that is uncertain is the approximation error, whose largest
value τ̄ is measured. So are g_v and g_ω, which the paper defines as extrema along the flight.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ftc_autopilot.config import Trigger
from ftc_autopilot.laws.proposed import Proposed
from gcs.theory.dwell import in_force
from gcs.theory.known import Known

__all__ = ["Subsystem", "attitude_subsystem", "speed_subsystem"]

_ROUNDING = 1e-3  # the held value is rounded to float32: |p| <= 1 to within this


@dataclass(frozen=True)
class Subsystem:
    """One Lyapunov function at each of n steps, and the inequality V̇_L <= -κ V_L + χ.

    Attributes:
        V_L: L1 of (48) or L3 of (64), (n,).
        V_L_dot: Its derivative at the begin of each period, by the chain rule, from the plant's
            true accelerations, the laws' rates of the estimates, and, as in the proofs, r_v and
            ω̇_d as the law has them; (n,).
        kappa: κ [1/s], (n,).
        chi: χ, (n,).
        covered: Steps at which every actuator of the subsystem has some effectiveness left, (n,).
        counted: Covered steps at which |p| <= 1, (26) and (29), holds; (n,).
        jumps: Between which steps V_L jumps by definition, (n - 1,).
        chi_parts: The summands of χ at the last counted step.
        constants: What entered them.
    """

    V_L: np.ndarray
    V_L_dot: np.ndarray
    kappa: np.ndarray
    chi: np.ndarray
    covered: np.ndarray
    counted: np.ndarray
    jumps: np.ndarray
    chi_parts: dict[str, float]
    constants: dict[str, float | list[float]]


def speed_subsystem(known: Known, law: Proposed, trigger: Trigger) -> Subsystem | None:
    """Evaluate L1 of (48), its derivative, and κ_v, χ_v of (53); None if no step counts."""
    signals, rho, lam = known.signals, known.rho[:, 3], known.lambda_v
    held = signals["held"][:, 3]
    a1, a2 = in_force(trigger.a1, known.time_s), in_force(trigger.a2_n, known.time_s)
    p1 = (signals["demand"][:, 3] - held) / (a1 * np.abs(held) + a2)
    varpi = known.fault[:, 3] - a2 * p1 * rho / (1.0 + a1 * p1)  # ϖ of (41)
    covered = rho > 0.0
    counted = covered & (np.abs(p1) <= 1.0 + _ROUNDING) & (signals["zeta_v"] > 0.0)
    counted &= np.isfinite(known.delta_v).all(axis=1)
    if not counted.any():
        return None

    beta = 1.0 / np.where(covered, rho, np.nan)
    sup_varpi = float(np.abs(varpi[counted]).max())
    g = beta * sup_varpi  # the paper has sup ϖ, (46) needs sup |ϖ|
    tau = np.abs(known.delta_v[counted]).max(axis=0)

    V_tp, Phi = signals["sync_error"][:, 0], signals["Phi_v"]
    g_tilde, beta_tilde = signals["g_v"] - g, signals["beta_v"] - beta
    V_L = (
        0.5 * V_tp**2
        + Phi**2 / (2.0 * law.gamma_v1)
        + rho * g_tilde**2 / (2.0 * law.gamma_v2)
        + rho * beta_tilde**2 / (2.0 * law.gamma_v3)
    )  # (48)
    V_L_dot = (
        V_tp * (lam * known.V_dot - signals["r_v"])
        + Phi * signals["Phi_v_dot"] / law.gamma_v1
        + rho * g_tilde * signals["g_v_dot"] / law.gamma_v2
        + rho * beta_tilde * signals["beta_v_dot"] / law.gamma_v3
    )
    parts: dict[str, Any] = {
        "g_v": rho * law.sigma_v2 * g**2 / (2.0 * law.gamma_v2),
        "beta_v": rho * law.sigma_v3 * beta**2 / (2.0 * law.gamma_v3),
        "h_v1": 1.5 * lam * law.h_v1**2,
        "h_v2": 0.5 * lam * law.h_v2**2 * float(tau @ tau),
        "eps_v": 0.557 * law.eps_v * rho,
    }
    kappa = min(2.0 * law.c_v, law.sigma_v1, law.sigma_v2, law.sigma_v3)
    return Subsystem(
        V_L=V_L,
        V_L_dot=V_L_dot,
        kappa=np.full(len(V_L), kappa),
        chi=np.sum([np.broadcast_to(part, V_L.shape) for part in parts.values()], axis=0),
        covered=covered,
        counted=counted,
        jumps=np.diff(rho) != 0.0,
        chi_parts=_at_last(parts, counted),
        constants={
            "lambda": lam,
            "sup_varpi_n": sup_varpi,
            **_at_last({"g_v": g, "beta_v": beta}, counted),
            "tau_bar_m_s2": tau.tolist(),
        },
    )


def attitude_subsystem(known: Known, law: Proposed, trigger: Trigger) -> Subsystem | None:
    """Evaluate L3 of (64), its derivative, and κ_ω, χ_ω of (69); None if no step counts."""
    signals, rho = known.signals, known.rho[:, :3]
    held = signals["held"][:, :3]
    b1 = in_force(trigger.b1, known.time_s)[:, None]
    b2 = np.radians(in_force(trigger.b2_deg, known.time_s))[:, None]
    p = (signals["demand"][:, :3] - held) / (b1 * np.abs(held) + b2)
    D = 1.0 / (1.0 + b1 * p * np.sign(held))  # (30)
    sigma = -b2 * p * D  # (30)
    covered: np.ndarray = np.all(rho > 0.0, axis=1)
    counted = covered & np.all(np.abs(p) <= 1.0 + _ROUNDING, axis=1)
    counted &= np.isfinite(known.delta_omega).all(axis=1)  # G and ω̇ too
    if not counted.any():
        return None

    G = known.G[counted]
    effect = np.einsum("kij,kj,klj->kil", G, (rho * D)[counted], G)
    g = float(np.linalg.eigvalsh(effect)[:, 0].min())  # g_ω of (63)
    if g <= 0.0:
        return None
    beta = 1.0 / g
    lumped = known.delta_omega + np.einsum("kij,kj->ki", known.G, rho * sigma)
    tau = np.abs(lumped[counted]).max(axis=0)

    e_prime, e_omega = signals["sync_error"][:, 1:], signals["e_omega"]
    Phi, beta_tilde = signals["Phi_omega"], signals["beta_omega"] - beta
    V_L = (
        0.5 * (e_prime**2).sum(axis=1)
        + 0.5 * (e_omega**2).sum(axis=1)
        + Phi**2 / (2.0 * law.gamma_omega1)
        + g * beta_tilde**2 / (2.0 * law.gamma_omega2)
    )  # (55), (64)
    K1, K2 = in_force(law.K1, known.time_s), in_force(law.K2, known.time_s)
    V_L_dot = (
        (e_prime * (known.lambda_omega * known.e_omega_rates - K1 * e_prime)).sum(axis=1)  # (58)
        + (e_omega * (known.omega_dot - signals["omega_d_dot"])).sum(axis=1)
        + Phi * signals["Phi_omega_dot"] / law.gamma_omega1
        + g * beta_tilde * signals["beta_omega_dot"] / law.gamma_omega2
    )
    parts = {
        "eps_omega": g * law.eps_omega**0.5,
        "h_omega1": 1.5 * law.h_omega1**2,
        "h_omega2": 0.5 * law.h_omega2**2 * float(tau @ tau),
        "beta_omega": g * law.sigma_omega2 * beta**2 / (2.0 * law.gamma_omega2),
    }
    gains = 2.0 * np.minimum(K1.min(axis=1), K2.min(axis=1))
    return Subsystem(
        V_L=V_L,
        V_L_dot=V_L_dot,
        kappa=np.minimum(gains, min(law.sigma_omega1, law.sigma_omega2)),
        chi=np.full(len(V_L), sum(parts.values())),
        covered=covered,
        counted=counted,
        jumps=np.diff(K1, axis=0).any(axis=1) | known.yaw_wraps,  # ω_d (57) jumps with K1
        chi_parts=parts,
        constants={
            "lambda_prime": known.lambda_omega,
            "g_omega": g,
            "beta_omega": beta,
            "tau_bar_rad_s2": tau.tolist(),
            "omega_d_filter_error_rad_s2": _filter_error(known, K1, counted),
        },
    )


def _filter_error(known: Known, K1: np.ndarray, counted: np.ndarray) -> list[float]:
    """Largest difference of filtered and true ω̇_d by axis, where K1 does not switch."""
    signals = known.signals
    steady = counted[:-1] & ~np.diff(K1, axis=0).any(axis=1)
    true = np.diff(signals["omega_d"], axis=0) / np.diff(known.time_s)[:, None]
    error = np.abs(signals["omega_d_dot"][:-1] - true)[steady & counted[1:]]
    largest: list[float] = error.max(axis=0, initial=0.0).tolist()
    return largest


def _at_last(values: dict[str, Any], counted: np.ndarray) -> dict[str, float]:
    """The values, each a number or an array over steps, at the last counted step."""
    last = np.flatnonzero(counted)[-1]
    return {
        name: float(np.broadcast_to(value, counted.shape)[last]) for name, value in values.items()
    }
