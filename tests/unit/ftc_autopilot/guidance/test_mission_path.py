"""The path of a mission: joined without a corner, through its places, within limits."""

import math
from itertools import groupby

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from ftc_autopilot.guidance.legs import Leg, Pose
from ftc_autopilot.guidance.limits import FlightLimits, tightest_turn
from ftc_autopilot.guidance.mission_items import MissionTarget
from ftc_autopilot.guidance.mission_path import MissionPath, Start, mission_path
from ftc_autopilot.guidance.mission_places import Home
from ftc_autopilot.guidance.path import (
    MAX_LEGS,
    NO_LOOP,
    commands_between,
    path_record,
    point_at,
)
from mavlink_defs.mission_files import mission_item
from mavlink_defs.profile import ItemError

LIMITS = FlightLimits(40.0, math.radians(40.0), 25.0, 0.3, 0.0, 0.0, 9.8)
START = Start(Pose(0.0, 0.0, 0.5), 100.0, 40.0)
metres = st.floats(-4000.0, 4000.0)


def waypoint(
    seq: int, north: float, east: float, height: float = 100.0, within: float = 0.0
) -> MissionTarget:
    return MissionTarget(mission_item(seq, 16), (north, east), height, within)


def loiter(
    seq: int,
    centre: tuple[float, float] | None,
    height: float = 100.0,
    radius: float = 0.0,
    turns: float | None = None,
    seconds: float | None = None,
) -> MissionTarget:
    command, first = 17, 0.0
    if turns is not None:
        command, first = 18, turns
    elif seconds is not None:
        command, first = 19, seconds
    return MissionTarget(mission_item(seq, command, (first,)), centre, height, radius=radius)


def returns(seq: int) -> MissionTarget:
    return MissionTarget(mission_item(seq, 20))


def speed(seq: int, airspeed: float) -> MissionTarget:
    return MissionTarget(mission_item(seq, 178, (0.0, airspeed)))


def delay(seq: int, seconds: float) -> MissionTarget:
    return MissionTarget(mission_item(seq, 112, (seconds,)))


def jump(seq: int, to: int, times: int) -> MissionTarget:
    return MissionTarget(mission_item(seq, 177, (to, times)))


def command(seq: int) -> MissionTarget:
    return MissionTarget(mission_item(seq, 183, (9.0, 1500.0)))


def square(within: float = 0.0, side: float = 2000.0) -> list[MissionTarget]:
    places = [(side, 0.0), (side, side), (0.0, side), (0.0, 0.0)]
    return [waypoint(k, *place, 100.0, within) for k, place in enumerate(places, start=1)]


def numbered(target: MissionTarget, seq: int) -> MissionTarget:
    return target._replace(item=mission_item(seq, target.item.command))


def miss(path: MissionPath, target: MissionTarget) -> float:
    """Least distance of a waypoint from the legs of its item [m]."""
    assert target.place is not None
    places = places_of(path, target.item.seq)
    return float(np.hypot(*(places - np.array(target.place)).T).min())


def end_of(leg: Leg) -> tuple[float, float, float, float]:
    path = path_record([leg])
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
            record = path_record([leg])
            for s in np.arange(0.0, min(leg.length_m, 5000.0) + 2.0, 2.0):
                point = point_at(record, min(float(s), leg.length_m))
                found.append((point.north, point.east))
    return np.array(found)


@st.composite
def missions(draw: st.DrawFn) -> list[MissionTarget]:
    """Level missions of every kind of item but jumps."""
    places = draw(st.lists(st.tuples(metres, metres), min_size=1, max_size=8))
    mission: list[MissionTarget] = []
    for north, east in places:
        if draw(st.booleans()):
            mission.append(speed(len(mission) + 1, draw(st.floats(35.0, 50.0))))
        if draw(st.booleans()):
            mission.append(delay(len(mission) + 1, draw(st.floats(0.0, 60.0))))
            mission.append(speed(len(mission) + 1, draw(st.floats(35.0, 50.0))))
        seq = len(mission) + 1
        if draw(st.booleans()):
            within = draw(st.sampled_from([0.0, 1.0, 10.0, 100.0]))
            mission.append(waypoint(seq, north, east, within=within))
        else:
            radius = draw(st.sampled_from([0.0, 600.0, -600.0]))
            centre = draw(st.sampled_from([(north, east), None]))
            turns = draw(st.sampled_from([0.0, 1.5, None]))
            seconds = draw(st.floats(0.0, 30.0))
            mission.append(loiter(seq, centre, 100.0, radius, turns, seconds))
    if draw(st.booleans()):
        mission.append(returns(len(mission) + 1))
    return mission


