"""Fences: areas to stay in and areas to stay out of, checked, and how far inside a place is.

The items belong to MAV_MISSION_TYPE_FENCE (https://mavlink.io/en/services/mission.html#fence).
As in ArduPlane a place is inside if it is in every inclusion area and in no exclusion area. All
rests on one number, the clearance: the distance to the nearest edge, positive inside [m].
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, TypeAlias

import numpy as np

from ftc_autopilot.common.geography import Origin
from ftc_autopilot.guidance.fence_parameters import ALT_MAX, ALT_MIN, AREAS, AROUND_HOME
from ftc_autopilot.guidance.limits import FlightLimits
from ftc_autopilot.guidance.mission_items import param
from ftc_autopilot.guidance.mission_places import (
    ANYWHERE_M,
    RELATIVE_FRAMES,
    Home,
    check_height,
    height_of,
    north_east_of,
)
from ftc_autopilot.guidance.path import point_at
from mavlink_defs import dialect
from mavlink_defs.config.problems import counted
from mavlink_defs.float32 import decimal_of_float32
from mavlink_defs.plan_fence import CIRCLES, POLYGONS, RALLY_POINT, RETURN_POINT
from mavlink_defs.profile import ItemError
from mavlink_defs.services.mission import MissionItem

_BOUNDARY = dialect.FENCE_BREACH_BOUNDARY
_MIN_CORNERS = 3
_MIN_AREA_M2 = 1.0
_LOOK_M = 5.0
"""Way along a path between two looks at a fence that is near [m]."""
_FINAL_M = 2000.0  # of a path that goes on without an end

FencePlace: TypeAlias = tuple[float, float]
"""North and east of the origin [m]."""


@dataclass(frozen=True)
class FenceArea:
    """A circle, or a polygon whose edges neither cross nor touch.

    Attributes:
        item: Number of its first item.
        stay_in: Whether it is an inclusion area.
        corners: North and east of its corners, shape (k, 2) [m]; a circle has one, its centre.
        radius: Of a circle; 0 for a polygon [m].
    """

    item: int
    stay_in: bool
    corners: np.ndarray
    radius: float = 0.0

    @property
    def where(self) -> str:
        """Where one must not be: "outside" it or "within"."""
        return "outside" if self.stay_in else "within"

    @property
    def text(self) -> str:
        """What it is: "inclusion circle of item 3"."""
        kind = "inclusion" if self.stay_in else "exclusion"
        return f"{kind} {'circle' if self.radius else 'polygon'} of item {self.item}"


@dataclass(frozen=True)
class Fence:
    """Areas, and where to go after a breach if the fence names a place; neither: no fence."""

    areas: tuple[FenceArea, ...] = ()
    return_point: FencePlace | None = None

    def nearest(self, place: FencePlace) -> tuple[float, FenceArea | None]:
        """Return the least clearance, and the area that has it; infinite without areas."""
        if not self.areas:
            return math.inf, None
        clear = self.clearances(place)
        nearest = int(clear.argmin())
        return float(clear[nearest]), self.areas[nearest]

    def clearances(self, place: FencePlace) -> np.ndarray:
        """Return for each area the distance to its edge, negative where one must not be [m].

        What is inside a polygon says the even-odd rule; around a circle's centre nothing is, and
        its edge is a radius away from there. All edges are looked at in one go: a fence may have
        hundreds of areas.
        """
        edges, sides, radii = self._edges
        begin, end = edges.begin - place, edges.end - place
        along = end - begin
        share = np.clip(-(begin * along).sum(axis=1) / edges.squares, 0.0, 1.0)
        distances = np.hypot(*(begin + share[:, None] * along).T)
        turns = begin[:, 0] * along[:, 1] - begin[:, 1] * along[:, 0]
        passes = (begin[:, 1] > 0.0) != (end[:, 1] > 0.0)  # the line to the north of the place
        passed = np.add.reduceat(passes & (turns * along[:, 1] > 0.0), edges.first, dtype=int)
        inside = np.where(passed % 2, 1.0, -1.0) * np.minimum.reduceat(distances, edges.first)
        clear: np.ndarray = sides * (inside + radii)
        return clear

    @cached_property
    def _edges(self) -> tuple["_Edges", np.ndarray, np.ndarray]:
        """All edges, and of each area the sign of an inclusion area and the radius."""
        lines = [area.corners for area in self.areas]
        begin = np.concatenate(lines)
        end = np.concatenate([np.roll(line, -1, axis=0) for line in lines])
        squares = np.maximum(np.square(end - begin).sum(axis=1), np.finfo(float).tiny)
        first = np.cumsum([0, *map(len, lines[:-1])])
        sides = np.array([1.0 if area.stay_in else -1.0 for area in self.areas])
        radii = np.array([area.radius for area in self.areas])
        return _Edges(begin, end, squares, first), sides, radii


class _Edges(NamedTuple):
    """The edges of all areas, one after the other; the one of a circle is its centre."""

    begin: np.ndarray  # [m]
    end: np.ndarray  # [m]
    squares: np.ndarray  # of their lengths, not 0 [m²]
    first: np.ndarray  # number of the first edge of each area


class FenceWatch(NamedTuple):
    """A fence as it is watched.

    Attributes:
        fence: The areas.
        parameters: Record of `fence_parameters.FenceRecords`.
        home: What heights and the circle around home count from.
        floor: Whether the least height counts.
    """

    fence: Fence
    parameters: np.void
    home: Home = Home()
    floor: bool = True

    @property
    def kinds(self) -> int:
        """What is watched, as of `FenceParameters.type`."""
        return int(self.parameters["type"]) & ~(0 if self.floor else ALT_MIN)

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing to watch."""
        kinds = self.kinds
        return not (kinds & ~AREAS or (kinds & AREAS and self.fence.areas))

    def at(self, place: tuple[float, float, float]) -> Iterator[tuple[int, float, str]]:
        """Yield all that is watched: FENCE_BREACH, how far inside a place is, what if < 0.

        Args:
            place: North, east and height above the origin [m].
        """
        (north, east, height), home, p = place, self.home, self.parameters
        above, kinds = height - home.height_m, self.kinds
        if kinds & ALT_MIN:
            low = float(p["alt_min_m"])
            yield dialect.FENCE_BREACH_MINALT, above - low, f"below {low:g} m"
        if kinds & ALT_MAX:
            high = float(p["alt_max_m"])
            yield dialect.FENCE_BREACH_MAXALT, high - above, f"above {high:g} m"
        if kinds & AROUND_HOME:
            radius = float(p["radius_m"])
            inside = radius - math.hypot(north - home.north_m, east - home.east_m)
            yield _BOUNDARY, inside, f"more than {radius:g} m from home"
        if kinds & AREAS:
            clear, area = self.fence.nearest((north, east))
            where = "" if area is None else f"{area.where} the {area.text}"
            yield _BOUNDARY, clear, where

    def clearance(self, place: tuple[float, float, float]) -> float:
        """Return how far inside a place is, north, east, height [m]; infinite if all is."""
        return min((clear for _, clear, _ in self.at(place)), default=math.inf)

    def room(self, place: tuple[float, float, float]) -> float:
        """Return the distance from a place to what is watched beside heights [m]."""
        beside = (clear for kind, clear, _ in self.at(place) if kind == _BOUNDARY)
        return min(beside, default=math.inf)

    def objection(self, place: tuple[float, float, float], *, stands: bool) -> str | None:
        """Return why a vehicle must not begin at a place; the ground is below the least height."""
        watch = self._replace(floor=False) if stands else self
        found = (why for _, clear, why in watch.at(place) if clear < 0.0)
        return next((f"outside the fence: {why}" for why in found), None)

    def left_by(self, path: np.void) -> int | None:
        """Return the number of the item on the way to which a path leaves it; None: none.

        A way as long as the clearance cannot lead outside, so the path is looked at where it might
        be; what is outside for less than `_LOOK_M` may be missed. Below the least height it may be
        on a runway.

        Args:
            path: Record of dtype `ftc_autopilot.guidance.path.PATH`.
        """
        aloft = float(path["take_off"]), float(path["final"]) or math.inf
        for leg in range(int(path["count"])):
            s, end = (float(at) for at in path["start"][leg : leg + 2])
            if math.isinf(end):
                curvature = abs(float(path["curvature"][leg]))
                end = s + (2.0 * math.pi / curvature if curvature else _FINAL_M)
            while s < end:
                point = point_at(path, s)
                place = float(point.north), float(point.east), float(point.height)
                watch = self if aloft[0] <= s < aloft[1] else self._replace(floor=False)
                clear = watch.clearance(place)
                if clear < 0.0:
                    return int(path["item"][leg])
                s += max(clear, _LOOK_M)
        return None


