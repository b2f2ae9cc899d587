"""Legs of a path: straight lines and arcs, and how they lead from one place to another.

Places are north and east of the origin [m], courses from north by east [rad]; a positive
curvature or radius turns right.
"""

import math
from collections.abc import Iterable
from typing import NamedTuple

_ANGLE_TOLERANCE = 1e-9
"""A turn that is short of a whole one by no more than this is none [rad]."""
_NEAR_M = 1e-6
"""Circles closer than this are the same, and so are points [m]."""


class Pose(NamedTuple):
    """A place and a course through it."""

    north: float
    east: float
    course: float


class Circle(NamedTuple):
    """A circle that is flown around; with radius 0 it is a point."""

    north: float
    east: float
    radius: float  # positive: flown clockwise


class Leg(NamedTuple):
    """A straight line or an arc; pieces of a ground track have no more than its first five fields.

    Attributes:
        north_m: Start, north of the origin [m].
        east_m: Start, east of the origin [m].
        course_rad: Course at the start [rad].
        curvature_1_m: 0 for a line; positive turns right [1/m].
        length_m: Length along the ground, infinite for the last leg of a path [m].
        height_m: Height above the origin at the start [m].
        climb: Height gained per metre of length.
        airspeed_m_s: Commanded airspeed [m/s].
        item: Number of the mission item that the leg leads to.
    """

    north_m: float
    east_m: float
    course_rad: float
    curvature_1_m: float
    length_m: float
    height_m: float = 0.0
    climb: float = 0.0
    airspeed_m_s: float = 0.0
    item: int = 0

    @property
    def end(self) -> Pose:
        """The pose at its end."""
        return self.at(self.length_m)

    def at(self, distance: float) -> Pose:
        """Return the pose after a distance [m]."""
        turned = self.curvature_1_m * distance
        # sin(x) / x of half the angle serves lines and arcs alike
        half = 0.5 * turned
        chord = distance * (math.sin(half) / half if half else 1.0)
        return Pose(
            self.north_m + chord * math.cos(self.course_rad + half),
            self.east_m + chord * math.sin(self.course_rad + half),
            self.course_rad + turned,
        )

    def cut(self, distance: float) -> tuple["Leg", "Leg"]:
        """Return the part up to a distance [m], and the rest."""
        rest = Leg(*self.at(distance), self.curvature_1_m, self.length_m - distance)
        return self._replace(length_m=distance), rest


def bearing(start: tuple[float, ...], end: tuple[float, ...]) -> float:
    """Return the course from one place to another."""
    return math.atan2(end[1] - start[1], end[0] - start[0])


def distance(start: tuple[float, ...], end: tuple[float, ...]) -> float:
    """Return the distance of two places [m]."""
    return math.hypot(end[0] - start[0], end[1] - start[1])


def tangent_course(place: tuple[float, ...], circle: Circle) -> float | None:
    """Return the course of the line from a place that runs into a circle; None from inside."""
    away, radius = distance(place, circle), abs(circle.radius)
    if away <= radius:
        return None
    return bearing(place, circle) - math.copysign(math.asin(radius / away), circle.radius)


def approach(
    pose: Pose, circle: Circle, radius: float, sides: Iterable[float] = (1.0, -1.0)
) -> list[Leg] | None:
    """Return the shortest arc and line from a pose into a circle, or to a point.

    Args:
        pose: Where it begins.
        circle: Where it ends, tangent to it in the sense in which it is flown around.
        radius: Of the arc, positive [m].
        sides: Permitted turns: 1 to the right, -1 to the left.

    Returns:
        At most one arc and one line, none of length 0. None if there is no such way.
    """
    ways = [way for side in sides if (way := _turn_into(pose, circle, side * radius)) is not None]
    return min(ways, key=lambda way: sum(leg.length_m for leg in way), default=None)


def _turn_into(pose: Pose, circle: Circle, radius: float) -> list[Leg] | None:
    """Return arc and line for a turn to one side; a left turn is a mirrored right turn."""
    side, r = math.copysign(1.0, radius), abs(radius)
    to_circle = bearing(pose, circle) - pose.course
    away = distance(pose, circle)
    # from the centre of the turn to the circle's, in the pose's axes: forward, inward
    forward, inward = away * math.cos(to_circle), side * away * math.sin(to_circle) - r
    between = math.hypot(forward, inward)
    offset = side * circle.radius - r  # of the line from the line between the centres
    if max(between, abs(offset)) < _NEAR_M or max(away, abs(circle.radius)) < _NEAR_M:
        return []
    if between < abs(offset):
        return None
    straight = math.sqrt(between * between - offset * offset)
    turn = (math.atan2(inward, forward) - math.atan2(offset, straight)) % (2.0 * math.pi)
    if turn > 2.0 * math.pi - _ANGLE_TOLERANCE:
        turn = 0.0
    arc = Leg(*pose, side / r, turn * r)
    line = Leg(*arc.end, 0.0, straight)
    return [leg for leg in (arc, line) if leg.length_m > 0.0]
