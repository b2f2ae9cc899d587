"""Draws: distributions, designs, and that the same seed draws the same flights."""

import math
from typing import Any

import numpy as np
import pytest
from campaign_flights import MASS, campaign_tree
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter
from scipy import stats

from ftc_lab.campaigns.distributions import Distribution, quantiles, support, value_of
from ftc_lab.campaigns.draws import MAX_FLIGHTS, dimensions, draw_table
from ftc_lab.campaigns.model import Campaign
from gcs.console.errors import BadInput

ADAPTER: TypeAdapter[Any] = TypeAdapter(Distribution)
KINDS: dict[str, tuple[dict[str, Any], Any]] = {
    "uniform": ({"low": -2.0, "high": 3.0}, stats.uniform(-2.0, 5.0)),
    "log_uniform": ({"low": 0.1, "high": 100.0}, stats.loguniform(0.1, 100.0)),
    "normal": ({"mean": 1.0, "deviation": 0.5}, stats.norm(1.0, 0.5)),
    "truncated_normal": (
        {"mean": 1.0, "deviation": 0.5, "low": 0.8, "high": 2.0},
        stats.truncnorm(-0.4, 2.0, loc=1.0, scale=0.5),
    ),
}


def distribution(kind: str, **keys: Any) -> Any:
    return ADAPTER.validate_python({"kind": kind, **keys})


def campaign(**changes: Any) -> Campaign:
    return Campaign.model_validate(campaign_tree(**changes))


def columns(**changes: Any) -> dict[str, list[Any]]:
    found: dict[str, list[Any]] = draw_table(campaign(**changes), [1, 2, 3]).to_pydict()
    return found


@pytest.mark.parametrize("kind", KINDS)
def test_drawn_values_have_the_distribution(kind: str) -> None:
    keys, expected = KINDS[kind]
    drawn = quantiles(distribution(kind, **keys), np.random.default_rng(1).random(4000))
    assert stats.kstest(drawn, expected.cdf).pvalue > 0.01


@given(st.sampled_from(sorted(KINDS)), st.floats(0.0, math.nextafter(1.0, 0.0)))
def test_drawn_values_lie_in_the_support(kind: str, uniform: float) -> None:
    drawn = distribution(kind, **KINDS[kind][0])
    low, high = support(drawn)
    (value,) = quantiles(drawn, np.array([uniform]))
    assert low <= value <= high


def test_every_choice_is_as_likely() -> None:
    drawn = quantiles(distribution("choice", values=["a", "b", "c"]), (np.arange(9) + 0.5) / 9)
    assert list(drawn) == ["a"] * 3 + ["b"] * 3 + ["c"] * 3


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([1, 0.5], [1.0, 0.5]),
        (["joint", 1], ["joint", "1"]),
        ([True, 2.0], ["true", "2.0"]),
        ([{1: 0.5}, None, [1, 2]], ['{"1": 0.5}', "null", "[1, 2]"]),
        ([2**53 + 1, 1], [str(2**53 + 1), "1"]),
        ([math.inf, 1], ["Infinity", "1"]),
    ],
)
def test_a_choice_is_of_numbers_or_of_texts(values: list[Any], expected: list[Any]) -> None:
    choice = distribution("choice", values=values)
    found = quantiles(choice, (np.arange(len(values)) + 0.5) / len(values)).tolist()
    assert found == expected
    assert [value_of(choice, cell) for cell in found] == values
    assert [type(value_of(choice, cell)) for cell in found] == [type(value) for value in values]


@pytest.mark.parametrize("values", [[1, 1.0], ["1", 1, "a"], [{"a": 1}, {"a": 1}], [object()]])
def test_a_choice_that_a_table_cannot_tell_apart_is_refused(values: list[Any]) -> None:
    with pytest.raises(ValueError, match=r"only once|expected values of a scenario"):
        distribution("choice", values=values)


def test_the_seed_decides_the_draws() -> None:
    assert columns() == columns()
    assert columns(seed=8)["factor.uncertainty.mass"] != columns()["factor.uncertainty.mass"]


@pytest.mark.parametrize("design", ["random", "sobol"])
def test_more_draws_begin_with_the_same(design: str) -> None:
    few, many = (columns(design=design, draws=n) for n in (8, 16))
    assert {name: values[:8] for name, values in many.items()} == few


