"""The result of a check in plain sentences."""

from collections.abc import Iterator

from ftc_autopilot.control.triggers import trigger_of
from ftc_lab.theory.check import Theory
from ftc_lab.theory.judgement import Hypotheses, Judgement, Rate, TheoremVerdict

ASSUMPTIONS = (
    "The ideal weights W* are taken as 0: the proofs hold for any W*, so Φ_v = Φ_ω = 0, and all "
    "that is uncertain (Δ + d, for the attitude also the trigger's σ' of (59)) is approximation "
    "error, with τ̄ its measured supremum by axis.",
    "ρ, faults, disturbances and the true aircraft are read from the scenario, applied "
    "deflections and thrust from the flight. g_v, g_ω and τ̄ are extrema along this flight, so "
    "the bounds hold for this flight and are not known before it.",
    "g_v is made of sup |ϖ|, which (46) needs, and not of sup ϖ as printed; χ_v has β²/2, as "
    "(53), and not the β² of the line before it.",
    "The laws differ from the proofs in this: ω̇_d comes from a first-order filter, neighbours' "
    "data are one period old, commands are held over a period and stop at limits, estimates "
    "and filters advance by explicit Euler. Finite differences of V_L contain all of it; the "
    "equalities and the chain rule take r_v, ω̇_d and the neighbours' reports as the laws have "
    "them, as the proofs do.",
    "A flight that begins with a command at a stop counts from where it leaves it.",
)
"""Assumptions where the paper leaves something open or the flight differs from it."""

NOT_CHECKED = (
    "The ideal weights, and with them Φ as a quantity of its own: no simulation knows them.",
    "Differentiability of T̂ and δ̂, which both Zeno proofs need. It does not hold: T̂ contains "
    "the neighbours' V̇_j by r_v, which jumps at every thrust event of theirs (T̂ then jumps by "
    "λ2 a_ij/λ times the change of their thrust while tanh in (33) is saturated), and ω_d jumps "
    "when K1 switches, δ̂ also when K2 does. With jumps there is no finite µ in continuous time, "
    "so the proofs as printed do not exclude Zeno behaviour.",
    "Dwell times in continuous time: nothing between two control steps is evaluated.",
    "Steps outside the hypotheses: actuators without any effectiveness (ρ = 0), for which β = 1/ρ "
    "does not exist although the paper counts stuck faults among the cases, and commands beyond "
    "the trigger's threshold, |p| > 1, as at a stop, where (26) fails. Equalities hold there as "
    "well and are compared; inequalities are not.",
    "Limits for t → ∞: a flight is finite.",
)
"""Limits of the check."""

_NAMES = {"speed": ("(53)", "|Ṽ'|"), "attitude": ("(69)", "‖e'‖")}


def theory_sentences(theory: Theory) -> list[str]:
    """Return sentences on what `check_theory` found, assumed and did not check."""
    sentences = [*_missing(theory), *_dwell(theory), *_residual(theory)]
    if not theory.uavs:
        return sentences
    if theory.proofs_absent is not None:
        return [*sentences, f"Proofs of (53), (69): not checked; {theory.proofs_absent}."]
    for subsystem in _NAMES:
        sentences += _proof(theory, subsystem)
    sentences += [f"Assumption: {text}" for text in ASSUMPTIONS]
    return [*sentences, *(f"Not checked: {text}" for text in NOT_CHECKED)]


def _missing(theory: Theory) -> Iterator[str]:
    missing = {uav.id: uav.missing_steps for uav in theory.uavs if uav.missing_steps}
    if missing:
        listed = ", ".join(f"{steps} of UAV {i}" for i, steps in missing.items())
        yield f"Steps that are missing in the record, and left out of everything: {listed}."


