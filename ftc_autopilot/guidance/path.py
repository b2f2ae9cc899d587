"""A path in space: straight lines and arcs, one after the other, each tangent to the one before.

The path parameter s counts metres along the ground track from the start of the first leg.
Positions are north and east of the origin and height above it [m], courses are from north by
east [rad], and a positive curvature turns right [1/m].
"""

import functools
import math
import zlib
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ftc_autopilot.guidance.legs import Leg
from ftc_autopilot.guidance.runway_marks import NO_MARKS, RunwayMarks
from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import hypot

MAX_LEGS = 4096
"""Most legs that a path can have: enough for as many items as a mission may have."""
MAX_COMMANDS = 2000
"""Most commands that can be passed on a path."""
NO_LOOP = -1
"""`loop` of a path that does not return to an earlier leg."""
_LEGS_PER_CALL = 8
"""Most legs that `locate` passes in one call; an aircraft passes one in many calls."""


PATH = np.dtype(
    [
        ("count", "i8"),  # legs in use, 0: no path
        ("id", "i8"),  # from the mission: members with another id fly another path
        ("loop", "i8"),  # leg that follows the last one, or NO_LOOP
        ("start", "f8", (MAX_LEGS + 1,)),  # s at the start of each leg, and at the end [m]
        ("north", "f8", (MAX_LEGS,)),
        ("east", "f8", (MAX_LEGS,)),
        ("course", "f8", (MAX_LEGS,)),
        ("curvature", "f8", (MAX_LEGS,)),
        ("height", "f8", (MAX_LEGS,)),
        ("climb", "f8", (MAX_LEGS,)),
        ("airspeed", "f8", (MAX_LEGS,)),
        ("item", "i8", (MAX_LEGS,)),
        ("commands", "i8"),  # commands that are passed
        ("passed", "f8", (MAX_COMMANDS,)),  # s where each is [m], in order
        ("command", "i8", (MAX_COMMANDS,)),  # its item
        # take-off and landing: path parameters [m] and heights of the centre of gravity [m]
        ("climb_to", "f8"),  # height that the take-off climbs to
        ("take_off", "f8"),  # end of the take-off, 0: there is none
        ("final", "f8"),  # where the line of the landing begins
        ("landing", "f8"),  # touchdown, 0: there is no landing
        ("around", "f8"),  # where the way around begins that leads to `final` again
        ("around_at", "f8"),  # its height
        ("flare", "f8"),  # height at which the flare begins
    ]
)


class PathPoint(NamedTuple):
    """The path at one value of its parameter."""

    north: float  # [m]
    east: float  # [m]
    course: float  # [rad]
    curvature: float  # [1/m]
    height: float  # [m]
    climb: float  # height per length
    airspeed: float  # [m/s]
    leg: int


class PathCommand(NamedTuple):
    """An item that is passed on a path and changes nothing of it."""

    leg: int
    distance: float  # from the start of the leg; there may be others in between [m]
    item: int


def path_record(
    legs: Sequence[Leg],
    loop: int = NO_LOOP,
    marks: RunwayMarks = NO_MARKS,
    commands: Sequence[PathCommand] = (),
) -> np.void:
    """Return a path as a record of dtype `PATH`; its id is a hash of the rest, not 0.

    Args:
        legs: At most `MAX_LEGS`; only the last one may be infinite, and then nothing follows it.
        loop: Leg that follows the last one, or `NO_LOOP`.
        marks: What of it is runway.
        commands: What is passed, in order; at most `MAX_COMMANDS`.
    """
    record: np.void = np.zeros(1, PATH)[0]
    record["count"], record["loop"] = len(legs), loop
    for k, leg in enumerate(legs):
        record["north"][k], record["east"][k] = leg.north_m, leg.east_m
        record["course"][k], record["curvature"][k] = leg.course_rad, leg.curvature_1_m
        record["height"][k], record["climb"][k] = leg.height_m, leg.climb
        record["airspeed"][k], record["item"][k] = leg.airspeed_m_s, leg.item
        record["start"][k + 1] = record["start"][k] + leg.length_m
    record["commands"] = len(commands)
    for i, (leg_number, distance, item) in enumerate(commands):
        record["passed"][i], record["command"][i] = record["start"][leg_number] + distance, item
    record["climb_to"], record["take_off"] = marks.climb_to, record["start"][marks.climb]
    if marks.landing:
        for name in ("final", "landing", "around"):
            record[name] = record["start"][getattr(marks, name)]
        record["around_at"], record["flare"] = marks.around_at, marks.flare
    record["id"] = functools.reduce(_add_crc, _used(record).values(), 0) or 1
    return record


def put_path(room: np.void, path: np.void) -> None:
    """Put a path in the place of another; while that is written, there is none.

    The rest of the room stays as it is: a file of it has no more than what was used.
    """
    room["count"] = 0
    for name, used in _used(path).items():
        if used.ndim:
            room[name][: len(used)] = used
        elif name != "count":
            room[name] = used
    room["count"] = path["count"]


def _used(path: np.void) -> dict[str, np.ndarray]:
    """Return each field of a path, as far as it is in use."""
    count, commands = int(path["count"]), int(path["commands"])
    rooms = {MAX_LEGS: count, MAX_LEGS + 1: count + 1, MAX_COMMANDS: commands}
    fields = {name: np.asarray(path[name]) for name in PATH.names or ()}
    return {name: one[: rooms[one.size]] if one.ndim else one for name, one in fields.items()}