class RallyPoint(NamedTuple):
    """A place to circle at in place of home: north, east, height above the origin [m], number."""

    north_m: float
    east_m: float
    height_m: float
    item: int = 0


def decode_fence(items: Sequence[MissionItem], origin: Origin, home: Home | None = None) -> Fence:
    """Return the fence that items describe.

    Args:
        items: Of MAV_MISSION_TYPE_FENCE, numbered from 0.
        origin: Of the simulation's world.
        home: Must be inside, as RTL leads there; None: that is not checked.

    Raises:
        ItemError: An item is none of a fence, or describes none.
    """
    areas: list[FenceArea] = []
    point: tuple[int, FencePlace] | None = None
    at = 0
    while at < len(items):
        item = items[at]
        _check_frame(item)
        if item.command in POLYGONS:
            area = _polygon(items, at, origin)
            areas.append(area)
            at += int(param(item, 1))
            continue
        place = north_east_of(item.x, item.y, origin, item.seq)
        if item.command in CIRCLES:
            areas.append(_circle(item, place))
        elif item.command == RETURN_POINT and point is None:
            point = item.seq, place
        elif item.command == RETURN_POINT:
            raise ItemError(item.seq, dialect.MAV_MISSION_INVALID, "is a second return point")
        else:
            text = f"command {item.command} is none of a fence"
            raise ItemError(item.seq, dialect.MAV_MISSION_UNSUPPORTED, text)
        at += 1
    fence = Fence(tuple(areas), None if point is None else point[1])
    if home is not None:
        _check_inside(fence, "home", (home.north_m, home.east_m))
    if point is not None:
        _check_inside(fence, "the return point", point[1], point[0])
    return fence


