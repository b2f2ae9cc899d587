"""One subsystem of one UAV, judged: equalities, hypotheses, and the inequality of its theorem."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from ftc_lab.theory.equality import ROUNDING, Equality
from ftc_lab.theory.ground_truth import Known
from ftc_lab.theory.lyapunov import Subsystem
from mavlink_defs.constants import ACTUATORS

_END_S = 3.0


class TheoremVerdict(StrEnum):
    """The outcome of a theorem's premises and conclusion; the first that applies."""

    VIOLATED = "equalities violated"  # the flight was not flown by the paper's equations
    CONTRADICTED = "contradicted"  # an inequality of the proof fails within its hypotheses
    LEFT = "left the hypotheses"  # the theorem makes no statement about this flight as a whole
    HELD = "held"


@dataclass(frozen=True)
class Hypotheses:
    """Whether a flight met the theorem's hypotheses.

    Attributes:
        steps: Recorded steps.
        from_s: First instant at which all was met; the theorem counts from there. None if never.
        at_stop: Steps from there on at which a command was beyond the trigger's threshold,
            |p| > 1 in (26), (30), because an actuator stood at its stop.
        no_effectiveness: Steps at which ρ = 0, by actuator; those with none are left out.
        beyond_bound: Steps from there on at which V_L was above both χ/κ and its value then.
        assumption_1: Largest ‖ΔJ⁻¹C ρ (J0⁻¹C0)⁻¹‖∞, to be below 1; None for the speed.
        assumption_2: Smallest λ_min(J0⁻¹C0 ρ (J0⁻¹C0)ᵀ), to be above 0; None for the speed.
    """

    steps: int
    from_s: float | None
    at_stop: int
    no_effectiveness: dict[str, int]
    beyond_bound: int
    assumption_1: float | None
    assumption_2: float | None

    @property
    def met(self) -> bool:
        """Whether they were met from `from_s` to the end, and ρ > 0 throughout."""
        return (
            self.from_s is not None
            and self.at_stop == 0
            and not self.no_effectiveness
            and self.beyond_bound == 0
            and (self.assumption_1 is None or self.assumption_1 < 1.0)
        )


@dataclass(frozen=True)
class Rate:
    """V̇_L against its bound -κ V_L + χ at a set of steps; None where there is no step.

    Attributes:
        steps: How many.
        satisfied: Share of them.
        largest_excess: Of V̇_L over its bound, per s; negative: the smallest margin.
        at_s: When.
        largest_use: Largest (V̇_L + κ V_L)/χ; above 1 contradicts.
    """

    steps: int
    satisfied: float | None
    largest_excess: float | None
    at_s: float | None
    largest_use: float | None


@dataclass(frozen=True)
class Slack:
    """Share of χ that one inequality of the proof gives away, over the counted steps."""

    mean: float
    smallest: float


@dataclass(frozen=True)
class Certificate:
    """A theorem's bound for a flight, and how much of it the flight used.

    V_L, χ and what is made of them have V_L's unit, in which the paper adds unlike quantities.

    Attributes:
        kappa_1_s: κ at the last counted step.
        chi: χ there.
        chi_parts: Its summands.
        ultimate_bound: χ/κ; None if κ = 0.
        initial: V_L at the first step at which it exists.
        largest: Largest V_L.
        sup_last_3s: The same over the last 3 s; None if there is none.
        error_bound: The bound that follows for |Ṽ'| or ‖e'‖: sqrt(2χ/κ).
        error_sup_last_3s: Largest |Ṽ'| or ‖e'‖ of the last 3 s.
        error_unit: Of both, m/s or deg.
        finite_difference: Of V_L from step to step, at the counted steps.
        chain_rule: V̇_L at the start of each period, at the counted steps.
        slack: By inequality.
        used: Mean (V̇_L + κ V_L)/χ by the chain rule; with all `slack` means it makes 1.
        jumps: Counted steps left out of `finite_difference` because V_L jumps by definition.
        constants: The constants in κ and χ.
    """

    kappa_1_s: float
    chi: float
    chi_parts: dict[str, float]
    ultimate_bound: float | None
    initial: float
    largest: float
    sup_last_3s: float | None
    error_bound: float | None
    error_sup_last_3s: float | None
    error_unit: str
    finite_difference: Rate
    chain_rule: Rate
    slack: dict[str, Slack]
    used: float
    jumps: int
    constants: dict[str, float | list[float]]


@dataclass(frozen=True)
class Judgement:
    """One subsystem of one UAV.

    Attributes:
        verdict: In one word.
        equalities: The laws' definitions and the proof's equalities.
        hypotheses: Whether the theorem applies.
        contradicted: Inequalities of the proof that fail at counted steps.
        certificate: None if no step meets the hypotheses.
    """

    verdict: TheoremVerdict
    equalities: list[Equality]
    hypotheses: Hypotheses
    contradicted: list[str]
    certificate: Certificate | None


