"""What the items of a mission ask for: decoded, checked one by one, placed in the world.

`ftc_autopilot.guidance.targets` says in which order they are flown, `mission_path` makes the path
of them. Positions are north and east of the origin and height above it [m].
"""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple, TypeAlias

from ftc_autopilot.common.geography import Origin
from ftc_autopilot.guidance.limits import FlightLimits
from ftc_autopilot.guidance.mission_commands import ANNOUNCED, FLOWN_STRAIGHT, PAYLOAD, TAG
from ftc_autopilot.guidance.mission_places import (
    ANYWHERE_M,
    RELATIVE_FRAMES,
    Home,
    check_height,
    height_of,
    north_east_of,
)
from mavlink_defs import dialect
from mavlink_defs.config.problems import counted
from mavlink_defs.constants import INT32_MAX
from mavlink_defs.float32 import decimal_of_float32
from mavlink_defs.profile import ItemError
from mavlink_defs.services.mission import MissionItem

WAYPOINT, RETURN = dialect.MAV_CMD_NAV_WAYPOINT, dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH
LOITER, LOITER_TURNS, LOITER_TIME = (
    dialect.MAV_CMD_NAV_LOITER_UNLIM,
    dialect.MAV_CMD_NAV_LOITER_TURNS,
    dialect.MAV_CMD_NAV_LOITER_TIME,
)
LOITER_TO_ALT = dialect.MAV_CMD_NAV_LOITER_TO_ALT
SPEED, DELAY = dialect.MAV_CMD_DO_CHANGE_SPEED, dialect.MAV_CMD_CONDITION_DELAY
DISTANCE = dialect.MAV_CMD_CONDITION_DISTANCE
JUMP, SET_HOME = dialect.MAV_CMD_DO_JUMP, dialect.MAV_CMD_DO_SET_HOME
JUMP_TO_TAG = dialect.MAV_CMD_DO_JUMP_TAG
TAKEOFF, LAND = dialect.MAV_CMD_NAV_TAKEOFF, dialect.MAV_CMD_NAV_LAND
GROUND_DELAY = dialect.MAV_CMD_NAV_DELAY

WAYPOINTS = {WAYPOINT} | FLOWN_STRAIGHT
PLACES = WAYPOINTS | {LOITER, LOITER_TURNS, LOITER_TIME, LOITER_TO_ALT, RETURN, LAND}
"""Commands that lead to a place."""
_ROUND = {WAYPOINT, LOITER, LOITER_TURNS, LOITER_TIME, LOITER_TO_ALT}
"""Commands with a radius."""
JUMPS = {JUMP, JUMP_TO_TAG}
COMMANDS = PLACES | JUMPS | {TAKEOFF, GROUND_DELAY, SPEED, DELAY, DISTANCE, SET_HOME}
"""All that a path is made of."""
_TAKEN = COMMANDS | ANNOUNCED
UNCHANGED, DEFAULT = -1.0, -2.0
"""Speeds of DO_CHANGE_SPEED that are none."""

_TERRAIN_FRAMES = {
    dialect.MAV_FRAME_GLOBAL_TERRAIN_ALT,
    dialect.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT,
}
_MAX_TURNS = 1000
_MAX_S = 86_400

_HOVERS = "the aircraft cannot hover"
_REASONS = {
    dialect.MAV_CMD_DO_CHANGE_ALTITUDE: "give the next place that altitude",
    dialect.MAV_CMD_CONDITION_CHANGE_ALT: "give the next place that altitude",
    dialect.MAV_CMD_NAV_CONTINUE_AND_CHANGE_ALT: "give NAV_LOITER_TO_ALT (31) that altitude",
    dialect.MAV_CMD_DO_SET_MISSION_CURRENT: "give DO_JUMP (177)",
    dialect.MAV_CMD_DO_SET_MODE: "a mission is flown in AUTO; its end may be RTL (20)",
    dialect.MAV_CMD_DO_INVERTED_FLIGHT: "no law flies inverted; leave it out",
    dialect.MAV_CMD_NAV_GUIDED_ENABLE: "a station chooses GUIDED; leave it out",
    dialect.MAV_CMD_NAV_LAND_LOCAL: "give NAV_LAND (21)",
    dialect.MAV_CMD_NAV_TAKEOFF_LOCAL: "give NAV_TAKEOFF (22)",
    dialect.MAV_CMD_NAV_VTOL_TAKEOFF: f"{_HOVERS}; give NAV_TAKEOFF (22)",
    dialect.MAV_CMD_NAV_VTOL_LAND: f"{_HOVERS}; leave it out",
    dialect.MAV_CMD_DO_VTOL_TRANSITION: f"{_HOVERS}; leave it out",
    dialect.MAV_CMD_NAV_PAYLOAD_PLACE: f"{_HOVERS}; give NAV_WAYPOINT (16) and DO_GRIPPER (211)",
    dialect.MAV_CMD_NAV_DELAY: f"{_HOVERS}; give NAV_LOITER_TIME (19)",
    dialect.MAV_CMD_FTC_REFERENCE_SEGMENT: "a mission is a profile of segments or a path, not both",
}