def decode_rally(
    items: Sequence[MissionItem], origin: Origin, home: Home, limits: FlightLimits
) -> tuple[RallyPoint, ...]:
    """Return the rally points that items describe.

    Args:
        items: Of MAV_MISSION_TYPE_RALLY, numbered from 0.
        origin: Of the simulation's world.
        home: What relative altitudes count from.
        limits: What guidance may ask of the aircraft.

    Raises:
        ItemError: An item is no rally point, or cannot be flown to.
    """
    points = []
    for item in items:
        if item.command != RALLY_POINT:
            text = f"command {item.command} is no rally point"
            raise ItemError(item.seq, dialect.MAV_MISSION_UNSUPPORTED, text)
        place = north_east_of(item.x, item.y, origin, item.seq)
        height = height_of(item.frame, decimal_of_float32(item.z), origin, home, item.seq)
        check_height(height, home, limits, item.seq)
        points.append(RallyPoint(*place, height, item.seq))
    return tuple(points)


def _polygon(items: Sequence[MissionItem], at: int, origin: Origin) -> FenceArea:
    """Return the polygon that begins with an item, each of whose items says how many there are."""
    first = items[at]
    count = param(first, 1)
    if not (_MIN_CORNERS <= count < math.inf and count == int(count)):
        text = f"polygon of {count:g} corners, must be a whole number, at least {_MIN_CORNERS}"
        raise ItemError(first.seq, dialect.MAV_MISSION_INVALID_PARAM1, text)
    own = items[at : at + int(count)]
    for k, item in enumerate(own):
        if item.command != first.command or param(item, 1) != count:
            text = f"polygon of {count:g} corners ends after {counted(k, 'corner')}"
            raise ItemError(item.seq, dialect.MAV_MISSION_INVALID_PARAM1, text)
        _check_frame(item)
    if len(own) < count:
        text = f"polygon of {count:g} corners ends after {counted(len(own), 'corner')}"
        raise ItemError(own[-1].seq, dialect.MAV_MISSION_INVALID_PARAM1, text)
    places = [north_east_of(item.x, item.y, origin, item.seq) for item in own]
    distinct = [k for k, place in enumerate(places) if place != places[k - 1]]  # some close it
    corners = np.array([places[k] for k in distinct]).reshape(-1, 2)
    if (crossing := crossing_edges(corners)) is not None:
        i, k = (own[distinct[edge]].seq for edge in crossing)
        text = f"polygon's edges from items {i} and {k} cross or touch"
        raise ItemError(k, dialect.MAV_MISSION_INVALID, text)
    if len(corners) < _MIN_CORNERS or abs(_area_m2(corners)) < _MIN_AREA_M2:
        text = "polygon encloses no area"
        raise ItemError(first.seq, dialect.MAV_MISSION_INVALID, text)
    return FenceArea(first.seq, POLYGONS[first.command], corners)


