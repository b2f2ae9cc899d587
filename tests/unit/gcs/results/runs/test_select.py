"""Conditions and orders of a list of runs."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcs.console.errors import BadInput
from gcs.results.runs.run import OUTCOMES, Run
from gcs.results.runs.select import KEYS, chosen, conditions_of

RUNS = st.builds(
    Run,
    name=st.text(max_size=4),
    kind=st.sampled_from(["flight", "campaign"]),
    time=st.sampled_from(["2026-01-01T00:00:00+00:00", "2026-02-01T00:00:00+00:00"]),
    outcome=st.sampled_from(OUTCOMES),
    law=st.sampled_from(["proposed", "surviving", ""]),
    changes=st.lists(st.text(max_size=3), max_size=2).map(tuple),
    saving=st.none() | st.floats(0, 1),
    iae=st.fixed_dictionaries({"roll": st.none() | st.floats(0, 9)}),
)


@given(runs=st.lists(RUNS, max_size=8), limit=st.floats(0, 1))
def test_a_condition_and_its_opposite_share_those_that_have_a_value(
    runs: list[Run], limit: float
) -> None:
    below = chosen(runs, conditions_of([f"saving<{limit!r}"]))
    above = chosen(runs, conditions_of([f"saving >= {limit!r}"]))
    assert sorted(map(id, below + above)) == sorted(id(r) for r in runs if r.saving is not None)
    assert all(run.saving is not None and run.saving < limit for run in below)


@given(runs=st.lists(RUNS, max_size=8), key=st.sampled_from(["saving", "iae_roll", "law", "time"]))
def test_an_order_loses_none_and_has_what_is_unknown_last(runs: list[Run], key: str) -> None:
    for order in (key, f"-{key}"):
        found = chosen(runs, [], order)
        assert sorted(map(id, found)) == sorted(map(id, runs))
        values = [run.iae["roll"] if key == "iae_roll" else getattr(run, key) for run in found]
        known = [value for value in values if value is not None]
        assert values[: len(known)] == known
        assert known == sorted(known, reverse=order.startswith("-"))


def test_texts_are_equal_or_contained() -> None:
    runs = [
        Run("a", "flight", "t", "completed", law="surviving", changes=("with realistic", "b=1")),
        Run("b", "flight", "t", "heading_lost", law="proposed"),
    ]

    def names(*conditions: str) -> list[str]:
        return [run.name for run in chosen(runs, conditions_of(conditions), "name")]

    assert names("law=surviving") == ["a"]
    assert names("law!=surviving") == ["b"]
    assert names("changes~REALISTIC", "changes~b=1") == ["a"]
    assert names("outcome=heading lost") == names("outcome=heading_lost") == ["b"]
    assert names("saving!=1") == ["a", "b"]
    assert names("saving<1") == []


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("law", "expected KEY=VALUE"),
        ("", "expected KEY=VALUE"),
        ("savings<1", "did you mean 'saving'"),
        ("saving<much", "expected a number, got 'much'"),
        ("outcome=crash", "expected one of completed"),
    ],
)
def test_a_condition_that_makes_no_sense_is_refused(text: str, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        conditions_of([text])
    with pytest.raises(BadInput, match="unknown key"):
        chosen([], [], "-nothing")


def test_every_key_is_in_the_json() -> None:
    tree = Run("a", "flight", "t", "completed").to_json()
    assert set(KEYS) == set(tree)
    assert Run.from_json(tree).to_json() == tree


@given(
    laws=st.lists(st.sampled_from(["pid", "proposed", "tube"]), unique=True, min_size=1),
    asked=st.sampled_from(["pid", "proposed", "tube", "pi"]),
)
def test_a_sweep_over_laws_is_found_by_each_of_them(laws: list[str], asked: str) -> None:
    run = Run("a", "sweep", "t", "completed", law=", ".join(laws))
    assert bool(chosen([run], conditions_of([f"law={asked}"]))) == (asked in laws)
    assert bool(chosen([run], conditions_of([f"law!={asked}"]))) == (asked not in laws)
