"""Statistics against published tables, and against simulation for what they promise."""

import math
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from ftc_lab.campaigns.statistics import (
    Estimate,
    compare_costs,
    compare_paired_costs,
    compare_paired_successes,
    compare_successes,
    flights_needed,
    holm,
    mean_difference,
    median_difference,
    proportion,
    quantile,
    tolerance_bound,
)

cost = st.sampled_from([0.0, 1.0, 1.5, 2.0, 7.0, math.inf])
costs = st.lists(cost, max_size=20)


@pytest.mark.parametrize(
    ("count", "flights", "low", "high"),
    [  # Clopper and Pearson's intervals at 95 %, as tables have them
        (0, 10, 0.0, 0.3085),
        (1, 10, 0.0025, 0.4450),
        (5, 20, 0.0866, 0.4910),
        (50, 100, 0.3983, 0.6017),
        (10, 10, 0.6915, 1.0),
    ],
)
def test_intervals_of_proportions_are_the_published_ones(
    count: int, flights: int, low: float, high: float
) -> None:
    found = proportion(count, flights)
    assert found.value == count / flights
    assert (found.low, found.high) == pytest.approx((low, high), abs=5e-5)


def test_no_flights_tell_nothing() -> None:
    found = proportion(0, 0)
    assert math.isnan(found.value)
    assert (found.low, found.high) == (0.0, 1.0)


@pytest.mark.parametrize("n", [5, 20, 59])
@pytest.mark.parametrize("p", [0.01, 0.05, 0.3, 0.5, 0.9])
def test_intervals_of_proportions_cover_exactly_computed(n: int, p: float) -> None:
    count = np.arange(n + 1)
    intervals = [proportion(int(k), n, 0.9) for k in count]
    covering = [each.low <= p <= each.high for each in intervals]
    assert stats.binom.pmf(count, n, p)[covering].sum() >= 0.9


@pytest.mark.parametrize(
    ("coverage", "confidence", "flights"),
    [(0.95, 0.95, 59), (0.90, 0.95, 29), (0.99, 0.95, 299), (0.90, 0.90, 22), (0.5, 0.5, 1)],
)
def test_flights_needed_are_wilks_numbers(coverage: float, confidence: float, flights: int) -> None:
    assert flights_needed(coverage, confidence) == flights


@given(st.floats(0.05, 0.999), st.floats(0.05, 0.999))
def test_flights_needed_are_the_fewest(coverage: float, confidence: float) -> None:
    n = flights_needed(coverage, confidence)
    assert 1.0 - coverage**n >= confidence
    assert n == 1 or 1.0 - coverage ** (n - 1) < confidence


def test_59_flights_without_a_failure_show_95_percent_at_95_percent() -> None:
    assert proportion(59, 59, 0.90).low > 0.95  # 90 % in two tails: 95 % in one
    assert proportion(58, 58, 0.90).low < 0.95


def test_the_worst_of_59_is_the_95_95_bound() -> None:
    values = np.random.default_rng(1).permutation(59).astype(float)
    assert tolerance_bound(values) == 58.0
    assert tolerance_bound(values[:58]) == math.inf
    assert tolerance_bound(np.array([])) == math.inf


def test_two_sided_order_statistics_are_the_tabled_ones() -> None:
    # median of 10: (x2, x9) at 97.85 % (Conover, Practical Nonparametric Statistics)
    found = quantile(np.arange(1.0, 11.0), 0.5)
    assert (found.value, found.low, found.high) == (5.0, 2.0, 9.0)
    assert quantile(np.arange(5.0), 0.5).low == -math.inf  # 5 are too few


def test_failures_rank_above_every_figure() -> None:
    found = quantile(np.array([*np.arange(30.0), math.inf, math.inf]), 0.95)
    assert found.high == math.inf
    assert quantile(np.array([1.0] + [math.inf] * 9), 0.5).value == math.inf


def covering(
    interval: Callable[[np.ndarray], tuple[float, float]], truth: float, n: int, rounds: int
) -> int:
    random = np.random.default_rng(12)
    inside = 0
    for _ in range(rounds):
        low, high = interval(random.exponential(size=n))
        inside += low <= truth <= high
    return inside


def plausible(inside: int, rounds: int, level: float) -> bool:
    """Whether a true coverage of `level` or more is compatible with a count, at 1 in 1000."""
    return bool(stats.binom.cdf(inside, rounds, level) > 1e-3)


@pytest.mark.parametrize("n", [8, 25, 60])
@pytest.mark.parametrize("share", [0.5, 0.9])
def test_quantiles_lie_within_their_intervals_as_often_as_promised(n: int, share: float) -> None:
    def interval(values: np.ndarray) -> tuple[float, float]:
        found = quantile(values, share, 0.9)
        return found.low, found.high

    assert plausible(covering(interval, -math.log(1.0 - share), n, 1000), 1000, 0.9)


