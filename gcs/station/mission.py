"""Missions as a ground station handles them: compared, shown, edited.

A mission is what the mission protocol transfers: items numbered from 0, of which item 0 is home.
Editing gives another mission with numbers in order; the targets of DO_JUMP follow their items.
"""

import copy
import math
from collections.abc import Sequence
from typing import TypeAlias

from mavlink_defs import dialect
from mavlink_defs.config.problems import counted
from mavlink_defs.float32 import decimal_of_float32
from mavlink_defs.mission_files import mission_item
from mavlink_defs.plan_fence import CIRCLES, POLYGONS, RALLY_POINT, RETURN_POINT
from mavlink_defs.profile import ANY_AIRSPEED, ProfileError, Segment, items_to_segments
from mavlink_defs.services.mission import MissionItem

Mission: TypeAlias = tuple[MissionItem, ...]
"""The items of a mission, home included; empty: none."""

HAS_PLACE = {
    dialect.MAV_CMD_NAV_WAYPOINT,
    dialect.MAV_CMD_NAV_LOITER_UNLIM,
    dialect.MAV_CMD_NAV_LOITER_TURNS,
    dialect.MAV_CMD_NAV_LOITER_TIME,
    dialect.MAV_CMD_NAV_LOITER_TO_ALT,
    dialect.MAV_CMD_NAV_SPLINE_WAYPOINT,
    dialect.MAV_CMD_NAV_LAND,
}
"""Commands of items that lead to a place."""

_NO_YAW = (0.0, 0.0, 0.0, math.nan)
_FLOATS = ("param1", "param2", "param3", "param4", "z")
_WHOLES = ("frame", "command", "autocontinue", "x", "y")


def profile_of(mission: Mission) -> tuple[Segment, ...] | None:
    """Return the segments of a mission that is a profile; empty without a mission, else None."""
    try:
        return items_to_segments(mission, ANY_AIRSPEED) if len(mission) > 1 else ()
    except ProfileError:
        return None


def is_same(a: Mission, b: Mission, first: int = 1) -> bool:
    """Return whether two missions are the same for a vehicle; its own home does not count.

    Args:
        a: One.
        b: The other.
        first: Number of the first item that counts; 0 for what has no home.
    """
    return [_content(item) for item in a[first:]] == [_content(item) for item in b[first:]]


def item_text(item: MissionItem) -> str:
    """Describe an item briefly: "waypoint", "loiter 3 turns", "jump to 2, 5 times"."""
    p1, p2, p3 = item.param1, item.param2, item.param3
    match item.command:
        case dialect.MAV_CMD_NAV_WAYPOINT:
            return f"waypoint, pass by {p3:g} m" if _given(p3) else "waypoint"
        case dialect.MAV_CMD_NAV_LOITER_UNLIM:
            return f"loiter{_radius(p3)}"
        case dialect.MAV_CMD_NAV_LOITER_TURNS:
            return f"loiter {counted(p1, 'turn')}{_radius(p3)}"
        case dialect.MAV_CMD_NAV_LOITER_TIME:
            return f"loiter {p1:g} s{_radius(p3)}"
        case dialect.MAV_CMD_NAV_LOITER_TO_ALT:
            return f"loiter to altitude{_radius(p2)}"
        case dialect.MAV_CMD_NAV_SPLINE_WAYPOINT:
            return "spline, flown as waypoint"
        case dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH:
            return "return to launch"
        case dialect.MAV_CMD_NAV_TAKEOFF:
            return "takeoff"
        case dialect.MAV_CMD_NAV_LAND:
            return "land"
        case dialect.MAV_CMD_DO_CHANGE_SPEED:
            return f"speed {p2:g} m/s"
        case dialect.MAV_CMD_DO_JUMP:
            return f"jump to {p1:g}, " + ("always" if p2 < 0.0 else counted(p2, "time"))
        case dialect.MAV_CMD_JUMP_TAG:
            return f"tag {p1:g}"
        case dialect.MAV_CMD_DO_JUMP_TAG:
            return f"jump to tag {p1:g}, " + ("always" if p2 < 0.0 else counted(p2, "time"))
        case dialect.MAV_CMD_CONDITION_DELAY:
            return f"wait {p1:g} s"
        case dialect.MAV_CMD_CONDITION_DISTANCE:
            return f"wait until {p1:g} m are left"
        case dialect.MAV_CMD_DO_SET_HOME:
            return "set home here" if p1 == 1.0 else "set home"
        case dialect.MAV_CMD_FTC_REFERENCE_SEGMENT:
            return f"segment from {p1:g} s"
    if item.command in {RETURN_POINT, RALLY_POINT}:
        return "return point" if item.command == RETURN_POINT else "rally point"
    if (stay_in := CIRCLES.get(item.command)) is not None:
        return f"{'inclusion' if stay_in else 'exclusion'} circle, radius {p1:g} m"
    if (stay_in := POLYGONS.get(item.command)) is not None:
        return f"corner of an {'inclusion' if stay_in else 'exclusion'} polygon of {p1:g}"
    from ftc_autopilot.guidance.mission_commands import command_text

    return command_text(item)


