"""The path of a mission: joined without a corner, through its places, within limits."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from ftc_autopilot.guidance.limits import FlightLimits, tightest_turn
from ftc_autopilot.guidance.mission_items import (
    Delay,
    Jump,
    Loiter,
    Return,
    SetHome,
    SetSpeed,
    Task,
    Waypoint,
)
from ftc_autopilot.guidance.mission_path import MissionPath, Start, mission_path, path_id_of
from ftc_autopilot.guidance.mission_places import Home
from ftc_autopilot.guidance.path import NO_LOOP, Leg, path_record, point_at
from ftc_autopilot.guidance.pieces import Pose
from mavlink_defs.profile import ItemError

LIMITS = FlightLimits(40.0, math.radians(40.0), 25.0, 0.3, 0.0, 0.0, 9.8)
START = Start(Pose(0.0, 0.0, 0.5), 100.0, 40.0)
metres = st.floats(-4000.0, 4000.0)


def square(within: float = 0.0, side: float = 2000.0) -> list[Waypoint]:
    places = [(side, 0.0), (side, side), (0.0, side), (0.0, 0.0)]
    return [Waypoint(k, *place, 100.0, within) for k, place in enumerate(places, start=1)]


def end_of(leg: Leg) -> tuple[float, float, float, float]:
    path = path_record([leg], path_id=1)
    point = point_at(path, leg.length_m)
    return point.north, point.east, point.course, point.height


def assert_joined(path: MissionPath) -> None:
    """Each leg begins where the one before ends, with its course and height."""
    pairs = list(zip(path.legs, path.legs[1:], strict=False))
    if path.loop != NO_LOOP:
        pairs.append((path.legs[-1], path.legs[path.loop]))
    for before, after in pairs:
        north, east, course, height = end_of(before)
        assert math.hypot(north - after.north_m, east - after.east_m) < 2e-3
        assert abs(math.remainder(course - after.course_rad, 2.0 * math.pi)) < 1e-5
        assert height == pytest.approx(after.height_m, abs=1e-2)
    assert all(0.0 < leg.length_m < math.inf for leg in path.legs[:-1])
    assert (path.legs[-1].length_m == math.inf) == (path.loop == NO_LOOP)


def places_of(path: MissionPath, item: int) -> np.ndarray:
    """Places on the legs of an item and the ones after them, every 2 m, shape (n, 2).

    An item at the place of the one before has no leg; then all legs count.
    """
    if item not in {leg.item for leg in path.legs}:
        return np.concatenate([places_of(path, leg.item) for leg in path.legs])
    found: list[tuple[float, float]] = []
    for leg, before in zip(path.legs, (path.legs[0], *path.legs), strict=False):
        if item in {leg.item, before.item}:
            record = path_record([leg], path_id=1)
            for s in np.arange(0.0, min(leg.length_m, 5000.0) + 2.0, 2.0):
                point = point_at(record, min(float(s), leg.length_m))
                found.append((point.north, point.east))
    return np.array(found)


@st.composite
def missions(draw: st.DrawFn) -> list[Task]:
    """Level missions of every kind of item but jumps."""
    places = draw(st.lists(st.tuples(metres, metres), min_size=1, max_size=8))
    tasks: list[Task] = []
    for north, east in places:
        if draw(st.booleans()):
            tasks.append(SetSpeed(len(tasks) + 1, draw(st.floats(35.0, 50.0))))
        if draw(st.booleans()):
            tasks.append(Delay(len(tasks) + 1, draw(st.floats(0.0, 60.0))))
            tasks.append(SetSpeed(len(tasks) + 1, draw(st.floats(35.0, 50.0))))
        item = len(tasks) + 1
        if draw(st.booleans()):
            within = draw(st.sampled_from([0.0, 1.0, 10.0, 100.0]))
            tasks.append(Waypoint(item, north, east, 100.0, within))
        else:
            radius = draw(st.sampled_from([0.0, 600.0, -600.0]))
            centre = draw(st.sampled_from([(north, east), None]))
            turns = draw(st.sampled_from([0.0, 1.5]))
            tasks.append(Loiter(item, centre, 100.0, radius, turns, draw(st.floats(0.0, 30.0))))
    if draw(st.booleans()):
        tasks.append(Return(len(tasks) + 1))
    return tasks


@given(missions(), st.sampled_from([None, START]))
def test_legs_join_and_turns_can_be_flown(tasks: list[Task], start: Start | None) -> None:
    path = mission_path(tasks, LIMITS, Home(), start)
    assert_joined(path)
    for leg in path.legs:
        tightest = tightest_turn(leg.airspeed_m_s, LIMITS)
        assert abs(leg.curvature_1_m) * tightest < 1.0 + 1e-6


@given(missions(), st.sampled_from([None, START]))
def test_every_waypoint_is_passed_as_near_as_asked(tasks: list[Task], start: Start | None) -> None:
    path = mission_path(tasks, LIMITS, Home(), start)
    for task in tasks:
        if isinstance(task, Waypoint) and task.within_m > 0.0:
            places = places_of(path, task.item)
            misses = np.hypot(places[:, 0] - task.north_m, places[:, 1] - task.east_m)
            assert misses.min() < task.within_m + 1.1  # the places are 2 m apart


@given(st.lists(st.tuples(metres, metres, st.sampled_from([0.0, 5.0])), min_size=2, max_size=6))
def test_a_mission_that_goes_around_closes(places: list[tuple[float, float, float]]) -> None:
    near = zip(places, [*places[1:], places[0]], strict=True)
    assume(all(math.dist(a[:2], b[:2]) > 1500.0 for a, b in near))
    tasks: list[Task] = [
        Waypoint(k, north, east, 100.0, within)
        for k, (north, east, within) in enumerate(places, start=1)
    ]
    path = mission_path([*tasks, Jump(len(tasks) + 1, 1, -1)], LIMITS, Home(), START)
    assert path.loop != NO_LOOP
    assert_joined(path)
    assert {leg.item for leg in path.legs[path.loop :]} == set(range(1, len(tasks) + 1))


def test_the_turns_of_a_square_are_of_20_degrees_of_bank_inside_its_corners() -> None:
    path = mission_path([*square(), Jump(5, 1, -1)], LIMITS, Home())
    arcs = [leg for leg in path.legs[path.loop :] if leg.curvature_1_m]
    radius = 40.0**2 / (9.8 * math.tan(math.radians(20.0)))
    assert [1.0 / leg.curvature_1_m for leg in arcs] == pytest.approx([radius] * 8)
    assert sum(leg.length_m for leg in path.legs[path.loop :]) == pytest.approx(
        4.0 * (2000.0 - 2.0 * radius) + 2.0 * math.pi * radius
    )
    assert [leg.item for leg in path.legs[path.loop :]] == [*[1] * 3, *[2] * 3, *[3] * 3, *[4] * 3]


def test_a_square_too_small_for_its_turns_has_tighter_ones_or_goes_over_the_waypoints() -> None:
    wide = mission_path([*square(side=800.0), Jump(5, 1, -1)], LIMITS, Home(), START)
    radii = [1.0 / leg.curvature_1_m for leg in wide.legs[wide.loop :] if leg.curvature_1_m]
    assert radii == pytest.approx([400.0] * 8)
    narrow = mission_path(square(side=400.0), LIMITS, Home(), START)
    for task in square(side=400.0):
        places = places_of(narrow, task.item)
        misses = np.hypot(places[:, 0] - task.north_m, places[:, 1] - task.east_m)
        assert misses.min() < 1.1


def test_after_the_last_waypoint_it_circles_through_it_to_the_right() -> None:
    last = mission_path(square()[:1], LIMITS, Home(), START).legs[-1]
    assert (last.length_m, last.item) == (math.inf, 1)
    assert (last.north_m, last.east_m) == pytest.approx((2000.0, 0.0), abs=1e-6)
    assert last.curvature_1_m > 0.0


def test_jumps_are_carried_out_and_then_the_mission_goes_on() -> None:
    a, b, *_ = square()
    path = mission_path([a, b, Jump(3, 1, 2), Waypoint(4, 0.0, 9e3, 100.0)], LIMITS, Home(), START)
    order = [leg.item for leg in path.legs]
    visits = [item for k, item in enumerate(order) if k == 0 or order[k - 1] != item]
    assert visits == [1, 2, 1, 2, 1, 2, 4]


def test_a_mission_begins_with_any_item() -> None:
    path = mission_path(square(), LIMITS, Home(), START, first=3)
    assert {leg.item for leg in path.legs} == {3, 4}


def test_a_loiter_lasts_as_long_as_it_says() -> None:
    tasks: list[Task] = [
        Loiter(1, (3000.0, 0.0), 100.0, -600.0, turns=2.0),
        Loiter(2, (3000.0, 9000.0), 100.0, 600.0, turns=0.0, seconds=100.0),
        Return(3),
    ]
    path = mission_path(tasks, LIMITS, Home(), START)
    circles = [leg for leg in path.legs if abs(abs(leg.curvature_1_m) - 1.0 / 600.0) < 1e-9]
    assert circles[0].length_m == pytest.approx(2.0 * 2.0 * math.pi * 600.0)
    assert [leg.curvature_1_m < 0.0 for leg in circles][:2] == [True, True]
    assert any(leg.length_m == pytest.approx(100.0 * 40.0) for leg in circles if leg.item == 2)


def test_speed_changes_where_the_delay_ends() -> None:
    a, b, *_ = square(within=1.0)
    tasks: list[Task] = [a, SetSpeed(2, 45.0), Delay(3, 10.0), SetSpeed(4, 50.0)]
    tasks.append(Waypoint(5, b.north_m, b.east_m, 100.0, 1.0))
    path = mission_path(tasks, LIMITS, Home(), START)
    way = [leg for leg in path.legs if leg.item == 5 and leg.length_m < math.inf]
    slow = sum(leg.length_m for leg in way if leg.airspeed_m_s == 45.0)
    assert slow == pytest.approx(450.0)
    assert {leg.airspeed_m_s for leg in path.legs if leg.item == 1} == {40.0}
    assert path.legs[-1].airspeed_m_s == 50.0


def test_home_is_where_it_was_set_last() -> None:
    a, b, *_ = square()
    elsewhere = SetHome(2, Home(5000.0, 5000.0, 0.0))
    for set_home, (north, east) in (
        (elsewhere, (5000.0, 5000.0)),
        (SetHome(2, None), (a.north_m, a.east_m)),
    ):
        tasks: list[Task] = [a, set_home, Waypoint(3, b.north_m, b.east_m, 100.0), Return(4)]
        last = mission_path(tasks, LIMITS, Home(), START).legs[-1]
        radius = 1.0 / last.curvature_1_m
        centre = (
            last.north_m - radius * math.sin(last.course_rad),
            last.east_m + radius * math.cos(last.course_rad),
        )
        assert centre == pytest.approx((north, east), abs=1e-6)


def test_a_formation_flies_from_home_straight_at_the_height_of_the_first_waypoint() -> None:
    first = mission_path(square(), LIMITS, Home(50.0, -20.0, 7.0)).legs[0]
    assert (first.north_m, first.east_m, first.height_m) == (50.0, -20.0, 100.0)
    assert first.curvature_1_m == first.climb == 0.0


def test_a_climb_is_even_and_one_too_steep_for_its_way_is_refused() -> None:
    a, b, *_ = square()
    path = mission_path([a, Waypoint(2, b.north_m, b.east_m, 300.0)], LIMITS, Home(), START)
    assert len({round(leg.climb, 9) for leg in path.legs if leg.item == 2 and leg.climb}) == 1
    with pytest.raises(ItemError, match=r"Item 2: height changes by \+900 m on a way of .* m, "):
        mission_path([a, Waypoint(2, b.north_m, b.east_m, 1000.0)], LIMITS, Home(), START)
    circle = Loiter(2, (b.north_m, b.east_m), 1000.0)
    assert_joined(mission_path([a, circle], LIMITS, Home(), START))


@pytest.mark.parametrize(
    ("tasks", "item", "reason"),
    [
        ([Loiter(1, (0.0, 0.0), 100.0, 100.0)], 1, "radius 100 m, must be >= "),
        ([SetSpeed(1, 40.0)], 1, "no waypoint or circle follows"),
        ([*square(), Jump(5, 6, -1), Jump(6, 5, -1)], 5, "leads around without a waypoint"),
        ([*square(), Jump(5, 1, 300)], 5, "jumps make more than 1000 places"),
        ([*square(), Jump(5, 1, 200)], 5, "with this jump the path has more than 256 legs"),
        ([Waypoint(k, 9e2 * k, 9e2 * (k % 2), 0.0) for k in range(1, 90)], 86, "more than 256"),
        ([*square(side=400.0), Jump(5, 1, -1)], 1, "waypoints are too near to go around: turns "),
    ],
)
def test_what_cannot_be_flown_is_refused_with_its_item(
    tasks: list[Task], item: int, reason: str
) -> None:
    with pytest.raises(ItemError, match=reason) as refusal:
        mission_path(tasks, LIMITS, Home(), START)
    assert refusal.value.seq == item


def test_other_missions_have_other_numbers() -> None:
    one, two = (mission_path(square(side=side), LIMITS, Home()) for side in (2000.0, 2001.0))
    assert path_id_of(one) == path_id_of(mission_path(square(), LIMITS, Home()))
    assert 0 < path_id_of(one) != path_id_of(two)