@pytest.mark.parametrize("n", [30, 59, 200])
def test_tolerance_bounds_hold_as_often_as_promised(n: int) -> None:
    inside = covering(
        lambda values: (-math.inf, tolerance_bound(values, 0.95, 0.9)), -math.log(0.05), n, 1000
    )
    assert plausible(inside, 1000, 0.9)


def pairs(both: int, only_old: int, only_new: int, neither: int) -> tuple[np.ndarray, np.ndarray]:
    old = [True] * (both + only_old) + [False] * (only_new + neither)
    new = [True] * both + [False] * only_old + [True] * only_new + [False] * neither
    return np.array(old), np.array(new)


def test_mcnemar_by_hand() -> None:
    found = compare_paired_successes(*pairs(40, 9, 1, 3))
    assert (found.only_old, found.only_new) == (9, 1)
    assert found.p_value == pytest.approx(2 * (1 + 10) / 2**10)
    assert compare_paired_successes(*pairs(40, 9, 1, 3), "worse").p_value == pytest.approx(
        11 / 1024
    )
    assert compare_paired_successes(*pairs(40, 1, 9, 3), "worse").p_value > 0.99


def test_mcnemar_on_agrestis_approval_ratings() -> None:
    # Categorical Data Analysis (2002), table 10.1: 794, 150, 86, 570; z² = 17.36
    found = compare_paired_successes(*pairs(794, 150, 86, 570))
    assert found.difference.value == pytest.approx(-0.04, abs=5e-5)
    assert found.p_value == pytest.approx(stats.binomtest(86, 150 + 86).pvalue)
    assert found.p_value == pytest.approx(stats.chi2.sf(17.36, 1), rel=0.3)  # for large numbers
    low, high = found.difference.low, found.difference.high
    assert low < -0.059 < -0.021 < high < 0.0  # Agresti's approximate one lies within


def test_equal_flights_do_not_differ() -> None:
    old, new = pairs(5, 0, 0, 5)
    assert compare_paired_successes(old, new).p_value == 1.0
    assert compare_paired_successes(old, new, "worse").p_value == 1.0


def test_fisher_on_the_lady_tasting_tea() -> None:
    old, new = np.array([True] * 3 + [False]), np.array([True] + [False] * 3)
    assert compare_successes(old, new, "worse").p_value == pytest.approx(17 / 70)
    assert compare_successes(new, old, "worse").p_value == pytest.approx(69 / 70)


@pytest.mark.parametrize("paired", [True, False])
def test_intervals_of_a_difference_cover(paired: bool) -> None:
    random, inside, rounds = np.random.default_rng(3), 0, 100
    for _ in range(rounds):
        old, new = random.random(30) < 0.9, random.random(30) < 0.7
        compare = compare_paired_successes if paired else compare_successes
        difference = compare(old, new, level=0.9).difference
        inside += difference.low <= -0.2 <= difference.high
    assert plausible(inside, rounds, 0.9)


DARWIN = np.array([6, 8, 14, 16, 23, 24, 28, 29, 41, -48, 49, 56, 60, -67, 75], dtype=float)
"""Differences of heights of maize, cross- less self-fertilised [1/8 in] (Darwin 1876)."""


def test_the_sign_test_on_darwins_maize() -> None:
    found = compare_paired_costs(np.full(15, 200.0), 200.0 + DARWIN)
    assert (found.worse, found.better) == (13, 2)
    assert found.p_value == pytest.approx(2 * (1 + 15 + 105) / 2**15)
    assert (found.share.low, found.share.high) == pytest.approx((0.5954, 0.9834), abs=5e-5)
    worse = compare_paired_costs(np.full(15, 200.0), 200.0 + DARWIN, "worse")
    assert worse.p_value == pytest.approx((1 + 15 + 105) / 2**15)


@given(
    st.lists(st.tuples(cost, cost), max_size=120),
    st.sampled_from([0.5, 0.8, 0.9, 0.95, 0.98, 0.99, 0.999]),
)
def test_the_interval_of_an_estimate_and_its_test_never_contradict_each_other(
    drawn: list[tuple[float, float]], level: float
) -> None:
    """With ties and failures: ½ is left out where the test of the same level rejects, and only."""
    old, new = np.array(drawn, dtype=float).reshape(-1, 2).T
    compared = compare_paired_costs(old, new, level=level)
    assert (compared.p_value < 1.0 - level) == (not contains_half(compared.share))
    one_sided = compare_paired_costs(old, new, "worse", level=2.0 * level - 1.0)
    assert (one_sided.p_value < 1.0 - level) == (one_sided.share.low > 0.5)
    success = compare_paired_successes(np.isfinite(old), np.isfinite(new), level=level)
    assert success.share is not None
    assert (success.p_value < 1.0 - level) == (not contains_half(success.share))
    if not success.difference.low <= 0.0 <= success.difference.high:  # conservative: one way only
        assert success.p_value < 1.0 - level


