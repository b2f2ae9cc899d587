"""Corners of a path at its waypoints, and the turns inside them."""

import math
from typing import NamedTuple

from ftc_autopilot.guidance.legs import Circle, Leg, distance, tangent_course
from ftc_autopilot.guidance.mission_items import MissionTarget


class Corner(NamedTuple):
    """A turn at a waypoint from one line to the next."""

    turn: float  # positive to the right [rad]
    out: float  # length of the next line [m]
    course: float  # of the next line [rad]

    @property
    def tangent(self) -> float:
        """Distance of the ends of the turn from the waypoint, in radii."""
        return math.tan(0.5 * abs(self.turn))

    @property
    def miss(self) -> float:
        """Distance of the turn from the waypoint, in radii."""
        return 1.0 / math.cos(0.5 * self.turn) - 1.0


def corner_at(target: MissionTarget, course: float, following: MissionTarget) -> Corner | None:
    """Return the corner at a waypoint that is reached with a course; None if there is none."""
    if target.radius != 0.0 or target.place is None or following.place is None:
        return None
    circle = Circle(*following.place, following.radius)
    out = tangent_course(target.place, circle)
    if out is None:
        return None
    length = math.sqrt(distance(target.place, circle) ** 2 - following.radius**2)
    return Corner(math.remainder(out - course, 2.0 * math.pi), length, out)


def rounded(line: Leg, corner: Corner, radius: float) -> tuple[Leg, Leg]:
    """Return a line without its end, and the turn that begins there."""
    line = line._replace(length_m=max(line.length_m - radius * corner.tangent, 0.0))
    curvature = math.copysign(1.0 / radius, corner.turn)
    return line, Leg(*line.end, curvature, radius * abs(corner.turn))
