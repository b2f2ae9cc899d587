"""Missions as files of ground stations: QGroundControl's plans, and waypoint lists.

A plan is JSON (https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html), a
list a table of text that begins with ``QGC WPL 110``; their first bytes tell them apart, whatever
their names. What is read are the entries of a scenario's mission, of which the items of the mission
protocol are made, home included as item 0. Jumps name an item by its `doJumpId`, or by the number
in its line; the items are numbered again.
"""

import codecs
import json
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from mavlink_defs import dialect
from mavlink_defs.config.problems import ConfigError, Problem, counted, shown
from mavlink_defs.config.user_files import open_file, read_text
from mavlink_defs.constants import INT32_MAX
from mavlink_defs.float32 import decimal_of_float32
from mavlink_defs.plan_fence import (
    PlanRow,
    PlanShapeError,
    fence_rows,
    fence_section,
    rally_rows,
    rally_section,
)
from mavlink_defs.plan_items import NotOneError, simple_items, with_mission
from mavlink_defs.services.mission import MissionItem
from mavlink_defs.visible import visible

_WAYPOINTS_HEAD = "QGC WPL 110"
_LISTS_BEGIN = b"QGC WPL"
_OF_PLANS = (b'"fileType"', b'"plannedHomePosition"', b'"groundStation"', b'"MAV_AUTOPILOT"')
"""Keys by which JSON is a plan, the older formats included."""
_HEAD_SIZE = 1_000_000  # bytes; keys of plans may be in any order
MISSION_SUFFIXES = frozenset({".plan", ".waypoints"})
"""Names of files that are written."""
_READ_SUFFIXES = MISSION_SUFFIXES | {".mission"}
"""Names of files that are missions whatever is in them."""
_COLUMNS = 12
_MAX_FLOAT = 1e38  # a float32 field holds a little more
_Number = TypeVar("_Number", int, float)
_FRAME = dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT
_PLANE = dialect.MAV_TYPE_FIXED_WING
MAX_NOT_FLOWN = 20
"""Parts of a mission file that are named as not flown."""
_PLAN_KEYS = {
    "fileType": "Plan",
    "version": 1,
    "groundStation": "",
    "geoFence": {},
    "rallyPoints": {},
    "mission": {},
}
_AREA_KEYS = {
    "geoFence": {"circles", "polygons", "breachReturn", "version"},
    "rallyPoints": {"points", "version"},
}
_MISSION_KEYS = {
    "version": 2,
    "firmwareType": 0,
    "vehicleType": _PLANE,
    "cruiseSpeed": 0.0,
    "hoverSpeed": 0.0,
    "globalPlanAltitudeMode": 0,
    "plannedHomePosition": [],
    "items": [],
}
"""Keys that are looked at, or say nothing of the flight; of `version` the one that is known."""


def mission_item(
    seq: int,
    command: int,
    params: Sequence[float | None] = (),
    latitude: int = 0,
    longitude: int = 0,
    altitude_m: float | None = 0.0,
    frame: int = _FRAME,
) -> MissionItem:
    """Return an item that is addressed to nobody yet.

    Args:
        seq: Its number.
        command: MAV_CMD.
        params: Parameters 1 to 4; None is NaN, those that lack are 0.
        latitude: [degE7], or what else the command has as x.
        longitude: The same, y.
        altitude_m: z; None is NaN.
        frame: MAV_FRAME.
    """
    given = (math.nan if value is None else value for value in params)
    p1, p2, p3, p4 = (*given, *[0.0] * 4)[:4]
    z = math.nan if altitude_m is None else altitude_m
    return MissionItem(0, 0, seq, frame, command, 0, 1, p1, p2, p3, p4, latitude, longitude, z, 0)


class MissionFile(NamedTuple):
    """What a mission file holds."""

    entries: tuple[dict[str, Any], ...]
    """As of the key `item` of a scenario's missions; entry 0 is home."""
    not_flown: tuple[str, ...] = ()
    """What else is in the file, and no vehicle takes, part by part."""
    fence: tuple[dict[str, Any], ...] = ()
    """The same entries, of the fence."""
    rally: tuple[dict[str, Any], ...] = ()
    """The same, of the rally points."""

    @property
    def items(self) -> tuple[MissionItem, ...]:
        """The items of the mission protocol, home included."""
        return items_of(self.entries)


def items_of(entries: Iterable[dict[str, Any]]) -> tuple[MissionItem, ...]:
    """Return the items that entries of a `MissionFile` describe, numbered from 0."""
    return tuple(
        mission_item(
            seq, one["command"], one["params"], *(one[k] for k in ("x", "y", "z", "frame"))
        )
        for seq, one in enumerate(entries)
    )