def contains_half(estimate: Estimate) -> bool:
    return estimate.low <= 0.5 <= estimate.high


def test_the_test_of_figures_equals_the_test_of_success_where_figures_are_failures() -> None:
    old, new = pairs(40, 9, 1, 3)
    success = compare_paired_successes(old, new)
    costs_of = [np.where(each, 1.0, math.inf) for each in (old, new)]
    figures = compare_paired_costs(costs_of[0], costs_of[1])
    assert (figures.worse, figures.better) == (success.only_old, success.only_new)
    assert figures.p_value == success.p_value


def test_holm_by_hand() -> None:
    # Holm's method on 0.01, 0.04, 0.03, 0.005: 4 · 0.005, 3 · 0.01, 2 · 0.03, then at least that
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([]) == []


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=20))
def test_adjusted_p_values_keep_the_order_and_lie_between_p_and_bonferroni(
    p_values: list[float],
) -> None:
    adjusted = holm(p_values)
    for p, own in zip(p_values, adjusted, strict=True):
        assert p <= own <= min(1.0, len(p_values) * p) + 1e-12
    order = np.argsort(p_values)
    assert np.all(np.diff(np.array(adjusted)[order]) >= 0.0)


def test_a_new_failure_is_worse_than_any_difference() -> None:
    old, new = np.full(15, 200.0), 200.0 + DARWIN
    lost = new.copy()
    lost[9] = math.inf  # the second-worst improvement becomes a failure
    before, after = (compare_paired_costs(old, each, "worse").p_value for each in (new, lost))
    assert after < before
    assert compare_paired_costs(old, lost).failed == 1
    both = old.copy()
    both[9] = math.inf
    assert compare_paired_costs(both, lost).flights == 15


def test_mann_and_whitney_by_hand() -> None:
    # of C(6, 3) = 20 orders one has all new costs above the old ones
    old, new = np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0])
    assert compare_costs(old, new, "worse").p_value == pytest.approx(1 / 20)
    assert compare_costs(old, new).p_value == pytest.approx(2 / 20)
    assert compare_costs(new, old, "worse").p_value == pytest.approx(1.0)


@pytest.mark.parametrize("compare", [compare_costs, compare_paired_costs])
def test_tests_reject_no_more_often_than_stated(compare: Callable[..., Any]) -> None:
    random, rejected, rounds = np.random.default_rng(5), 0, 200
    for _ in range(rounds):
        old, new = (random.exponential(size=25) for _ in range(2))
        old[random.random(25) < 0.1] = math.inf
        new[random.random(25) < 0.1] = math.inf
        rejected += compare(old, new, "worse").p_value <= 0.05
    assert stats.binom.sf(rejected - 1, rounds, 0.05) > 1e-3


@given(costs, costs)
def test_comparisons_never_fail_and_never_warn(old: list[float], new: list[float]) -> None:
    n = min(len(old), len(new))
    a, b = np.array(old), np.array(new)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for found in (compare_costs(a, b), compare_paired_costs(a[:n], b[:n])):
            assert 0.0 <= found.p_value <= 1.0
        for estimate in (mean_difference, median_difference):
            difference = estimate(a[:n], b[:n])
            assert math.isnan(difference.value) or difference.low <= difference.high
        success = compare_successes(a < 9, b < 9)
        assert 0.0 <= success.p_value <= 1.0
        assert -1.0 <= success.difference.low <= success.difference.high <= 1.0


def test_differences_are_of_pairs_with_two_costs() -> None:
    old = np.array([1.0, 2.0, 3.0, math.inf, 5.0])
    new = np.array([2.0, 2.5, 4.5, 1.0, math.inf])
    assert mean_difference(old, new).value == pytest.approx(1.0)
    assert median_difference(old, new).value == pytest.approx(0.5)
    assert mean_difference(old, new) == mean_difference(old, new)


@pytest.mark.slow
@pytest.mark.parametrize("estimate", [mean_difference, median_difference])
def test_bootstrap_intervals_cover_roughly(estimate: Callable[..., Any]) -> None:
    random, inside, rounds = np.random.default_rng(9), 0, 30
    for _ in range(rounds):
        old = random.normal(10.0, 2.0, 60)
        found = estimate(old, old + random.normal(1.0, 0.5, 60), 0.9)
        inside += found.low <= 1.0 <= found.high
    assert plausible(inside, rounds, 0.85)  # the bootstrap promises its level for many flights


def test_medians_of_very_many_pairs_are_of_a_part_of_them() -> None:
    """It is spread over all: a change half-way is seen by half of the part."""
    old = np.random.default_rng(4).normal(size=50_000)
    new = old + np.where(np.arange(50_000) < 25_000, 0.0, 1.0)
    found = median_difference(old, new)
    assert found.low < 0.5 < found.high
    assert found.high - found.low < 0.1
