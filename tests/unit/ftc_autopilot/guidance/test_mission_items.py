"""Items of the mission protocol in the world, and what is refused of them."""

import contextlib
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ftc_autopilot.common.geography import Origin, place_of, position_of
from ftc_autopilot.guidance.limits import FlightLimits
from ftc_autopilot.guidance.mission_commands import ANNOUNCED, command_text
from ftc_autopilot.guidance.mission_items import MissionTarget, decode_items, remarks_on
from ftc_autopilot.guidance.mission_places import Home
from mavlink_defs import dialect
from mavlink_defs.constants import INT32_MAX
from mavlink_defs.mission_files import mission_item
from mavlink_defs.profile import ItemError
from mavlink_defs.services.mission import MissionItem

ORIGIN = Origin()
LIMITS = FlightLimits(
    40.0, 0.7, 25.0, 0.3, 0.0, 0.0, 9.8, 25.0, 60.0, lowest_m=-10.0, highest_m=3000.0
)
HOME = Home(0.0, 0.0, 20.0)
HERE = place_of(ORIGIN, 800.0, -300.0, 0.0)[:2]
RELATIVE, ABSOLUTE = (
    dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
    dialect.MAV_FRAME_GLOBAL,
)


def decoded(*items: MissionItem) -> tuple[MissionTarget, ...]:
    return decode_items((mission_item(0, 16), *items), ORIGIN, HOME, LIMITS)


def item(command: int, *params: float, z: float = 100.0, frame: int = RELATIVE) -> MissionItem:
    return mission_item(1, command, params, *HERE, z, frame)


@given(st.floats(-50_000.0, 50_000.0), st.floats(-50_000.0, 50_000.0))
def test_a_position_comes_back_from_its_place_to_the_centimetre(north: float, east: float) -> None:
    latitude, longitude, *_ = place_of(ORIGIN, north, east, 0.0)
    assert position_of(ORIGIN, latitude, longitude) == pytest.approx((north, east), abs=0.02)


def test_east_is_near_across_the_date_line() -> None:
    origin = Origin(latitude_deg=0.0, longitude_deg=179.999)
    _, east = position_of(origin, 0, round(-179.999e7))
    assert east == pytest.approx(222.6, abs=0.1)


PLACE = (800.0, -300.0)


@pytest.mark.parametrize(
    ("sent", "place", "height", "within", "radius"),
    [
        (item(16, 0.0, 5.0), PLACE, 120.0, 5.0, 0.0),
        (item(16, math.nan, math.nan, math.nan, math.nan), PLACE, 120.0, 0.0, 0.0),
        (item(16, z=700.0, frame=ABSOLUTE), PLACE, 116.0, 0.0, 0.0),
        (item(16, 0.0, 0.0, -300.0), PLACE, 120.0, 0.0, -300.0),
        (item(17, 0.0, 0.0, -300.0), PLACE, 120.0, 0.0, -300.0),
        (item(18, 2.5, 0.0, 300.0), PLACE, 120.0, 0.0, 300.0),
        (item(19, 60.0), PLACE, 120.0, 0.0, 0.0),
        (mission_item(1, 17, (), 0, 0, 100.0), None, 120.0, 0.0, 0.0),
        (mission_item(1, 17, (), INT32_MAX, INT32_MAX, 100.0), None, 120.0, 0.0, 0.0),
        (item(20), None, 0.0, 0.0, 0.0),
        (item(31, 1.0, -300.0, 9.0, 9.0), PLACE, 120.0, 0.0, -300.0),
        (item(82, 5.0, 9.0, 9.0), PLACE, 120.0, 0.0, 0.0),
        (item(16, frame=dialect.MAV_FRAME_GLOBAL_TERRAIN_ALT), PLACE, 120.0, 0.0, 0.0),
        (mission_item(1, 16, (), INT32_MAX, INT32_MAX, 100.0), None, 120.0, 0.0, 0.0),
        (item(178, 0.0, -2.0), None, 0.0, 0.0, 0.0),
        (item(114, 50.0), None, 0.0, 0.0, 0.0),
        (item(22, z=-500.0), None, -480.0, 0.0, 0.0),
        (item(16, z=-10.0), PLACE, 10.0, 0.0, 0.0),
        (item(178, 1.0, 45.0, -1.0), None, 0.0, 0.0, 0.0),
        (item(177, 1.0, -1.0), None, 0.0, 0.0, 0.0),
        (item(112, 12.5), None, 0.0, 0.0, 0.0),
        (item(179, 1.0), None, 0.0, 0.0, 0.0),
        (item(179, z=600.0, frame=ABSOLUTE), PLACE, 16.0, 0.0, 0.0),
    ],
)
def test_each_item_is_placed(
    sent: MissionItem,
    place: tuple[float, float] | None,
    height: float,
    within: float,
    radius: float,
) -> None:
    (target,) = decoded(sent)
    assert target.item is sent
    assert target.place == (place and pytest.approx(place, abs=0.02))
    assert (target.height, target.within, target.radius) == (height, within, radius)


