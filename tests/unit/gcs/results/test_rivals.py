"""What a simpler law does better by a tenth, and how such a statement could lie."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ftc_autopilot.control.laws import KINDS
from gcs.results.rivals import SIMPLEST_FIRST, beaten_by, cost_of, flight_of, law_of

LOST, UNKNOWN = math.inf, math.nan


def test_every_law_of_ours_has_a_place() -> None:
    assert sorted(SIMPLEST_FIRST) == sorted(KINDS)


@pytest.mark.parametrize(
    ("other", "cost", "beaten"),
    [
        (9.0, 10.0, True),  # a tenth, exactly
        (9.01, 10.0, False),
        (0.0, 1.0, True),  # one loss against none
        (0.0, 0.0, False),  # equal
        (5.0, LOST, True),  # short, and so with small integrals: worse than any
        (LOST, 5.0, False),
        (LOST, LOST, False),
        (UNKNOWN, 5.0, False),
        (UNKNOWN, LOST, False),
        (5.0, UNKNOWN, False),
        (-110.0, -100.0, True),  # of a height or a distance, of which more is better
        (-109.0, -100.0, False),
        (-1.0, 0.0, True),
    ],
)
def test_better_by_a_tenth(other: float, cost: float, beaten: bool) -> None:
    assert beaten_by("tube", cost, [("pid", other)]) == ("pid" if beaten else None)


def test_only_simpler_laws_count_and_the_simplest_is_named() -> None:
    rivals = [("surviving", 1.0), ("backstepping", 1.0), ("pid", 9.5), ("proposed", 2.0)]
    assert beaten_by("tube", 10.0, rivals) == "backstepping"
    assert beaten_by("backstepping", 10.0, rivals) is None  # not by itself, nor by what is less so
    assert beaten_by("pid", 10.0, rivals) is None
    assert beaten_by("law.py:Mine", 10.0, [("tube", 1.0)]) == "tube"
    assert beaten_by("law.py:Mine", 10.0, [("other.py:Law", 1.0)]) is None


@given(st.floats(0.0, 1e6), st.floats(0.0, 1e6))
def test_of_two_costs_at_most_one_is_better(one: float, other: float) -> None:
    laws = beaten_by("tube", one, [("pid", other)]), beaten_by("tube", other, [("pid", one)])
    assert None in laws


def test_where_more_is_better_the_cost_falls() -> None:
    assert cost_of("saving", 0.99) == pytest.approx(0.01)  # half of what 98 % leave
    assert cost_of("lowest_altitude_m", 90.0) == -90.0
    assert cost_of("iae_roll", 12.0) == cost_of("max_error_roll", 12.0) == 12.0
    for name in ("min_interval_s", "attitude_lost_at_s", "duration_s", "no_such"):
        assert math.isnan(cost_of(name, 1.0))  # a later loss is no worse, a longer flight no better
    assert math.isnan(cost_of("iae_roll", None))


def test_the_same_flight_differs_in_law_and_trigger_only() -> None:
    pid = {"name": "a", "seed": "1", "controller.kind": "pid", "trigger.mode": "periodic"}
    tube = {"name": "b", "seed": "1", "controller.kind": "tube", "controller.tube_scale": "2"}
    assert flight_of(pid) == flight_of(tube)
    assert (law_of(pid), law_of(tube), law_of({})) == ("pid", "tube", "proposed")
    for key, value in (
        ("seed", "2"),
        ("duration_s", "12"),
        ("faults[0].uav", "3"),
        ("wind.turbulence", "light"),
        ("controller.reference_bandwidth_rad_s", "1"),  # a slower reference is easier to track
    ):
        assert flight_of(pid) != flight_of({**tube, key: value})
