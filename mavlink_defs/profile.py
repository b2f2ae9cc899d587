"""Reference profiles as missions: one MISSION_ITEM_INT per segment.

Item 0 of a mission is home, as for every vehicle that presents itself as ArduPilot; the
segments are items 1 to N. Roll and pitch travel in the integer fields x and y, in degE7.
"""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from mavlink_defs import dialect
from mavlink_defs.dialect import MAVLink_mission_item_int_message
from mavlink_defs.float32 import decimal_of_float32

MAX_SEGMENTS = 50
MAX_ITEMS = MAX_SEGMENTS + 1  # and home

_DEG_E7 = 1e7

# The command itself defines x, y and z, so MAV_FRAME_MISSION ("the frame is
# irrelevant") and every global frame that clients write to their files mean the same.
_FRAMES = frozenset(
    {
        dialect.MAV_FRAME_GLOBAL,
        dialect.MAV_FRAME_MISSION,
        dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT,
        dialect.MAV_FRAME_GLOBAL_INT,
        dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
    }
)


@dataclass(frozen=True)
class Segment:
    """Reference values from a start time on.

    Attributes:
        start_s: Start, counted from the start of the mission [s].
        airspeed_m_s: Reference airspeed [m/s].
        roll_deg: Reference roll angle [deg].
        pitch_deg: Reference pitch angle [deg].
        yaw_deg: Reference yaw angle [deg].
        ramp: Whether the values are approached linearly until the next segment starts.
    """

    start_s: float
    airspeed_m_s: float
    roll_deg: float
    pitch_deg: float
    yaw_deg: float
    ramp: bool

    def as_dict(self) -> dict[str, Any]:
        """Return the segment with the keys of a scenario file."""
        values = asdict(self)
        values["shape"] = "ramp" if values.pop("ramp") else "step"
        return values


@dataclass(frozen=True)
class AirspeedLimits:
    """Range of airspeed commands that an aircraft accepts."""

    min_m_s: float
    max_m_s: float


ANY_AIRSPEED = AirspeedLimits(0.0, math.inf)
"""Limits to use when the aircraft is unknown."""


class ProfileError(ValueError):
    """A mission that cannot be flown.

    Attributes:
        seq: Number of the offending item.
        mav_mission_result: The MAV_MISSION_RESULT to answer with.
        text: One sentence with item, value and expected range, short enough for a STATUSTEXT.
    """

    def __init__(self, seq: int, mav_mission_result: int, text: str) -> None:
        super().__init__(seq, mav_mission_result, text)
        self.seq, self.mav_mission_result, self.text = seq, mav_mission_result, text

    def __str__(self) -> str:
        return self.text


class ItemError(ProfileError):
    """One item of a mission cannot be flown.

    Attributes:
        reason: The text without the item.
    """

    def __init__(self, seq: int, mav_mission_result: int, reason: str) -> None:
        super().__init__(seq, mav_mission_result, f"Item {seq}: {reason}")
        self.reason = reason


