"""Statistics of campaigns: proportions, quantiles, comparisons on the same draws or on others.

Figures are costs: smaller is better, and a flight that has none, because it was lost or its process
crashed, costs infinity. So no flight is left out of a rank or a quantile: a failure is worse
than every flight that has a figure (worst-rank analysis, Lachin 1999). Means know no infinity;
what they leave out is counted. docs/explanation/campaign-statistics.md has sources and limits.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from scipy import stats

Alternative: TypeAlias = Literal["two-sided", "worse"]
"""Alternative to "no difference": any difference, or that the new flights are worse."""

_RESAMPLES = 9999
_FEWEST_RESAMPLES = 999
_MANY = 1000
"""Pairs from which on the bootstrap is plainer: it is better than the pairs need, and slow."""
_MAX_PAIRS = 20_000
"""Pairs of which a bootstrap of medians takes no more: draws have no order."""


@dataclass(frozen=True)
class Estimate:
    """An estimate with the limits of its confidence interval; infinite where it has none."""

    value: float
    low: float
    high: float


def proportion(count: int, flights: int, level: float = 0.95) -> Estimate:
    """Estimate a probability, with the interval of Clopper and Pearson (1934).

    Args:
        count: Flights with the event.
        flights: All flights, independent draws; with none, nothing is known.
        level: Confidence level of the two-sided interval.
    """
    if flights == 0:
        return Estimate(math.nan, 0.0, 1.0)
    interval = stats.binomtest(count, flights).proportion_ci(level, method="exact")
    return Estimate(count / flights, float(interval.low), float(interval.high))


def flights_needed(coverage: float = 0.95, confidence: float = 0.95) -> int:
    """Return how many flights bound a share of all flights by the worst one (Wilks 1941).

    It is also the number that must all succeed to show a success probability above `coverage`.

    Args:
        coverage: Share of flights to be bounded, in (0, 1).
        confidence: Probability that the worst of the flights bounds them, in (0, 1).

    Returns:
        The smallest n with 1 - coverageⁿ ≥ confidence; 59 for 0.95 and 0.95.
    """
    n = math.ceil(math.log1p(-confidence) / math.log(coverage))
    return n - 1 if n > 1 and 1.0 - coverage ** (n - 1) >= confidence else n


def tolerance_bound(costs: np.ndarray, coverage: float = 0.95, confidence: float = 0.95) -> float:
    """Return a cost that at least a share `coverage` of all flights do not exceed.

    Args:
        costs: Of independent flights, shape (flights,); infinite for failures.
        coverage: The share.
        confidence: Probability that the bound holds, whatever the distribution.

    Returns:
        The smallest order statistic that is such a bound; infinity if none is, because there are
        too few flights (`flights_needed`) or too many failures.
    """
    rank = int(stats.binom.ppf(confidence, len(costs), coverage)) + 1 if len(costs) else 1
    return float(np.sort(costs)[rank - 1]) if rank <= len(costs) else math.inf


def quantile(costs: np.ndarray, share: float, level: float = 0.95) -> Estimate:
    """Estimate a quantile; the interval is between order statistics, free of a distribution.

    Args:
        costs: Of independent flights, shape (flights,); infinite for failures.
        share: Of flights below the quantile, in (0, 1).
        level: Confidence level of the two-sided interval; each tail has at most half the rest.
    """
    n = len(costs)
    if n == 0:
        return Estimate(math.nan, -math.inf, math.inf)
    ordered = np.sort(costs)
    value = float(ordered[min(math.ceil(n * share - 1e-9), n) - 1])
    tail = (1.0 - level) / 2.0
    # X_(r) > quantile with P(B < r), X_(s) < quantile with P(B >= s), for B binomial (n, share)
    low_rank = int(stats.binom.ppf(tail, n, share))
    high_rank = int(stats.binom.ppf(1.0 - tail, n, share)) + 1
    low = float(ordered[low_rank - 1]) if low_rank >= 1 else -math.inf
    high = float(ordered[high_rank - 1]) if high_rank <= n else math.inf
    return Estimate(value, low, high)


@dataclass(frozen=True)
class SuccessComparison:
    """Success of new flights compared with old ones.

    Attributes:
        old: Flights that succeeded, and all of them.
        new: The same of the new flights.
        difference: New less old success probability, with a conservative interval.
        p_value: Of the test.
        test: Name of the test.
        only_old: Pairs in which only the old flight succeeded; None if unpaired.
        only_new: Pairs in which only the new flight succeeded; None if unpaired.
        share: Of the pairs with two outcomes, those in which only the new flight succeeded, as a
            probability, with an interval that leaves ½ out exactly where the test rejects at its
            level; None if unpaired.
    """

    old: tuple[int, int]
    new: tuple[int, int]
    difference: Estimate
    p_value: float
    test: str
    only_old: int | None = None
    only_new: int | None = None
    share: Estimate | None = None


def compare_paired_successes(
    old: np.ndarray, new: np.ndarray, alternative: Alternative = "two-sided", level: float = 0.95
) -> SuccessComparison:
    """Compare on the same draws: McNemar's exact test (1947) of the pairs that differ.

    Args:
        old: Success of each draw, bool, shape (pairs,).
        new: The same with the other law or code.
        alternative: Of the test.
        level: Of both intervals. The share's is Clopper and Pearson's; the difference's
            is Bonferroni's for the two discordant probabilities, each with Clopper and Pearson's.
            It covers at least that often.
    """
    old, new, n = old.astype(bool), new.astype(bool), len(old)
    only_old, only_new = int((old & ~new).sum()), int((new & ~old).sum())
    discordant = only_old + only_new
    side = "two-sided" if alternative == "two-sided" else "greater"
    p_value = stats.binomtest(only_old, discordant, alternative=side).pvalue if discordant else 1.0
    lost, won = (proportion(count, n, (1.0 + level) / 2.0) for count in (only_old, only_new))
    return SuccessComparison(
        old=(int(old.sum()), n),
        new=(int(new.sum()), n),
        only_old=only_old,
        only_new=only_new,
        share=proportion(only_new, discordant, level),
        difference=Estimate(won.value - lost.value, won.low - lost.high, won.high - lost.low),
        p_value=float(p_value),
        test="McNemar's exact test",
    )


def compare_successes(
    old: np.ndarray, new: np.ndarray, alternative: Alternative = "two-sided", level: float = 0.95
) -> SuccessComparison:
    """Compare flights of different draws: Fisher's exact test (1935).

    Args:
        old: Success of each flight, bool, shape (old flights,).
        new: The same of the others, shape (new flights,).
        alternative: Of the test.
        level: Of the interval of the difference: Bonferroni's for the two probabilities,
            each with Clopper and Pearson's. It covers at least that often.
    """
    (a, n), (b, m) = (int(old.sum()), len(old)), (int(new.sum()), len(new))
    side = "two-sided" if alternative == "two-sided" else "greater"
    p_value = stats.fisher_exact([[a, n - a], [b, m - b]], alternative=side).pvalue
    first, second = (proportion(count, of, (1.0 + level) / 2.0) for count, of in ((a, n), (b, m)))
    difference = Estimate(
        second.value - first.value, second.low - first.high, second.high - first.low
    )
    return SuccessComparison(
        old=(a, n),
        new=(b, m),
        difference=difference,
        p_value=float(p_value),
        test="Fisher's exact test",
    )


@dataclass(frozen=True)
class Comparison:
    """Costs of new flights compared with old ones.

    Attributes:
        flights: Pairs compared, or flights of both sides together.
        failed: Of these, how many have a failure on one side or on both.
        worse: Pairs in which the new flight is worse; None if unpaired.
        better: Pairs in which it is better; None if unpaired.
        share: Probability that the new flight is worse than the old one. Of pairs: if they differ,
            with an interval that leaves ½ out exactly where the test rejects at its level.
            Unpaired: equal costs count half, without an interval.
        p_value: Of the test.
        test: Name of the test.
    """

    flights: int
    failed: int
    worse: int | None
    better: int | None
    share: Estimate
    p_value: float
    test: str


def compare_paired_costs(
    old: np.ndarray, new: np.ndarray, alternative: Alternative = "two-sided", level: float = 0.95
) -> Comparison:
    """Compare on the same draws: the sign test of the pairs that differ, which assumes nothing.

    A failure is worse than every cost; two failures do not differ. For costs of 0 and 1 this is
    McNemar's test of successes.

    Args:
        old: Cost of each draw, shape (pairs,); infinite for failures.
        new: The same with the other law or code.
        alternative: Of the test.
        level: Of the interval, Clopper and Pearson's, whose tails are the same as the test's. It
            is two-sided: the test "worse" at the level α has its limits at 1 - 2 α.
    """
    worse, better = int((new > old).sum()), int((new < old).sum())
    differing = worse + better
    side = "two-sided" if alternative == "two-sided" else "greater"
    p_value = stats.binomtest(worse, differing, alternative=side).pvalue if differing else 1.0
    failed = int((np.isinf(old) | np.isinf(new)).sum())
    share = proportion(worse, differing, level)
    return Comparison(len(old), failed, worse, better, share, float(p_value), "sign test")


def compare_costs(
    old: np.ndarray, new: np.ndarray, alternative: Alternative = "two-sided"
) -> Comparison:
    """Compare flights of different draws: the rank test of Mann and Whitney (1947).

    Args:
        old: Cost of each flight, shape (old flights,); infinite for failures.
        new: The same of the others, shape (new flights,).
        alternative: Of the test.
    """
    failed = int(np.isinf(old).sum() + np.isinf(new).sum())
    p_value, share = 1.0, math.nan
    if len(old) and len(new):
        side = "two-sided" if alternative == "two-sided" else "greater"
        found = stats.mannwhitneyu(new, old, alternative=side)
        p_value, share = float(found.pvalue), float(found.statistic) / (len(old) * len(new))
    estimate = Estimate(share, -math.inf, math.inf)
    test = "Mann and Whitney's test"
    return Comparison(len(old) + len(new), failed, None, None, estimate, p_value, test)


def holm(p_values: Sequence[float]) -> list[float]:
    """Adjust p-values of several tests by Holm's method (1979).

    Whoever rejects where the adjusted value is at most α rejects any true hypothesis with a
    probability of at most α, however the tests depend on each other.
    """
    n, largest = len(p_values), 0.0
    adjusted = [0.0] * n
    for k, i in enumerate(sorted(range(n), key=lambda i: p_values[i])):
        largest = max(largest, min(1.0, (n - k) * p_values[i]))
        adjusted[i] = largest
    return adjusted


def mean_difference(old: np.ndarray, new: np.ndarray, level: float = 0.95) -> Estimate:
    """Estimate how much larger the mean cost is, from pairs in which both flights have one.

    The interval is the bootstrap's over pairs, bias-corrected and accelerated (Efron 1987),
    with a fixed seed; from 1000 pairs on it is Student's t, which costs less time. Pairs with a
    failure are left out: count them beside it.

    Args:
        old: Cost of each draw, shape (pairs,); infinite for failures.
        new: The same with the other law or code.
        level: Confidence level of the two-sided interval.
    """
    return _bootstrapped(old, new, "mean", level)


def median_difference(old: np.ndarray, new: np.ndarray, level: float = 0.95) -> Estimate:
    """Estimate how much larger the median cost is, by the percentile bootstrap over pairs.

    From 1000 pairs on it has fewer resamples, at least 999; of more than 20 000 pairs that many,
    evenly spaced, stand for all. Arguments, and the pairs left out, are as of `mean_difference`.
    """
    return _bootstrapped(old, new, "median", level)


def _bootstrapped(
    old: np.ndarray, new: np.ndarray, name: Literal["mean", "median"], level: float
) -> Estimate:
    known = np.isfinite(old) & np.isfinite(new)
    old, new = old[known], new[known]
    if name == "median" and len(old) > _MAX_PAIRS:
        kept = np.linspace(0, len(old) - 1, _MAX_PAIRS).astype(int)
        old, new = old[kept], new[kept]
    if len(old) < 2:
        return Estimate(math.nan, -math.inf, math.inf)
    average = np.mean if name == "mean" else np.median

    def difference(a: np.ndarray, b: np.ndarray, axis: int = -1) -> np.ndarray:
        return np.asarray(average(b, axis=axis) - average(a, axis=axis))

    value = float(difference(old, new))
    if np.ptp(new - old) == 0.0:  # whichever pairs are drawn: no distribution to correct
        return Estimate(value, value, value)
    if name == "mean" and len(old) >= _MANY:
        limits = stats.ttest_1samp(new - old, 0.0).confidence_interval(level)
        return Estimate(value, float(limits.low), float(limits.high))
    found = stats.bootstrap(
        (old, new),
        difference,
        paired=True,
        n_resamples=max(_FEWEST_RESAMPLES, min(_RESAMPLES, _RESAMPLES * _MANY // len(old))),
        batch=max(1, 1_000_000 // len(old)),
        confidence_level=level,
        method="BCa" if name == "mean" else "percentile",
        rng=np.random.default_rng(0),
    ).confidence_interval
    return Estimate(value, float(found.low), float(found.high))
