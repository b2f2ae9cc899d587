"""What the items of a mission ask for: waypoints, circles, and what is done on the way.

Items of the mission protocol are decoded and checked one by one here; `mission_path` makes the
path of them. Positions are north and east of the origin and height above it [m].
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from ftc_autopilot.common.geography import Origin
from ftc_autopilot.guidance.limits import FlightLimits
from ftc_autopilot.guidance.mission_places import (
    ANYWHERE_M,
    Home,
    check_height,
    height_of,
    north_east_of,
)
from mavlink_defs import dialect
from mavlink_defs.constants import INT32_MAX
from mavlink_defs.float32 import decimal_of_float32
from mavlink_defs.profile import ItemError
from mavlink_defs.services.mission import MissionItem

_MOST_TURNS = 1000
_LONGEST_S = 86_400

_FLIES_ONLY = "flights begin and end in the air"
_REASONS = {
    dialect.MAV_CMD_NAV_LAND: _FLIES_ONLY,
    dialect.MAV_CMD_NAV_TAKEOFF: _FLIES_ONLY,
    dialect.MAV_CMD_NAV_LAND_LOCAL: _FLIES_ONLY,
    dialect.MAV_CMD_NAV_TAKEOFF_LOCAL: _FLIES_ONLY,
    dialect.MAV_CMD_DO_LAND_START: _FLIES_ONLY,
    dialect.MAV_CMD_NAV_VTOL_TAKEOFF: "the aircraft cannot hover",
    dialect.MAV_CMD_NAV_VTOL_LAND: "the aircraft cannot hover",
    dialect.MAV_CMD_NAV_DELAY: "the aircraft cannot hover",
    dialect.MAV_CMD_NAV_SPLINE_WAYPOINT: "paths are made of lines and arcs",
    dialect.MAV_CMD_FTC_REFERENCE_SEGMENT: "a mission is a profile of segments or a path, not both",
}


@dataclass(frozen=True)
class Waypoint:
    """A place to fly by.

    Attributes:
        item: Number of the mission item, as of all tasks.
        north_m: [m].
        east_m: [m].
        height_m: [m].
        within_m: Greatest distance at which it is passed; 0: as the turn takes it [m].
    """

    item: int
    north_m: float
    east_m: float
    height_m: float
    within_m: float = 0.0


@dataclass(frozen=True)
class Loiter:
    """A circle; one that is left again is left on the tangent to what comes next.

    Attributes:
        item: Number of the mission item.
        centre: North and east; None: the circle goes through the place before [m].
        height_m: [m].
        radius_m: Positive clockwise; 0: as of other turns [m].
        turns: Turns that are flown at least; infinite if it is not left.
        seconds: Time that is flown in it besides [s].
    """

    item: int
    centre: tuple[float, float] | None
    height_m: float
    radius_m: float = 0.0
    turns: float = math.inf
    seconds: float = 0.0


@dataclass(frozen=True)
class Return:
    """The circle around home, at the height of the way there."""

    item: int


@dataclass(frozen=True)
class SetSpeed:
    """The airspeed from here on [m/s]."""

    item: int
    airspeed_m_s: float


@dataclass(frozen=True)
class Delay:
    """Time before what follows up to the next place is done [s]."""

    item: int
    seconds: float


@dataclass(frozen=True)
class Jump:
    """The next item is another one.

    Attributes:
        item: Number of the mission item.
        to: Item to go on with.
        times: How often, after that the mission goes on; -1: always.
    """

    item: int
    to: int
    times: int


@dataclass(frozen=True)
class SetHome:
    """A new home; without one the place where the mission is by then."""

    item: int
    home: Home | None


@dataclass(frozen=True)
class Takeoff:
    """A takeoff before the first place: it is past when the mission begins, in the air."""

    item: int


Task: TypeAlias = Waypoint | Loiter | Return | SetSpeed | Delay | Jump | SetHome | Takeoff
"""What one mission item asks for."""


_PLACES = (Waypoint, Loiter, Return)
"""Tasks that lead to a place."""


def is_path(items: Sequence[MissionItem]) -> bool:
    """Return whether a mission, home included, is to become a path: it has no segment first."""
    return len(items) > 1 and items[1].command != dialect.MAV_CMD_FTC_REFERENCE_SEGMENT


def has_place(item: MissionItem) -> bool:
    """Return whether an item names a place: some clients write 0 for none, others no value."""
    return INT32_MAX not in (abs(item.x), abs(item.y)) and (item.x, item.y) != (0, 0)


def refusal(command: int) -> str:
    """Return why a command cannot be part of a path."""
    reason = _REASONS.get(command)
    return f"command {command} is not supported" + (f": {reason}" if reason else "")


def decode_items(
    items: Sequence[MissionItem], origin: Origin, home: Home, limits: FlightLimits
) -> tuple[Task, ...]:
    """Return the tasks of a mission: task k is that of item k + 1, as item 0 is home.

    Args:
        items: The whole mission, home included.
        origin: Of the simulation's world.
        home: What relative altitudes count from, before the mission sets another.
        limits: What the aircraft that is to fly it can fly.

    Raises:
        ItemError: An item cannot be flown.
    """
    tasks: list[Task] = []
    for seq, item in enumerate(items[1:], start=1):
        if item.seq != seq:
            text = f"it stands at place {seq}, but has number {item.seq}"
            raise ItemError(seq, dialect.MAV_MISSION_INVALID_SEQUENCE, text)
        decode = _DECODERS.get(item.command)
        if decode is None:
            raise ItemError(seq, dialect.MAV_MISSION_UNSUPPORTED, refusal(item.command))
        task = decode(_Fields(item, origin, home, limits, len(items)))
        if isinstance(task, SetHome) and task.home is not None:
            home = task.home
        if isinstance(task, Takeoff) and any(isinstance(t, _PLACES) for t in tasks):
            text = f"{refusal(item.command)}; it is taken as past before the first place only"
            raise ItemError(seq, dialect.MAV_MISSION_UNSUPPORTED, text)
        tasks.append(task)
    return tuple(tasks)


class _Fields:
    """The fields of an item, checked as they are read."""

    def __init__(
        self,
        item: MissionItem,
        origin: Origin,
        home: Home,
        limits: FlightLimits,
        count: int,
    ) -> None:
        self.seq = item.seq
        self.limits, self.count = limits, count
        self.item, self._origin, self._home = item, origin, home
        params = (item.param1, item.param2, item.param3, item.param4)
        self._params = [decimal_of_float32(param) for param in params]

    def param(self, number: int) -> float:
        """Return a parameter; 0 if it is NaN, that is, not given."""
        value = self._params[number - 1]
        return 0.0 if math.isnan(value) else value

    def check(self, number: int, name: str, good: bool, expected: str) -> float:
        """Return a parameter that must be as expected."""
        value = self._params[number - 1]
        if not good:
            text = f"{name} {value:g}, must be {expected}"
            raise ItemError(self.seq, dialect.MAV_MISSION_INVALID_PARAM1 + number - 1, text)
        return self.param(number)

    def position(self) -> tuple[float, float]:
        """Return north and east of its place [m]."""
        return north_east_of(self.item.x, self.item.y, self._origin, self.seq)

    def radius(self) -> float:
        """Return the radius of a circle, positive clockwise [m]: param 3 of whatever has one."""
        good = abs(self.param(3)) <= ANYWHERE_M
        return self.check(3, "radius", good, f"at most {ANYWHERE_M:g} m")

    def height(self) -> float:
        """Return its height above the origin [m]."""
        altitude = decimal_of_float32(self.item.z)
        return height_of(self.item.frame, altitude, self._origin, self._home, self.seq)

    def flown_height(self) -> float:
        """Return the height above the origin of a place that is flown to [m]."""
        height = self.height()
        check_height(height, self._home, self.limits, self.seq)
        return height


def _waypoint(fields: _Fields) -> Task:
    """NAV_WAYPOINT: 1 hold time of rotorcraft, 2 acceptance radius, 3 radius to pass by."""
    within = fields.check(2, "acceptance radius", not fields.param(2) < 0.0, ">= 0 m")
    radius, height = fields.radius(), fields.flown_height()
    north, east = fields.position()
    if radius != 0.0:
        return Loiter(fields.seq, (north, east), height, radius, turns=0.0)
    return Waypoint(fields.seq, north, east, height, within)


def _circle(fields: _Fields, turns: float = math.inf, seconds: float = 0.0) -> Loiter:
    centre = fields.position() if has_place(fields.item) else None
    return Loiter(fields.seq, centre, fields.flown_height(), fields.radius(), turns, seconds)


def _loiter_turns(fields: _Fields) -> Task:
    turns = fields.check(1, "turns", 0.0 < fields.param(1) <= _MOST_TURNS, f"1 to {_MOST_TURNS}")
    return _circle(fields, turns)


def _loiter_time(fields: _Fields) -> Task:
    seconds = fields.check(1, "time", 0.0 <= fields.param(1) <= _LONGEST_S, f"0 to {_LONGEST_S} s")
    return _circle(fields, 0.0, seconds)


def _set_speed(fields: _Fields) -> Task:
    """DO_CHANGE_SPEED: 1 type, 2 speed; the aircraft holds airspeeds, whatever the type."""
    low, high = fields.limits.slowest_m_s, fields.limits.fastest_m_s
    kind = fields.param(1)
    fields.check(1, "speed type", kind in {0.0, 1.0}, "0 (airspeed) or 1 (ground speed)")
    good = low <= fields.param(2) <= high
    return SetSpeed(fields.seq, fields.check(2, "speed", good, f"{low:g} to {high:g} m/s"))


def _delay(fields: _Fields) -> Task:
    seconds = fields.check(1, "delay", 0.0 <= fields.param(1) <= _LONGEST_S, f"0 to {_LONGEST_S} s")
    return Delay(fields.seq, seconds)


def _jump(fields: _Fields) -> Task:
    to, times = fields.param(1), fields.param(2)
    last = fields.count - 1
    fields.check(1, "jump to item", to in range(1, last + 1), f"1 to {last}")
    fields.check(2, "jumps", times in range(-1, _MOST_TURNS + 1), f"-1 (always) to {_MOST_TURNS}")
    return Jump(fields.seq, int(to), int(times))


def _set_home(fields: _Fields) -> Task:
    """DO_SET_HOME: 1 whether it is the present place, 5 to 7 another place."""
    present = fields.check(1, "use of the present place", fields.param(1) in {0.0, 1.0}, "0 or 1")
    return SetHome(fields.seq, None if present else Home(*fields.position(), fields.height()))


_DECODERS: dict[int, Callable[[_Fields], Task]] = {
    dialect.MAV_CMD_NAV_WAYPOINT: _waypoint,
    dialect.MAV_CMD_NAV_LOITER_UNLIM: _circle,
    dialect.MAV_CMD_NAV_LOITER_TURNS: _loiter_turns,
    dialect.MAV_CMD_NAV_LOITER_TIME: _loiter_time,
    dialect.MAV_CMD_NAV_TAKEOFF: lambda fields: Takeoff(fields.seq),
    dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH: lambda fields: Return(fields.seq),
    dialect.MAV_CMD_DO_CHANGE_SPEED: _set_speed,
    dialect.MAV_CMD_DO_JUMP: _jump,
    dialect.MAV_CMD_DO_SET_HOME: _set_home,
    dialect.MAV_CMD_CONDITION_DELAY: _delay,
}
