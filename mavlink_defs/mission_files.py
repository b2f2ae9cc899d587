"""Missions as files of ground stations: QGroundControl's plans, and waypoint lists.

A ``.plan`` is JSON (https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html),
a ``.waypoints`` file a table of text that begins with ``QGC WPL 110``. Both become the items of the
mission protocol, home included as item 0.
"""

import json
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

from mavlink_defs import dialect
from mavlink_defs.config.problems import ConfigError, Problem, shown
from mavlink_defs.config.user_files import read_text
from mavlink_defs.constants import INT32_MAX
from mavlink_defs.float32 import decimal_of_float32
from mavlink_defs.services.mission import MissionItem

_WAYPOINTS_HEAD = "QGC WPL 110"
_COLUMNS = 12
_LARGEST = 1e38  # a float32 field holds a little more
_Number = TypeVar("_Number", int, float)
_FRAME = dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT


def mission_item(
    seq: int,
    command: int,
    params: Sequence[float] = (),
    latitude: int = 0,
    longitude: int = 0,
    altitude_m: float = 0.0,
    frame: int = _FRAME,
) -> MissionItem:
    """Return an item that is addressed to nobody yet.

    Args:
        seq: Its number.
        command: MAV_CMD.
        params: Parameters 1 to 4; those that lack are 0.
        latitude: [degE7], or what else the command has as x.
        longitude: The same, y.
        altitude_m: z.
        frame: MAV_FRAME.
    """
    p1, p2, p3, p4 = (*params, *[0.0] * 4)[:4]
    return MissionItem(
        0, 0, seq, frame, command, 0, 1, p1, p2, p3, p4, latitude, longitude, altitude_m, 0
    )


def is_mission_file(path: Path) -> bool:
    """Return whether a file is a mission file, by its name."""
    return path.suffix.lower() in {".plan", ".waypoints"}


def read_mission_file(path: Path) -> tuple[MissionItem, ...]:
    """Read a mission, item 0 is home.

    Raises:
        ConfigError: The file cannot be read, or holds something else; the place is named.
    """
    text = read_text(path)
    try:
        if text.lstrip().startswith("{"):
            return _of_plan(text)
        return _of_waypoints(text)
    except _NotOneError as error:
        raise ConfigError(path, [Problem((), str(error))]) from error


def waypoints_text(items: Sequence[MissionItem]) -> str:
    """Return a mission, home included, as a ``.waypoints`` file."""
    lines = [_WAYPOINTS_HEAD]
    for item in items:
        params = (item.param1, item.param2, item.param3, item.param4)
        numbers = [_text(decimal_of_float32(value)) for value in params]
        places = [f"{value / 1e7:.7f}" for value in (item.x, item.y)]
        fields = (item.seq, int(item.seq == 0), item.frame, item.command)
        row = (*fields, *numbers, *places, _text(decimal_of_float32(item.z)), item.autocontinue)
        lines.append("\t".join(map(str, row)))
    return "\n".join(lines) + "\n"


def plan_text(items: Sequence[MissionItem]) -> str:
    """Return a mission, home included, as a ``.plan`` of QGroundControl."""
    home, *others = items
    plan = {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "ftc-sitl",
        "geoFence": {"circles": [], "polygons": [], "version": 2},
        "rallyPoints": {"points": [], "version": 2},
        "mission": {
            "version": 2,
            "firmwareType": dialect.MAV_AUTOPILOT_ARDUPILOTMEGA,
            "vehicleType": dialect.MAV_TYPE_FIXED_WING,
            "cruiseSpeed": 40,
            "hoverSpeed": 5,
            "globalPlanAltitudeMode": 1,
            "plannedHomePosition": [home.x / 1e7, home.y / 1e7, decimal_of_float32(home.z)],
            "items": [_simple_item(item) for item in others],
        },
    }
    return json.dumps(plan, indent=4) + "\n"


class _NotOneError(ValueError):
    """The text is no such file; one line."""


def _simple_item(item: MissionItem) -> dict[str, Any]:
    params = (item.param1, item.param2, item.param3, item.param4)
    numbers = [decimal_of_float32(value) for value in params]
    return {
        "type": "SimpleItem",
        "autoContinue": bool(item.autocontinue),
        "command": item.command,
        "doJumpId": item.seq,
        "frame": item.frame,
        "params": [
            *(None if math.isnan(value) else value for value in numbers),
            item.x / 1e7,
            item.y / 1e7,
            decimal_of_float32(item.z),
        ],
    }