def _circle(item: MissionItem, place: FencePlace) -> FenceArea:
    radius = decimal_of_float32(item.param1)
    if not 0.0 < radius <= ANYWHERE_M:
        text = f"radius {radius:g} m, must be above 0 and at most {ANYWHERE_M:g} m"
        raise ItemError(item.seq, dialect.MAV_MISSION_INVALID_PARAM1, text)
    return FenceArea(item.seq, CIRCLES[item.command], np.array([place]), radius)


def _check_frame(item: MissionItem) -> None:
    if item.frame not in RELATIVE_FRAMES | {
        dialect.MAV_FRAME_GLOBAL,
        dialect.MAV_FRAME_GLOBAL_INT,
    }:
        text = f"frame {item.frame} is not supported, must be global, absolute or relative"
        raise ItemError(item.seq, dialect.MAV_MISSION_UNSUPPORTED_FRAME, text)


def _check_inside(fence: Fence, what: str, place: FencePlace, seq: int | None = None) -> None:
    """Refuse a place that an area excludes: the item is `seq`, or the area's."""
    clear, area = fence.nearest(place)
    if area is not None and clear < 0.0:
        text = f"{what} is {-clear:.0f} m {area.where} the {area.text}"
        raise ItemError(area.item if seq is None else seq, dialect.MAV_MISSION_INVALID, text)


def crossing_edges(corners: np.ndarray) -> tuple[int, int] | None:
    """Return two edges of a polygon that meet though they are not neighbours; None: none do.

    Two edges meet if their bounding boxes do, and each has the other's ends on both sides.

    Args:
        corners: Shape (k, 2); edge i leads from corner i to the next.
    """
    begin, end = corners, np.roll(corners, -1, axis=0)
    low, high = np.minimum(begin, end), np.maximum(begin, end)

    def side(points: np.ndarray) -> np.ndarray:
        """Return on which side of every edge (row) points (column) lie."""
        along, to = (end - begin)[:, None], points[None] - begin[:, None]
        sides: np.ndarray = np.sign(along[..., 0] * to[..., 1] - along[..., 1] * to[..., 0])
        return sides

    apart = side(begin) * side(end) <= 0.0
    boxes = ((low[:, None] <= high[None]) & (low[None] <= high[:, None])).all(axis=2)
    count = len(corners)
    i, k = np.nonzero(np.triu(apart & apart.T & boxes, 2))
    is_far = ~((i == 0) & (k == count - 1))
    return (int(i[is_far][0]), int(k[is_far][0])) if is_far.any() else None


def _area_m2(corners: np.ndarray) -> float:
    own = corners - corners[:1]
    following = np.roll(own, -1, axis=0)
    return 0.5 * float((own[:, 0] * following[:, 1] - own[:, 1] * following[:, 0]).sum())