def is_mission_file(path: Path) -> bool:
    """Return whether a file is a mission file, by its first bytes; by its name if it has none."""
    if path.suffix.lower() in _READ_SUFFIXES:
        return True
    try:
        with open_file(path) as file:
            head = file.read(_HEAD_SIZE).removeprefix(codecs.BOM_UTF8).lstrip()
    except OSError:
        return False
    return head.startswith(_LISTS_BEGIN) or (
        head.startswith(b"{") and any(key in head for key in _OF_PLANS)  # YAML may begin with {
    )


def read_mission_file(path: Path) -> MissionFile:
    """Read a mission.

    Raises:
        ConfigError: The file cannot be read, or holds something else; the place is named.
    """
    text = read_text(path)
    try:
        if text.lstrip().startswith("{"):
            return _of_plan(text)
        return MissionFile(_of_waypoints(text))
    except (NotOneError, PlanShapeError) as error:
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


def plan_text(
    items: Sequence[MissionItem],
    fence: Sequence[MissionItem] = (),
    rally: Sequence[MissionItem] = (),
) -> str:
    """Return a mission, home included, fence and rally points as a ``.plan`` of QGroundControl."""
    home, *others = items
    plan = {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "ftc-sitl",
        "geoFence": fence_section(fence),
        "rallyPoints": rally_section(rally),
        "mission": {
            "version": 2,
            "firmwareType": dialect.MAV_AUTOPILOT_ARDUPILOTMEGA,
            "vehicleType": dialect.MAV_TYPE_FIXED_WING,
            "globalPlanAltitudeMode": 1,
            "plannedHomePosition": [home.x / 1e7, home.y / 1e7, decimal_of_float32(home.z)],
            "items": [_simple_item(item) for item in others],
        },
    }
    return json.dumps(plan, indent=4) + "\n"


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


def _of_plan(text: str) -> MissionFile:
    try:
        plan = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise NotOneError(f"is no JSON: {error}") from error
    if "fileType" not in plan and "items" in plan:  # a .mission, the format before plans
        plan = with_mission(plan)
    mission = plan.get("mission")
    if plan.get("fileType") != "Plan" or not isinstance(mission, dict):
        raise NotOneError("expected a plan with fileType 'Plan' and a mission")
    home, listed = mission.get("plannedHomePosition"), mission.get("items")
    if not isinstance(listed, list):
        raise NotOneError("mission.items: expected a list")
    where = "mission.plannedHomePosition"
    numbers = _numbers(home if isinstance(home, list) else [], where, 3)
    entries = [_entry(dialect.MAV_CMD_NAV_WAYPOINT, 0, [0.0] * 4 + numbers, where)]
    ids, places = list[int](), list[str]()
    for where, entry in simple_items(listed, "mission.items"):
        params = entry.get("params")
        numbers = _numbers(params if isinstance(params, list) else [], f"{where}.params", 7)
        command, frame = (_whole(entry, key, where) for key in ("command", "frame"))
        entries.append(_entry(command, frame, numbers, where))
        ids.append(_whole({"doJumpId": len(ids) + 1} | entry, "doJumpId", where))
        places.append(where)
    _find_targets(entries, ids, places, "doJumpId")
    parts = list(_not_flown(plan, mission))
    if (more := len(parts) - MAX_NOT_FLOWN + 1) > 1:
        parts[-more:] = [f"{more} more keys"]
    fence, rally = (_entries(rows) for rows in (fence_rows(plan), rally_rows(plan)))
    return MissionFile(tuple(entries), tuple(parts), fence, rally)


def _entries(rows: Iterable[PlanRow]) -> tuple[dict[str, Any], ...]:
    """Return entries of items that have no jump among them."""
    return tuple(
        _entry(command, frame, _numbers(values, where, 7), where)
        for command, frame, values, where in rows
    )


def _not_flown(plan: dict[str, Any], mission: dict[str, Any]) -> Iterator[str]:
    """Say what is in a plan besides the items and where they are."""
    for key, noun in (("cruiseSpeed", "cruise"), ("hoverSpeed", "hover")):
        if key in mission:
            yield f"a {noun} speed of {shown(mission[key])} m/s"
    if (kind := mission.get("vehicleType", _PLANE)) != _PLANE:
        yield f"vehicleType {shown(kind)}, which is no fixed-wing aircraft"
    items = (entry for entry in mission["items"] if isinstance(entry, dict))
    held = sum(entry.get("autoContinue") is False for entry in items)
    if held:
        yield f"autoContinue false of {counted(held, 'item')}"
    for where, tree, known in (("", plan, _PLAN_KEYS), ("mission.", mission, _MISSION_KEYS)):
        for key, value in tree.items():
            if key not in known:
                yield f"{where}{visible(key)[:60]}"
            elif key == "version" and value != known[key]:
                yield f"what is new in {where}version {shown(value)}"
    for name, read in _AREA_KEYS.items():
        section = plan.get(name)
        for key, value in section.items() if isinstance(section, dict) else ():
            if value and key not in read:  # polygon of version 1, say
                yield f"{name}.{visible(key)[:60]}"


