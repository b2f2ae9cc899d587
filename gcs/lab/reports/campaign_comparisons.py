"""The section of a campaign's report that compares its variants on the same draws."""

from collections.abc import Iterator, Sequence

import numpy as np

from gcs.lab.campaigns.findings import FIGURES, Findings
from gcs.lab.campaigns.samples import Sample, same_draws
from gcs.lab.campaigns.statistics import (
    SuccessComparison,
    compare_paired_costs,
    compare_paired_successes,
    holm,
    mean_difference,
    median_difference,
)
from gcs.lab.reports.markdown import interval, p_value, table


def comparisons(findings: Findings) -> str:
    """Return tables of every variant against the first one, and what they mean."""
    if not findings.is_sample:
        return "The points are not independent draws: tests would say nothing about them.\n"
    first, *others = findings.counted.values()
    pairs = [pair for other in others if (pair := same_draws(first, other)) is not None]
    if not pairs:
        return "No two variants have flown the same draws.\n"
    success = [compare_paired_successes(old.success, new.success) for old, new in pairs]
    figures = [
        (new.variant, title, compare_paired_costs(old.cost(figure), new.cost(figure)))
        for old, new in pairs
        for figure, title in FIGURES.items()
    ]
    p_values = [found.p_value for found in success]
    adjusted = holm([*p_values, *(found.p_value for _, _, found in figures)])
    of_success = [
        [f"`{new.variant}`", *_of_success(found, own)]
        for (_, new), found, own in zip(pairs, success, adjusted, strict=False)
    ]
    of_figures = [
        [
            f"`{variant}`",
            title,
            *(found.flights, found.worse, found.better),
            interval(found.share, "probability"),
            *(p_value(found.p_value), p_value(own)),
        ]
        for (variant, title, found), own in zip(figures, adjusted[len(success) :], strict=True)
    ]
    against, tests = f"against `{first.variant}`", ["p", "p, adjusted"]
    head = [against, "draws", "only it succeeds", "only the other", "only it, of these [95 %]"]
    costs = [against, "figure", "draws", "worse", "better", "worse, of these [95 %]", *tests]
    conditional = [against, "figure", "draws both survived", "mean difference [95 %]"]
    return (
        "The same draws, flown by both; no draw is left out. Success:\n\n"
        + table([*head, *tests, "difference [95 %]"], of_success)
        + "\nFigures, of which a failure is worse than any:\n\n"
        + table(costs, of_figures)
        + f"\n{_meaning(len(adjusted))}\n"
        + "\n### Of the draws that both survived\n\n"
        + table([*conditional, "difference of medians [95 %]"], _of_survivors(pairs))
        + f"\n{_MEANING_OF_SURVIVORS}\n"
    )


def _of_success(found: SuccessComparison, adjusted: float) -> Sequence[object]:
    return [
        found.new[1],
        found.only_new,
        found.only_old,
        "-" if found.share is None else interval(found.share, "probability"),
        p_value(found.p_value),
        p_value(adjusted),
        interval(found.difference, "probability"),
    ]


def _meaning(tests: int) -> str:
    return (
        "Tests are exact and of all draws in which the two differ: McNemar's test of success, the "
        "sign test of figures, which asks how often one is worse, not by how much. The interval of "
        "a share belongs to its test: it leaves 50 % out where p < 0.05, and only there. The "
        "difference is that of the success probabilities; its interval covers at least as often "
        "as it says, and may include 0 although p is small. p-values are two-sided, and adjusted "
        f"by Holm's method over all {tests} tests of these two tables: if no two variants "
        "differed, any adjusted one would be below 0.05 in at most 5 % of campaigns."
    )


_MEANING_OF_SURVIVORS = (
    "How much larger the figure is where both have it, with bootstrap intervals; not tested. Draws "
    "with a failure are missing, and they are the hardest ones: a difference may have another sign "
    "than over all draws. Mean and median may differ in sign, too, as few large differences move "
    "the mean and not the median."
)


def _of_survivors(pairs: list[tuple[Sample, Sample]]) -> Iterator[list[str]]:
    for old, new in pairs:
        for figure, title in FIGURES.items():
            first, second = old.cost(figure), new.cost(figure)
            both = int((np.isfinite(first) & np.isfinite(second)).sum())
            yield [
                f"`{new.variant}`",
                title,
                f"{both} of {len(old)}",
                interval(mean_difference(first, second)),
                interval(median_difference(first, second)),
            ]