def _dwell(theory: Theory) -> Iterator[str]:
    period = theory.period_s
    if not trigger_of(theory.trigger_mode).BY_THRESHOLD:
        yield (
            f"Trigger {theory.trigger_mode}: no event depends on the thresholds of (25), (29); no "
            "dwell time to bound."
        )
        return
    channels = [channel for uav in theory.uavs for channel in uav.dwell.values()]
    checked = [c for c in channels if c["held"] is not None and c["bound_s"] is not None]
    if not checked:
        yield "No channel had two events: no interval to compare with a bound."
        return
    shortest, bounds = min(c["min_interval_s"] for c in checked), [c["bound_s"] for c in checked]
    intervals = sum(c["intervals"] for c in checked)
    single = sum(c["intervals_of_one_period"] for c in checked)
    yield (
        f"Smallest interval between two events of a channel: {_time(shortest)}; {single} of "
        f"{intervals} intervals are one control period, {_time(period)}, below which a sampled "
        "trigger cannot go."
    )
    under = sum(c["bound_below_period"] for c in checked)
    below = sum(c["intervals_below_bound"] for c in checked)
    verdict = "no interval is" if below == 0 else f"{below} intervals are"
    yield (
        f"Zeno bounds a2/µ, b2/µ with the measured µ: {_time(min(bounds))} to "
        f"{_time(max(bounds))}, {under} of {len(bounds)} below the control period; {verdict} "
        "shorter than its bound. µ is measured on the very commands that are compared, so this "
        "says that the triggers do what they should"
        + (", and a bound below the period says nothing that sampling does not." if under else ".")
    )


def _residual(theory: Theory) -> Iterator[str]:
    for number in range(max((len(uav.residual) for uav in theory.uavs), default=0)):
        parts = [uav.residual[number] for uav in theory.uavs]
        tracking, synchronisation = (
            ", ".join(
                f"{name} {_largest([part[kind][f'{name}_{unit}'] for part in parts])}"
                for name, unit in _QUANTITIES.items()
            )
            for kind in ("tracking", "synchronisation")
        )
        first = parts[0]
        yield (
            f"Segment {number + 1}, over ({first['from_s']:g}, {first['end_s']:g}] s, largest of "
            f"all UAVs [m/s, deg]: tracking error {tracking}; synchronisation error (31), (32) "
            f"{synchronisation}."
        )


_QUANTITIES = {"airspeed": "m_s", "roll": "deg", "pitch": "deg", "yaw": "deg"}


def _proof(theory: Theory, subsystem: str) -> Iterator[str]:
    equation, _ = _NAMES[subsystem]
    judged = {uav.id: uav.proofs[subsystem] for uav in theory.uavs}
    verdicts = "; ".join(
        f"{verdict} for UAV {', '.join(str(i) for i in ids)}"
        for verdict in TheoremVerdict
        if (ids := [i for i, part in judged.items() if part.verdict is verdict])
    )
    yield f"{equation}, V̇_L ≤ -κ V_L + χ of the {subsystem} subsystem: {verdicts}."
    yield from _equalities(subsystem, judged)
    for i, part in judged.items():
        if not part.hypotheses.met:
            yield f"UAV {i} left the hypotheses of {equation}: {_left(part.hypotheses)}."
        if part.contradicted:
            yield f"UAV {i} contradicts, within the hypotheses: {', '.join(part.contradicted)}."
    yield from _certificates(theory, subsystem, judged)


def _equalities(subsystem: str, judged: dict[int, Judgement]) -> Iterator[str]:
    compared = [(i, e) for i, part in judged.items() for e in part.equalities if e.steps]
    violated = [(i, e) for i, e in compared if e.violated]
    listed = "; ".join(
        f"UAV {i}: {e.equation} {e.quantity} in {e.violated} of {e.steps} steps, "
        f"most at {e.at_s:g} s"
        for i, e in violated
    )
    names = {(e.equation, e.quantity) for _, e in compared}
    largest = max((e.largest for _, e in compared if e.largest is not None), default=0.0)
    yield (
        f"Equalities of the {subsystem} subsystem, of the laws and of the proof, {len(names)} per "
        "UAV: "
        + (f"VIOLATED. {listed}." if violated else "all hold to rounding.")
        + f" Largest deviation: {largest:.2g} of the summands."
    )
    skipped = sorted(
        {e.equation for part in judged.values() for e in part.equalities if not e.steps}
    )
    if skipped:
        yield (
            f"Not compared: {', '.join(skipped)} with neighbours' reports or applied commands; "
            "in real time their age is not recorded."
        )