def test_relative_altitudes_count_from_the_home_that_the_mission_sets() -> None:
    home = mission_item(1, 179, (), *HERE, 634.0, ABSOLUTE)
    _, waypoint = decoded(home, mission_item(2, 16, (), *HERE, 100.0, RELATIVE))
    assert waypoint.height == pytest.approx(150.0)


@pytest.mark.parametrize(
    ("sent", "result", "text"),
    [
        (item(21), "UNSUPPORTED", "Item 1: the aircraft has no gear to land on"),
        (item(84), "UNSUPPORTED", "Item 1: command 84 is not supported: the aircraft cannot hover"),
        (item(219), "UNSUPPORTED", "Item 1: command 219 is not supported"),
        (item(186), "UNSUPPORTED", "not supported: give the next place that altitude"),
        (item(94), "UNSUPPORTED", "cannot hover; give NAV_WAYPOINT (16) and DO_GRIPPER (211)"),
        (item(31, 1.0, 1e9), "INVALID_PARAM2", "radius 1e+09, must be at most 100000 m"),
        (item(114, -1.0), "INVALID_PARAM1", "distance -1, must be 0 to 100000 m"),
        (item(601, 3.0), "INVALID_PARAM1", "jump to tag 3, must be one of a JUMP_TAG (600)"),
        (item(178, 0.0, -3.0), "INVALID_PARAM2", "speed -3, must be above 0 m/s, -1 (as"),
        (item(53100), "UNSUPPORTED", "a mission is a profile of segments or a path, not both"),
        (item(16, frame=8), "UNSUPPORTED_FRAME", "frame 8 is not supported"),
        (item(16, 0.0, -1.0), "INVALID_PARAM2", "acceptance radius -1, must be >= 0 m"),
        (item(17, 0.0, 0.0, 1e9), "INVALID_PARAM3", "radius 1e+09, must be at most 100000 m"),
        (item(18, 0.0), "INVALID_PARAM1", "turns 0, must be"),
        (item(19, -1.0), "INVALID_PARAM1", "time -1, must be 0 to 86400 s"),
        (item(178, 0.0, 0.0), "INVALID_PARAM2", "speed 0, must be above 0 m/s"),
        (item(178, 3.0, 40.0), "INVALID_PARAM1", "speed type 3, must be 0"),
        (item(177, 2.0, -1.0), "INVALID_PARAM1", "jump to item 2, must be 1 to 1"),
        (item(177, 1.0, 0.5), "INVALID_PARAM2", "jumps 0.5, must be -1"),
        (item(16, z=math.nan), "INVALID_PARAM7", "altitude is not given"),
        (item(16, z=-10.5), "INVALID_PARAM7", "is -10.5 m above home, must be -10 to 3000 m"),
        (item(18, 1.0, z=3001.0), "INVALID_PARAM7", "is 3001 m above home, must be -10 to 3000"),
        (item(16, z=593.0, frame=ABSOLUTE), "INVALID_PARAM7", "is -11 m above home, must be"),
        (item(16, z=math.inf), "INVALID_PARAM7", "altitude inf m, must be within 100 km"),
        (mission_item(2, 16, (), *HERE), "INVALID_SEQUENCE", "is at place 1, but has number 2"),
        (
            mission_item(1, 16, (), 473977419, 85455938, 1.0),
            "INVALID_PARAM5_X",
            "km from the origin, must be <= 100 km; to fly there, give the scenario origin: "
            "{latitude_deg: 47.3977, longitude_deg: 8.5456}; to fly it here, gcs mission has",
        ),
        (mission_item(1, 18, (1.0,), 0, 0, 0.0), "INVALID_PARAM7", "altitude is not given"),
        (
            mission_item(1, 179, (), INT32_MAX, INT32_MAX, 1.0),
            "INVALID_PARAM5_X",
            "latitude or longitude is not given",
        ),
        (mission_item(1, 16, (), 95 * 10**7, 0), "INVALID_PARAM5_X", "latitude 95, must be -90"),
    ],
)
def test_what_cannot_be_flown_is_refused_by_item_and_reason(
    sent: MissionItem, result: str, text: str
) -> None:
    with pytest.raises(ItemError) as refusal:
        decoded(sent)
    assert text in refusal.value.text
    assert refusal.value.mav_mission_result == getattr(dialect, f"MAV_MISSION_{result}")