def _of_waypoints(text: str) -> tuple[dict[str, Any], ...]:
    rows = [line for line in map(str.strip, text.splitlines()) if line and line[0] != "#"]
    if not rows or rows[0].split() != _WAYPOINTS_HEAD.split():
        raise NotOneError(f"expected a plan (JSON), or {_WAYPOINTS_HEAD!r} in the first line")
    entries, ids = [], []
    for seq, row in enumerate(rows[1:]):
        where, fields = f"item {seq}", row.split()
        if len(fields) != _COLUMNS:
            raise NotOneError(f"{where}: expected {_COLUMNS} columns, got {len(fields)}")
        number, frame, command = (_number_in(int, fields[i], where) for i in (0, 2, 3))
        numbers = _numbers([_number_in(float, field, where) for field in fields[4:11]], where, 7)
        entries.append(_entry(command, frame, numbers, where))
        ids.append(number)
    if not entries:
        raise NotOneError("expected home as item 0, got no item")
    _find_targets(entries, ids, [f"item {seq}" for seq in range(len(ids))], "the number")
    return tuple(entries)


def _find_targets(
    entries: Sequence[dict[str, Any]], ids: Sequence[int], places: Sequence[str], key: str
) -> None:
    """Let jumps go to the number that an item has, in place of what the file calls it.

    Then all parameters become decimals, as float32 fields hold them. The last entries have ids and
    places in the file; what is before them has none.
    """
    first = len(entries) - len(ids)
    for entry, where in zip(entries[first:], places, strict=True):
        if entry["command"] != dialect.MAV_CMD_DO_JUMP:
            continue
        target = math.nan if entry["params"][0] is None else entry["params"][0]
        found = [k for k, name in enumerate(ids, first) if name == target]
        if len(found) != 1:
            got = counted(len(found), "item") if found else "no item"
            text = f"jumps to {key} {target:g}, which {got} {'have' if found else 'has'}"
            raise NotOneError(f"{where}: {text}")
        entry["params"][0] = float(found[0])
    for entry in entries:
        given = entry["params"]
        entry["params"] = [None if value is None else decimal_of_float32(value) for value in given]


def _entry(command: int, frame: int, numbers: Sequence[float], where: str) -> dict[str, Any]:
    """Return an entry of seven parameters; x and y are degrees in every file."""
    if not 0 <= command <= 0xFFFF or not 0 <= frame <= 0xFF:
        raise NotOneError(f"{where}: there is no command {command} in a frame {frame}")
    *params, x, y, z = numbers
    places = [INT32_MAX if math.isnan(value) else round(value * 1e7) for value in (x, y)]
    if any(abs(place) > INT32_MAX for place in places):
        raise NotOneError(f"{where}: expected degrees, got {x:g} and {y:g}")
    given = [None if math.isnan(value) else value for value in params]
    height = None if math.isnan(z) else decimal_of_float32(z)
    place = {"x": places[0], "y": places[1], "z": height}
    return {"command": command, "frame": frame, "params": given} | place


def _numbers(values: Sequence[Any], where: str, count: int) -> list[float]:
    """Return numbers that float32 fields hold; nothing given becomes NaN."""
    if len(values) != count:
        raise NotOneError(f"{where}: expected {count} numbers, got {len(values)}")
    numbers = []
    for value in values:
        if value is not None and (isinstance(value, bool) or not isinstance(value, int | float)):
            raise NotOneError(f"{where}: expected numbers, got {value!r}")
        if value is not None and abs(value) > _MAX_FLOAT:  # a whole number may be too large for %g
            raise NotOneError(
                f"{where}: expected numbers within {_MAX_FLOAT:g}, got {shown(value)}"
            )
        numbers.append(math.nan if value is None else float(value))
    return numbers


def _number_in(kind: Callable[[str], _Number], field: str, where: str) -> _Number:
    try:
        return kind(field)
    except ValueError:
        noun = "whole number" if kind is int else "number"
        raise NotOneError(f"{where}: expected a {noun}, got {shown(field)}") from None


def _whole(entry: dict[str, Any], key: str, where: str) -> int:
    value = entry.get(key)
    if isinstance(value, bool) or not isinstance(value, int):
        raise NotOneError(f"{where}.{key}: expected a whole number, got {value!r}")
    return value


def _text(value: float) -> str:
    """Return a number as such files have it."""
    return f"{value:.8f}" if abs(value) < 1e6 else repr(value)
