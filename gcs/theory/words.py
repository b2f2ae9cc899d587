"""The result of a check in plain sentences."""

from collections.abc import Iterator
from typing import Any

__all__ = ["ASSUMPTIONS", "NOT_CHECKED", "theory_words"]

ASSUMPTIONS = (
    "The ideal weights W* are taken as 0: the proofs hold for any W*, so Φ_v = Φ_ω = 0, and all "
    "that is uncertain (Δ + d, for the attitude also the trigger's σ' of (59)) is approximation "
    "error, with τ̄ its measured supremum by axis.",
    "ρ, faults, disturbances and the true aircraft are read from the scenario, applied "
    "deflections and thrust from the flight. g_v, g_ω and τ̄ are extrema along this flight, so "
    "the bounds are those of this flight and not known before it.",
    "g_v is made of sup |ϖ|, which (46) needs, and not of sup ϖ as printed; χ_v has β²/2, as "
    "(53), and not the β² of the line before it.",
    "The laws differ from the proofs in this: ω̇_d comes from a first-order filter, neighbours' "
    "data are one period old, commands are held over a period and stop at limits, estimates "
    "and filters advance by explicit Euler. Finite differences of V_L contain all of it; the "
    "chain rule takes r_v and ω̇_d as the laws have them, as the proofs do.",
)
"""What was taken where the paper leaves open or the flight differs from it."""

NOT_CHECKED = (
    "The ideal weights, and with them Φ as a quantity of its own: no simulation knows them.",
    "Differentiability of T̂ and δ̂, which both Zeno proofs need. It does not hold: T̂ contains "
    "the neighbours' V̇_j by r_v, which jumps at every thrust event of theirs (T̂ then jumps by "
    "λ2 a_ij/λ times the change of their thrust while tanh in (33) is saturated), and ω_d jumps "
    "when K1 switches, δ̂ also when K2 does. With jumps there is no finite µ in continuous time, "
    "so the proofs as printed do not exclude Zeno behaviour.",
    "Dwell times in continuous time: nothing between two control steps is evaluated.",
    "Actuators without any effectiveness (ρ = 0): β = 1/ρ of the proofs does not exist, although "
    "the paper counts stuck faults among the cases. Such steps are left out.",
    "Commands beyond the trigger's threshold, |p| > 1, as at a stop: (26) fails there, and the "
    "proofs know no stops. Such steps are left out and counted.",
    "Assumption 1, which (69) does not use; and limits for t → ∞: a flight is finite.",
)
"""What such a check cannot tell."""

_NAMES = {"speed": ("(53)", "|Ṽ'|", "m_s", "m/s"), "attitude": ("(69)", "‖e'‖", "deg", "deg")}


def theory_words(result: dict[str, Any]) -> list[str]:
    """Say what a result of `check_theory` says: findings, assumptions, what was not checked."""
    words = [*_dwell(result), *_residual(result)]
    if not result["uavs"]:
        return words
    absent = result["uavs"][0]["lyapunov_absent"]
    if absent is not None:
        return [*words, f"Lyapunov inequalities (53), (69): not checked; {absent}."]
    for subsystem in _NAMES:
        words += _lyapunov(result, subsystem)
    words += [f"Assumption: {text}" for text in ASSUMPTIONS]
    return [*words, *(f"Not checked: {text}" for text in NOT_CHECKED)]


def _dwell(result: dict[str, Any]) -> Iterator[str]:
    period = result["period_s"]
    if result["trigger_mode"] == "periodic":
        yield f"No trigger: every channel is sent every {_time(period)}; no dwell time to bound."
        return
    channels = [channel for uav in result["uavs"] for channel in uav["dwell"].values()]
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


def _residual(result: dict[str, Any]) -> Iterator[str]:
    for number in range(max((len(uav["residual"]) for uav in result["uavs"]), default=0)):
        parts = [uav["residual"][number] for uav in result["uavs"]]
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


def _lyapunov(result: dict[str, Any], subsystem: str) -> Iterator[str]:
    equation, symbol, unit, shown = _NAMES[subsystem]
    found = {uav["id"]: uav["lyapunov"][subsystem] for uav in result["uavs"]}
    parts = {i: part for i, part in found.items() if "absent" not in part}
    for i in found.keys() - parts.keys():
        yield f"{equation} was not checked for UAV {i}: {found[i]['absent']}."
    if not parts:
        return
    differences, rules = (
        [part[kind] for part in parts.values()] for kind in ("finite_difference", "chain_rule")
    )
    bad = [str(i) for i, part in parts.items() if part["contradicted"]]
    yield (
        f"{equation}, V̇_L ≤ -κ V_L + χ of the {subsystem} subsystem: "
        + (f"CONTRADICTED by UAV {', '.join(bad)}" if bad else "not contradicted")
        + f"; by finite differences it held in {_percent(differences)} of "
        f"{sum(d['steps'] for d in differences)} steps, by the chain rule in {_percent(rules)}. "
        f"Largest (V̇_L + κ V_L)/χ: {max(d['largest_use'] for d in differences):.2g} and "
        f"{max(r['largest_use'] for r in rules):.2g} (1 is the bound)."
    )
    excluded = [part["excluded"] for part in parts.values()]
    counts = {key: sum(e[key] for e in excluded) for key in excluded[0]}
    yield (
        f"Left out of {equation}: {counts['jump_of_V_L']} jumps of V_L itself (ρ or K1 switches, "
        f"yaw wraps), {counts['command_beyond_threshold']} steps with the command beyond the "
        f"threshold, {counts['no_effectiveness']} with an actuator at ρ = 0, "
        f"{counts['not_finite']} not finite."
    )
    bounded = {i: p for i, p in parts.items() if p["ultimate_bound_held"] is not None}
    if not bounded:
        yield f"No ultimate bound of {equation} to compare: κ is 0, or at the end there is no V_L."
        return
    over = [str(i) for i, part in bounded.items() if not part["ultimate_bound_held"]]
    loosest = max(bounded.values(), key=lambda part: part["ultimate_bound"])
    kappa = loosest["kappa_1_s"]
    part = max(loosest["chi_parts"], key=lambda name: loosest["chi_parts"][name])
    yield (
        f"Ultimate bound χ/κ of the {subsystem} subsystem {loosest['ultimate_bound']:.4g}, largest "
        f"V_L of the last 3 s {max(p['sup_last_3s'] for p in bounded.values()):.4g}"
        + (
            f": exceeded by UAV {', '.join(over)}, counting steps outside the hypotheses."
            if over
            else ": respected."
        )
        + f" It promises {symbol} ≤ {loosest[f'error_bound_{unit}']:.3g} {shown}; flown: "
        f"{max(p[f'error_sup_last_3s_{unit}'] for p in bounded.values()):.3g} {shown}. The time "
        f"constant 1/κ is {1.0 / kappa:.3g} s, the flight {result['duration_s']:g} s. Of χ = "
        f"{loosest['chi']:.4g} the summand with {part} makes {loosest['chi_parts'][part]:.4g}."
    )


def _percent(parts: list[dict[str, Any]]) -> str:
    steps = sum(part["steps"] for part in parts)
    held = sum(part["satisfied"] * part["steps"] for part in parts)
    return f"{100.0 * held / steps:.4g} %"


def _largest(values: list[float | None]) -> str:
    known = [value for value in values if value is not None]
    return f"{max(known):.3g}" if known else "-"


def _time(seconds: float) -> str:
    return f"{1e3 * seconds:.3g} ms" if seconds >= 1e-3 else f"{1e6 * seconds:.3g} µs"
