"""The legs of a take-off and of a landing: roll, climb, approach, flare, and the way around again.

All of them are straight and lie on the line of the runway, but for the circuit that leads from an
approach that is given up to its beginning.
"""

import math

from ftc_autopilot.guidance.legs import Circle, Leg, Pose
from ftc_autopilot.guidance.limits import FlightLimits, turn_radius
from ftc_autopilot.guidance.mission_items import MissionTarget
from ftc_autopilot.guidance.runway import CANNOT_START, FROM_LAUNCHER, RunwayFigures
from ftc_autopilot.guidance.runway_marks import RunwayMarks
from mavlink_defs import dialect
from mavlink_defs.profile import ItemError
from sitl_plant.airframe.gear import Runway

_FLARE_LEGS = 8
_SETTLING = 3.0
"""Time of level flight on the line of the runway before an approach descends, in lags."""
BREEZE_M_S = 2.0
"""Wind below which no landing is turned into it [m/s]."""
LEAST_CLIMB_M = 10.0
"""Least height to which a take-off climbs above the runway [m]."""
_BISECTIONS = 40


def take_off_legs(
    begin: Pose, height: float, target: MissionTarget, limits: FlightLimits
) -> list[Leg]:
    """Return the roll and the climb of a take-off, along the aircraft's nose.

    Args:
        begin: Where it stands.
        height: Of its centre of gravity [m].
        target: NAV_TAKEOFF.
        limits: What the aircraft can fly.

    Raises:
        ItemError: It cannot take off.
    """
    figures, seq = _figures(limits), target.item.seq
    if figures.starts == CANNOT_START:
        text = "the aircraft has neither wheels nor a launcher to take off from; add"
        text += " `gear: {kind: tricycle}`, or a `launcher` to its gear"
        raise ItemError(seq, dialect.MAV_MISSION_UNSUPPORTED, text)
    roll = figures.launch if figures.starts == FROM_LAUNCHER else figures.take_off_roll
    if math.isinf(roll):
        text = "the aircraft's thrust does not bring it to the airspeed at which it rotates,"
        text += f" {figures.rotate:.1f} m/s"
        raise ItemError(seq, dialect.MAV_MISSION_UNSUPPORTED, text)
    _check_length(figures, roll, seq, "a take-off")
    airspeed = target.airspeed
    rolling = Leg(*begin, 0.0, roll, height, 0.0, airspeed, seq)
    climb, rise = limits.climb, target.height - height
    return [rolling, Leg(*rolling.end, 0.0, rise / climb, height, climb, airspeed, seq)]


def landing_legs(
    line: Leg, height: float, target: MissionTarget, limits: FlightLimits
) -> tuple[list[Leg], RunwayMarks]:
    """Return the legs from the beginning of a landing's line on, and marks that count from there.

    The line is flown level, then down the slope, which is the usual one if there is room for it;
    the last leg of the way around leads to the first one here.

    Args:
        line: Straight from the place before to the one of touchdown, at no height.
        height: At its beginning [m].
        target: NAV_LAND, with the height of the centre of gravity at touchdown.
        limits: What the aircraft can fly.

    Raises:
        ItemError: It cannot land so.
    """
    figures, seq = _figures(limits), target.item.seq
    _check_length(figures, figures.landing_roll, seq, "a landing")
    approach, at = figures.approach, target.airspeed_there
    level = _level_length(target, limits)
    slope = _slope(line.length_m, level, height - target.height, figures, seq)
    flare_from, flare_length = figures.flare_height(slope), figures.flare_length(slope)
    descent = (height - target.height - flare_from) / slope
    before, rest = line.cut(line.length_m - descent - flare_length)
    glide, flare = rest.cut(descent)
    there = (approach, seq)
    legs = [before._replace(height_m=height, airspeed_m_s=approach, item=seq)]
    legs.append(Leg(*glide[:5], height, -slope, *there))
    bias = figures.touchdown * figures.flare
    flare = flare._replace(length_m=flare_length, height_m=target.height)
    legs += flare_legs(flare._replace(airspeed_m_s=approach, item=seq), flare_from, bias)
    landing = len(legs)
    end = line.end
    away = (height - target.height) / limits.climb + _SETTLING * figures.lag * at
    after = Leg(*end, 0.0, max(figures.landing_roll, away), target.height)
    after = after._replace(climb=-figures.touchdown / approach)
    legs.append(after._replace(airspeed_m_s=approach, item=seq))
    around = len(legs)
    radius = turn_radius(at, limits)
    back = line.length_m + after.length_m
    turn = Leg(*after.end, -1.0 / radius, math.pi * radius, height, 0.0, at, seq)
    down = Leg(*turn.end, 0.0, back, height, 0.0, at, seq)
    legs += [turn, down, Leg(*down.end, -1.0 / radius, math.pi * radius, height, 0.0, at, seq)]
    marks = RunwayMarks(0, 0.0, 0, landing, around, height, target.height + flare_from)
    return legs, marks


