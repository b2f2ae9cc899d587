"""The path of a glide without thrust: to a runway within reach, or straight ahead into the wind.

The height that a path takes is its time by the sink of the glide; time is length by ground speed in
the wind of now. Height to spare is flown in whole turns beside the final, and the rest on a longer
final: both are as long as the height demands (FAA-H-8083-3C, chapter 18, spiral over the key
position).
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ftc_autopilot.guidance.legs import Circle, Leg, Pose, approach
from ftc_autopilot.guidance.limits import FlightLimits, turn_radius
from ftc_autopilot.guidance.path import path_record
from ftc_autopilot.guidance.runway import RunwayFigures
from ftc_autopilot.guidance.runway_legs import BREEZE_M_S, flare_legs
from ftc_autopilot.guidance.runway_marks import RunwayMarks

_SETTLING = 3.0
"""Time on the line of the runway before the flare, in lags."""
_LOAD = 1.0 / math.cos(math.radians(20.0)) ** 2
"""Sink in a turn by the one in straight flight: as the drag that lift makes, at 20° of bank."""
_PIECE = math.radians(30.0)
"""Part of a turn that has one slope [rad]."""
_TURN_SHARE = 0.5
"""Share of the height that a turn into the wind may take."""
_BISECTIONS = 30


class Begin(NamedTuple):
    """Where a glide begins.

    Attributes:
        pose: Place, and course over ground.
        height: Above the origin [m].
        wind: Velocity of the air, north and east [m/s].
    """

    pose: Pose
    height: float
    wind: tuple[float, float]


class Glide:
    """Makes the paths of glides of an aircraft."""

    def __init__(self, begin: Begin, ground: float, limits: FlightLimits, item: int = 0) -> None:
        """Note the situation.

        Args:
            begin: Where it begins.
            ground: Height of the centre of gravity on the ground [m].
            limits: What the aircraft can fly.
            item: Number of the mission item that its legs belong to.
        """
        assert limits.runway is not None
        self._begin, self._ground, self._item = begin, ground, item
        self._own: RunwayFigures = limits.runway
        self._radius = turn_radius(self._own.glide, limits)
        self._flare_s = self._own.flare * math.log(self._own.sink / self._own.touchdown)
        self._flare_m = (self._own.sink - self._own.touchdown) * self._own.flare
        self._height = begin.height - ground - self._flare_m

    def to_runway(self, touchdown: Pose) -> np.void | None:
        """Return the path to a place of touchdown, with the course there; None if out of reach."""
        least = _SETTLING * self._own.lag * self._speed(touchdown.course)

        def way(final: float, turns: int) -> list[Leg]:
            return self._way(touchdown, final + self._flare_length(touchdown.course), turns)

        needed = self._needed(way(least, 0))
        if needed > self._height:
            return None
        turns = int((self._height - needed) / max(self._needed(way(least, 1)) - needed, 1.0))
        low, high = least, least + self._height / self._own.sink * self._own.glide
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            fits = self._needed(way(middle, turns)) <= self._height
            low, high = (middle, high) if fits else (low, middle)
        return self._path(way(low, turns))

    def ahead(self) -> np.void:
        """Return the path straight ahead, into the wind if there is the height to turn."""
        pose, (north, east) = self._begin.pose, self._begin.wind
        legs = list[Leg]()
        if math.hypot(north, east) > BREEZE_M_S:
            angle = math.remainder(math.atan2(-east, -north) - pose.course, 2.0 * math.pi)
            turn = Leg(*pose, math.copysign(1.0 / self._radius, angle), abs(angle) * self._radius)
            if self._taken([turn]) < _TURN_SHARE * self._height:
                legs.append(turn)
        end = legs[-1].end if legs else pose
        left = max(self._height - self._taken(legs), 1.0)
        length = left / self._own.sink * self._speed(end.course)
        return self._path([*legs, Leg(*end, 0.0, length + self._flare_length(end.course))])

    def _way(self, touchdown: Pose, final: float, turns: int) -> list[Leg]:
        """Return arc, line, turn and final; the shorter one of those from either side."""
        cos_c, sin_c = math.cos(touchdown.course), math.sin(touchdown.course)
        begin = Pose(
            touchdown.north - final * cos_c, touchdown.east - final * sin_c, touchdown.course
        )
        ways = []
        for side in (1.0, -1.0):
            r = side * self._radius
            circle = Circle(begin.north - r * sin_c, begin.east + r * cos_c, r)
            legs = approach(self._begin.pose, circle, self._radius)
            if legs is None:
                continue
            end = legs[-1].end if legs else self._begin.pose
            turn = side * (begin.course - end.course) % (2.0 * math.pi)
            whole = 2.0 * math.pi * turns
            legs.append(Leg(*end, 1.0 / r, (turn + whole) * self._radius))
            ways.append([*legs, Leg(*begin, 0.0, final)])
        return min(ways, key=self._needed)

    def _flare_length(self, course: float) -> float:
        return self._flare_s * self._speed(course)

    def _speed(self, course: float) -> float:
        """Return the ground speed along a course [m/s]."""
        north, east = self._begin.wind
        along = north * math.cos(course) + east * math.sin(course)
        across = east * math.cos(course) - north * math.sin(course)
        through = math.sqrt(max(self._own.glide**2 - across**2, 0.0))
        return max(through + along, 0.1 * self._own.glide)

    def _needed(self, way: Sequence[Leg]) -> float:
        """Return the height that a way takes before its flare [m]."""
        *legs, final = way
        rest = final.length_m - self._flare_length(final.course_rad)
        return self._taken([*legs, final._replace(length_m=rest)])

    def _taken(self, legs: Sequence[Leg]) -> float:
        return sum(piece.length_m * self._slope(piece) for piece in _pieces(legs))

    def _slope(self, piece: Leg) -> float:
        """Return the height that a piece takes per length."""
        load = _LOAD if piece.curvature_1_m else 1.0
        return load * self._own.sink / self._speed(piece.at(0.5 * piece.length_m).course)

    def _path(self, way: Sequence[Leg]) -> np.void:
        """Return a way as a path, down to its flare, touchdown and roll."""
        *legs, final = way
        line, flare = final.cut(final.length_m - self._flare_length(final.course_rad))
        share = self._height / max(self._needed(way), 1.0)
        height, made, own = self._begin.height, list[Leg](), self._own
        begins = len(_pieces(legs))
        for piece in _pieces([*legs, line]):
            slope = share * self._slope(piece)
            made.append(self._leg(piece, height, -slope, own.approach))
            height -= slope * piece.length_m
        slowest = own.rotate
        flat = self._leg(flare, self._ground, 0.0, slowest)
        made += flare_legs(flat, self._flare_m, own.touchdown * own.flare)
        roll = Leg(*final.end, 0.0, own.landing_roll)
        marks = RunwayMarks(final=begins, landing=len(made), flare=self._ground + self._flare_m)
        made.append(self._leg(roll, self._ground, -own.touchdown / own.approach, slowest))
        return path_record(made, marks=marks)

    def _leg(self, piece: Leg, height: float, climb: float, airspeed: float) -> Leg:
        course = math.remainder(piece.course_rad, 2.0 * math.pi)
        return Leg(*piece[:2], course, *piece[3:5], height, climb, airspeed, self._item)


def _pieces(legs: Sequence[Leg]) -> list[Leg]:
    """Return legs, turns cut into pieces."""
    pieces = []
    for leg in legs:
        number = max(math.ceil(abs(leg.curvature_1_m) * leg.length_m / _PIECE), 1)
        length, rest = leg.length_m / number, leg
        for _ in range(number):
            piece, rest = rest.cut(length)
            pieces.append(piece)
    return [piece for piece in pieces if piece.length_m > 0.0]
