"""Fence and rally points on a map: outlines and places of the items that a vehicle holds."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ftc_autopilot.common.geography import Origin, position_of
from ftc_autopilot.guidance.fence import FenceArea, decode_fence
from gcs.tui.labels import Place
from mavlink_defs.profile import ItemError
from mavlink_defs.services.mission import MissionItem

INCLUSION, EXCLUSION = "inclusion", "exclusion"
_CIRCLE_POINTS = 60


class Outline(NamedTuple):
    """A closed line of a kind, which has a colour: `INCLUSION`, `EXCLUSION`; a runway, some day."""

    kind: str
    line: np.ndarray  # north and east, shape (k, 2) [m]


class MapAreas(NamedTuple):
    """What a map shows beside vehicles and mission."""

    outlines: tuple[Outline, ...] = ()
    rally: tuple[Place, ...] = ()


def map_areas(
    fence: Sequence[MissionItem],
    rally: Sequence[MissionItem],
    origin: Origin,
    at: Place = (0.0, 0.0),
) -> MapAreas:
    """Return fence and rally points as a map shows them; nothing of a fence that is none.

    Args:
        fence: Items of a fence.
        rally: Items of rally points.
        origin: Of the map.
        at: Where that is on the map [m].
    """
    try:
        areas = decode_fence(fence, origin).areas
    except ItemError:
        areas = ()
    outlines = tuple(
        Outline(INCLUSION if area.stay_in else EXCLUSION, outline(area) + np.array(at))
        for area in areas
    )
    places = (position_of(origin, item.x, item.y) for item in rally)
    return MapAreas(outlines, tuple((north + at[0], east + at[1]) for north, east in places))


def outline(area: FenceArea) -> np.ndarray:
    """Return the edge of an area as a closed line, shape (k, 2) [m]."""
    if area.radius:
        return circle(area.corners[0], area.radius)
    return np.concatenate([area.corners, area.corners[:1]])


def circle(centre: Sequence[float] | np.ndarray, radius: float) -> np.ndarray:
    """Return a circle as a closed line, shape (k, 2) [m]."""
    angle = np.linspace(0.0, 2.0 * np.pi, _CIRCLE_POINTS)
    points: np.ndarray = np.array(centre) + radius * np.column_stack([np.cos(angle), np.sin(angle)])
    return points