def judge(
    known: Known,
    channels: Sequence[int],
    subsystem: Subsystem | None,
    definitions: Sequence[Equality],
    error: np.ndarray,
    unit: str,
) -> Judgement:
    """Judge a subsystem.

    Args:
        known: The flight.
        channels: Its actuators.
        subsystem: None if no step counts.
        definitions: Equalities that are not in `subsystem`.
        error: |Ṽ'| or the norm of e', (n,).
        unit: Of the error.
    """
    if subsystem is None:
        equalities, contradicted, certificate = list(definitions), [], None
    else:
        equalities = [*definitions, *subsystem.equalities]
        certificate = _certificate(known, subsystem, error, unit)
        contradicted = [
            equation for equation, slack in certificate.slack.items() if slack.smallest < -ROUNDING
        ]
        if (certificate.finite_difference.satisfied or 1.0) < 1.0:
            contradicted.append("V̇_L ≤ -κ V_L + χ by finite differences")
    hypotheses = _hypotheses(known, channels, subsystem)
    if any(equality.violated for equality in equalities):
        verdict = TheoremVerdict.VIOLATED
    elif contradicted:
        verdict = TheoremVerdict.CONTRADICTED
    else:
        verdict = TheoremVerdict.HELD if hypotheses.met else TheoremVerdict.LEFT
    return Judgement(verdict, equalities, hypotheses, contradicted, certificate)


def _hypotheses(known: Known, channels: Sequence[int], subsystem: Subsystem | None) -> Hypotheses:
    rho = known.rho[:, channels]
    stuck = {
        ACTUATORS[channel]: int(np.count_nonzero(known.present & (rho[:, k] == 0.0)))
        for k, channel in enumerate(channels)
    }
    assumption_1 = assumption_2 = None
    if len(channels) > 1 and known.present.any():
        assumption_1, assumption_2 = _assumptions(known, rho[known.present])
    first = at_stop = beyond = 0
    if subsystem is not None:
        first = int(np.flatnonzero(subsystem.counted)[0])
        after = np.arange(len(known.present)) >= first
        at_stop = int(np.count_nonzero(after & subsystem.covered & ~subsystem.counted))
        with np.errstate(all="ignore"):
            bound = np.maximum(subsystem.chi / subsystem.kappa, subsystem.V_L[first])
            beyond = int(np.count_nonzero(after & subsystem.covered & (bound < subsystem.V_L)))
    return Hypotheses(
        steps=int(np.count_nonzero(known.present)),
        from_s=None if subsystem is None else float(known.time_s[first]),
        at_stop=at_stop,
        no_effectiveness={name: steps for name, steps in stuck.items() if steps},
        beyond_bound=beyond,
        assumption_1=assumption_1,
        assumption_2=assumption_2,
    )


def _assumptions(known: Known, rho: np.ndarray) -> tuple[float, float]:
    """Norm of Assumption 1 and eigenvalue of Assumption 2, their worst over present steps."""
    nominal, V = known.G_nominal, known.signals["V"][known.present]
    rows, row = np.unique(rho, axis=0, return_inverse=True)
    errors = known.G_error @ (rows[:, :, None] * np.linalg.inv(nominal))
    effect = np.linalg.eigvalsh(nominal @ (rows[:, :, None] * nominal.T))[:, 0]
    effect[(rows == 0.0).any(axis=1)] = 0.0  # but for rounding
    return float(np.abs(errors).sum(axis=2).max()), float((V**4 * effect[row.ravel()]).min())


def _certificate(known: Known, s: Subsystem, error: np.ndarray, unit: str) -> Certificate:
    time_s, at = known.time_s, np.flatnonzero(s.counted)
    last = at[-1]
    kappa, chi = float(s.kappa[last]), float(s.chi[last])
    ultimate = chi / kappa if kappa > 0.0 else None
    at_end = s.covered & (time_s > time_s[-1] - _END_S)
    adjacent = s.counted[:-1] & s.covered[1:]
    shares = {name: (slack / s.chi)[at] for name, slack in s.slack.items()}
    return Certificate(
        kappa_1_s=kappa,
        chi=chi,
        chi_parts=s.chi_parts,
        ultimate_bound=ultimate,
        initial=float(s.V_L[s.covered][0]),
        largest=float(s.V_L[s.covered].max()),
        sup_last_3s=_largest(s.V_L[at_end]),
        error_bound=None if ultimate is None else _error_bound(ultimate, unit),
        error_sup_last_3s=_largest(error[known.present & (time_s > time_s[-1] - _END_S)]),
        error_unit=unit,
        finite_difference=_rate(s, adjacent & ~s.jumps, np.diff(s.V_L) / known.period_s, time_s),
        chain_rule=_rate(s, s.counted, s.V_L_dot, time_s),
        slack={name: Slack(float(v.mean()), float(v.min())) for name, v in shares.items()},
        used=float(((s.V_L_dot + s.kappa * s.V_L) / s.chi)[at].mean()),
        jumps=int(np.count_nonzero(s.jumps & adjacent)),
        constants=s.constants,
    )


def _rate(s: Subsystem, where: np.ndarray, rate: np.ndarray, time_s: np.ndarray) -> Rate:
    """Compare V̇_L with its bound at the steps of a mask; mask and rate may lack the last one."""
    at = np.flatnonzero(where)
    if not len(at):
        return Rate(0, None, None, None, None)
    decay, chi = s.kappa[at] * s.V_L[at], s.chi[at]
    excess = rate[at] + decay - chi
    worst = int(excess.argmax())
    return Rate(
        steps=len(at),
        satisfied=float((excess <= 0.0).mean()),
        largest_excess=float(excess[worst]),
        at_s=float(time_s[at[worst]]),
        largest_use=float(((rate[at] + decay) / chi).max()),
    )


def _error_bound(ultimate: float, unit: str) -> float:
    """Return the error's bound under V_L <= χ/κ: half its square is one of V_L's summands."""
    bound = math.sqrt(2.0 * ultimate)
    return math.degrees(bound) if unit == "deg" else bound


def _largest(values: np.ndarray) -> float | None:
    return float(values.max()) if len(values) else None
