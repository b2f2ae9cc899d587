"""The Lyapunov functions of the paper's proofs along a flight: (48) with (53), (64) with (69).

The paper's ideal weights W* are unknown. Its proofs hold for any W*, so W* = 0 is used:
Φ = W*ᵀW* = 0, and all uncertainty is approximation error, whose largest value τ̄ is measured.
So are g_v and g_ω, which the paper defines as extrema along the flight.

A proof is a chain of equalities and inequalities. The equalities are compared to rounding; of
each inequality the slack is kept, right side minus left side. With the slacks added back,
V̇_L <= -κ V_L + χ becomes an equality.
"""

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ftc_autopilot.control.laws.proposed import Proposed
from ftc_autopilot.control.triggers import Trigger
from ftc_lab.theory.definitions import thresholds
from ftc_lab.theory.dwell import in_force
from ftc_lab.theory.equality import Equality, compare
from ftc_lab.theory.ground_truth import Known, solve

_ROUNDING = 1e-3  # the held value is rounded to float32: |p| <= 1 to within this


@dataclass(frozen=True)
class Subsystem:
    """One Lyapunov function at each of n steps, and the inequality V̇_L <= -κ V_L + χ.

    Attributes:
        V_L: L1 of (48) or L3 of (64), (n,).
        V_L_dot: Its derivative at the start of each period, by the chain rule, from the plant's
            true accelerations, the laws' rates of the estimates, and, as in the proofs, r_v and
            ω̇_d as the law has them; (n,).
        kappa: κ [1/s], (n,).
        chi: χ, (n,).
        covered: Steps at which every actuator of the subsystem has some effectiveness left, (n,).
        counted: Covered steps at which |p| <= 1, (26) and (29), holds; (n,).
        jumps: Between which steps V_L jumps by definition, (n - 1,).
        chi_parts: The summands of χ at the last counted step.
        slack: Slack of each inequality of the proof, right side minus left side, by equation;
            (n,) each. By the proof, none is negative at counted steps.
        equalities: The proof's equalities along the flight.
        constants: The constants in κ and χ.
    """

    V_L: np.ndarray
    V_L_dot: np.ndarray
    kappa: np.ndarray
    chi: np.ndarray
    covered: np.ndarray
    counted: np.ndarray
    jumps: np.ndarray
    chi_parts: dict[str, float]
    slack: dict[str, np.ndarray]
    equalities: list[Equality]
    constants: dict[str, float | list[float]]


@dataclass(frozen=True)
class _Error:
    """The tracking part of a Lyapunov function, each of shape (n,)."""

    energy: np.ndarray  # half its square
    change: np.ndarray  # of that, per second
    decay: np.ndarray  # decay by the gains, per second
    rate: np.ndarray  # smallest decay per energy [1/s]


@dataclass(frozen=True)
class _Estimate:
    """The part of one estimate: weight · (value - ideal)²/2; the arrays have shape (n,)."""

    value: np.ndarray
    change: np.ndarray  # per second
    ideal: np.ndarray | float
    weight: np.ndarray | float  # ρ/γ or g_ω/γ
    leakage: float  # σ [1/s]

    @property
    def error(self) -> np.ndarray:
        """What the estimate is off."""
        return self.value - self.ideal

    def leaked(self, of: np.ndarray | float) -> Any:
        """Return the leakage's share of V̇_L in the square of something."""
        return 0.5 * self.weight * self.leakage * of**2