def _of_plan(text: str) -> tuple[MissionItem, ...]:
    try:
        plan = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise _NotOneError(f"is no JSON: {error}") from error
    mission = plan.get("mission")
    if plan.get("fileType") != "Plan" or not isinstance(mission, dict):
        raise _NotOneError("expected a plan with fileType 'Plan' and a mission")
    home, listed = mission.get("plannedHomePosition"), mission.get("items")
    if not isinstance(listed, list):
        raise _NotOneError("mission.items: expected a list")
    where = "mission.plannedHomePosition"
    numbers = _numbers(home if isinstance(home, list) else [], where, 3)
    items = [_item(0, dialect.MAV_CMD_NAV_WAYPOINT, 0, [0.0] * 4 + numbers, where)]
    for i, entry in enumerate(listed):
        where = f"mission.items[{i}]"
        if not isinstance(entry, dict) or entry.get("type") != "SimpleItem":
            kind = entry.get("complexItemType") if isinstance(entry, dict) else None
            text = f"{where}: expected a SimpleItem, got {kind or 'something else'}"
            raise _NotOneError(f"{text}; its waypoints can be drawn one by one")
        params = entry.get("params")
        numbers = _numbers(params if isinstance(params, list) else [], f"{where}.params", 7)
        command, frame = (_whole(entry, key, where) for key in ("command", "frame"))
        items.append(_item(len(items), command, frame, numbers, where))
    return tuple(items)


def _of_waypoints(text: str) -> tuple[MissionItem, ...]:
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    if not lines or lines[0].split() != _WAYPOINTS_HEAD.split():
        raise _NotOneError(f"expected a plan (JSON), or {_WAYPOINTS_HEAD!r} in the first line")
    items = []
    for seq, line in enumerate(lines[1:]):
        where, fields = f"item {seq}", line.split()
        if len(fields) != _COLUMNS:
            raise _NotOneError(f"{where}: expected {_COLUMNS} columns, got {len(fields)}")
        number, frame, command = (_number_in(int, fields[i], where) for i in (0, 2, 3))
        numbers = _numbers([_number_in(float, field, where) for field in fields[4:11]], where, 7)
        if number != seq:
            raise _NotOneError(f"{where}: expected the number {seq}, got {number}")
        items.append(_item(seq, command, frame, numbers, where))
    if not items:
        raise _NotOneError("expected home as item 0, got no item")
    return tuple(items)


def _item(seq: int, command: int, frame: int, numbers: Sequence[float], where: str) -> MissionItem:
    """Return an item of seven parameters; x and y are degrees in every file."""
    if not 0 <= command <= 0xFFFF or not 0 <= frame <= 0xFF:
        raise _NotOneError(f"{where}: there is no command {command} in a frame {frame}")
    *params, x, y, z = numbers
    places = [INT32_MAX if math.isnan(value) else round(value * 1e7) for value in (x, y)]
    if any(abs(place) > INT32_MAX for place in places):
        raise _NotOneError(f"{where}: expected degrees, got {x:g} and {y:g}")
    latitude, longitude = places
    return mission_item(seq, command, params, latitude, longitude, z, frame)


def _numbers(values: Sequence[Any], where: str, count: int) -> list[float]:
    """Return numbers that float32 fields hold; nothing given becomes NaN."""
    if len(values) != count:
        raise _NotOneError(f"{where}: expected {count} numbers, got {len(values)}")
    numbers = []
    for value in values:
        if value is not None and (isinstance(value, bool) or not isinstance(value, int | float)):
            raise _NotOneError(f"{where}: expected numbers, got {value!r}")
        if value is not None and abs(value) > _LARGEST:  # a whole number may be too large for %g
            raise _NotOneError(f"{where}: expected numbers within {_LARGEST:g}, got {shown(value)}")
        numbers.append(math.nan if value is None else float(value))
    return numbers


def _number_in(kind: Callable[[str], _Number], field: str, where: str) -> _Number:
    try:
        return kind(field)
    except ValueError:
        noun = "whole number" if kind is int else "number"
        raise _NotOneError(f"{where}: expected a {noun}, got {shown(field)}") from None


def _whole(entry: dict[str, Any], key: str, where: str) -> int:
    value = entry.get(key)
    if isinstance(value, bool) or not isinstance(value, int):
        raise _NotOneError(f"{where}.{key}: expected a whole number, got {value!r}")
    return value


def _text(value: float) -> str:
    """Return a number as such files have it."""
    return f"{value:.8f}" if abs(value) < 1e6 else repr(value)
