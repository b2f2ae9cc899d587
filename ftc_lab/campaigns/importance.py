"""Which drawn factor drives a cost: rank correlations, and Sobol indices of Saltelli designs."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy import stats


@dataclass(frozen=True)
class Importance:
    """The association of one factor with a cost.

    Attributes:
        factor: Its name.
        strength: Share of the ranks' standard deviation that goes with the factor, in [0, 1]:
            Spearman's |ρ|, or the correlation ratio of the ranks if the factor has no order.
        correlation: Spearman's ρ; None if the factor has no order.
        p_value: Of no association, by Spearman's or by Kruskal and Wallis's test.
        flights: Flights that have the factor, of which alone the association is.
    """

    factor: str
    strength: float
    correlation: float | None
    p_value: float
    flights: int


def importances(
    factors: Iterable[tuple[str, np.ndarray]], costs: Mapping[str, np.ndarray]
) -> dict[str, list[Importance]]:
    """Rank factors by their association with costs, the strongest first.

    Failures, with an infinite cost, rank worst and equal. A factor that does not vary among the
    flights that have it, or whose cost does not, has no association and is left out.

    Args:
        factors: Name and drawn values of each, shape (flights,); objects have no order, flights
            with NaN do not have the factor. Each is asked for once.
        costs: Of the same flights by name, shape (flights,); may be infinite.

    Returns:
        The factors of each cost.
    """
    ranks = {
        what: stats.rankdata(cost)
        for what, cost in costs.items()
        if len(cost) >= 3 and len(np.unique(cost)) > 1
    }
    found: dict[str, list[Importance]] = {what: [] for what in costs}
    for name, values in factors if ranks else ():
        ordered = values.dtype != object
        having = ~np.isnan(values) if ordered else np.ones(len(values), bool)
        own = values[having]
        if len(own) < 3 or len(np.unique(own)) < 2:
            continue
        of = _of_numbers if ordered else _of_categories
        for what, all_ranks in ranks.items():
            if np.ptp(all_ranks[having]) > 0.0:
                found[what].append(of(name, own, all_ranks[having]))
    return {what: sorted(own, key=lambda each: -each.strength) for what, own in found.items()}


def _of_numbers(name: str, values: np.ndarray, ranks: np.ndarray) -> Importance:
    result = stats.spearmanr(stats.rankdata(values), ranks)
    rho = float(result.statistic)
    smallest = 2.0 / math.factorial(min(len(ranks), 20))  # of few flights: n! orders are as likely
    return Importance(name, abs(rho), rho, max(float(result.pvalue), smallest), len(ranks))


def _of_categories(name: str, values: np.ndarray, ranks: np.ndarray) -> Importance:
    groups = [ranks[values == value] for value in np.unique(values)]
    result = stats.kruskal(*groups)
    # H is (n - 1) times the share of the ranks' variance between the groups
    ratio = min(float(result.statistic) / (len(ranks) - 1), 1.0)
    return Importance(name, ratio**0.5, None, float(result.pvalue), len(ranks))


@dataclass(frozen=True)
class SobolIndex:
    """Shares of a cost's variance that go with one factor, each ± its 95 % interval's half width.

    Attributes:
        factor: Its name.
        first: Share of the factor on its own.
        first_half_width: Of its bootstrap interval.
        total: Share of the factor with all its interactions.
        total_half_width: Of its bootstrap interval.
    """

    factor: str
    first: float
    first_half_width: float
    total: float
    total_half_width: float


def sobol_indices(factors: list[str], costs: np.ndarray) -> list[SobolIndex]:
    """Estimate Sobol indices by SALib (Saltelli 2010, Jansen 1999), largest total first.

    Args:
        factors: Names, in the order of the design's columns.
        costs: Of every flight of a Saltelli design without second order, in its order, finite:
            a variance knows no infinity. Shape (N (factors + 2),).

    Raises:
        ValueError: The number of costs does not fit such a design, or one is not finite.
    """
    from SALib.analyze import sobol

    if len(costs) == 0 or len(costs) % (len(factors) + 2):
        raise ValueError(
            f"{len(costs)} costs are not a Saltelli design of {len(factors)} factors, "
            f"expected a multiple of {len(factors) + 2}"
        )
    if not np.isfinite(costs).all():
        raise ValueError(f"{np.isinf(costs).sum()} of the costs are not finite")
    problem = {"num_vars": len(factors), "names": factors, "bounds": [[0.0, 1.0]] * len(factors)}
    found = sobol.analyze(problem, costs, calc_second_order=False, seed=1)  # 0 is none
    columns = (found[key] for key in ("S1", "S1_conf", "ST", "ST_conf"))
    indices = [
        SobolIndex(name, *map(float, values))
        for name, *values in zip(factors, *columns, strict=True)
    ]
    return sorted(indices, key=lambda each: -each.total)
