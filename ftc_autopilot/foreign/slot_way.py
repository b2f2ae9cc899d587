"""The way of a slot in space: behind which path or arc it lies, and how fast it will be there."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ftc_autopilot.common.angles import wrap
from ftc_autopilot.config import AutopilotConfig
from ftc_autopilot.guidance.path import point_at
from ftc_autopilot.guidance.planner import Planner
from ftc_autopilot.guidance.runway import figures_of
from mavlink_defs.profile import ItemError
from mavlink_defs.runtime.jit import in_python
from mavlink_defs.services.mission import MissionItem

_point_at = in_python(point_at)
_STEPS = 5
"""Into which half a window is divided."""
_LEAST_RADIUS = 0.2
"""Of a slot's own turn, by the one of its line: beyond the centre it would turn the other way."""


class SlotLine(Protocol):
    """A line beside which a slot moves."""

    def at(self, ahead: float) -> tuple[float, float, float]:
        """Return north, east [m] and course [rad] so far along it [m]."""

    def down(self, ahead: float) -> float:
        """Return how far below the origin the slot is there [m]."""

    def curvature_at(self, ahead: float) -> float:
        """Return its curvature there, to the right [1/m]."""


@dataclass(frozen=True)
class Arc:
    """The arc on which a neighbour flies now."""

    north: float
    east: float
    course: float
    curvature: float  # to the right [1/m]
    slot_down: float

    def at(self, ahead: float) -> tuple[float, float, float]:
        """Return north, east [m] and course [rad] so far ahead of the neighbour [m]."""
        half = 0.5 * self.curvature * ahead
        chord = ahead * (math.sin(half) / half if half else 1.0)
        north = self.north + chord * math.cos(self.course + half)
        east = self.east + chord * math.sin(self.course + half)
        return north, east, self.course + 2.0 * half

    def down(self, ahead: float) -> float:
        """Return how far below the origin the slot is [m]."""
        return self.slot_down

    def curvature_at(self, ahead: float) -> float:
        """Return its curvature, to the right [1/m]."""
        return self.curvature


@dataclass(frozen=True)
class Planned:
    """The path of the mission."""

    path: np.void
    up: float  # the slot above it [m]

    def at(self, ahead: float) -> tuple[float, float, float]:
        """Return north, east [m] and course [rad] so far along the path [m]."""
        point = _point_at(self.path, ahead)
        return float(point.north), float(point.east), float(point.course)

    def down(self, ahead: float) -> float:
        """Return how far below the origin the slot is there [m]."""
        return -float(_point_at(self.path, ahead).height) - self.up

    def curvature_at(self, ahead: float) -> float:
        """Return its curvature there, to the right [1/m]."""
        return float(_point_at(self.path, ahead).curvature)


@dataclass(frozen=True)
class SlotPace:
    """How a slot moves: means of so long before and after now.

    Attributes:
        lead_m: Mean of its place, from the present one along its way [m].
        speed_m_s: Mean of its speed over ground [m/s].
        air_m_s2: Mean of its acceleration through the air [m/s²].
    """

    lead_m: float
    speed_m_s: float
    air_m_s2: float


@dataclass(frozen=True)
class SlotWay:
    """The way of a slot.

    Attributes:
        line: Beside which it moves.
        ahead_m: Its place on it [m].
        right_m: Its place beside it [m].
        rate_m_s: How fast it moves along it now [m/s].
        wind: North, east [m/s].
    """

    line: SlotLine
    ahead_m: float
    right_m: float
    rate_m_s: float
    wind: tuple[float, float]

    def at(self, ahead: float) -> tuple[float, float, float]:
        """Return north, east [m] and course [rad], so far ahead along the line [m]."""
        north, east, course = self.line.at(self.ahead_m + ahead)
        north -= self.right_m * math.sin(course)
        east += self.right_m * math.cos(course)
        return north, east, course

    def arc_at(self, behind: float, bends_in_s: float) -> Arc:
        """Return the arc of the slot's own way from its place less a distance on [m].

        Args:
            behind: The distance [m].
            bends_in_s: The curvature is the one of so much later [s].
        """
        north, east, course = self.at(-behind)
        on_line = self.ahead_m - behind
        curvature = self.line.curvature_at(on_line + bends_in_s * self.rate_m_s)
        curvature /= max(1.0 - curvature * self.right_m, _LEAST_RADIUS)
        return Arc(north, east, course, curvature, self.line.down(on_line))

    def pace(self, window_s: float) -> SlotPace:
        """Return how it moves within a window around now, if its airspeed on the line is kept."""
        after, before = (self._half(side * window_s / 2.0) for side in (1.0, -1.0))
        return SlotPace(
            lead_m=0.5 * (after[0] + before[0]),
            speed_m_s=(after[1] - before[1]) / window_s,
            air_m_s2=(after[2] - before[2]) / window_s,
        )

    def _half(self, length_s: float) -> tuple[float, float, float]:
        """Return the mean and the last distance [m], and airspeed more [m/s], up to a time."""
        dt, course = length_s / _STEPS, self.at(0.0)[2]
        tail = self._tail(course)
        ahead = moved = total = 0.0
        rate = self.rate_m_s
        for _ in range(_STEPS):
            far = ahead + rate * dt
            then = self.at(far)[2]
            further = rate * dt - self.right_m * wrap(then - course)
            total += moved + 0.5 * further
            moved += further
            ahead, course = far, then
            rate = self.rate_m_s + self._tail(course) - tail
        speed = further / dt - (self._tail(course) - tail)
        return total / _STEPS, moved, speed

    def _tail(self, course: float) -> float:
        """Return the wind from behind on a course [m/s]."""
        return self.wind[0] * math.cos(course) + self.wind[1] * math.sin(course)


def planned(config: AutopilotConfig, items: Sequence[MissionItem]) -> np.void | None:
    """Return the path that the members of a formation make of a mission; None if they refuse it."""
    bandwidth = config.controller.reference_bandwidth_rad_s
    runway = figures_of(config.runway_guidance, config.guidance, config.aircraft, bandwidth)
    planner = Planner(config.aircraft, config.guidance, config.origin, config.formation, runway)
    try:
        return planner.path(items)
    except ItemError:
        return None