def waypoint(like: MissionItem, x: int, y: int, z: float) -> MissionItem:
    """Return a waypoint at a place [degE7, m], its altitude in the frame of another item."""
    relative = dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
    frame = like.frame if like.command in HAS_PLACE else relative
    return mission_item(0, dialect.MAV_CMD_NAV_WAYPOINT, _NO_YAW, x, y, z, frame)


def inserted(mission: Mission, at: int, item: MissionItem) -> Mission:
    """Return the mission with an item more, which gets the number `at`."""
    return _numbered(mission, (*mission[:at], item, *mission[at:]))


def removed(mission: Mission, at: int) -> Mission:
    """Return the mission without item `at`; jumps to it lead to the one that followed."""
    return _numbered(mission, mission[:at] + mission[at + 1 :])


def moved(mission: Mission, at: int, to: int) -> Mission:
    """Return the mission with item `at` at number `to`."""
    rest = mission[:at] + mission[at + 1 :]
    return _numbered(mission, (*rest[:to], mission[at], *rest[to:]))


def with_place(mission: Mission, at: int, x: int, y: int, z: float) -> Mission:
    """Return the mission with another place of item `at` [degE7, m in its own frame]."""
    changed = copy.copy(mission[at])
    changed.x, changed.y, changed.z = x, y, z
    return (*mission[:at], changed, *mission[at + 1 :])


def _numbered(before: Mission, order: Sequence[MissionItem]) -> Mission:
    """Renumber items, and let jumps lead to where they led before."""
    places = {id(item): seq for seq, item in enumerate(order)}
    remaining = [places.get(id(item)) for item in before]
    items = []
    for seq, item in enumerate(order):
        own = copy.copy(item)
        own.seq = seq
        if own.command == dialect.MAV_CMD_DO_JUMP:
            own.param1 = float(_target(remaining, int(own.param1), len(order) - 1))
        items.append(own)
    return tuple(items)


def _target(remaining: Sequence[int | None], target: int, last: int) -> int:
    """Return the new number of an item, or of the next one that remains."""
    if not 0 <= target < len(remaining):
        return target  # it was wrong already
    return next((seq for seq in remaining[target:] if seq is not None), last)


def _content(item: MissionItem) -> tuple[str, ...]:
    """Return what an item says, as float32 fields hold it; NaN equals NaN here."""
    floats = (repr(decimal_of_float32(getattr(item, name))) for name in _FLOATS)
    return (*floats, *(str(getattr(item, name)) for name in _WHOLES))


def _given(value: float) -> bool:
    return value != 0.0 and not math.isnan(value)


def _radius(value: float) -> str:
    return f", radius {value:g} m" if _given(value) else ""
