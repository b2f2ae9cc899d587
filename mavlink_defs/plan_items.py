"""Entries of a QGroundControl plan as simple items, one for each item of the mission protocol.

Surveys and scans carry theirs, as `TransectStyleComplexItem.Items`. A landing pattern stands for
those that QGroundControl makes of it (`LandingComplexItem::appendMissionItems`): the start of the
landing, the approach and the landing. Earlier formats have `coordinate` beside `params`, or
`param1` to `param4`; the oldest, a .mission, is no plan yet.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from mavlink_defs import dialect
from mavlink_defs.config.problems import shown

_LANDINGS = {
    "fwLandingPattern": dialect.MAV_CMD_NAV_LAND,
    "vtolLandingPattern": dialect.MAV_CMD_NAV_VTOL_LAND,
}
_TRANSECTS = "TransectStyleComplexItem"


class NotOneError(ValueError):
    """The text is no such file; one line."""


def simple_items(listed: Sequence[Any], where: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the place in the file and the keys of each simple item, with seven `params`.

    Args:
        listed: Entries of a plan's mission.
        where: Name of the list.

    Raises:
        NotOneError: An entry is none, or stands for items that it does not carry.
    """
    for i, entry in enumerate(listed):
        at = f"{where}[{i}]"
        kind = entry.get("complexItemType") if isinstance(entry, dict) else None
        if not isinstance(entry, dict) or (kind is None and not {"command", "params"} & set(entry)):
            raise NotOneError(f"{at}: expected a SimpleItem or a ComplexItem, got something else")
        if kind is None:
            yield at, _with_params(entry)
        elif kind in _LANDINGS:
            yield from ((at, item) for item in _landing(entry, at))
        else:
            carried = entry.get(_TRANSECTS)
            items = carried.get("Items") if isinstance(carried, dict) else None
            if not isinstance(items, list) or not items:
                text = f"{at}: {shown(kind)} carries no {_TRANSECTS}.Items to be flown"
                raise NotOneError(f"{text}; save it with QGroundControl 4, or draw its waypoints")
            yield from simple_items(items, f"{at}.{_TRANSECTS}.Items")


def with_mission(old: Mapping[str, Any]) -> dict[str, Any]:
    """Return the plan that a .mission, QGroundControl's format before plans, would be.

    Raises:
        NotOneError: It has complex items, which carry none.
    """
    if old.get("complexItems"):
        text = "complexItems: a .mission has no items of them"
        raise NotOneError(f"{text}; save it as a plan with QGroundControl 4")
    home = old.get("plannedHomePosition")
    home = home.get("coordinate") if isinstance(home, dict) else home
    mission = {"plannedHomePosition": home, "items": old.get("items"), "version": 2}
    return {"fileType": "Plan", "version": 1, "mission": mission}


def _with_params(entry: Mapping[str, Any]) -> dict[str, Any]:
    """Return a simple item with seven params, whatever its format."""
    params, place = entry.get("params"), entry.get("coordinate")
    if isinstance(place, list) and not (isinstance(params, list) and len(params) > 4):
        before = [entry.get(f"param{k}") for k in range(1, 5)]
        params = [*(params if isinstance(params, list) else before), *place]
    return {**entry, "params": params}


def _landing(entry: Mapping[str, Any], where: str) -> Iterator[dict[str, Any]]:
    """Yield the items of a landing pattern."""
    approach = entry.get("landingApproachCoordinate", entry.get("loiterCoordinate"))
    land = entry.get("landCoordinate")
    if not (isinstance(approach, list) and isinstance(land, list)):
        text = "expected landingApproachCoordinate (or loiterCoordinate) and landCoordinate"
        raise NotOneError(f"{where}: {text}")
    frame = dialect.MAV_FRAME_GLOBAL
    if entry.get("altitudesAreRelative", True):
        frame = dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT
    yield _item(dialect.MAV_CMD_DO_LAND_START, dialect.MAV_FRAME_MISSION)
    if entry.get("stopTakingPhotos"):
        yield _item(dialect.MAV_CMD_DO_SET_CAM_TRIGG_DIST, dialect.MAV_FRAME_MISSION)
        yield _item(dialect.MAV_CMD_IMAGE_STOP_CAPTURE, dialect.MAV_FRAME_MISSION)
    if entry.get("stopVideoPhotos", entry.get("stopTakingVideo")):
        yield _item(dialect.MAV_CMD_VIDEO_STOP_CAPTURE, dialect.MAV_FRAME_MISSION)
    if entry.get("useLoiterToAlt", True):
        radius = entry.get("loiterRadius")
        if isinstance(radius, bool) or not isinstance(radius, int | float):
            raise NotOneError(f"{where}.loiterRadius: expected a number, got {shown(radius)}")
        side = 1.0 if entry.get("loiterClockwise", True) else -1.0
        circle = (1.0, math.copysign(radius, side), 0.0, 1.0)  # leave it on course for the runway
        yield _item(dialect.MAV_CMD_NAV_LOITER_TO_ALT, frame, circle, approach)
    else:
        yield _item(dialect.MAV_CMD_NAV_WAYPOINT, frame, place=approach)
    yield _item(_LANDINGS[entry["complexItemType"]], frame, place=land)


def _item(
    command: int,
    frame: int,
    params: Sequence[float] = (0.0, 0.0, 0.0, 0.0),
    place: Sequence[Any] = (0.0, 0.0, 0.0),
) -> dict[str, Any]:
    return {"command": command, "frame": frame, "params": [*params, *place]}
