"""The places of a mission in the order of flight, each with all that the ones before it decide."""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple, TypeAlias

from ftc_autopilot.guidance.limits import FlightLimits, tightest_turn, too_tight, turn_radius
from ftc_autopilot.guidance.mission_commands import ANNOUNCED, TAG
from ftc_autopilot.guidance.mission_items import (
    DEFAULT,
    DELAY,
    DISTANCE,
    JUMP,
    JUMPS,
    LAND,
    LOITER,
    LOITER_TIME,
    LOITER_TURNS,
    PLACES,
    RETURN,
    SET_HOME,
    SPEED,
    UNCHANGED,
    WAYPOINT,
    WAYPOINTS,
    MissionTarget,
    When,
    first_of,
    param,
)
from ftc_autopilot.guidance.mission_places import Home
from mavlink_defs import dialect
from mavlink_defs.mission_files import mission_item
from mavlink_defs.profile import ItemError
from mavlink_defs.services.mission import MissionItem

MAX_VISITS = 1000
_LEVEL_M = 1.0
"""Difference of the heights of home and a runway that is not remarked on [m]."""

Visit: TypeAlias = tuple[MissionTarget, ...]
"""What is done on the way to a place, jumps included, and the place."""


class Order(NamedTuple):
    """The places in the order of flight.

    Attributes:
        visits: What is done on the way to each place, and the place.
        again: Which visit follows the last one; None: there is an end.
        after: What is passed behind the last place.
    """

    visits: tuple[Visit, ...]
    again: int | None = None
    after: Visit = ()


def order_of(mission: Sequence[MissionTarget], first: int = 1) -> Order:
    """Carry out the jumps of a mission.

    A jump counts by itself, and is not set back by another one, as in ArduPilot. What comes before
    the last place has its effect; what comes after it has none, but is passed.

    Args:
        mission: Target k is item k + 1.
        first: Item to begin with.

    Raises:
        ItemError: Jumps lead around without a place, or make too many of them.
    """
    visits: list[Visit] = []
    visit: list[MissionTarget] = []
    left = {t.item.seq: int(param(t.item, 2)) for t in mission if t.item.command in JUMPS}
    begun: dict[tuple[int, ...], int] = {}  # visits made when an endless jump was taken before
    at, jump = first, None
    while at <= len(mission):
        target = mission[at - 1]
        seq, command = target.item.seq, target.item.command
        at += 1
        if command in JUMPS:
            if left[seq] == 0:
                continue
            to = _destination(mission, target)
            if left[seq] > 0:
                left[seq] -= 1
            else:
                state = (seq, *left.values())
                if begun.get(state, len(visits)) < len(visits):
                    return Order(tuple(visits), begun[state])
                if state in begun:
                    text = f"jump to item {to} leads around without a waypoint"
                    raise ItemError(seq, dialect.MAV_MISSION_INVALID_PARAM1, text)
                begun[state] = len(visits)
            at, jump = to, seq
        visit.append(target)
        if command in PLACES:
            visits.append(tuple(visit))
            visit.clear()
            if command in {LOITER, RETURN, LAND}:
                break
            if jump is not None and len(visits) > MAX_VISITS:
                text = f"jumps make more than {MAX_VISITS} places of the mission"
                raise ItemError(jump, dialect.MAV_MISSION_NO_SPACE, f"{text}; jump less often")
    return Order(tuple(visits), after=tuple(visit))


def _destination(mission: Sequence[MissionTarget], jump: MissionTarget) -> int:
    """Return the number of the item that a jump leads to; of equal tags the first counts."""
    to = param(jump.item, 1)
    if jump.item.command == JUMP:
        return int(to)
    items = (target.item for target in mission)
    return next(item.seq for item in items if item.command == TAG and param(item, 1) == to)


