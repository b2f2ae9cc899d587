"""Missions that are edited: whatever is done, jumps lead to where they led before."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcs.station.mission import (
    Mission,
    inserted,
    is_same,
    item_text,
    moved,
    profile_of,
    removed,
    waypoint,
    with_place,
)
from mavlink_defs import dialect
from mavlink_defs.profile import Segment, segments_to_items
from mavlink_defs.services.mission import MissionItem

RELATIVE = dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT


def item(command: int, *params: float, x: int = 0, y: int = 0, z: float = 0.0) -> MissionItem:
    p1, p2, p3, p4 = (*params, 0.0, 0.0, 0.0, 0.0)[:4]
    return dialect.MAVLink_mission_item_int_message(
        1, 1, 0, RELATIVE, command, 0, 1, p1, p2, p3, p4, x, y, z
    )


def mission_of(*items: MissionItem) -> Mission:
    home = item(dialect.MAV_CMD_NAV_WAYPOINT)
    mission: Mission = (home,)
    for one in items:
        mission = inserted(mission, len(mission), one)
    return mission


@st.composite
def missions(draw: st.DrawFn) -> Mission:
    """Waypoints, each with a place of its own, and jumps to anywhere."""
    count = draw(st.integers(1, 8))
    items = [
        item(dialect.MAV_CMD_DO_JUMP, draw(st.integers(1, count)), 2.0)
        if draw(st.booleans())
        else item(dialect.MAV_CMD_NAV_WAYPOINT, x=k + 1)
        for k in range(count)
    ]
    for k, one in enumerate(items):
        one.seq = k + 1
        one.y = 1000 + k  # tells items apart, also jumps
    return (item(dialect.MAV_CMD_NAV_WAYPOINT), *items)


def jumps(mission: Mission) -> dict[int, int]:
    """Return what each jump leads to; both known by their mark."""
    return {
        one.y: mission[int(one.param1)].y
        for one in mission
        if one.command == dialect.MAV_CMD_DO_JUMP
    }


@given(missions(), st.data())
def test_jumps_follow_their_items(mission: Mission, data: st.DataObject) -> None:
    places = st.integers(1, len(mission) - 1)
    at, to = data.draw(places), data.draw(places)
    before = jumps(mission)
    more = inserted(mission, at, item(dialect.MAV_CMD_NAV_WAYPOINT, x=99, y=99))
    swapped = moved(mission, at, to)
    for edited in (more, swapped):
        assert [one.seq for one in edited] == list(range(len(edited)))
        assert jumps(edited) == before
    assert is_same(removed(more, at), mission)
    assert is_same(moved(swapped, to, at), mission)
    gone = mission[at].y
    fewer = removed(mission, at)
    if len(fewer) > 1:
        left = {jump: target for jump, target in before.items() if jump != gone}
        after = jumps(fewer)
        assert after.keys() == left.keys()
        following = mission[at + 1] if at + 1 < len(mission) else fewer[-1]
        for jump, target in left.items():
            assert after[jump] == (following.y if target == gone else target)


def test_editing_changes_no_other_mission() -> None:
    mission = mission_of(item(dialect.MAV_CMD_NAV_WAYPOINT, x=1), item(dialect.MAV_CMD_DO_JUMP, 1))
    texts = [str(one) for one in mission]
    inserted(mission, 1, waypoint(mission[1], 5, 6, 70.0))
    with_place(mission, 1, 5, 6, 70.0)
    moved(mission, 2, 1)
    removed(mission, 1)
    assert [str(one) for one in mission] == texts


def test_what_the_wire_rounds_is_the_same() -> None:
    ours = mission_of(item(dialect.MAV_CMD_NAV_WAYPOINT, math.nan, x=1, z=100.1))
    theirs = mission_of(item(dialect.MAV_CMD_NAV_WAYPOINT, math.nan, x=1, z=100.0999984741211))
    assert is_same(ours, theirs)
    theirs[0].x = 7  # home is the vehicle's own
    assert is_same(ours, theirs)
    assert not is_same(ours, with_place(theirs, 1, 2, 0, 100.1))
    assert not is_same(ours, theirs[:1])


def test_a_new_waypoint_counts_its_altitude_as_its_neighbour_does() -> None:
    absolute = item(dialect.MAV_CMD_NAV_WAYPOINT)
    absolute.frame = dialect.MAV_FRAME_GLOBAL_INT
    assert waypoint(absolute, 1, 2, 3.0).frame == dialect.MAV_FRAME_GLOBAL_INT
    assert waypoint(item(dialect.MAV_CMD_DO_JUMP, 1), 1, 2, 3.0).frame == RELATIVE


def test_a_mission_is_a_profile_or_not() -> None:
    segment = Segment(0.0, 40.0, 0.0, 0.0, 0.0, ramp=False)
    assert profile_of(tuple(segments_to_items([segment], 1, 1))) == (segment,)
    assert profile_of(()) == profile_of(mission_of()) == ()
    assert profile_of(mission_of(item(dialect.MAV_CMD_NAV_WAYPOINT, x=1))) is None


@pytest.mark.parametrize(
    ("one", "text"),
    [
        (item(dialect.MAV_CMD_NAV_WAYPOINT), "waypoint"),
        (item(dialect.MAV_CMD_NAV_WAYPOINT, 0.0, 0.0, -50.0), "waypoint, pass by -50 m"),
        (item(dialect.MAV_CMD_NAV_LOITER_UNLIM, 0.0, 0.0, math.nan), "loiter"),
        (item(dialect.MAV_CMD_NAV_LOITER_TURNS, 2.0, 0.0, 300.0), "loiter 2 turns, radius 300 m"),
        (item(dialect.MAV_CMD_NAV_LOITER_TURNS, 1.0), "loiter 1 turn"),
        (item(dialect.MAV_CMD_NAV_LOITER_TIME, 60.0), "loiter 60 s"),
        (item(dialect.MAV_CMD_DO_JUMP, 2.0, -1.0), "jump to 2, always"),
        (item(dialect.MAV_CMD_DO_JUMP, 2.0, 5.0), "jump to 2, 5 times"),
        (item(dialect.MAV_CMD_DO_CHANGE_SPEED, 0.0, 45.0), "speed 45 m/s"),
        (item(dialect.MAV_CMD_NAV_LOITER_TO_ALT, 0.0, -90.0), "loiter to altitude, radius -90 m"),
        (item(dialect.MAV_CMD_DO_JUMP_TAG, 7.0, 1.0), "jump to tag 7, 1 time"),
        (item(dialect.MAV_CMD_DO_SET_SERVO, 9.0, 1500.0), "DO_SET_SERVO 9 1500"),
        (item(dialect.MAV_CMD_NAV_LAND), "land"),
    ],
)
def test_texts_of_items(one: MissionItem, text: str) -> None:
    assert item_text(one) == text
