"""Pieces of a ground track: straight lines and arcs, and how they lead from one place to another.

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


class Piece(NamedTuple):
    """A line or an arc."""

    start: Pose
    curvature: float  # 0 for a line
    length: float

    @property
    def end(self) -> Pose:
        """The pose at its end."""
        return self.at(self.length)

    def at(self, distance: float) -> Pose:
        """Return the pose after a distance [m]."""
        north, east, course = self.start
        turned = self.curvature * distance
        # sin(x) / x of half the angle serves lines and arcs alike
        half = 0.5 * turned
        chord = distance * (math.sin(half) / half if half else 1.0)
        return Pose(
            north + chord * math.cos(course + half),
            east + chord * math.sin(course + half),
            course + turned,
        )

    def cut(self, distance: float) -> tuple["Piece", "Piece"]:
        """Return the part up to a distance [m], and the rest."""
        rest = Piece(self.at(distance), self.curvature, self.length - distance)
        return self._replace(length=distance), rest


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
) -> list[Piece] | None:
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
    return min(ways, key=lambda way: sum(piece.length for piece in way), default=None)


def _turn_into(pose: Pose, circle: Circle, radius: float) -> list[Piece] | None:
    """Return arc and line for a turn to one side; a left turn is a mirrored right turn."""
    side, r = math.copysign(1.0, radius), abs(radius)
    to_circle = bearing(pose, circle) - pose.course
    away = distance(pose, circle)
    # from the centre of the turn to that of the circle, in the pose's axes: forward, inward
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
    arc = Piece(pose, side / r, turn * r)
    line = Piece(arc.end, 0.0, straight)
    return [piece for piece in (arc, line) if piece.length > 0.0]
