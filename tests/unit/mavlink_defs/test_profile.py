import math
from contextlib import suppress
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lossy_network import GCS, over_the_wire

from mavlink_defs import dialect
from mavlink_defs.dialect import MAVLink_mission_item_int_message
from mavlink_defs.profile import (
    MAX_SEGMENTS,
    AirspeedLimits,
    ProfileError,
    Segment,
    check_mission,
    items_to_segments,
    segments_to_items,
)

LIMITS = AirspeedLimits(15.0, 45.0)


def decimals(low: float, high: float, places: int) -> st.SearchStrategy[float]:
    scale = 10**places
    return st.integers(round(low * scale), round(high * scale)).map(lambda n: n / scale)


@st.composite
def profiles(draw: st.DrawFn, max_segments: int = MAX_SEGMENTS) -> tuple[Segment, ...]:
    later = st.sets(decimals(0.01, 900.0, 2), max_size=max_segments - 1)
    starts = [0.0, *sorted(draw(later))]
    last = len(starts) - 1
    return tuple(
        Segment(
            start,
            draw(decimals(15.0, 45.0, 3)),
            draw(decimals(-90.0, 90.0, 7)),
            draw(decimals(-89.9, 89.9, 7)),
            draw(decimals(-180.0, 180.0, 3)),
            ramp=0 < i < last and draw(st.booleans()),
        )
        for i, start in enumerate(starts)
    )


def segment(start_s: float = 0.0, ramp: bool = False) -> Segment:
    return Segment(start_s, 30.0, 5.0, 2.0, -10.0, ramp)


def mission(*segments: Segment) -> list[MAVLink_mission_item_int_message]:
    return segments_to_items(segments, 1, 1)


@given(profiles())
def test_profile_crosses_the_wire_unchanged(profile: tuple[Segment, ...]) -> None:
    received: Any = [over_the_wire(item, GCS) for item in mission(*profile)]
    assert items_to_segments(received, LIMITS) == profile


def test_item_0_is_home() -> None:
    home, first = mission(segment())
    assert (home.seq, home.command) == (0, dialect.MAV_CMD_NAV_WAYPOINT)
    assert (first.seq, first.command) == (1, dialect.MAV_CMD_FTC_REFERENCE_SEGMENT)
    assert (first.x, first.y, first.z) == (50_000_000, 20_000_000, 0.0)
    assert (first.frame, first.autocontinue) == (dialect.MAV_FRAME_GLOBAL, 1)


@pytest.mark.parametrize(
    ("field", "value", "result"),
    [
        ("param1", math.nan, dialect.MAV_MISSION_INVALID_PARAM1),
        ("param1", math.inf, dialect.MAV_MISSION_INVALID_PARAM1),
        ("param1", -1.0, dialect.MAV_MISSION_INVALID_PARAM1),
        ("param1", 0.0, dialect.MAV_MISSION_INVALID_PARAM1),  # not after the segment before
        ("param2", 14.9, dialect.MAV_MISSION_INVALID_PARAM2),
        ("param2", 45.1, dialect.MAV_MISSION_INVALID_PARAM2),
        ("param2", math.nan, dialect.MAV_MISSION_INVALID_PARAM2),
        ("param3", 2.0, dialect.MAV_MISSION_INVALID_PARAM3),
        ("param3", 0.5, dialect.MAV_MISSION_INVALID_PARAM3),
        ("param3", math.nan, dialect.MAV_MISSION_INVALID_PARAM3),
        ("param4", 180.1, dialect.MAV_MISSION_INVALID_PARAM4),
        ("param4", -math.inf, dialect.MAV_MISSION_INVALID_PARAM4),
        ("x", 900_000_001, dialect.MAV_MISSION_INVALID_PARAM5_X),
        ("x", 2**31 - 1, dialect.MAV_MISSION_INVALID_PARAM5_X),
        ("y", -900_000_000, dialect.MAV_MISSION_INVALID_PARAM6_Y),
        ("command", dialect.MAV_CMD_NAV_WAYPOINT, dialect.MAV_MISSION_UNSUPPORTED),
        ("frame", dialect.MAV_FRAME_LOCAL_NED, dialect.MAV_MISSION_UNSUPPORTED_FRAME),
        ("seq", 3, dialect.MAV_MISSION_INVALID_SEQUENCE),
    ],
)
def test_bad_item_is_answered_with_the_matching_result(
    field: str, value: float, result: int
) -> None:
    items = mission(segment(), segment(10.0), segment(20.0))
    setattr(items[2], field, value)
    with pytest.raises(ProfileError) as caught:
        items_to_segments(items, LIMITS)
    assert (caught.value.seq, caught.value.mav_mission_result) == (2, result)
    assert str(caught.value) == caught.value.text
    assert len(caught.value.text) <= 50


@pytest.mark.parametrize(
    ("segments", "seq", "result"),
    [
        ([], 0, dialect.MAV_MISSION_INVALID),
        ([segment(1.0)], 1, dialect.MAV_MISSION_INVALID_PARAM1),
        ([segment(ramp=True), segment(1.0)], 1, dialect.MAV_MISSION_INVALID_PARAM3),
        ([segment(), segment(1.0, ramp=True)], 2, dialect.MAV_MISSION_INVALID_PARAM3),
        ([segment(), segment(2.0), segment(1.0)], 3, dialect.MAV_MISSION_INVALID_PARAM1),
        ([segment(float(i)) for i in range(51)], 51, dialect.MAV_MISSION_NO_SPACE),
    ],
)
def test_bad_profile_is_refused(segments: list[Segment], seq: int, result: int) -> None:
    with pytest.raises(ProfileError) as caught:
        items_to_segments(mission(*segments), LIMITS)
    assert (caught.value.seq, caught.value.mav_mission_result) == (seq, result)


def test_fifty_segments_fit() -> None:
    assert len(items_to_segments(mission(*map(segment, range(50))), LIMITS)) == 50


def test_forgotten_home_is_pointed_out() -> None:
    items = mission(segment(), segment(1.0))[1:]
    for seq, item in enumerate(items):
        item.seq = seq
    for some in (items, items[:1]):
        with pytest.raises(ProfileError, match="item 0 is home"):
            check_mission(some, LIMITS)


def test_home_alone_is_an_empty_mission() -> None:
    check_mission(mission(), LIMITS)
    with pytest.raises(ProfileError):
        items_to_segments(mission(), LIMITS)


floats32 = st.floats(width=32)
items = st.builds(
    MAVLink_mission_item_int_message,
    st.just(1),
    st.just(1),
    st.integers(0, 3),
    st.integers(0, 255),
    st.sampled_from([16, 53100]),
    st.just(0),
    st.just(1),
    floats32,
    floats32,
    floats32,
    floats32,
    st.integers(-(2**31), 2**31 - 1),
    st.integers(-(2**31), 2**31 - 1),
    floats32,
)


@given(st.lists(items, max_size=4))
def test_no_mission_breaks_the_check(mission: list[MAVLink_mission_item_int_message]) -> None:
    with suppress(ProfileError):
        items_to_segments(mission, LIMITS)