def is_path(items: Sequence[MissionItem]) -> bool:
    """Return whether a mission, home included, is to become a path: it has no segment first."""
    return len(items) > 1 and items[1].command != dialect.MAV_CMD_FTC_REFERENCE_SEGMENT


def landing_start(items: Sequence[MissionItem]) -> int | None:
    """Return the item with which the landing of a mission begins; None without a landing.

    It is the last DO_LAND_START before it, or the place before it.
    """
    commands = [item.command for item in items]
    if LAND not in commands:
        return None
    landing = commands.index(LAND)
    marks = [k for k in range(landing) if commands[k] == dialect.MAV_CMD_DO_LAND_START]
    places = [k for k in range(1, landing) if commands[k] in PLACES]
    return (marks or places or [landing])[-1]


def has_place(item: MissionItem) -> bool:
    """Return whether an item names a place: some clients write 0 for none, others no value."""
    return INT32_MAX not in (abs(item.x), abs(item.y)) and (item.x, item.y) != (0, 0)


def refusal(command: int) -> str:
    """Return why a command cannot be part of a path."""
    reason = _REASONS.get(command)
    return f"command {command} is not supported" + (f": {reason}" if reason else "")


def remarks_on(items: Sequence[MissionItem]) -> Iterator[str]:
    """Yield what is flown otherwise than the items of a mission, home included, may be meant."""
    flown = items[1:]
    low = [one for one in flown if _height_over(items[0], one) <= 0.0]
    if low:
        yield f"{first_of(low)} not above home: that is on the ground, if it is flat"
    if number := sum(item.command in FLOWN_STRAIGHT for item in flown):
        yield f"{counted(number, 'spline or arc')} flown as waypoint, on a line"
    if number := sum(item.frame in _TERRAIN_FRAMES for item in flown):
        yield f"{counted(number, 'altitude')} above terrain counted from home: the ground is flat"
    if number := sum(item.command in PAYLOAD for item in flown):
        yield f"{counted(number, 'payload command')} announced only"


def first_of(items: Sequence[MissionItem]) -> str:
    """Return the first of some items, and how many more there are: "item 3 and 2 more"."""
    return f"item {items[0].seq}" + (f" and {len(items) - 1} more" if len(items) > 1 else "")


def _height_over(home: MissionItem, item: MissionItem) -> float:
    """Return the height over home of a place in the air; infinite if none is given [m]."""
    if item.command not in PLACES - {RETURN, LAND} or not has_place(item) or math.isnan(item.z):
        return math.inf
    return item.z if item.frame in RELATIVE_FRAMES else item.z - home.z


class When(NamedTuple):
    """Where on the way to a place something happens: behind both, at the latest at its end."""

    after_m: float = 0.0  # from the way's begin
    left_m: float = math.inf  # to the way's end

    def on(self, length: float) -> float:
        """Return the distance from the begin of a way of some length [m]."""
        return max(self.after_m, length - self.left_m)