@dataclass(frozen=True)
class _Proof:
    """What differs between the two proofs; the arrays have shape (n,)."""

    known: Known
    equations: tuple[str, str]  # V̇_L before the inequalities, and the result
    error: _Error
    estimates: dict[str, _Estimate]
    before: tuple[np.ndarray, ...]  # summands of V̇_L before the inequalities, but decay, adaptation
    cancelled: tuple[np.ndarray, ...]  # magnitudes of terms that cancel within them
    slack: dict[str, np.ndarray]  # of the inequalities up to there
    parts: dict[str, Any]  # summands of χ that do not come from the estimates
    covered: np.ndarray  # this and the rest as in `Subsystem`
    counted: np.ndarray
    jumps: np.ndarray
    equalities: list[Equality]  # up to there
    constants: dict[str, float | list[float]]

    def subsystem(self) -> Subsystem:
        """Assemble V_L from the error and the estimates, and finish the proof."""
        error, estimates = self.error, self.estimates.values()
        V_L = sum((0.5 * one.weight * one.error**2 for one in estimates), error.energy)
        kappa = np.minimum(error.rate, min(one.leakage for one in estimates))
        parts = self.parts | {name: one.leaked(one.ideal) for name, one in self.estimates.items()}
        chi = np.sum([np.broadcast_to(part, V_L.shape) for part in parts.values()], axis=0)
        adaptation = [one.weight * one.error * one.change for one in estimates]
        V_L_dot = error.change + np.sum(adaptation, axis=0)
        unequal, result = self.equations
        leakage = sum(one.leaked(one.error) for one in estimates)
        slack = self.slack | {
            f"{result}, estimates": np.sum([one.leaked(one.value) for one in estimates], axis=0),
            f"{result}, κ": error.decay + leakage - kappa * V_L,
        }
        along = partial(
            compare,
            where=self.covered,
            time_s=self.known.time_s,
            cancelled=(*self.cancelled, *self.before, *adaptation),
        )
        text = "rate of V_L before the inequalities"
        begun = along(unequal, text, V_L_dot, -error.decay, *self.before, *adaptation)
        text = "rate of V_L with the slack of each inequality"
        ended = along(result, text, V_L_dot, -kappa * V_L, chi, *(-part for part in slack.values()))
        return Subsystem(
            V_L=V_L,
            V_L_dot=V_L_dot,
            kappa=kappa,
            chi=chi,
            covered=self.covered,
            counted=self.counted,
            jumps=self.jumps,
            chi_parts=_at_last(parts, self.counted),
            slack=slack,
            equalities=[*self.equalities, begun, ended],
            constants=self.constants,
        )


def speed_subsystem(known: Known, law: Proposed, trigger: Trigger) -> Subsystem | None:
    """Evaluate L1 of (48), its derivative, and κ_v, χ_v of (53); None if no step counts."""
    s, rho, lam, near = known.signals, known.rho[:, 3], known.lambda_v, known.neighbours
    V_tp, zeta, held = s["sync_error"][:, 0], s["zeta_v"], s["held"][:, 3]
    a1, a2 = (part[:, 3] for part in thresholds(known, trigger))
    p1 = (s["demand"][:, 3] - held) / (a1 * np.abs(held) + a2)
    D = 1.0 / (1.0 + a1 * p1)  # (28)
    varpi = known.fault[:, 3] - a2 * p1 * rho * D  # ϖ of (41)
    covered = known.present & (rho > 0.0)
    counted = covered & (np.abs(p1) <= 1.0 + _ROUNDING) & (zeta > 0.0)
    if not counted.any():
        return None

    beta = 1.0 / np.where(covered, rho, np.nan)
    sup_varpi = float(np.abs(varpi[counted]).max())
    g = beta * sup_varpi  # the paper has sup ϖ, (46) needs sup |ϖ|
    tau = np.abs(known.delta_v[counted]).max(axis=0)
    estimates = {
        "Phi_v": _Estimate(s["Phi_v"], s["Phi_v_dot"], 0.0, 1.0 / law.gamma_v1, law.sigma_v1),
        "g_v": _Estimate(s["g_v"], s["g_v_dot"], g, rho / law.gamma_v2, law.sigma_v2),
        "beta_v": _Estimate(s["beta_v"], s["beta_v_dot"], beta, rho / law.gamma_v3, law.sigma_v3),
    }

    # the terms of (41), (49) and the inequalities, each multiplied by Ṽ'
    nominal, uncertain = (
        lam * V_tp * (known.v * part).sum(axis=1) / s["V"]
        for part in (known.drift_v, known.delta_v)
    )
    nominal_size = lam * V_tp * np.linalg.norm(known.drift_v, axis=1)
    drive = V_tp * (s["alpha_v"] - s["r_v"])
    thrust, offset = V_tp * zeta * rho * D * s["demand"][:, 3], V_tp * zeta * varpi
    network = lam * V_tp**2 * s["basis"] * s["Phi_v"] / (2.0 * law.h_v1**2)
    robust = lam * V_tp**2 / (2.0 * law.h_v2**2)
    offset_hat = V_tp * s["g_v"] * zeta
    smooth, lemma3 = offset_hat * np.tanh(offset_hat / law.eps_v), 0.2785 * law.eps_v
    h_v1, h_v2 = 1.5 * lam * law.h_v1**2, 0.5 * lam * law.h_v2**2 * float(tau @ tau)
    change = law.lambda1 * (known.V_dot - s["reference_dot"][:, 0])
    change += law.lambda2 * ((known.V_dot[:, None] - near.V_dot) @ near.weights)  # of (31)
    return _Proof(
        known=known,
        equations=("(49)", "(53)"),
        error=_Error(
            energy=0.5 * V_tp**2,
            change=V_tp * (lam * known.V_dot - s["r_v"]),
            decay=law.c_v * V_tp**2,
            rate=np.full(len(V_tp), 2.0 * law.c_v),
        ),
        estimates=estimates,
        before=(drive, -network, -robust, uncertain, thrust, offset),
        cancelled=(nominal_size,),
        slack={
            "(43), network": np.full(len(V_tp), h_v1),  # all of it: W*ᵀς = 0
            "(43), uncertainty": h_v2 + robust - uncertain,
            "(46)": rho * g * np.abs(V_tp) * zeta - offset,
            "(47)": rho * (smooth + lemma3 - np.abs(V_tp) * s["g_v"] * zeta),
            "(51)": rho * (lemma3 - smooth - drive * s["beta_v"]) - thrust,
        },
        parts={"h_v1": h_v1, "h_v2": h_v2, "eps_v": 2.0 * lemma3 * rho},
        covered=covered,
        counted=counted,
        jumps=np.diff(rho) != 0.0,
        equalities=[
            compare(
                "(41)",
                "Ṽ' · rate of Ṽ'",
                V_tp * change,
                nominal,
                uncertain,
                thrust,
                offset,
                -V_tp * s["r_v"],
                where=known.reported,
                time_s=known.time_s,
                cancelled=(nominal_size,),
            )
        ],
        constants={
            "lambda": lam,
            "sup_varpi_n": sup_varpi,
            **_at_last({"g_v": g, "beta_v": beta}, counted),
            "tau_bar_m_s2": tau.tolist(),
        },
    ).subsystem()