@given(missions(), st.sampled_from([None, START]))
def test_legs_join_and_turns_can_be_flown(
    mission: list[MissionTarget], start: Start | None
) -> None:
    path = mission_path(mission, LIMITS, Home(), start)
    assert_joined(path)
    for leg in path.legs:
        tightest = tightest_turn(leg.airspeed_m_s, LIMITS)
        assert abs(leg.curvature_1_m) * tightest < 1.0 + 1e-6


@settings(max_examples=settings().max_examples // 2)
@given(missions(), st.sampled_from([None, START]))
def test_every_waypoint_is_passed_as_near_as_asked(
    mission: list[MissionTarget], start: Start | None
) -> None:
    path = mission_path(mission, LIMITS, Home(), start)
    for target in mission:
        if target.within > 0.0:
            assert miss(path, target) < target.within + 1.1  # the places are 2 m apart


@given(st.lists(st.tuples(metres, metres, st.sampled_from([0.0, 5.0])), min_size=2, max_size=6))
def test_a_mission_that_goes_around_closes(places: list[tuple[float, float, float]]) -> None:
    near = zip(places, [*places[1:], places[0]], strict=True)
    assume(all(math.dist(a[:2], b[:2]) > 1500.0 for a, b in near))
    mission = [
        waypoint(k, north, east, 100.0, within)
        for k, (north, east, within) in enumerate(places, start=1)
    ]
    path = mission_path([*mission, jump(len(mission) + 1, 1, -1)], LIMITS, Home(), START)
    assert path.loop != NO_LOOP
    assert_joined(path)
    assert {leg.item for leg in path.legs[path.loop :]} == set(range(1, len(mission) + 1))


def test_the_turns_of_a_square_are_of_20_degrees_of_bank_inside_its_corners() -> None:
    path = mission_path([*square(), jump(5, 1, -1)], LIMITS, Home())
    arcs = [leg for leg in path.legs[path.loop :] if leg.curvature_1_m]
    radius = 40.0**2 / (9.8 * math.tan(math.radians(20.0)))
    assert [1.0 / leg.curvature_1_m for leg in arcs] == pytest.approx([radius] * 8)
    assert sum(leg.length_m for leg in path.legs[path.loop :]) == pytest.approx(
        4.0 * (2000.0 - 2.0 * radius) + 2.0 * math.pi * radius
    )
    assert [leg.item for leg in path.legs[path.loop :]] == [*[1] * 3, *[2] * 3, *[3] * 3, *[4] * 3]


def test_a_square_too_small_for_its_turns_has_tighter_ones_or_goes_over_the_waypoints() -> None:
    wide = mission_path([*square(side=800.0), jump(5, 1, -1)], LIMITS, Home(), START)
    radii = [1.0 / leg.curvature_1_m for leg in wide.legs[wide.loop :] if leg.curvature_1_m]
    assert radii == pytest.approx([400.0] * 8)
    narrow = mission_path(square(side=400.0), LIMITS, Home(), START)
    assert all(miss(narrow, target) < 1.1 for target in square(side=400.0))


def test_after_the_last_waypoint_it_circles_through_it_to_the_right() -> None:
    last = mission_path(square()[:1], LIMITS, Home(), START).legs[-1]
    assert (last.length_m, last.item) == (math.inf, 1)
    assert (last.north_m, last.east_m) == pytest.approx((2000.0, 0.0), abs=1e-6)
    assert last.curvature_1_m > 0.0


def test_jumps_are_carried_out_and_then_the_mission_goes_on() -> None:
    a, b, *_ = square()
    path = mission_path([a, b, jump(3, 1, 2), waypoint(4, 0.0, 9e3, 100.0)], LIMITS, Home(), START)
    order = [leg.item for leg in path.legs]
    visits = [item for k, item in enumerate(order) if k == 0 or order[k - 1] != item]
    assert visits == [1, 2, 1, 2, 1, 2, 4]


def test_a_mission_begins_with_any_item() -> None:
    path = mission_path(square(), LIMITS, Home(), START, first=3)
    assert {leg.item for leg in path.legs} == {3, 4}


def test_a_loiter_lasts_as_long_as_it_says() -> None:
    mission = [
        loiter(1, (3000.0, 0.0), 100.0, -600.0, turns=2.0),
        loiter(2, (3000.0, 9000.0), 100.0, 600.0, seconds=100.0),
        returns(3),
    ]
    path = mission_path(mission, LIMITS, Home(), START)
    circles = [leg for leg in path.legs if abs(abs(leg.curvature_1_m) - 1.0 / 600.0) < 1e-9]
    assert circles[0].length_m == pytest.approx(2.0 * 2.0 * math.pi * 600.0)
    assert [leg.curvature_1_m < 0.0 for leg in circles][:2] == [True, True]
    assert any(leg.length_m == pytest.approx(100.0 * 40.0) for leg in circles if leg.item == 2)


def test_speed_changes_where_the_delay_ends() -> None:
    a, b, *_ = square(within=1.0)
    mission = [a, speed(2, 45.0), delay(3, 10.0), speed(4, 50.0), numbered(b, 5)]
    path = mission_path(mission, LIMITS, Home(), START)
    way = [leg for leg in path.legs if leg.item == 5 and leg.length_m < math.inf]
    slow = sum(leg.length_m for leg in way if leg.airspeed_m_s == 45.0)
    assert slow == pytest.approx(450.0)
    assert {leg.airspeed_m_s for leg in path.legs if leg.item == 1} == {40.0}
    assert path.legs[-1].airspeed_m_s == 50.0


def test_commands_are_passed_where_conditions_let_them_and_change_no_leg() -> None:
    a, b, *_ = square(within=1.0)
    left = MissionTarget(mission_item(5, 114, (300.0,)))
    beyond = delay(7, 1e4)
    on_the_way = [command(2), delay(3, 10.0), command(4), left, command(6), beyond, command(8)]
    mission = [a, *on_the_way, numbered(b, 9), command(10), delay(11, 5.0), command(12)]
    path = mission_path(mission, LIMITS, Home(), START)
    record = path_record(*path[:4])
    found = {item: s for s, item in commands_between(record, -1.0, math.inf)}
    begin = next(float(record["start"][k]) for k, leg in enumerate(path.legs) if leg.item == 9)
    end = max(float(record["start"][k]) for k, leg in enumerate(path.legs) if leg.item == 9)
    expected = [begin, begin + 400.0, end - 300.0, end, end, end + 200.0]
    assert list(found) == [2, 4, 6, 8, 10, 12]
    assert list(found.values()) == pytest.approx(expected, abs=1e-6)
    plain = mission_path([a, numbered(b, 9)], LIMITS, Home(), START)
    assert plain.legs == path.legs


def test_speed_changes_where_so_much_of_the_way_is_left() -> None:
    a, b, *_ = square(within=1.0)
    left = MissionTarget(mission_item(2, 114, (300.0,)))
    path = mission_path([a, left, speed(3, 50.0), numbered(b, 4)], LIMITS, Home(), START)
    way = [leg for leg in path.legs if leg.item == 4 and leg.length_m < math.inf]
    assert sum(leg.length_m for leg in way if leg.airspeed_m_s == 50.0) == pytest.approx(300.0)


def test_speeds_that_are_none_leave_the_airspeed_or_return_to_cruise() -> None:
    a, b, c, _ = square()
    mission = [a, speed(2, 50.0), speed(3, -1.0), numbered(b, 4), speed(5, -2.0), numbered(c, 6)]
    path = mission_path(mission, LIMITS, Home(), START)
    assert {leg.airspeed_m_s for leg in path.legs if leg.item == 4} == {50.0}
    assert {leg.airspeed_m_s for leg in path.legs if leg.item == 6} == {40.0}


def test_a_circle_to_an_altitude_is_left_as_soon_as_it_is_reached() -> None:
    to_altitude = MissionTarget(mission_item(1, 31), (3000.0, 0.0), 2000.0, radius=600.0)
    path = mission_path([to_altitude, loiter(2, (3000.0, 9000.0))], LIMITS, Home(), START)
    assert_joined(path)
    there = [leg for leg in path.legs if leg.item == 1]
    assert there[-1].curvature_1_m == pytest.approx(1.0 / 600.0)
    assert sum(leg.length_m for leg in there) == pytest.approx(1900.0 / LIMITS.climb)


def test_jumps_to_a_tag_lead_to_the_first_item_that_has_it() -> None:
    a, b, *_ = square()
    tags = [MissionTarget(mission_item(seq, 600, (7.0,))) for seq in (2, 4)]
    back = MissionTarget(mission_item(5, 601, (7.0, 2.0)))
    path = mission_path([a, tags[0], numbered(b, 3), tags[1], back], LIMITS, Home(), START)
    order = [leg.item for leg in path.legs]
    assert order.count(1) < 4
    assert [item for item, _ in groupby(order)] == [1, 3]
    assert [item for _, item in commands_between(path_record(*path[:4]), -1.0, math.inf)] == [
        *[2, 4] * 3
    ]


def test_a_waypoint_without_a_place_is_where_the_path_is() -> None:
    a, b, *_ = square()
    nowhere = MissionTarget(mission_item(2, 16), None, 100.0)
    path = mission_path([a, nowhere, numbered(b, 3)], LIMITS, Home(), START)
    assert_joined(path)
    assert miss(path, a) < 1.1


def test_as_many_items_as_a_mission_may_have_fit() -> None:
    mission = [waypoint(k, 9e2 * k, 9e2 * (k % 2), 100.0, 1.0) for k in range(1, 1001)]
    assert 1000 < len(mission_path(mission, LIMITS, Home(), START).legs) <= MAX_LEGS


def test_home_is_where_it_was_set_last() -> None:
    a, b, *_ = square()
    here = MissionTarget(mission_item(2, 179, (1.0,)))
    elsewhere = MissionTarget(mission_item(2, 179), (5000.0, 5000.0))
    for set_home, place in ((elsewhere, elsewhere.place), (here, a.place)):
        mission = [a, set_home, numbered(b, 3), returns(4)]
        last = mission_path(mission, LIMITS, Home(), START).legs[-1]
        radius = 1.0 / last.curvature_1_m
        centre = (
            last.north_m - radius * math.sin(last.course_rad),
            last.east_m + radius * math.cos(last.course_rad),
        )
        assert centre == pytest.approx(place, abs=1e-6)


def test_a_formation_flies_from_home_straight_at_the_height_of_the_first_waypoint() -> None:
    first = mission_path(square(), LIMITS, Home(50.0, -20.0, 7.0)).legs[0]
    assert (first.north_m, first.east_m, first.height_m) == (50.0, -20.0, 100.0)
    assert first.curvature_1_m == first.climb == 0.0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_circle_too_tight_is_flown_as_tight_as_can_be(side: float) -> None:
    mission = [*square()[:2], loiter(3, (500.0, 0.0), 100.0, side * 100.0, turns=2.0)]
    path = mission_path([*mission, loiter(4, (0.0, 0.0), 100.0, 600.0)], LIMITS, Home(), START)
    assert_joined(path)
    least = tightest_turn(40.0, LIMITS)
    circle = max((leg for leg in path.legs if leg.item == 3), key=lambda leg: leg.length_m)
    assert 1.0 / circle.curvature_1_m == pytest.approx(side * least)
    assert circle.length_m == pytest.approx(4.0 * math.pi * least)
    assert 1.0 / path.legs[-1].curvature_1_m == pytest.approx(600.0)


def test_speeds_beyond_the_limits_are_flown_as_the_nearest_within_them() -> None:
    limits = LIMITS._replace(slowest_m_s=30.0, fastest_m_s=60.0)
    mission = [speed(1, 12.0), waypoint(2, 3e3, 0.0), speed(3, 99.0), waypoint(4, 6e3, 0.0)]
    mission += [speed(5, -2.0), waypoint(6, 9e3, 0.0)]
    legs = mission_path(mission, limits, Home()).legs
    assert [leg.airspeed_m_s for leg in legs[:3]] == [30.0, 60.0, 40.0]


def test_what_is_not_flown_as_asked_is_said() -> None:
    limits = LIMITS._replace(slowest_m_s=30.0, fastest_m_s=60.0)
    circles = [loiter(k, (1e3, 0.0), 100.0, -100.0, turns=1.0) for k in (2, 4)]
    as_asked = [speed(1, 60.0), loiter(2, (1e3, 0.0), 100.0, 2e3, turns=1.0), speed(3, -2.0)]
    assert not mission_path(as_asked, limits, Home()).remarks
    mission = [speed(1, 20.0), circles[0], speed(3, 99.0), circles[1]]
    least = math.ceil(tightest_turn(30.0, limits))
    assert mission_path(mission, limits, Home()).remarks == (
        "item 1 and 1 more: airspeed 20, must be 30 to 60 m/s; 30 m/s is flown",
        f"item 2 and 1 more: radius 100 m, must be >= {least} m at 30 m/s; flown as tight as that",
    )


def test_a_climb_is_even_and_one_too_steep_for_its_way_goes_on_behind_it() -> None:
    a, b, *_ = square()
    path = mission_path([a, b._replace(height=300.0)], LIMITS, Home(), START)
    assert len({round(leg.climb, 9) for leg in path.legs if leg.item == 2 and leg.climb}) == 1
    steep = mission_path(
        [a, b._replace(height=1000.0), waypoint(3, 2e3, 4e3, 1000.0)], LIMITS, Home(), START
    )
    assert_joined(steep)
    climbs = {leg.item: leg.climb for leg in reversed(steep.legs)}
    assert [climbs[2], climbs[3]] == pytest.approx([0.3, 0.15], abs=0.02)
    end = point_at(path_record(*steep[:4]), 1e5)
    assert end.height == pytest.approx(1000.0)
    (remark,) = steep.remarks
    assert remark.startswith("item 2: height changes by +900 m on a way of 1")
    assert remark.endswith(" m too low")
    circle = loiter(2, b.place, 1000.0)
    assert_joined(mission_path([a, circle], LIMITS, Home(), START))


@pytest.mark.parametrize(
    ("mission", "item", "reason"),
    [
        ([speed(1, 40.0)], 1, "no waypoint or circle follows"),
        ([*square(), jump(5, 6, -1), jump(6, 5, -1)], 5, "leads around without a waypoint"),
        ([*square(), jump(5, 1, 300)], 5, "jumps make more than 1000 places"),
        (
            [*(command(k) for k in range(1, 8)), numbered(square()[0], 8), jump(9, 1, 300)],
            9,
            "with this jump the path has more than 2000 commands; jump less often",
        ),
        (
            [waypoint(k, 9e2 * k, 9e2 * (k % 2), 0.0) for k in range(1, 1400)],
            1366,
            "more than 4096 legs up to here; shorten",
        ),
        ([*square(side=400.0), jump(5, 1, -1)], 3, "waypoints are too near to go around: turns "),
    ],
)
def test_what_cannot_be_flown_is_refused_with_its_item(
    mission: list[MissionTarget], item: int, reason: str
) -> None:
    with pytest.raises(ItemError, match=reason) as refusal:
        mission_path(mission, LIMITS, Home(), START)
    assert refusal.value.seq == item


def test_other_missions_have_other_numbers() -> None:
    ids = [
        int(path_record(*mission_path(square(side=side), LIMITS, Home())[:4])["id"])
        for side in (2000.0, 2000.0, 2001.0)
    ]
    assert 0 < ids[0] == ids[1] != ids[2]


def test_a_take_off_leads_at_least_ten_metres_up() -> None:
    low = MissionTarget(mission_item(1, 22), height=3.0)
    assert mission_path([low, square()[1]], LIMITS, Home()).remarks == (
        "item 1: it leads 3.0 m above the runway, must be >= 10 m, which is flown",
    )
    assert not mission_path([low._replace(height=10.0), square()[1]], LIMITS, Home()).remarks
