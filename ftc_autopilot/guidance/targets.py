"""The places of a mission one after the other, each with all that the ones before it decide."""

import math
from dataclasses import dataclass, replace

from ftc_autopilot.guidance.jumps import Order, Visit
from ftc_autopilot.guidance.limits import FlightLimits, airspeeds_for, tightest_turn, turn_radius
from ftc_autopilot.guidance.mission_items import Delay, Loiter, SetHome, SetSpeed, Waypoint
from ftc_autopilot.guidance.mission_places import Home
from mavlink_defs import dialect
from mavlink_defs.profile import ItemError


@dataclass(frozen=True)
class Target:
    """A waypoint or a circle, and the way to it.

    Attributes:
        item: Number of the mission item.
        place: North and east of the waypoint or the centre [m]; None: a circle through the place
            before.
        height: [m].
        within: Greatest distance at which a waypoint is passed; 0: any [m].
        radius: Of the circle, positive clockwise; 0 for a waypoint [m].
        length: Of the circle; it may be infinite [m].
        airspeed: Where the way to it begins [m/s].
        changes: Distance [m] from there and airspeed [m/s] of each change on the way; those beyond
            its end take effect at the end.
        home: Home when it is reached.
        jump: As of `Visit`.
    """

    item: int
    place: tuple[float, float] | None
    height: float
    within: float
    radius: float
    length: float
    airspeed: float
    changes: tuple[tuple[float, float], ...]
    home: Home
    jump: int | None = None

    @property
    def airspeed_there(self) -> float:
        """Airspeed at the end of the way to it [m/s]."""
        return self.changes[-1][1] if self.changes else self.airspeed

    @property
    def fastest(self) -> float:
        """Greatest airspeed on the way to it [m/s]."""
        return max(self.airspeed, *(speed for _, speed in self.changes), 0.0)

    @property
    def is_endless(self) -> bool:
        """Whether nothing follows."""
        return math.isinf(self.length)


class Targets:
    """The targets of a mission, by number from 0; after the last place comes a circle without end.

    Raises:
        ItemError: A circle is too small to be flown.
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
        place, height = begin[:2], begin[2]
        nowhere = Target(0, place, height, 0.0, 0.0, 0.0, airspeed, (), home)
        self._found = [nowhere]

    def __call__(self, k: int) -> Target | None:
        """Return target k; None after the one without end."""
        while len(self._found) <= k + 1:
            before = self._found[-1]
            if before.is_endless:
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

    def _next(self, before: Target) -> Target:
        visits, again = self._order.visits, self._order.again
        n = len(self._found) - 1
        if n < len(visits):
            return self._resolve(visits[n], before)
        if again is not None:
            return self._resolve(visits[again + (n - again) % (len(visits) - again)], before)
        airspeed = before.airspeed_there
        return replace(
            before,
            place=None,
            radius=before.radius or turn_radius(airspeed, self._limits),
            length=math.inf,
            airspeed=airspeed,
            changes=(),
        )

    def _resolve(self, visit: Visit, before: Target) -> Target:
        airspeed, home = before.airspeed_there, before.home
        changes: list[tuple[float, float]] = []
        now, distance = airspeed, 0.0
        for task in visit.on_the_way:
            match task:
                case SetSpeed(_, now):
                    changes.append((distance, now))
                case Delay(_, seconds):
                    distance += seconds * now
                case SetHome(_, new):
                    north, east = before.place or (home.north_m, home.east_m)
                    home = new or Home(north, east, before.height)
        to, radius, length, within = visit.place, 0.0, 0.0, 0.0
        place: tuple[float, float] | None
        if isinstance(to, Waypoint):
            place, height, within = (to.north_m, to.east_m), to.height_m, to.within_m
        elif isinstance(to, Loiter):
            radius = self._radius(to.item, to.radius_m, now)
            place, height = to.centre, to.height_m
            length = 2.0 * math.pi * abs(radius) * to.turns + now * to.seconds
        else:
            radius, length = self._radius(to.item, 0.0, now), math.inf
            place, height = (home.north_m, home.east_m), before.height
        way = (within, radius, length, airspeed, tuple(changes), home, visit.jump)
        return Target(to.item, place, height, *way)

    def _radius(self, item: int, radius: float, airspeed: float) -> float:
        """Return the radius of a circle, or that of a turn if it is 0."""
        least = tightest_turn(airspeed, self._limits)
        if radius != 0.0 and abs(radius) < least:
            airspeeds = airspeeds_for(abs(radius), self._limits)
            text = f"radius {abs(radius):g} m, must be >= {math.ceil(least)} m at {airspeed:g} m/s"
            if airspeeds is not None:
                text += " (or the airspeed {} to {} m/s)".format(*airspeeds)
            raise ItemError(item, dialect.MAV_MISSION_INVALID_PARAM3, text)
        return radius or turn_radius(airspeed, self._limits)
