"""What a vehicle flies along in space: its mission, the way home, a circle somewhere.

A new path is made whenever the vehicle is to go elsewhere, from where it is then. The members of a
formation fly one path for their mission, the one from home.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ftc_autopilot.common.geography import Origin, Place, place_of
from ftc_autopilot.config import AutopilotConfig
from ftc_autopilot.control.controllers import Controllers, ReferenceSource, begin_path
from ftc_autopilot.guidance.glide import Begin, Glide
from ftc_autopilot.guidance.legs import Pose
from ftc_autopilot.guidance.limits import tightest_turn
from ftc_autopilot.guidance.mission_items import LAND, check_gear
from ftc_autopilot.guidance.mission_path import Start
from ftc_autopilot.guidance.mission_places import Home, home_item
from ftc_autopilot.guidance.path import (
    NO_LOOP,
    PathPoint,
    commands_between,
    locate,
    point_at,
    put_path,
)
from ftc_autopilot.guidance.planner import Planner
from ftc_autopilot.guidance.runway import figures_of
from ftc_autopilot.guidance.runway_legs import BREEZE_M_S, touchdown_on
from ftc_autopilot.guidance.runway_state import (
    AROUND,
    CLIMBING,
    FINAL,
    FLARE,
    STANDING,
    STOPPED,
)
from ftc_autopilot.hot.hot_state import HotState
from mavlink_defs.profile import ItemError
from mavlink_defs.services.mission import MissionItem
from sitl_plant.airframe.rigid_body import R1
from sitl_plant.vec3 import mul, vec3

_SAME_RADIUS = 1.0 + 1e-6
"""Share by which a turn may be too tight, by rounding."""


class VehicleHome:
    """The home in force; at first the origin.

    Attributes:
        at: Home, relative to the origin.
    """

    def __init__(self, origin: Origin) -> None:
        self._origin = origin
        self.at = Home()

    @property
    def place(self) -> Place:
        """Home in the units of MAVLink; its height is that above the origin."""
        return place_of(self._origin, self.at.north_m, self.at.east_m, -self.at.height_m)

    def item(self) -> MissionItem:
        """Return item 0 of every mission."""
        return home_item(self._origin, self.at)


class Way(NamedTuple):
    """A path that can be flown, not yet in force.

    Attributes:
        path: Record of dtype `ftc_autopilot.guidance.path.PATH`.
        near: Path parameter of a point near the vehicle [m].
        in_slot: Whether a member of a formation flies in its slot.
        airspeed: On ways that no mission sets one for, from now on [m/s]; None: as before.
    """

    path: np.void
    near: float = 0.0
    in_slot: bool = False
    airspeed: float | None = None


class FlightPath:
    """Paths of one vehicle; what it decides reaches the controller between two steps.

    Attributes:
        planner: What makes the paths.
        items: Of the mission, home included; none without one, or if it is a profile. Its altitudes
            are decoded when a path is made of it, with the home of then.
        home: Home.
        airspeed: On ways that no mission sets one for [m/s].
        number: Counts the paths.
        begun_at: Path parameter where the present one was begun [m].
        refuge: Returns where RTL leads with a home, north, east, height [m]; None: to that home, at
            the present height.
    """

    def __init__(
        self, config: AutopilotConfig, hot: HotState, controllers: Controllers, home: VehicleHome
    ) -> None:
        bandwidth = config.controller.reference_bandwidth_rad_s
        runway = figures_of(config.runway_guidance, config.guidance, config.aircraft, bandwidth)
        self.planner = Planner(
            config.aircraft, config.guidance, config.origin, config.formation, runway
        )
        self.items: tuple[MissionItem, ...] = ()
        self.airspeed = self.planner.limits.cruise_m_s
        self._hot, self.home = hot, home
        self._runway = config.runway
        self._in_formation = config.formation is not None
        self._guidance, self._paths = controllers.uavs[0]["guidance"], controllers.paths
        self.number, self.begun_at = 0, 0.0
        self.refuge: Callable[[Home], tuple[float, float, float] | None] = lambda _: None

    # state

    @property
    def flown(self) -> bool:
        """Whether the references come from a path."""
        return int(self._guidance["follows"]) == ReferenceSource.PATH

    @property
    def record(self) -> np.void:
        """The path, of dtype `ftc_autopilot.guidance.path.PATH`."""
        path: np.void = self._paths[0]
        return path

    @property
    def phase(self) -> int:
        """Phase of take-off or landing, of `ftc_autopilot.guidance.runway_state`."""
        return int(self._guidance["runway"]["phase"])

    @property
    def reason(self) -> int:
        """Why the last take-off was rejected, or the last approach given up."""
        return int(self._guidance["runway"]["reason"])

    @property
    def stands(self) -> bool:
        """Whether the vehicle stands on the ground."""
        return self.phase in (STANDING, STOPPED)

    @property
    def landed(self) -> bool:
        """Whether it has flown its path to a landing."""
        return self.phase == STOPPED and bool(self.record["landing"] > 0.0)

    @property
    def position(self) -> float:
        """Path parameter [m]."""
        return float(self._guidance["path_position"])

    def point(self) -> PathPoint:
        """Return the point of the path where the vehicle is; there must be a path."""
        return point_at(self.record, self.position)

    @property
    def wind(self) -> tuple[float, float]:
        """The wind that guidance has estimated, else the present one, north and east [m/s]."""
        law, measured = self._guidance["law"]["path"], self._hot.measured
        wind = mul(R1(vec3(measured["attitude"])), vec3(measured["wind"]))
        if law["started"] and self.flown:
            wind = vec3(law["wind"])
        return float(wind[0]), float(wind[1])

    def item(self) -> int:
        """Return the number of the mission item that is flown."""
        return int(self.record["item"][self.point().leg])

    def is_at_end(self) -> bool:
        """Return whether the last leg is flown, which has no end."""
        return self._is_last(self.point().leg)

    def items_between(self, before: int, now: int) -> list[int]:
        """Return the items that end between two legs, in the order in which they are flown."""
        path, items, leg = self.record, list[int](), before
        for _ in range(int(path["count"])):
            following = leg + 1 if leg + 1 < path["count"] else int(path["loop"])
            if leg == now:
                return items
            if following == NO_LOOP:
                break
            if path["item"][following] != path["item"][leg] or self._is_last(following):
                items.append(int(path["item"][leg]))
            leg = following
        return []  # flown backwards

    def commands_between(self, before: float, now: float) -> list[int]:
        """Return the items of the commands passed between two places on the path [m]."""
        return [item for _, item in commands_between(self.record, before, now)]

    def _is_last(self, leg: int) -> bool:
        path = self.record
        return bool(path["loop"] == NO_LOOP and leg == path["count"] - 1)

    def way_left(self) -> float:
        """Return the length of the way to the end of the item that is flown [m]; 0 without end."""
        path, leg = self.record, self.point().leg
        end = leg
        while (
            end + 1 < path["count"]
            and path["item"][end + 1] == path["item"][leg]
            and not self._is_last(end + 1)
        ):
            end += 1
        left = float(path["start"][end + 1]) - self._within(path)
        return max(left, 0.0) if math.isfinite(left) else 0.0

    def cross_track(self) -> float:
        """Return the distance from the path, positive to its right [m]."""
        north, east, _ = map(float, self._hot.measured["position"])
        return float(locate(self.record, north, east, self.position)[1])

    def here(self) -> tuple[float, float, float]:
        """Return where the vehicle is: north, east and height [m]."""
        north, east, down = map(float, self._hot.measured["position"])
        return north, east, -down

    def target(self) -> tuple[float, float, float]:
        """Return north, east and height of where the item leads, or of the last circle's centre."""
        path, leg = self.record, self.point().leg
        left = self.way_left()
        if left > 0.0:
            end = point_at(path, self.position + left)
            return float(end.north), float(end.east), float(end.height)
        radius = 1.0 / float(path["curvature"][leg]) if path["curvature"][leg] else 0.0
        north, east = float(path["north"][leg]), float(path["east"][leg])
        course = float(path["course"][leg])
        height = float(path["height"][leg])
        return north - radius * math.sin(course), east + radius * math.cos(course), height

    # ways: those that cannot be flown raise ItemError; nothing changes before `begin`

    def check(self, items: Sequence[MissionItem], home: Home | None = None) -> None:
        """Check a mission, with another home than the present one if that is given."""
        self.planner.check(items, home or self.home.at)

    def mission(
        self,
        item: int,
        items: Sequence[MissionItem] | None = None,
        home: Home | None = None,
        airspeed: float | None = None,
    ) -> Way:
        """Return the way of a mission, from here.

        Args:
            item: Item to begin with.
            items: The mission; None: the one in force.
            home: Home; None: the present one.
            airspeed: Up to the mission's first change of it [m/s]; None: cruise.
        """
        home = home or self.home.at
        items = items or self.items
        if not self._in_formation:
            start = self._start(airspeed or self.planner.limits.cruise_m_s)
            return Way(self.planner.path(items, start, home, item))
        path = self.planner.path(items, home=home)
        legs = np.flatnonzero(path["item"][: path["count"]] >= item)
        leg = int(legs[0]) if len(legs) else 0
        return Way(path, float(path["start"][leg]), in_slot=True)

    def take_off(self, height: float) -> Way:
        """Return the way of a take-off, and a circle at a height above home [m] at its end."""
        start = self._start(self.planner.limits.cruise_m_s)
        return Way(self.planner.take_off(start, self.home.at.height_m + height))

    def circle_here(self, height: float | None = None) -> Way:
        """Return the circle at the present place, and height if no other is given [m]."""
        start = self._start(self.airspeed)
        return Way(self.planner.circle(start, None, start.height if height is None else height))

    def way_home(self, home: Home | None = None) -> Way:
        """Return the way of RTL: home or to another `refuge`, and the circle there."""
        home = home or self.home.at
        if (place := self.refuge(home)) is not None:
            return self.way_to(place)
        return Way(self.planner.way_home(self._start(self.airspeed), home))

    def landing(self, height: float, place: tuple[float, float] | None = None) -> Way:
        """Return the way of AUTOLAND: to a place, or a known runway, or here, into the wind.

        Args:
            height: Above home, to which it descends before the approach [m].
            place: North and east [m].
        """
        check_gear(self.planner.limits)
        start, home = self._start(self.airspeed), self.home.at
        to = self._runway_ahead() if place is None else None
        if to is None:
            north, east = self.wind
            calm = math.hypot(north, east) < BREEZE_M_S
            course = start.pose.course if calm else math.atan2(-east, -north)
            to = Pose(*(place or start.pose[:2]), course), self._ground
        height = min(start.height, home.height_m + height)
        return Way(self.planner.landing(start, *to, height, home))

    def glide(self) -> tuple[Way, bool]:
        """Return the way down without thrust, and whether a runway is within reach."""
        limits = self.planner.limits
        here = self.planner.start_of(self._hot.measured, self.airspeed)
        begin = Begin(here.pose, here.height, self.wind)
        if (to := self._runway_ahead()) is not None:
            touchdown, ground = to
            path = Glide(begin, ground, limits, self._item_of(LAND)).to_runway(touchdown)
            if path is not None:
                return Way(path), True
        return Way(Glide(begin, self._ground, limits).ahead()), False

    def way_to(
        self,
        place: tuple[float, float, float],
        radius_m: float = 0.0,
        airspeed: float | None = None,
    ) -> Way:
        """Return the way into a circle around a place.

        Args:
            place: North, east and height [m].
            radius_m: As of `Planner.circle`.
            airspeed: [m/s]; None: as before.
        """
        airspeed = airspeed or self.airspeed
        north, east, height = place
        start = self._start(airspeed)
        path = self.planner.circle(start, (north, east), height, radius_m)
        return Way(path, airspeed=airspeed)

    def begin(self, way: Way) -> None:
        """Put a path in force; one whose writing a death cuts short has no legs."""
        self.number, self.begun_at = self.number + 1, way.near
        self.airspeed = way.airspeed or self.airspeed
        put_path(self.record, way.path)
        begin_path(self._guidance, way.near, in_slot=way.in_slot)

    def go_around(self) -> None:
        """Give up the approach that is flown."""
        self._guidance["runway"]["asked"] = 1

    def change_speed(self, airspeed: float) -> None:
        """Fly on at another airspeed, until the mission says another.

        Raises:
            ItemError: A turn is too tight for it.
        """
        path, first = self.record, self.point().leg
        legs = range(first, int(path["count"]))
        if path["loop"] != NO_LOOP:
            legs = range(min(first, int(path["loop"])), int(path["count"]))
        same = [k for k in legs if path["airspeed"][k] == path["airspeed"][first]]
        for k in same:
            curvature = abs(float(path["curvature"][k]))
            least = tightest_turn(airspeed, self.planner.limits)
            if curvature * least > _SAME_RADIUS:
                text = f"a turn of {1.0 / curvature:.0f} m is too tight, must be >= {least:.0f} m"
                raise ItemError(int(path["item"][k]), 0, text)
        path["airspeed"][same] = airspeed
        self.airspeed = airspeed

    # inside

    def _item_of(self, command: int) -> int:
        return next((item.seq for item in self.items if item.command == command), 0)

    @property
    def _ground(self) -> float:
        """Height of the centre of gravity on the ground at home [m]."""
        assert self.planner.limits.runway is not None
        return self.home.at.height_m + self.planner.limits.runway.height

    def _runway_ahead(self) -> tuple[Pose, float] | None:
        """Return place and course of a touchdown, and the height of the centre of gravity there.

        They are the mission's, else of the runway that the vehicle knows; None: there is neither.
        """
        if self._item_of(LAND):
            planned = self.planner.path(self.items, home=self.home.at)
            there = point_at(planned, float(planned["landing"]))
            at = Pose(float(there.north), float(there.east), float(there.course))
            return at, float(there.height)
        own = self.planner.limits.runway
        if self._runway is None or own is None:
            return None
        return touchdown_on(self._runway, self.wind, own), self._ground

    def _start(self, airspeed: float) -> Start:
        """Return where a path begins: near a runway at the height to which it climbs first."""
        start = self.planner.start_of(self._hot.measured, airspeed)
        runway = self._guidance["runway"]
        if runway["phase"] not in (CLIMBING, FINAL, FLARE, AROUND):
            return start
        return start._replace(height=max(start.height, float(runway["climb_to"])))

    def _within(self, path: np.void) -> float:
        """Return the path parameter, within the first round of a path that returns."""
        s, end = self.position, float(path["start"][path["count"]])
        if path["loop"] == NO_LOOP or s < end:
            return s
        again = float(path["start"][path["loop"]])
        return again + (s - again) % (end - again)
