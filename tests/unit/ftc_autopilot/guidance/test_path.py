"""Paths: a place is found where it was put, legs join without a corner, loops go round."""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ftc_autopilot.guidance.legs import Leg
from ftc_autopilot.guidance.path import (
    PathCommand,
    commands_between,
    locate,
    path_record,
    point_at,
)

LENGTHS = st.floats(20.0, 2000.0)
CURVATURES = st.one_of(
    st.just(0.0),
    st.floats(1 / 2000.0, 1 / 100.0),
    st.floats(-1 / 100.0, -1 / 2000.0),
)
LEGS = st.lists(st.tuples(LENGTHS, CURVATURES, st.floats(-0.2, 0.2)), min_size=1, max_size=8)


def chain(pieces: Sequence[tuple[float, float, float]], course: float = 0.3) -> list[Leg]:
    """Legs of length, curvature and climb, each tangent to the one before; no arc turns round."""
    legs, (north, east, height) = [], (7.0, -3.0, 100.0)
    for k, (whole, curvature, climb) in enumerate(pieces):
        length = whole
        if curvature:
            length = min(whole, 0.9 * math.pi / abs(curvature))
        legs.append(Leg(north, east, course, curvature, length, height, climb, 40.0, k))
        # by many short chords, independently of the closed form
        n = 20_000
        courses = course + curvature * length * (np.arange(n) + 0.5) / n
        north += float(np.cos(courses).sum()) * length / n
        east += float(np.sin(courses).sum()) * length / n
        course += curvature * length
        height += climb * length
    return legs


def race_track(loop: int = 0) -> np.void:
    """Two straights of 500 m and two half circles of 200 m radius, to the right."""
    half = math.pi * 200.0
    legs = [
        Leg(0.0, 0.0, 0.0, 0.0, 500.0, 100.0, 0.0, 40.0, 1),
        Leg(500.0, 0.0, 0.0, 1 / 200.0, half, 100.0, 0.0, 40.0, 2),
        Leg(500.0, 400.0, math.pi, 0.0, 500.0, 100.0, 0.0, 40.0, 3),
        Leg(0.0, 400.0, math.pi, 1 / 200.0, half, 100.0, 0.0, 40.0, 4),
    ]
    return path_record(legs, loop)


@given(LEGS, st.floats(0.0, 1.0), st.floats(-60.0, 60.0), st.floats(-15.0, 15.0))
def test_a_place_beside_the_path_is_found_again(
    pieces: list[tuple[float, float, float]], share: float, right: float, moved: float
) -> None:
    path = path_record(chain(pieces))
    s = share * float(path["start"][path["count"]])
    point = point_at(path, s)
    north = point.north - right * math.sin(point.course)
    east = point.east + right * math.cos(point.course)
    found, off = locate(path, north, east, s + moved)
    assert found == pytest.approx(s, abs=1e-2)
    assert off == pytest.approx(right, abs=1e-2)


@given(LEGS)
def test_a_path_has_no_corner_and_no_step(pieces: list[tuple[float, float, float]]) -> None:
    legs = chain(pieces)
    path = path_record(legs)
    for k in range(1, len(legs)):
        s = float(path["start"][k])
        before, after = point_at(path, s - 1e-6), point_at(path, s)
        assert (before.leg, after.leg) == (k - 1, k)
        assert math.hypot(after.north - before.north, after.east - before.east) < 1e-2
        assert math.remainder(after.course - before.course, 2 * math.pi) == pytest.approx(
            0.0, abs=1e-6
        )
        assert after.height == pytest.approx(before.height, abs=1e-5)


@given(LEGS, st.floats(-0.2, 1.2))
def test_the_course_is_the_direction_in_which_the_point_moves(
    pieces: list[tuple[float, float, float]], share: float
) -> None:
    path = path_record(chain(pieces))
    s = share * float(path["start"][path["count"]])
    here, there = point_at(path, s), point_at(path, s + 1e-3)
    if here.leg != there.leg:
        return
    course = math.atan2(there.east - here.east, there.north - here.north)
    assert math.remainder(course - here.course, 2 * math.pi) == pytest.approx(0.0, abs=1e-4)
    assert (there.height - here.height) / 1e-3 == pytest.approx(here.climb, abs=1e-4)


@given(st.floats(0.0, 6000.0), st.floats(-50.0, 50.0))
def test_a_loop_goes_on_counting(s: float, right: float) -> None:
    path = race_track()
    lap = float(path["start"][4])
    point, again = point_at(path, s), point_at(path, s + lap)
    assert again[:3] == pytest.approx(point[:3], abs=1e-6)
    north = point.north - right * math.sin(point.course)
    east = point.east + right * math.cos(point.course)
    assert locate(path, north, east, s - 5.0) == pytest.approx((s, right), abs=1e-6)