def _left(hypotheses: Hypotheses) -> str:
    steps = hypotheses.steps
    reasons = []
    if hypotheses.from_s is None:
        reasons.append("no step met them")
    if hypotheses.at_stop:
        reasons.append(f"a command beyond its stop in {hypotheses.at_stop / steps:.2%} of steps")
    for actuator, count in hypotheses.no_effectiveness.items():
        reasons.append(f"Assumption 2, {actuator} at ρ = 0 in {count / steps:.2%} of steps")
    if hypotheses.beyond_bound:
        reasons.append(f"V_L above χ/κ in {hypotheses.beyond_bound / steps:.2%} of steps")
    if hypotheses.assumption_1 is not None and hypotheses.assumption_1 >= 1.0:
        reasons.append(f"Assumption 1, its norm is {hypotheses.assumption_1:.3g} and not below 1")
    return ", ".join(reasons)


def _certificates(theory: Theory, subsystem: str, judged: dict[int, Judgement]) -> Iterator[str]:
    equation, symbol = _NAMES[subsystem]
    found = {i: part.certificate for i, part in judged.items() if part.certificate is not None}
    if not found:
        return
    differences = [part.finite_difference for part in found.values()]
    rules = [part.chain_rule for part in found.values()]
    if any(rate.steps for rate in differences):
        yield (
            f"Within the hypotheses {equation} held by finite differences in "
            f"{_satisfied(differences)} of {sum(d.steps for d in differences)} steps "
            f"({sum(part.jumps for part in found.values())} jumps of V_L itself left out: ρ or K1 "
            f"switches, an angle wraps), by the chain rule in {_satisfied(rules)}. Largest "
            f"(V̇_L + κ V_L)/χ: {_use(differences):.2g} and {_use(rules):.2g} (1 is the bound)."
        )
    names = next(iter(found.values())).slack
    given = {
        name: sum(part.slack[name].mean for part in found.values()) / len(found) for name in names
    }
    used = sum(part.used for part in found.values()) / len(found)
    yield (
        f"Of χ each inequality gives away, mean over steps and UAVs: "
        f"{', '.join(f'{name} {share:.2%}' for name, share in given.items())}; "
        f"V̇_L + κ V_L is the remaining {used:.2%}."
    )
    bounded = {i: p for i, p in found.items() if p.ultimate_bound is not None}
    ended = [p.sup_last_3s for p in bounded.values() if p.sup_last_3s is not None]
    errors = [p.error_sup_last_3s for p in bounded.values() if p.error_sup_last_3s is not None]
    if not ended or not errors:
        yield f"No ultimate bound of {equation} to compare: κ is 0, or at the end there is no V_L."
        return
    loosest = max(bounded.values(), key=lambda part: part.ultimate_bound or 0.0)
    summand = max(loosest.chi_parts, key=lambda name: loosest.chi_parts[name])
    yield (
        f"Ultimate bound χ/κ of the {subsystem} subsystem {loosest.ultimate_bound:.4g}, largest "
        f"V_L of the last 3 s {max(ended):.4g}. It promises {symbol} ≤ {loosest.error_bound:.3g} "
        f"{loosest.error_unit}; flown: {max(errors):.3g} {loosest.error_unit}. The time constant "
        f"1/κ is {1.0 / loosest.kappa_1_s:.3g} s, the flight {theory.duration_s:g} s. Of χ = "
        f"{loosest.chi:.4g} the summand with {summand} makes {loosest.chi_parts[summand]:.4g}."
    )


def _satisfied(rates: list[Rate]) -> str:
    held = sum((rate.satisfied or 0.0) * rate.steps for rate in rates)
    return f"{100.0 * held / sum(rate.steps for rate in rates):.4g} %"


def _use(rates: list[Rate]) -> float:
    return max(rate.largest_use for rate in rates if rate.largest_use is not None)


def _largest(values: list[float | None]) -> str:
    known = [value for value in values if value is not None]
    return f"{max(known):.3g}" if known else "-"


def _time(seconds: float) -> str:
    return f"{1e3 * seconds:.3g} ms" if seconds >= 1e-3 else f"{1e6 * seconds:.3g} µs"