floats = st.floats(width=32)


@given(
    st.integers(0, 255),
    st.sampled_from([16, 17, 18, 19, 20, 31, 82, 112, 114, 177, 178, 179, 206, 600, 601]),
    st.tuples(floats, floats, floats, floats),
    st.integers(-(2**31), 2**31 - 1),
    st.integers(-(2**31), 2**31 - 1),
    floats,
)
def test_no_item_is_too_strange_to_be_refused(
    frame: int, command: int, params: tuple[float, ...], x: int, y: int, z: float
) -> None:
    with contextlib.suppress(ItemError):
        (target,) = decoded(mission_item(1, command, params, x, y, z, frame))
        place = target.place or (0.0, 0.0)
        assert all(map(math.isfinite, (*place, target.height, target.radius)))


def test_what_a_planner_leaves_out_is_as_at_the_place_before() -> None:
    first = mission_item(1, 16, (), *HERE, 80.0)
    nothing = mission_item(2, 16, (), 0, 0, 0.0)
    no_altitude = mission_item(3, 16, (), *HERE, math.nan)
    lower = mission_item(4, 16, (), 0, 0, 50.0)
    found = decoded(first, nothing, no_altitude, lower)
    assert [target.height for target in found] == [100.0, 100.0, 100.0, 70.0]
    assert [target.place is None for target in found] == [False, True, False, True]


@pytest.mark.parametrize("command", sorted(ANNOUNCED))
def test_commands_that_change_no_path_are_taken_whatever_they_say(command: int) -> None:
    strange = mission_item(1, command, (math.nan, -1e9, 3.0, 4.0), 5, -6, math.nan, 2)
    assert decoded(strange) == (MissionTarget(strange),)


@pytest.mark.parametrize("place", [16, 17, 20])
def test_a_takeoff_is_taken_as_past_before_the_first_place_only(place: int) -> None:
    speed = mission_item(1, 178, (0.0, 45.0))
    takeoff = mission_item(2, 22, (15.0, 0.0, 0.0, math.nan), 0, 0, 50.0)
    assert decoded(speed, takeoff, mission_item(3, place, (), *HERE, 100.0))[1].item is takeoff
    with pytest.raises(ItemError, match=r"^Item 2: a takeoff stands before the first place only"):
        decoded(mission_item(1, place, (), *HERE, 100.0), takeoff)
    on_ground = mission_item(1, 93, (30.0,))
    assert decoded(on_ground, takeoff)[0].item is on_ground
    with pytest.raises(ItemError, match=r"cannot hover; give NAV_LOITER_TIME \(19\)"):
        decoded(mission_item(1, place, (), *HERE, 100.0), mission_item(2, 93, (30.0,)))


def test_remarks_say_what_is_flown_otherwise() -> None:
    frame = dialect.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT
    home, plain = mission_item(0, 16), mission_item(1, 16)
    assert not list(remarks_on((home, plain)))
    other = (mission_item(2, 82), mission_item(3, 16, frame=frame), mission_item(4, 183, (9.0,)))
    assert list(remarks_on((home, plain, *other))) == [
        "1 spline or arc flown as waypoint, on a line",
        "1 altitude above terrain counted from home: the ground is flat",
        "1 payload command announced only",
    ]


def test_a_place_on_the_ground_is_remarked_on_but_no_landing() -> None:
    home = mission_item(0, 16, (), *HERE, 20.0, ABSOLUTE)
    low = [item(16, z=0.0), item(18, z=20.0, frame=ABSOLUTE), item(21, z=0.0), item(20, z=0.0)]
    high = [
        item(16, z=1.0),
        item(16, z=20.5, frame=ABSOLUTE),
        mission_item(5, 17),
        item(16, z=math.nan),
    ]
    assert not list(remarks_on((home, *high, *low[2:])))
    assert list(remarks_on((home, *high, low[1]))) == [
        "item 1 not above home: that is on the ground, if it is flat"
    ]
    (remark,) = remarks_on((home, *low))
    assert remark.startswith("item 1 and 1 more not above home")


@pytest.mark.parametrize(
    ("one", "text"),
    [
        (mission_item(1, 183, (9.0, 1500.0)), "DO_SET_SERVO 9 1500"),
        (mission_item(1, 206, (25.0, 0.0, 1.0, math.nan)), "DO_SET_CAM_TRIGG_DIST 25 0 1"),
        (mission_item(1, 216), "DO_SPRAYER"),
        (mission_item(1, 9999, (1.0,)), "command 9999 1"),
    ],
)
def test_texts_of_commands(one: MissionItem, text: str) -> None:
    assert command_text(one) == text