def segments_to_items(
    segments: Sequence[Segment], target_system: int, target_component: int
) -> list[MAVLink_mission_item_int_message]:
    """Return the mission that carries `segments`: a home item of zeros, then one item each."""

    def item(seq: int, command: int, *values: float) -> MAVLink_mission_item_int_message:
        param1, param2, param3, param4, x, y = values
        return MAVLink_mission_item_int_message(
            target_system,
            target_component,
            seq,
            dialect.MAV_FRAME_GLOBAL,
            command,
            current=0,
            autocontinue=1,
            param1=param1,
            param2=param2,
            param3=param3,
            param4=param4,
            x=round(x * _DEG_E7),
            y=round(y * _DEG_E7),
            z=0.0,
            mission_type=dialect.MAV_MISSION_TYPE_MISSION,
        )

    home = item(0, dialect.MAV_CMD_NAV_WAYPOINT, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    command = dialect.MAV_CMD_FTC_REFERENCE_SEGMENT
    return [home] + [
        item(
            seq,
            command,
            s.start_s,
            s.airspeed_m_s,
            float(s.ramp),
            s.yaw_deg,
            s.roll_deg,
            s.pitch_deg,
        )
        for seq, s in enumerate(segments, start=1)
    ]


def items_to_segments(
    items: Sequence[MAVLink_mission_item_int_message], limits: AirspeedLimits
) -> tuple[Segment, ...]:
    """Decode and check a mission.

    Args:
        items: The whole mission, home included.
        limits: Airspeed limits of the aircraft that is to fly it.

    Raises:
        ProfileError: The mission is not a profile that the aircraft can fly.
    """
    if len(items) > MAX_ITEMS:
        text = f"Mission has {len(items) - 1} segments, at most {MAX_SEGMENTS} fit"
        raise ProfileError(MAX_ITEMS, dialect.MAV_MISSION_NO_SPACE, text)
    if items and items[0].command == dialect.MAV_CMD_FTC_REFERENCE_SEGMENT:
        text = "Mission item 0 is home, segments begin at item 1"
        raise ProfileError(0, dialect.MAV_MISSION_INVALID, text)
    if len(items) < 2:
        raise ProfileError(0, dialect.MAV_MISSION_INVALID, "Mission has no segment, needs 1")
    segments = tuple(_segment(seq, items[seq], limits) for seq in range(1, len(items)))
    _check_starts(segments)
    for seq in (1, len(segments)):
        if segments[seq - 1].ramp:
            text = "first and last segment cannot be a ramp"
            raise ItemError(seq, dialect.MAV_MISSION_INVALID_PARAM3, text)
    return segments


def check_mission(
    items: Sequence[MAVLink_mission_item_int_message], limits: AirspeedLimits
) -> None:
    """Check an uploaded mission; home alone is an empty one, as clients clear with it.

    Raises:
        ProfileError: The mission is neither empty nor a profile that the aircraft can fly.
    """
    if len(items) != 1 or items[0].command == dialect.MAV_CMD_FTC_REFERENCE_SEGMENT:
        items_to_segments(items, limits)


def _segment(seq: int, item: MAVLink_mission_item_int_message, limits: AirspeedLimits) -> Segment:
    if item.seq != seq:
        text = f"Item {item.seq} is at place {seq} of the mission"
        raise ProfileError(seq, dialect.MAV_MISSION_INVALID_SEQUENCE, text)
    if item.command != dialect.MAV_CMD_FTC_REFERENCE_SEGMENT:
        text = f"command {item.command} is not supported"
        raise ItemError(seq, dialect.MAV_MISSION_UNSUPPORTED, text)
    if item.frame not in _FRAMES:
        text = f"frame {item.frame} is not supported"
        raise ItemError(seq, dialect.MAV_MISSION_UNSUPPORTED_FRAME, text)
    start, airspeed, shape, yaw = map(
        decimal_of_float32, (item.param1, item.param2, item.param3, item.param4)
    )
    roll, pitch = item.x / _DEG_E7, item.y / _DEG_E7
    low, high = limits.min_m_s, limits.max_m_s
    for index, name, value, good, expected in (
        (1, "start", start, 0.0 <= start < math.inf, ">= 0 s"),
        (2, "airspeed", airspeed, low <= airspeed <= high, f"{low:g} to {high:g} m/s"),
        (3, "shape", shape, shape in {0.0, 1.0}, "0 or 1"),
        (4, "yaw", yaw, abs(yaw) <= 180.0, "-180 to 180 deg"),
        (5, "roll", roll, abs(roll) <= 90.0, "-90 to 90 deg"),
        (6, "pitch", pitch, abs(pitch) < 90.0, "between -90 and 90 deg"),
    ):
        if not good:  # NaN satisfies no comparison
            text = f"{name} {value:g}, must be {expected}"
            raise ItemError(seq, dialect.MAV_MISSION_INVALID_PARAM1 + index - 1, text)
    return Segment(start, airspeed, roll, pitch, yaw, ramp=shape == 1.0)


def _check_starts(segments: Sequence[Segment]) -> None:
    if segments[0].start_s != 0.0:
        text = f"start {segments[0].start_s:g} s, must be 0 s"
        raise ItemError(1, dialect.MAV_MISSION_INVALID_PARAM1, text)
    for i in range(1, len(segments)):
        before, start = segments[i - 1].start_s, segments[i].start_s
        if start <= before:
            text = f"start {start:g} s, must be after {before:g} s"
            raise ItemError(i + 1, dialect.MAV_MISSION_INVALID_PARAM1, text)