def test_a_flight_round_the_loop_is_followed_step_by_step() -> None:
    path, s = race_track(), 0.0
    for expected in np.arange(0.0, 7000.0, 4.0):
        point = point_at(path, expected)
        s, right = locate(path, point.north, point.east, s)
        assert (s, right) == pytest.approx((expected, 0.0), abs=1e-6)


def test_a_loop_may_begin_at_a_later_leg() -> None:
    """The way to the race track is flown once."""
    legs = [Leg(-300.0, 0.0, 0.0, 0.0, 300.0, 100.0, 0.0, 40.0, 1)]
    track = race_track()
    for k in range(4):
        north, east, course, curvature = (
            float(track[key][k]) for key in ("north", "east", "course", "curvature")
        )
        length = float(track["start"][k + 1] - track["start"][k])
        legs.append(Leg(north, east, course, curvature, length, 100.0, 0.0, 40.0, k + 2))
    path = path_record(legs, 1)
    lap = float(track["start"][4])
    assert point_at(path, 300.0 + lap + 10.0)[:2] == pytest.approx((10.0, 0.0))
    assert point_at(path, 290.0)[:2] == pytest.approx((-10.0, 0.0))
    assert locate(path, 10.0, 1.0, 295.0 + lap) == pytest.approx((310.0 + lap, 1.0))


def test_before_its_start_and_after_its_end_a_path_goes_on() -> None:
    legs = chain([(100.0, 0.0, 0.1), (300.0, 1 / 200.0, 0.0)], course=0.0)
    path = path_record(legs)
    before = point_at(path, -50.0)
    assert before[:5] == pytest.approx((-43.0, -3.0, 0.0, 0.0, 95.0))
    assert locate(path, -43.0, 2.0, 0.0) == pytest.approx((-50.0, 5.0))
    assert point_at(path, 800.0).course == pytest.approx(700.0 / 200.0)


def test_on_an_endless_circle_the_turn_that_is_flown_counts() -> None:
    path = path_record([Leg(0.0, 0.0, 0.0, -1 / 150.0, math.inf, 50.0, 0.0, 35.0, 1)])
    s = 0.0
    for expected in np.arange(0.0, 3000.0, 3.0):
        point = point_at(path, expected)
        s, right = locate(path, point.north, point.east, s)
        assert (s, right) == pytest.approx((expected, 0.0), abs=1e-6)


@pytest.mark.parametrize("laps", [0, 1])
def test_who_is_behind_is_found_on_the_leg_before(laps: int) -> None:
    """A short way back over each joint, from a straight into an arc or the other way round."""
    path = race_track()
    lap = float(path["start"][4])
    for joint in (lap, *map(float, path["start"][1:4])):
        s = laps * lap + joint - 12.0
        point = point_at(path, s)
        assert locate(path, point.north, point.east, s + 20.0) == pytest.approx((s, 0.0), abs=1e-6)


def test_commands_are_passed_in_every_round_but_those_before_it_once() -> None:
    half, whole = math.pi * 200.0, 2.0 * math.pi * 200.0 + 1000.0
    legs = [
        Leg(-100.0, 0.0, 0.0, 0.0, 100.0, 100.0, 0.0, 40.0, 1),
        Leg(0.0, 0.0, 0.0, 0.0, 500.0, 100.0, 0.0, 40.0, 1),
        Leg(500.0, 0.0, 0.0, 1 / 200.0, half, 100.0, 0.0, 40.0, 2),
        Leg(500.0, 400.0, math.pi, 0.0, 500.0, 100.0, 0.0, 40.0, 3),
        Leg(0.0, 400.0, math.pi, 1 / 200.0, half, 100.0, 0.0, 40.0, 4),
    ]
    passed = (PathCommand(0, 0.0, 10), PathCommand(1, 50.0, 11), PathCommand(3, 0.0, 12))
    path = path_record(legs, 1, commands=passed)
    rounds = [(0.0, 10), (150.0, 11), (600.0 + half, 12)]
    rounds += [(s + k * whole, item) for k in (1, 2) for s, item in rounds[1:3]]
    last = 100.0 + 3.0 * whole
    found = commands_between(path, -1.0, last)
    assert [item for _, item in found] == [item for _, item in rounds]
    assert [s for s, _ in found] == pytest.approx([s for s, _ in rounds])
    # in parts, each once
    parts = [math.nextafter(s, math.inf) for s in np.linspace(-1.0, last, 57)]
    pieces = [commands_between(path, a, b) for a, b in pairwise(parts)]
    assert [item for piece in pieces for _, item in piece] == [item for _, item in rounds]