def attitude_subsystem(known: Known, law: Proposed, trigger: Trigger) -> Subsystem | None:
    """Evaluate L3 of (64), its derivative, and κ_ω, χ_ω of (69); None if no step counts."""
    s, rho, lam, near = known.signals, known.rho[:, :3], known.lambda_omega, known.neighbours
    held, delta_hat = s["held"][:, :3], s["demand"][:, :3]
    b1, b2 = (part[:, :3] for part in thresholds(known, trigger))
    p = (delta_hat - held) / (b1 * np.abs(held) + b2)
    D = 1.0 / (1.0 + b1 * p * np.sign(held))  # (30)
    sigma = -b2 * p * D  # (30)
    covered = known.present & np.all(rho > 0.0, axis=1)
    counted = covered & np.all(np.abs(p) <= 1.0 + _ROUNDING, axis=1)
    if not counted.any():
        return None

    G = known.G[counted]
    effect = np.einsum("kij,kj,klj->kil", G, (rho * D)[counted], G)
    g = float(np.linalg.eigvalsh(effect)[:, 0].min())  # g_ω of (63)
    if g <= 0.0:
        return None
    lumped = known.delta_omega + np.einsum("kij,kj->ki", known.G, rho * sigma)
    tau = np.abs(lumped[counted]).max(axis=0)
    beta, gammas = 1.0 / g, (law.gamma_omega1, law.gamma_omega2)
    estimates = {
        "Phi_omega": _Estimate(
            s["Phi_omega"], s["Phi_omega_dot"], 0.0, 1.0 / gammas[0], law.sigma_omega1
        ),
        "beta_omega": _Estimate(
            s["beta_omega"], s["beta_omega_dot"], beta, g / gammas[1], law.sigma_omega2
        ),
    }

    # the terms of (58), (59), (65) and the inequalities, each multiplied by e' or e_ω
    e_prime, e_omega = s["sync_error"][:, 1:], s["e_omega"]
    K1, K2 = in_force(law.K1, known.time_s), in_force(law.K2, known.time_s)
    e_sq = _dot(e_omega, e_omega)
    control = np.einsum("kij,kj->ki", known.G, rho * D * delta_hat)  # G ρ D δ̂
    moved, uncertain, along = (
        _dot(e_omega, control),
        _dot(e_omega, lumped),
        _dot(e_omega, s["zeta_omega"]),
    )
    network = s["Phi_omega"] * s["basis"] * e_sq / (2.0 * law.h_omega1**2)
    robust = e_sq / (2.0 * law.h_omega2**2)
    coupling = lam * _dot(e_prime, solve(known.R2, e_omega))
    h_1, h_2 = 1.5 * law.h_omega1**2, 0.5 * law.h_omega2**2 * float(tau @ tau)
    lemma2 = g * law.eps_omega**0.5
    e_norm = np.sqrt(e_sq)
    sizes = tuple(
        e_norm * np.linalg.norm(part, axis=1)
        for part in (control, lumped, known.omega_dot, known.drift_omega, s["zeta_omega"])
    )
    rates = solve(known.R2, known.omega)
    e_change = law.lambda3 * (rates - s["reference_dot"][:, 1:])
    e_change += law.lambda4 * np.einsum(
        "kjc,j->kc", rates[:, None] - near.attitude_dot, near.weights
    )  # of (32)
    e_decay = _dot(e_prime, K1 * e_prime)
    return _Proof(
        known=known,
        equations=("(65)", "(69)"),
        error=_Error(
            energy=0.5 * (_dot(e_prime, e_prime) + e_sq),  # (55), (64)
            change=coupling - e_decay + _dot(e_omega, known.omega_dot - s["omega_d_dot"]),  # (58)
            decay=e_decay + _dot(e_omega, K2 * e_omega),
            rate=2.0 * np.minimum(K1.min(axis=1), K2.min(axis=1)),
        ),
        estimates=estimates,
        before=(along, -network, -robust, moved, uncertain),
        cancelled=(coupling, *sizes),
        slack={
            "(61), network": np.full(len(p), h_1),  # all of it: W*ᵀς = 0
            "(61), uncertainty": h_2 + robust - uncertain,
            "(66)": lemma2 - g * s["beta_omega"] * along - moved,
        },
        parts={"eps_omega": lemma2, "h_omega1": h_1, "h_omega2": h_2},
        covered=covered,
        counted=counted,
        jumps=np.diff(K1, axis=0).any(axis=1) | known.wraps,  # ω_d (57) jumps with K1
        equalities=[
            compare(
                "(58)",
                "e'ᵀ · rate of e'",
                _dot(e_prime, e_change),
                -e_decay,
                coupling,
                where=known.reported,
                time_s=known.time_s,
                cancelled=(_norm(e_prime) * lam * (_norm(rates) + _norm(s["omega_d"])),),
            ),
            compare(
                "(59)",
                "e_ωᵀ · rate of e_ω",
                _dot(e_omega, known.omega_dot - s["omega_d_dot"]),
                _dot(e_omega, known.drift_omega),
                moved,
                uncertain,
                -_dot(e_omega, s["omega_d_dot"]),
                where=known.present,
                time_s=known.time_s,
                cancelled=sizes,
            ),
        ],
        constants={
            "lambda_prime": lam,
            "g_omega": g,
            "beta_omega": beta,
            "tau_bar_rad_s2": tau.tolist(),
            "omega_d_filter_error_rad_s2": _filter_error(known, K1, counted),
        },
    ).subsystem()


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    product: np.ndarray = (a * b).sum(axis=1)
    return product


def _norm(a: np.ndarray) -> np.ndarray:
    norm: np.ndarray = np.linalg.norm(a, axis=1)
    return norm


def _filter_error(known: Known, K1: np.ndarray, counted: np.ndarray) -> list[float]:
    """Return the largest difference of filtered and true ω̇_d by axis, where K1 is constant."""
    signals = known.signals
    steady = counted[:-1] & ~np.diff(K1, axis=0).any(axis=1)
    true = np.diff(signals["omega_d"], axis=0) / np.diff(known.time_s)[:, None]
    error = np.abs(signals["omega_d_dot"][:-1] - true)[steady & counted[1:]]
    largest: list[float] = error.max(axis=0, initial=0.0).tolist()
    return largest


def _at_last(values: dict[str, Any], counted: np.ndarray) -> dict[str, float]:
    """Return values, each a number or an array over steps, at the last counted step."""
    last = np.flatnonzero(counted)[-1]
    return {
        name: float(np.broadcast_to(value, counted.shape)[last]) for name, value in values.items()
    }
