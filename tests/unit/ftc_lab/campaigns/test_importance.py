"""Which factor drives a cost, on functions whose answer is known."""

import math

import numpy as np
import pytest
from SALib.sample import sobol as saltelli
from SALib.test_functions import Ishigami

from ftc_lab.campaigns.importance import Importance, importances, sobol_indices
from ftc_lab.campaigns.statistics import flights_needed


def ranked(factors: dict[str, np.ndarray], costs: np.ndarray) -> list[Importance]:
    return importances(factors.items(), {"cost": costs})["cost"]


def test_the_strongest_factor_comes_first() -> None:
    random = np.random.default_rng(1)
    factors = {name: random.uniform(size=300) for name in ("none", "weak", "strong")}
    costs = 10.0 * factors["strong"] ** 3 - factors["weak"]
    first, second, third = ranked(factors, costs)
    assert (first.factor, second.factor, third.factor) == ("strong", "weak", "none")
    assert first.correlation is not None
    assert second.correlation is not None
    assert first.correlation > 0.9
    assert second.correlation < 0.0
    assert first.p_value < 1e-6
    assert third.p_value > 0.01


def test_spearman_by_hand() -> None:
    # ranks 1 2 3 4 5 against 2 1 4 3 5: 1 - 6 · 4 / (5 · 24) = 0.8
    [found] = ranked({"x": np.arange(5.0)}, np.array([2.0, 1.0, 4.0, 3.0, 5.0]))
    assert found.correlation == pytest.approx(0.8)


def test_few_flights_in_order_are_no_evidence() -> None:
    """4! orders are as likely: two of 24 are as strong."""
    values = np.where(np.arange(40) < 4, np.arange(40.0), np.nan)
    [found] = ranked({"x": values}, np.arange(40.0))
    assert found.correlation == pytest.approx(1.0)
    assert found.flights == 4
    assert found.p_value >= 2 / 24


def test_failures_count_and_are_worst() -> None:
    x = np.linspace(0.0, 1.0, 60)
    failing = np.where(x > 0.8, math.inf, 1.0)  # a cost that the survivors do not show
    [found] = ranked({"x": x}, failing)
    assert found.correlation is not None
    assert found.correlation > 0.6


def test_kinds_without_an_order_are_compared_as_groups() -> None:
    kinds = np.array(["loss", "bias", "stuck"] * 40, dtype=object)
    costs = np.arange(120.0) % 3
    strong, none = ranked({"kind": kinds, "x": np.tile([1.0, 2.0], 60)}, costs)
    assert (strong.factor, strong.correlation) == ("kind", None)
    assert strong.strength == pytest.approx(1.0)
    assert none.strength < 0.2


def test_what_does_not_vary_has_no_importance() -> None:
    x = np.arange(10.0)
    assert ranked({"x": x}, np.ones(10)) == []
    assert ranked({"x": np.ones(10)}, x) == []
    assert ranked({"x": x[:2]}, x[:2]) == []


def test_sobol_indices_of_the_ishigami_function() -> None:
    # Ishigami and Homma 1990, a = 7, b = 0.1: analytic values
    names = ["x1", "x2", "x3"]
    problem = {"num_vars": 3, "names": names, "bounds": [[-math.pi, math.pi]] * 3}
    points = saltelli.sample(problem, 2048, calc_second_order=False, seed=1)
    found = {each.factor: each for each in sobol_indices(names, Ishigami.evaluate(points))}
    first = [found[name].first for name in names]
    total = [found[name].total for name in names]
    assert first == pytest.approx([0.3139, 0.4424, 0.0], abs=0.03)
    assert total == pytest.approx([0.5576, 0.4424, 0.2437], abs=0.03)


def test_sobol_intervals_are_the_same_every_time() -> None:
    costs = np.random.default_rng(0).normal(size=64 * 4)
    assert sobol_indices(["a", "b"], costs) == sobol_indices(["a", "b"], costs)


def test_sobol_indices_want_a_whole_design_without_failures() -> None:
    with pytest.raises(ValueError, match="multiple of 4"):
        sobol_indices(["a", "b"], np.ones(flights_needed()))
    with pytest.raises(ValueError, match="1 of the costs"):
        sobol_indices(["a", "b"], np.array([1.0, 2.0, 3.0, math.inf]))
