"""The section of a campaign's report that compares its variants on the same draws."""

from collections.abc import Iterator, Sequence

import numpy as np

from ftc_lab.campaigns import statistics
from ftc_lab.campaigns.findings import FIGURES, Findings
from ftc_lab.campaigns.samples import Sample, same_draws
from ftc_lab.reports.markdown import interval, p_value, render


def comparisons(findings: Findings) -> str:
    """Return tables of every variant against the first one, and what they mean."""
    if not findings.is_sample:
        return "The points are not independent draws: tests would say nothing about them.\n"
    first, *others = findings.counted.values()
    pairs = [pair for other in others if (pair := same_draws(first, other)) is not None]
    if not pairs:
        return "No two variants have flown the same draws.\n"
    success = [statistics.compare_paired_successes(old.success, new.success) for old, new in pairs]
    figures = [
        (new.variant, title, statistics.compare_paired_costs(old.cost(figure), new.cost(figure)))
        for old, new in pairs
        for figure, title in FIGURES.items()
    ]
    p_values = [found.p_value for found in success]
    adjusted = statistics.holm([*p_values, *(found.p_value for _, _, found in figures)])
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
    return render(
        "comparisons.md",
        against=f"against `{first.variant}`",
        success=of_success,
        figures=of_figures,
        tests=len(adjusted),
        survivors=list(_of_survivors(pairs)),
    )


def _of_success(found: statistics.SuccessComparison, adjusted: float) -> Sequence[object]:
    return [
        found.new[1],
        found.only_new,
        found.only_old,
        "-" if found.share is None else interval(found.share, "probability"),
        p_value(found.p_value),
        p_value(adjusted),
        interval(found.difference, "probability"),
    ]


def _of_survivors(pairs: list[tuple[Sample, Sample]]) -> Iterator[list[str]]:
    for old, new in pairs:
        for figure, title in FIGURES.items():
            first, second = old.cost(figure), new.cost(figure)
            both = int((np.isfinite(first) & np.isfinite(second)).sum())
            yield [
                f"`{new.variant}`",
                title,
                f"{both} of {len(old)}",
                interval(statistics.mean_difference(first, second)),
                interval(statistics.median_difference(first, second)),
            ]