def _add_crc(crc: int, used: np.ndarray) -> int:
    return zlib.crc32(used.tobytes(), crc)


def commands_between(path: np.void, before: float, now: float) -> list[tuple[float, int]]:
    """Return s [m] and item of each command that is passed behind `before` and up to `now` [m]."""
    count, end = int(path["commands"]), float(path["start"][path["count"]])
    at, items = path["passed"][:count], path["command"][:count]
    first, last, again, once = 0, 0, 0.0, 0.0
    if path["loop"] != NO_LOOP and now >= end:
        again = float(path["start"][path["loop"]])
        once = end - again
        first, last = (max(int((s - again) // once), 0) for s in (before, now))
    found = list[tuple[float, int]]()
    for k in range(first, last + 1):  # rounds; what is before the loop is passed in the first one
        there = at + k * once
        chosen = (there > before) & (there <= now) & ((k == 0) | (at >= again))
        found += zip(there[chosen].tolist(), items[chosen].tolist(), strict=True)
    return found


@compiled
def point_at(path: np.void, s: float) -> PathPoint:
    """Return the path at s [m]; before its start and after its end it is extended."""
    k, distance = _leg_at(path, s)
    course, curvature = path["course"][k], path["curvature"][k]
    sin_c, cos_c = math.sin(course), math.cos(course)
    turned = curvature * distance
    if abs(turned) < 1e-9:
        forward, right = distance, 0.5 * turned * distance
    else:
        forward, right = math.sin(turned) / curvature, (1.0 - math.cos(turned)) / curvature
    return PathPoint(
        north=path["north"][k] + cos_c * forward - sin_c * right,
        east=path["east"][k] + sin_c * forward + cos_c * right,
        course=course + turned,
        curvature=curvature,
        height=path["height"][k] + path["climb"][k] * distance,
        climb=path["climb"][k],
        airspeed=path["airspeed"][k],
        leg=k,
    )


@compiled
def height_at(path: np.void, s: float) -> float:
    """Return the height of the path at s [m], as `point_at` has it."""
    k, distance = _leg_at(path, s)
    return float(path["height"][k] + path["climb"][k] * distance)


@compiled
def locate(path: np.void, north: float, east: float, near: float) -> tuple[float, float]:
    """Project a position on the path.

    Args:
        path: Record of dtype `PATH` with at least one leg.
        north: [m].
        east: [m].
        near: s of the position a short time ago; of several projections the nearest one counts [m].

    Returns:
        s [m], and the distance from the path, positive to its right [m].
    """
    k, along = _leg_at(path, near)
    begin, right, moved = near - along, 0.0, 0
    for _ in range(_LEGS_PER_CALL):
        along, right = _project(path, k, north, east, along)
        following, preceding = _following(path, k), _preceding(path, k, begin)
        if along > _length(path, k) and moved >= 0 and following >= 0:
            begin += _length(path, k)
            k, along, moved = following, 0.0, 1
        elif along < 0.0 and moved <= 0 and preceding >= 0:
            k, moved = preceding, -1
            along = _length(path, k)
            begin -= along
        else:
            break
    if moved > 0:
        along = max(along, 0.0)
    elif moved < 0:
        along = min(along, _length(path, k))
    return begin + along, right


@compiled
def _length(path: np.void, k: int) -> float:
    """Return the length of leg k [m]."""
    return float(path["start"][k + 1] - path["start"][k])


@compiled
def _following(path: np.void, k: int) -> int:
    """Return the leg after leg k, or -1."""
    return k + 1 if k + 1 < path["count"] else int(path["loop"])


@compiled
def _preceding(path: np.void, k: int, begin: float) -> int:
    """Return the leg before leg k, which begins at s = `begin`, or -1."""
    if k == path["loop"] and begin > path["start"][k] + 0.5 * _length(path, k):
        return int(path["count"] - 1)
    return k - 1


@compiled
def _leg_at(path: np.void, s: float) -> tuple[int, float]:
    """Return the leg at s, and the distance from its start [m]."""
    last = path["count"] - 1
    end = path["start"][last + 1]
    if path["loop"] != NO_LOOP and s >= end:
        again = path["start"][path["loop"]]
        s = again + (s - again) % (end - again)
    k = 0
    while k < last:  # by halves
        middle = (k + last) // 2
        if s >= path["start"][middle + 1]:
            k = middle + 1
        else:
            last = middle
    return k, s - path["start"][k]


@compiled
def _project(path: np.void, k: int, north: float, east: float, along: float) -> tuple[float, float]:
    """Project a position on leg k, extended; of the turns of an arc the one nearest `along`."""
    course, curvature = path["course"][k], path["curvature"][k]
    sin_c, cos_c = math.sin(course), math.cos(course)
    d_north, d_east = north - path["north"][k], east - path["east"][k]
    forward = cos_c * d_north + sin_c * d_east
    right = cos_c * d_east - sin_c * d_north
    if curvature == 0.0:
        return forward, right
    side = math.copysign(1.0, curvature)
    radius = 1.0 / abs(curvature)
    inward = radius - side * right  # from the centre, against the first radius
    angle = math.atan2(forward, inward)
    turn = 2.0 * math.pi
    angle += turn * round((along / radius - angle) / turn)
    return angle * radius, side * (radius - hypot(forward, inward))
