"""A gate between two campaigns: conditions under which the new one fails."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from pydantic import Field

from ftc_lab.campaigns import statistics
from ftc_lab.campaigns.conditions import (
    EVENTS,
    Condition,
    counted,
    happened,
    parse_condition,
    parsed,
)
from ftc_lab.campaigns.samples import Sample, higher_is_better, same_draws
from gcs.console.errors import BadInput
from mavlink_defs.config.models import Model
from mavlink_defs.config.quantity import quantity

DEFAULT = "worse p(success) at 95 %"
"""Condition of a gate for which none is named."""


class Worse(Model):
    """The new campaign is worse in a probability or a figure, by a test with a confidence.

    Attributes:
        confidence_percent: Confidence of the test.
    """

    figure: str = Field(min_length=1)
    confidence_percent: float = quantity("%", ge=50.0, lt=100.0)

    @property
    def event(self) -> str | None:
        """Event whose probability is compared; None for a figure."""
        name = self.figure.removeprefix("p(").removesuffix(")").strip()
        return name if self.figure.startswith("p(") else None

    @property
    def error(self) -> float:
        """Permitted probability of a false alarm."""
        return 1.0 - self.confidence_percent / 100.0

    def __str__(self) -> str:
        return f"worse {self.figure} at {self.confidence_percent:g} %"


Rule: TypeAlias = Worse | Condition
"""Something under which a campaign fails."""


@dataclass(frozen=True)
class Check:
    """A rule applied to one variant.

    Attributes:
        variant: Name of the variant.
        rule: The rule, as users write it.
        violated: Whether the gate is closed.
        text: What was found, in a sentence.
    """

    variant: str
    rule: str
    violated: bool
    text: str


def parse_rules(texts: Iterable[str], samples: Iterable[Sample]) -> list[Rule]:
    """Read rules, and check that their figures exist.

    Args:
        texts: Each "worse p(EVENT) at NUMBER %", "worse FIGURE at NUMBER %", or a condition on the
            new campaign as of `parse_condition`.
        samples: What they will be applied to.

    Raises:
        BadInput: Everything that is wrong with them.
    """
    rules: list[Rule] = []
    problems: list[BadInput] = []
    known = list(samples)
    for text in texts:
        try:
            rules.append(_parse_rule(text, known))
        except BadInput as problem:
            problems.append(problem)
    if problems:
        raise BadInput("\n".join(map(str, problems)), problems[0].hint)
    return rules


def _parse_rule(text: str, samples: Sequence[Sample]) -> Rule:
    if text.split(maxsplit=1)[:1] != ["worse"]:
        try:
            return parse_condition(text, "--fail-if")
        except BadInput as problem:
            raise BadInput(str(problem), f"{problem.hint}; or as in {DEFAULT!r}") from None
    figure, at, confidence = text.removeprefix("worse").rpartition(" at ")
    parts = {"figure": figure.strip(), "confidence_percent": confidence.strip().removesuffix("%")}
    if not at or not confidence.rstrip().endswith("%"):
        raise BadInput(
            f"--fail-if is {text!r}, expected 'worse FIGURE at NUMBER %'", f"as in {DEFAULT!r}"
        )
    rule = parsed(Worse, parts, text, "--fail-if")
    if rule.event is None:
        for sample in samples:
            sample.cost(rule.figure)
    elif rule.event not in EVENTS:
        raise BadInput(
            f"--fail-if {text!r}: {rule.event!r} is no event, expected one of {', '.join(EVENTS)}",
            f"as in {DEFAULT!r}",
        )
    return rule


def gate(
    old: Mapping[str, Sample], new: Mapping[str, Sample], rules: Sequence[Rule]
) -> list[Check]:
    """Apply rules to every variant.

    The permitted probability of a false alarm of a "worse" rule is divided by the number of
    variants it compares (Bonferroni), so that it holds for all of them together.

    Args:
        old: Flights of the campaign to compare with, by variant.
        new: Flights of the campaign in question; further variants are not compared.
        rules: What would make it fail.
    """
    checks = []
    common = [name for name in old if name in new]
    for rule in rules:
        if isinstance(rule, Condition):
            checks += [_absolute(rule, sample) for sample in new.values()]
        else:
            checks += [_relative(rule, old[name], new[name], len(common)) for name in common]
    return checks


def _absolute(rule: Condition, new: Sample) -> Check:
    count, flights = int(happened(rule.event, new.outcome).sum()), len(new)
    both_tails = 1.0 - 2.0 * rule.error  # for one-sided limits
    found = statistics.proportion(count, flights, both_tails)
    shown = found.high < rule.probability if rule.relation == "<" else found.low > rule.probability
    limit = f"at most {found.high:.4f}" if rule.relation == "<" else f"at least {found.low:.4f}"
    return Check(
        new.variant,
        str(rule),
        shown,
        f"{counted(rule.event)} in {count} of {flights} flights; p is {limit} at "
        f"{rule.confidence_percent:g} % (Clopper and Pearson)",
    )


def _relative(rule: Worse, old: Sample, new: Sample, variants: int) -> Check:
    limit = rule.error / variants
    pair = same_draws(old, new)
    paired = pair is not None
    left = 0
    if pair is not None:
        left = len(old) + len(new) - 2 * len(pair[0])
        old, new = pair
    draws = f"the same {len(old)} draws" if paired else "different draws"
    if left:
        draws += f" ({left} flights without a partner left out)"
    compared = _event if rule.event else _cost
    p_value, text = compared(rule, old, new, paired, 1.0 - 2.0 * limit)
    shared = "" if variants == 1 else f" ({rule.error:.3g} shared by {variants} variants)"
    return Check(
        new.variant,
        str(rule),
        p_value <= limit,
        f"{text}, {draws}; p = {p_value:.3g}, limit {limit:.3g}{shared}",
    )


def _counts(worse: int, better: int, share: statistics.Estimate, level: float) -> str:
    """Return in how many draws the new flights are worse, with limits that belong to the test."""
    text = f"worse in {worse} draws, better in {better}"
    if worse + better == 0:
        return text
    low, value, high = (100.0 * each for each in (share.low, share.value, share.high))
    return f"{text}: worse in {value:.1f} % of these [{low:.1f} %, {high:.1f} %], {_each(level)}"


def _each(level: float) -> str:
    return f"limits at {50.0 * (1.0 + level):.6g} % each"


def _event(rule: Worse, old: Sample, new: Sample, paired: bool, level: float) -> tuple[float, str]:
    event = rule.event or ""
    before, after = happened(event, old.outcome), happened(event, new.outcome)
    good = (before, after) if event == "success" else (~before, ~after)
    compare = statistics.compare_paired_successes if paired else statistics.compare_successes
    found = compare(*good, "worse", level)
    counts = (
        f"{counted(event)} in {after.sum()} of {len(after)} flights, "
        f"was {before.sum()} of {len(before)}"
    )
    if found.only_old is not None and found.only_new is not None:
        worse = statistics.proportion(found.only_old, found.only_old + found.only_new, level)
        counts += f"; {_counts(found.only_old, found.only_new, worse, level)}"
    change = found.difference
    return found.p_value, (
        f"{counts}; {'success' if event == 'success' else 'its absence'} changed by "
        f"{100.0 * change.value:+.1f} points [{100.0 * change.low:+.1f}, "
        f"{100.0 * change.high:+.1f}], {_each(level)}; {found.test}"
    )


def _cost(rule: Worse, old: Sample, new: Sample, paired: bool, level: float) -> tuple[float, str]:
    before, after = old.cost(rule.figure), new.cost(rule.figure)
    found = (
        statistics.compare_paired_costs(before, after, "worse", level)
        if paired
        else statistics.compare_costs(before, after, "worse")
    )
    if found.worse is not None and found.better is not None:
        counts = _counts(found.worse, found.better, found.share, level)
    else:
        counts = f"worse with a probability of {100.0 * found.share.value:.1f} %, equal ones half"
    sign = -1.0 if higher_is_better(rule.figure) else 1.0
    medians = (sign * statistics.quantile(costs, 0.5).value for costs in (after, before))
    what = "draws" if paired else "flights"
    return found.p_value, (
        "median {:.4g}, was {:.4g}; ".format(*medians)
        + f"{counts}; {found.test}; {found.failed} of {found.flights} {what} with a failure, "
        "ranked worst"
    )