class Targets:
    """The targets of a mission, by number from 0; after the last place comes a circle without end.

    As ArduPlane does, an airspeed beyond the limits is flown as the nearest within them, a circle
    that is too tight as tight as it can be, and a landing below the ground on it: see `remarks`.
    """

    def __init__(
        self,
        order: Order,
        limits: FlightLimits,
        home: Home,
        begin: tuple[float, float, float],
        airspeed: float,
    ) -> None:
        """Resolve nothing yet.

        Args:
            order: The visits.
            limits: What the aircraft can fly.
            home: Home before the first one.
            begin: North, east and height where the first one is approached from [m].
            airspeed: Airspeed there [m/s].
        """
        self._order, self._limits = order, limits
        self._notes: dict[str, dict[int, tuple[MissionItem, str]]] = {}
        start = MissionTarget(mission_item(0, WAYPOINT), begin[:2], begin[2])
        self._found = [start._replace(airspeed=airspeed, home=home)]

    def __call__(self, k: int) -> MissionTarget | None:
        """Return target k; None after the one without end."""
        while len(self._found) <= k + 1:
            before = self._found[-1]
            if math.isinf(before.length):
                return None
            self._found.append(self._next(before))
        return self._found[k + 1]

    def index_of_same(self, k: int) -> int | None:
        """Return the earlier target that is the same place of an endless mission as target k."""
        again = self._order.again
        if again is None:
            return None
        earlier = k - (len(self._order.visits) - again)
        return earlier if earlier >= again else None

    def jump_to(self, k: int) -> int | None:
        """Return the number of the jump that led to target k; None if it is the first visit."""
        flown = [target.item for visit in self._order.visits[: k + 1] for target in visit]
        place = next(item for item in reversed(flown) if item.command in PLACES)
        if sum(item is place for item in flown) == 1:
            return None
        return next(item.seq for item in reversed(flown) if item.command in JUMPS)

    def note(self, kind: str, item: MissionItem, text: str) -> None:
        """Note what is flown otherwise than an item says; of each kind the first is a remark."""
        self._notes.setdefault(kind, {}).setdefault(item.seq, (item, text))

    def remarks(self) -> Iterator[str]:
        """Yield what is flown otherwise than the items say, up to the last target asked for."""
        for noted in self._notes.values():
            items, texts = zip(*noted.values(), strict=True)
            yield f"{first_of(items)}: {texts[0]}"

    def _next(self, before: MissionTarget) -> MissionTarget:
        visits, again = self._order.visits, self._order.again
        n = len(self._found) - 1
        if n < len(visits):
            return self._resolve(visits[n], before)
        if again is not None:
            return self._resolve(visits[again + (n - again) % (len(visits) - again)], before)
        airspeed = before.airspeed_there
        radius = before.radius or turn_radius(airspeed, self._limits)
        circle = before._replace(place=None, radius=radius, length=math.inf)
        *_, commands = self._on_the_way(self._order.after, before)
        return circle._replace(airspeed=airspeed, changes=(), commands=commands)

    def _on_the_way(
        self, visit: Visit, before: MissionTarget
    ) -> tuple[Home, tuple[tuple[When, float], ...], tuple[tuple[When, int], ...]]:
        """Return home, changes of the airspeed and commands of what is done behind a place."""
        home, airspeed, when = before.home, before.airspeed_there, When()
        changes, commands = list[tuple[When, float]](), list[tuple[When, int]]()
        for target in visit:
            item, first = target.item, param(target.item, 1)
            if item.command == SPEED and (speed := param(item, 2)) != UNCHANGED:
                airspeed = self._airspeed(item, speed)
                changes.append((when, airspeed))
            elif item.command == DELAY:
                way = first * airspeed
                when = When(when.after_m + way, when.left_m - way)
            elif item.command == DISTANCE:
                when = When(when.after_m, min(when.left_m, first))
            elif item.command == SET_HOME:
                place, height = target.place, target.height
                if place is None:
                    place, height = before.place or (home.north_m, home.east_m), before.height
                home = Home(*place, height)
            elif item.command in ANNOUNCED:
                commands.append((when, item.seq))
        return home, tuple(changes), tuple(commands)

    def _resolve(self, visit: Visit, before: MissionTarget) -> MissionTarget:
        """Return the place of a visit with all that the way to it and the visits before decide."""
        *on_the_way, to = visit
        home, changes, commands = self._on_the_way(tuple(on_the_way), before)
        to = to._replace(
            airspeed=before.airspeed_there, changes=changes, commands=commands, home=home
        )
        command, airspeed = to.item.command, to.airspeed_there
        if command == LAND:
            return self._on_ground(to)
        if command in WAYPOINTS and to.radius == 0.0:
            return to if to.place else to._replace(place=before.place)
        radius = self._radius(to, airspeed)
        if command == RETURN:
            place, height = (home.north_m, home.east_m), before.height
            return to._replace(place=place, height=height, radius=radius, length=math.inf)
        turns = {LOITER: math.inf, LOITER_TURNS: param(to.item, 1)}.get(command, 0.0)
        seconds = param(to.item, 1) if command == LOITER_TIME else 0.0
        length = 2.0 * math.pi * abs(radius) * turns + airspeed * seconds
        return to._replace(radius=radius, length=length)

    def _radius(self, target: MissionTarget, airspeed: float) -> float:
        """Return the radius of a circle, as near to its own as can be; of a turn if it is 0."""
        if (text := too_tight(target.radius, airspeed, self._limits)) is not None:
            self.note("circle", target.item, f"{text}; flown as tight as that")
        radius = target.radius or turn_radius(airspeed, self._limits)
        return math.copysign(max(abs(radius), tightest_turn(airspeed, self._limits)), radius)

    def _airspeed(self, item: MissionItem, asked: float) -> float:
        """Return the airspeed that a DO_CHANGE_SPEED leads to [m/s]."""
        low, high = self._limits.slowest_m_s, self._limits.fastest_m_s
        if asked == DEFAULT:
            return self._limits.cruise_m_s
        airspeed = min(max(asked, low), high)
        if airspeed != asked:
            text = f"airspeed {asked:g}, must be {low:g} to {high:g} m/s; {airspeed:g} m/s is flown"
            self.note("airspeed", item, text)
        return airspeed

    def _on_ground(self, landing: MissionTarget) -> MissionTarget:
        """Return a landing that does not lead into the ground, which is flat; note one above it."""
        runway = self._limits.runway
        assert runway is not None
        ground = landing.home.height_m + self._limits.lowest_m + runway.height
        if landing.height >= ground:
            above = landing.height - runway.height - landing.home.height_m
            if above >= _LEVEL_M:
                text = f"touchdown {above:.4g} m above home: that is in the air, if it is flat"
                self.note("landing", landing.item, text)
            return landing
        text = f"touchdown {ground - landing.height:.4g} m below the ground; flown on it"
        self.note("landing", landing.item, text)
        return landing._replace(height=ground)
