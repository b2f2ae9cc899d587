"""Fence and rally points in QGroundControl's plans: the sections `geoFence` and `rallyPoints`.

https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html. They are read into
the items that QGroundControl uploads of them, and written from any such items.
"""

from collections.abc import Iterator, Sequence
from typing import Any, TypeAlias

from mavlink_defs import dialect
from mavlink_defs.float32 import decimal_of_float32
from mavlink_defs.services.mission import MissionItem

_ABSOLUTE, _RELATIVE = dialect.MAV_FRAME_GLOBAL, dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT
_CORNER_IN = dialect.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION
_CORNER_OUT = dialect.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION
_CIRCLE_IN = dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION
_CIRCLE_OUT = dialect.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION

POLYGONS = {_CORNER_IN: True, _CORNER_OUT: False}
"""Commands of corners, and whether to stay in."""
CIRCLES = {_CIRCLE_IN: True, _CIRCLE_OUT: False}
"""Commands of circles, and whether to stay in."""
RETURN_POINT = dialect.MAV_CMD_NAV_FENCE_RETURN_POINT
RALLY_POINT = dialect.MAV_CMD_NAV_RALLY_POINT

PlanRow: TypeAlias = tuple[int, int, list[Any], str]
"""MAV_CMD, MAV_FRAME, params 1 to 7 as the plan has them, and where they are in it."""


class PlanShapeError(ValueError):
    """A section is not what QGroundControl writes; one line."""


def fence_rows(plan: dict[str, Any]) -> Iterator[PlanRow]:
    """Yield the items of a plan's fence.

    Raises:
        PlanShapeError: A circle or polygon has not the keys of one.
    """
    for shape, where in _listed(plan, "geoFence", "polygons"):
        corners = _list(shape.get("polygon"), f"{where}.polygon")
        command = _CORNER_IN if _is_inclusion(shape, where) else _CORNER_OUT
        if not corners:  # a fence that vanishes keeps nobody inside
            raise PlanShapeError(f"{where}.polygon: expected corners, got none")
        for k, corner in enumerate(corners):
            at = f"{where}.polygon[{k}]"
            yield command, _ABSOLUTE, [len(corners), 0, 0, 0, *_list(corner, at, 2), 0], at
    for shape, where in _listed(plan, "geoFence", "circles"):
        command = _CIRCLE_IN if _is_inclusion(shape, where) else _CIRCLE_OUT
        circle = shape.get("circle")
        if not isinstance(circle, dict):
            raise PlanShapeError(f"{where}.circle: expected centre and radius")
        centre = _list(circle.get("center"), f"{where}.circle.center", 2)
        yield command, _ABSOLUTE, [circle.get("radius"), 0, 0, 0, *centre, 0], f"{where}.circle"
    fence = plan.get("geoFence")
    if isinstance(fence, dict) and (point := fence.get("breachReturn")) is not None:
        where = "geoFence.breachReturn"
        yield RETURN_POINT, _RELATIVE, [0, 0, 0, 0, *_list(point, where, 3)], where


def rally_rows(plan: dict[str, Any]) -> Iterator[PlanRow]:
    """Yield the items of a plan's rally points.

    Raises:
        PlanShapeError: One is no list of three numbers.
    """
    rally = plan.get("rallyPoints")
    points = rally.get("points") if isinstance(rally, dict) else None
    for k, point in enumerate(points if isinstance(points, list) else []):
        where = f"rallyPoints.points[{k}]"
        yield RALLY_POINT, _RELATIVE, [0, 0, 0, 0, *_list(point, where, 3)], where


def fence_section(items: Sequence[MissionItem]) -> dict[str, Any]:
    """Return the section `geoFence` of a fence that a vehicle has accepted."""
    polygons: list[dict[str, Any]] = []
    section: dict[str, Any] = {"circles": [], "polygons": polygons, "version": 2}
    missing = 0  # corners of the last polygon
    for item in items:
        place, number = _place(item), decimal_of_float32(item.param1)
        inclusion = item.command in {_CORNER_IN, _CIRCLE_IN}
        if item.command in POLYGONS:
            if not missing:
                missing = int(number)
                polygons.append({"inclusion": inclusion, "polygon": [], "version": 1})
            polygons[-1]["polygon"].append(place)
            missing -= 1
        elif item.command in CIRCLES:
            circle = {"center": place, "radius": number}
            section["circles"].append({"circle": circle, "inclusion": inclusion, "version": 1})
        else:
            section["breachReturn"] = [*place, decimal_of_float32(item.z)]
    return section


def rally_section(items: Sequence[MissionItem]) -> dict[str, Any]:
    """Return the section `rallyPoints`; a plan has altitudes above home alone."""
    points = [[*_place(item), decimal_of_float32(item.z)] for item in items]
    return {"points": points, "version": 2}


def _place(item: MissionItem) -> list[float]:
    return [item.x / 1e7, item.y / 1e7]


def _listed(plan: dict[str, Any], section: str, key: str) -> Iterator[tuple[dict[str, Any], str]]:
    """Yield the objects of a list, and where each is."""
    tree = plan.get(section)
    listed = tree.get(key) if isinstance(tree, dict) else None
    for k, entry in enumerate(listed if isinstance(listed, list) else []):
        where = f"{section}.{key}[{k}]"
        if not isinstance(entry, dict):
            raise PlanShapeError(f"{where}: expected an object, got {entry!r:.60}")
        yield entry, where


def _is_inclusion(shape: dict[str, Any], where: str) -> bool:
    inclusion = shape.get("inclusion")
    if not isinstance(inclusion, bool):
        raise PlanShapeError(f"{where}.inclusion: expected true or false, got {inclusion!r:.60}")
    return inclusion


def _list(value: Any, where: str, count: int | None = None) -> list[Any]:
    if not isinstance(value, list) or (count is not None and len(value) != count):
        expected = "a list" if count is None else f"{count} numbers"
        raise PlanShapeError(f"{where}: expected {expected}, got {value!r:.60}")
    return value