def too_short(
    line: Leg, height: float, target: MissionTarget, limits: FlightLimits
) -> tuple[str, float] | None:
    """Return that an approach's line is too short, and the length [m] of the usual slope's.

    Args:
        line: As of `landing_legs`, like all that follows.
        height: At its beginning [m].
        target: NAV_LAND.
        limits: What the aircraft can fly.

    Returns:
        None: it is long enough.
    """
    figures, descent = _figures(limits), height - target.height
    level = _level_length(target, limits)
    least = _needed(figures.steepest, level, descent, figures)
    if line.length_m >= least:
        return None
    text = f"an approach of {line.length_m:.0f} m is too short for {descent:.0f} m of height at"
    text += f" {figures.approach:.1f} m/s, must be >= {least:.0f} m"
    return text, _needed(figures.slope, level, descent, figures)


def landing_circle(
    touchdown: Pose, side: float, height: float, target: MissionTarget, limits: FlightLimits
) -> Circle:
    """Return the circle from which the line of a landing with the usual slope is a tangent.

    Args:
        touchdown: Place and course of the touchdown.
        side: Positive: the circle is to the right of the line.
        height: Of the circle [m].
        target: NAV_LAND there.
        limits: What the aircraft can fly.
    """
    figures, radius = _figures(limits), turn_radius(target.airspeed, limits)
    level = _level_length(target, limits)
    length = _needed(figures.slope, level, height - target.height, figures)
    right, c, s = math.copysign(radius, side), *_along(touchdown.course)
    return Circle(
        touchdown.north - length * c - right * s, touchdown.east - length * s + right * c, right
    )


def touchdown_on(runway: Runway, wind: tuple[float, float], figures: RunwayFigures) -> Pose:
    """Return where a runway is touched down on, with as much of it before as behind the roll.

    It is landed on along its heading, unless the wind, north and east [m/s], comes from behind.
    """
    course = math.radians(runway.heading_deg)
    c, s = _along(course)
    before = 0.5 * (runway.length_m - figures.landing_roll)
    if wind[0] * c + wind[1] * s > BREEZE_M_S:
        course, before = course + math.pi, runway.length_m - before
    course = math.remainder(course, 2.0 * math.pi)
    return Pose(runway.north_m + before * c, runway.east_m + before * s, course)


def around_to(line: Leg, length: float, radius: float) -> tuple[Leg, ...]:
    """Return the way over a line and around, by two half circles to the left, to a longer line.

    Args:
        line: Straight, to the place of touchdown.
        length: Of the longer line, which is the last leg [m].
        radius: Of the half circles [m].
    """
    half = math.pi * radius
    turn = Leg(*line.end, -1.0 / radius, half)
    back = Leg(*turn.end, 0.0, length)
    last = Leg(*back.end, -1.0 / radius, half)
    return line, turn, back, last, Leg(*last.end, 0.0, length)


def _level_length(target: MissionTarget, limits: FlightLimits) -> float:
    """Return how much of the line of an approach is flown level, at least [m]."""
    figures = _figures(limits)
    slowing = figures.slowing_length(target.airspeed_there, limits.gravity_m_s2)
    return max(slowing, _SETTLING * figures.lag * figures.approach)


def _needed(slope: float, level: float, descent: float, figures: RunwayFigures) -> float:
    """Return the length of the line that an approach with a slope takes [m]."""
    down = max(descent - figures.flare_height(slope), 0.0) / slope
    return down + figures.flare_length(slope) + level


def flare_legs(line: Leg, begin: float, bias: float) -> list[Leg]:
    """Return a line as legs of an exponential flare.

    Args:
        line: With the height at its end, airspeed and item.
        begin: Height at its beginning above that at its end [m].
        bias: Depth of the level below its end that the flare leads to [m].
    """
    above = [
        (begin + bias) * (bias / (begin + bias)) ** (k / _FLARE_LEGS) - bias
        for k in range(_FLARE_LEGS + 1)
    ]
    legs, piece, rest = list[Leg](), line.length_m / _FLARE_LEGS, line
    for k in range(_FLARE_LEGS):
        part, rest = rest.cut(piece)
        climb = (above[k + 1] - above[k]) / piece
        legs.append(Leg(*part[:4], piece, line.height_m + above[k], climb, *line[7:]))
    return legs


def _slope(length: float, level: float, descent: float, figures: RunwayFigures, seq: int) -> float:
    """Return the slope of an approach: the usual one, or as steep as its line demands.

    Args:
        length: Of the line, long enough for the steepest one [m].
        level: Of the part of it that is flown level, at least [m].
        descent: Height to lose [m].
        figures: Of the aircraft.
        seq: Number of the item.
    """
    least = figures.flare_height(figures.slope)
    if descent < least:
        text = f"the approach begins {descent:.1f} m above the runway, must be >= {least:.1f} m;"
        text += " raise the item before"
        raise ItemError(seq, dialect.MAV_MISSION_INVALID_PARAM7, text)
    low, high = figures.slope, figures.steepest
    if _needed(low, level, descent, figures) <= length:
        return low
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        fits = _needed(middle, level, descent, figures) <= length
        low, high = (low, middle) if fits else (middle, high)
    return high


def _along(course: float) -> tuple[float, float]:
    return math.cos(course), math.sin(course)


def _figures(limits: FlightLimits) -> RunwayFigures:
    assert limits.runway is not None
    return limits.runway


def _check_length(figures: RunwayFigures, roll: float, seq: int, what: str) -> None:
    if 0.0 < figures.length < roll:
        text = f"the runway is {figures.length:g} m long, {what} takes {roll:.0f} m"
        text += "; land slower, or elsewhere"
        raise ItemError(seq, dialect.MAV_MISSION_UNSUPPORTED, text)