class MissionTarget(NamedTuple):
    """An item of a mission in the simulation's world, and how the way to it is flown.

    Attributes:
        item: The item.
        place: North and east of a waypoint, a circle's centre or a new home [m]; None: a circle
            through the place before, or a waypoint or home at the place before.
        height: [m].
        within: Greatest distance at which a waypoint is passed; 0: any [m].
        radius: Of a circle, positive clockwise; 0: as of other turns, or a waypoint [m].
        length: Of the circle; it may be infinite [m]. This and all that follows depends on the
            items flown before; see `ftc_autopilot.guidance.targets`.
        airspeed: Where the way to it begins [m/s].
        changes: Where on the way the airspeed changes, and to what [m/s]; what lies beyond its end
            takes effect at the end.
        commands: Where on the way items are passed that change nothing of it, and their numbers.
        home: Home when it is reached.
    """

    item: MissionItem
    place: tuple[float, float] | None = None
    height: float = 0.0
    within: float = 0.0
    radius: float = 0.0
    length: float = 0.0
    airspeed: float = 0.0
    changes: tuple[tuple[When, float], ...] = ()
    commands: tuple[tuple[When, int], ...] = ()
    home: Home = Home()

    @property
    def airspeed_there(self) -> float:
        """Airspeed at the end of the way to it [m/s]."""
        return self.changes[-1][1] if self.changes else self.airspeed

    @property
    def fastest(self) -> float:
        """Greatest airspeed on the way to it [m/s]."""
        return max(self.airspeed, *(speed for _, speed in self.changes), 0.0)


def param(item: MissionItem, number: int) -> float:
    """Return param 1 to 4 of an item; 0 if it is NaN, that is, not given."""
    value = _param(item, number)
    return 0.0 if math.isnan(value) else value


def decode_items(
    items: Sequence[MissionItem], origin: Origin, home: Home, limits: FlightLimits
) -> tuple[MissionTarget, ...]:
    """Return the targets of a mission: target k is item k + 1, as item 0 is home.

    Args:
        items: The whole mission, home included.
        origin: Of the simulation's world.
        home: What relative altitudes count from, before the mission sets another.
        limits: What the aircraft that is to fly it can fly.

    Raises:
        ItemError: An item cannot be flown.
    """
    targets: list[MissionTarget] = []
    tags = {param(item, 1) for item in items[1:] if item.command == TAG}
    height = math.nan  # of the place before
    for seq, item in enumerate(items[1:], start=1):
        if item.seq != seq:
            text = f"it is at place {seq}, but has number {item.seq}"
            raise ItemError(seq, dialect.MAV_MISSION_INVALID_SEQUENCE, text)
        if item.command not in _TAKEN:
            raise ItemError(seq, dialect.MAV_MISSION_UNSUPPORTED, refusal(item.command))
        on_ground = item.command in {TAKEOFF, GROUND_DELAY}
        if on_ground and any(t.item.command in PLACES for t in targets):
            text = "a takeoff stands before the first place only"
            if item.command == GROUND_DELAY:
                text = (
                    f"{refusal(item.command)}; a wait on the ground stands before the first place"
                )
            raise ItemError(seq, dialect.MAV_MISSION_UNSUPPORTED, text)
        _check_params(item, len(items) - 1, tags)
        target = _placed(item, origin, home, limits, height)
        if item.command in PLACES and item.command != RETURN:
            height = target.height
        if item.command == SET_HOME and target.place is not None:
            home = Home(*target.place, target.height)
        targets.append(target)
    return tuple(targets)


_Check: TypeAlias = tuple[int, str, bool, str]
"""Number and name of a param, whether it is good, and what is expected."""


def _check_params(item: MissionItem, last: int, tags: set[float]) -> None:
    """Refuse params that cannot be flown; `last`: number of the last item; `tags`: that it has."""
    for number, name, good, expected in _checks_of(item, last, tags):
        if not good:
            text = f"{name} {_param(item, number):g}, must be {expected}"
            raise ItemError(item.seq, dialect.MAV_MISSION_INVALID_PARAM1 + number - 1, text)