def test_a_draw_does_not_depend_on_those_before_it() -> None:
    stream = np.random.default_rng(np.random.SeedSequence(7, spawn_key=(5,)))
    value = columns()["factor.uncertainty.mass"][5]
    assert value == 0.8 + (1.2 - 0.8) * stream.random(1)[0]


def test_variants_fly_the_same_draws() -> None:
    rows = columns(variants={"a": {}, "b": {}}, draws=3)
    assert rows["row"] == list(range(6))
    assert rows["variant"] == ["a", "b"] * 3
    for name in ("draw", "seed", "factor.uncertainty.mass"):
        assert rows[name][0::2] == rows[name][1::2]
    assert len(set(rows["seed"])) == 3


def test_latin_hypercube_has_one_value_in_each_layer() -> None:
    values = np.array(columns(design="latin_hypercube", draws=20)["factor.uncertainty.mass"])
    assert sorted((values - 0.8) / 0.4 * 20 // 1) == list(range(20))


def test_a_grid_is_every_combination() -> None:
    factors = {
        "trigger.mode": {"draw": {"kind": "choice", "values": ["joint", "periodic"]}},
        "step_us": {"draw": {"kind": "choice", "values": [1000, 2000, 4000]}},
    }
    rows = columns(design="grid", draws=None, factors=factors)
    pairs = list(zip(rows["factor.trigger.mode"], rows["factor.step_us"], strict=True))
    assert pairs == [(mode, us) for mode in ("joint", "periodic") for us in (1000, 2000, 4000)]


@pytest.mark.parametrize(
    "changes",
    [
        {"draws": MAX_FLIGHTS + 1},
        {"draws": 2**22, "design": "saltelli"},
        {"draws": MAX_FLIGHTS // 2 + 1, "variants": {"a": {}, "b": {}}},
        {
            "draws": None,
            "design": "grid",
            "factors": {
                f"uncertainty.{name}": {
                    "draw": {"kind": "choice", "values": [1.0 + k / 999 for k in range(300)]},
                }
                for name in ("mass", "inertia", "coefficients")
            },
        },
    ],
    ids=["draws", "saltelli", "variants", "grid"],
)
def test_too_many_flights_are_refused_before_they_are_drawn(changes: dict[str, Any]) -> None:
    with pytest.raises(BadInput, match="expected at most 10,000,000"):
        columns(**changes)


def test_saltelli_has_the_rows_that_its_analysis_expects() -> None:
    from SALib.analyze import sobol

    both = {"uncertainty.inertia.Jxx": MASS["uncertainty.mass"], **MASS}
    chosen = campaign(design="saltelli", draws=64, factors=both)
    table = draw_table(chosen, [1])
    names = [axis.column for axis in dimensions(chosen, [1])]
    assert table.num_rows == 64 * (len(names) + 2)
    figure = 3.0 * table.column("factor.uncertainty.mass").to_numpy()
    problem = {"num_vars": 2, "names": names, "bounds": [[0, 1]] * 2}
    found = sobol.analyze(problem, figure, calc_second_order=False, seed=1)
    assert found["S1"] == pytest.approx([0.0, 1.0], abs=0.05)


FAULT = {
    "kinds": {
        "loss": {"kind": "uniform", "low": 0.5, "high": 1.0},
        "stuck": {"kind": "uniform", "low": -0.3, "high": 0.3},
    },
    "start_s": {"kind": "uniform", "low": 1.0, "high": 2.0},
    "lasts_s": {"kind": "choice", "values": [3]},
}


def test_every_part_of_a_fault_is_drawn() -> None:
    rows = columns(factors={}, faults={"f": FAULT}, draws=400)
    assert set(rows["fault.f.uav"]) == {1, 2, 3}
    assert set(rows["fault.f.actuator"]) == {"aileron", "elevator", "rudder", "throttle"}
    assert 150 < rows["fault.f.kind"].count("loss") < 250
    for kind, start, end, severity in zip(
        *(rows[f"fault.f.{name}"] for name in ("kind", "start_s", "end_s", "severity")),
        strict=True,
    ):
        assert 1.0 <= start <= 2.0
        assert end == start + 3.0
        assert 0.5 <= severity <= 1.0 if kind == "loss" else -0.3 <= severity <= 0.3


def test_a_fault_for_good_has_no_end() -> None:
    rows = columns(factors={}, faults={"f": FAULT | {"lasts_s": None, "uavs": [2]}})
    assert rows["fault.f.end_s"] == [None] * 8
    assert rows["fault.f.uav"] == [2] * 8