def _checks_of(item: MissionItem, last: int, tags: set[float]) -> Iterator[_Check]:
    command, p1, p2 = item.command, param(item, 1), param(item, 2)
    if command == WAYPOINT:
        yield 2, "acceptance radius", not p2 < 0.0, ">= 0 m"
    elif command == LOITER_TURNS:
        yield 1, "turns", 0.0 < p1 <= _MAX_TURNS, f"1 to {_MAX_TURNS}"
    elif command in {LOITER_TIME, DELAY}:
        name = "delay" if command == DELAY else "time"
        yield 1, name, 0.0 <= p1 <= _MAX_S, f"0 to {_MAX_S} s"
    elif command == SPEED:  # the aircraft holds airspeeds, whatever the type
        yield 1, "speed type", p1 in {0.0, 1.0}, "0 (airspeed) or 1 (ground speed)"
        good = p2 > 0.0 or p2 in {UNCHANGED, DEFAULT}
        yield 2, "speed", good, "above 0 m/s, -1 (as it is) or -2 (cruise)"
    elif command == DISTANCE:
        yield 1, "distance", 0.0 <= p1 <= ANYWHERE_M, f"0 to {ANYWHERE_M:g} m"
    elif command == SET_HOME:
        yield 1, "use of the present place", p1 in {0.0, 1.0}, "0 or 1"
    elif command == JUMP:
        yield 1, "jump to item", p1 in range(1, last + 1), f"1 to {last}"
    elif command == JUMP_TO_TAG and p1 not in tags:
        known = ", ".join(f"{tag:g}" for tag in sorted(tags)) or "one of a JUMP_TAG (600)"
        yield 1, "jump to tag", False, known
    if command in JUMPS:
        good = p2 in range(-1, _MAX_TURNS + 1)
        yield 2, "jumps", good, f"-1 (always) to {_MAX_TURNS}"
    elif command in _ROUND:
        number = 2 if command == LOITER_TO_ALT else 3
        good = abs(param(item, number)) <= ANYWHERE_M
        yield number, "radius", good, f"at most {ANYWHERE_M:g} m"


def _placed(
    item: MissionItem, origin: Origin, home: Home, limits: FlightLimits, before: float
) -> MissionTarget:
    """Return an item whose params are good with its place and height.

    What a planner leaves out, x and y of 0 or no value, is the place before; no altitude, or 0 m
    there, is its height, `before`.
    """
    command = item.command
    if command == LAND:
        check_gear(limits, item.seq)
    if command == TAKEOFF:
        return MissionTarget(item, height=_take_off_height(item, origin, home))
    flown_to = command in PLACES and command != RETURN
    if not flown_to and (command != SET_HOME or param(item, 1) == 1.0):
        return MissionTarget(item)
    place = None
    if command == SET_HOME or has_place(item):
        place = north_east_of(item.x, item.y, origin, item.seq)
    altitude, height = decimal_of_float32(item.z), before
    left_out = math.isnan(altitude) or (place is None and altitude == 0.0)
    if not left_out or math.isnan(before):
        altitude = math.nan if left_out else altitude
        height = height_of(item.frame, altitude, origin, home, item.seq)
    if not flown_to:
        return MissionTarget(item, place, height)
    if command == LAND:
        check_height(max(height, home.height_m + limits.lowest_m), home, limits, item.seq)
        return _landing(item, place, height, limits)
    check_height(height, home, limits, item.seq)
    within = param(item, 2) if command == WAYPOINT else 0.0
    radius = 0.0 if command in FLOWN_STRAIGHT else param(item, 2 if command == LOITER_TO_ALT else 3)
    return MissionTarget(item, place, height, within, radius)


def check_gear(limits: FlightLimits, seq: int = 0) -> None:
    """Refuse a landing of an aircraft that cannot land; `seq`: number of its item."""
    if limits.runway is None or not limits.runway.lands:
        text = "the aircraft has no gear to land on; add `gear: {kind: tricycle}` to it, or"
        raise ItemError(seq, dialect.MAV_MISSION_UNSUPPORTED, f"{text} `{{kind: belly}}`")


def _landing(
    item: MissionItem,
    place: tuple[float, float] | None,
    height: float,
    limits: FlightLimits,
) -> MissionTarget:
    """Return a landing; its height is the one of the centre of gravity at touchdown."""
    if limits.runway is None or place is None:
        text = "the place of touchdown is not given"
        raise ItemError(item.seq, dialect.MAV_MISSION_INVALID_PARAM5_X, text)
    return MissionTarget(item, place, height + limits.runway.height, length=math.inf)


def _take_off_height(item: MissionItem, origin: Origin, home: Home) -> float:
    """Return the height of a takeoff; NaN if it has none, as one that is past may have."""
    try:
        return height_of(item.frame, decimal_of_float32(item.z), origin, home, item.seq)
    except ItemError:
        return math.nan


def _param(item: MissionItem, number: int) -> float:
    return decimal_of_float32((item.param1, item.param2, item.param3, item.param4)[number - 1])
