"""From the items of a mission to the path that one aircraft flies."""

import math
from collections import deque
from collections.abc import Iterator, Sequence

import numpy as np

from ftc_autopilot.common.geography import Origin
from ftc_autopilot.guidance.aircraft_limits import limits_of
from ftc_autopilot.guidance.formation import Formation
from ftc_autopilot.guidance.laws import Guidance
from ftc_autopilot.guidance.legs import Pose
from ftc_autopilot.guidance.limits import FlightLimits, level_airspeed, too_tight
from ftc_autopilot.guidance.mission_items import (
    LAND,
    LOITER,
    LOITER_TO_ALT,
    RETURN,
    TAKEOFF,
    MissionTarget,
    check_gear,
    decode_items,
    is_path,
    remarks_on,
)
from ftc_autopilot.guidance.mission_path import MissionPath, Start, mission_path
from ftc_autopilot.guidance.mission_places import Home
from ftc_autopilot.guidance.path import path_record
from ftc_autopilot.guidance.runway import STANDS, RunwayFigures
from ftc_autopilot.guidance.runway_legs import LEAST_CLIMB_M, landing_circle
from ftc_autopilot.guidance.runway_sequence import why_not_in_sequence
from mavlink_defs import dialect
from mavlink_defs.mission_files import mission_item
from mavlink_defs.profile import AirspeedLimits, ItemError
from mavlink_defs.services.mission import MissionItem
from mavlink_defs.services.mission_upload import content_of
from sitl_plant.airframe.config import Aircraft
from sitl_plant.airframe.rigid_body import R1
from sitl_plant.vec3 import mul, norm, sub, vec3

_CLIMB_RESERVE_DEG = 5.0
"""Climb that is kept for corrections [deg]."""


class Planner:
    """Makes the paths of one aircraft.

    A mission that is changed in flight is checked, put in force and compared with the fence one
    after the other, while nothing is controlled: the last two paths are kept for that.

    Attributes:
        airspeeds: Range of airspeeds on a path.
        limits: What the aircraft can fly.
    """

    def __init__(
        self,
        aircraft: Aircraft,
        guidance: Guidance,
        origin: Origin,
        formation: Formation | None = None,
        runway: RunwayFigures | None = None,
    ) -> None:
        """Note the limits.

        Args:
            aircraft: The nominal aircraft.
            guidance: Parameters of the guidance law.
            origin: Of the simulation's world.
            formation: What it flies in, if any.
            runway: Its take-off and landing; None: neither is planned.
        """
        self._origin, self._formation = origin, formation
        self._made: deque[tuple[tuple[object, ...], tuple[np.void, tuple[str, ...]]]] = deque(
            maxlen=2
        )
        own = limits_of(guidance, aircraft)
        self.airspeeds = AirspeedLimits(own.airspeed_min_m_s, own.airspeed_max_m_s)
        climb_deg = max(own.climb_max_deg - _CLIMB_RESERVE_DEG, 0.5 * own.climb_max_deg)
        self.limits = FlightLimits(
            cruise_m_s=own.cruise_m_s,
            bank_rad=math.radians(guidance.bank_max_deg),
            level_m_s=level_airspeed(aircraft, math.radians(own.incidence_max_deg)),
            climb=math.tan(math.radians(climb_deg)),
            wind_m_s=guidance.wind_max_m_s,
            offset_m=0.0 if formation is None else _farthest_right(formation),
            gravity_m_s2=aircraft.gravity_m_s2,
            slowest_m_s=self.airspeeds.min_m_s,
            fastest_m_s=self.airspeeds.max_m_s,
            lowest_m=guidance.min_altitude_m,
            highest_m=guidance.max_altitude_m,
            runway=runway,
        )

    def check(
        self,
        items: Sequence[MissionItem],
        home: Home = Home(),  # noqa: B008 - frozen
    ) -> None:
        """Check a mission, home included; its item 0 is not read.

        Raises:
            ItemError: It cannot be flown.
        """
        self.path(items, home=home)

    def remarks(
        self,
        items: Sequence[MissionItem],
        home: Home = Home(),  # noqa: B008 - frozen
    ) -> Iterator[str]:
        """Yield what is flown otherwise than the items of a mission may be meant.

        Args:
            items: The mission, home included.
            home: What relative altitudes count from.

        Raises:
            ItemError: It cannot be flown.
        """
        yield from remarks_on(items)
        if is_path(items):
            yield from self._path(items, None, home, 1)[1]

    def first_path(self, items: Sequence[MissionItem], measured: np.void) -> np.void:
        """Return the path of a mission that begins with simulated time.

        The members of a formation fly the same one, from home; a single UAV begins where it is.

        Args:
            items: The mission, home included.
            measured: The state before the first step, dtype
                `mavlink_defs.framing.codec.SIM_STATE`.

        Raises:
            ItemError: It cannot be flown.
        """
        in_formation = self._formation is not None
        start = None if in_formation else self.start_of(measured, self.limits.cruise_m_s)
        return self.path(items, start)

    def path(
        self,
        items: Sequence[MissionItem],
        start: Start | None = None,
        home: Home = Home(),  # noqa: B008 - frozen
        first: int = 1,
    ) -> np.void:
        """Return the path of a mission, a record of dtype `ftc_autopilot.guidance.path.PATH`.

        Args:
            items: The mission, home included; its item 0 is not read.
            start: Where it begins; None: at home, the same for all aircraft.
            home: Where RETURN_TO_LAUNCH leads, and what relative altitudes count from.
            first: Item to begin with.

        Raises:
            ItemError: It cannot be flown.
        """
        return self._path(items, start, home, first)[0]

    def _path(
        self, items: Sequence[MissionItem], start: Start | None, home: Home, first: int
    ) -> tuple[np.void, tuple[str, ...]]:
        """Return a path, and the remarks on it."""
        asked = start, home, first, *map(content_of, items[1:])
        for of, made in self._made:
            if of == asked:
                return made
        mission = decode_items(items, self._origin, home, self.limits)
        path = mission_path(mission, self.limits, home, start, first)
        if start is not None and start.stands and not path.marks.climb:
            text = "the aircraft stands on the ground; begin with NAV_TAKEOFF (22)"
            raise ItemError(first, dialect.MAV_MISSION_INVALID, text)
        if self._formation is not None and path.marks.landing and self.limits.runway is not None:
            why = why_not_in_sequence(self._formation, self.limits.runway)
            if why is not None:
                raise ItemError(int(path.legs[-1].item), dialect.MAV_MISSION_UNSUPPORTED, why)
        if self._formation is not None and start is None and self.limits.runway is not None:
            path = _from_one_runway(path, mission)
        made = _record(path), path.remarks
        self._made.append((asked, made))
        return made

    def circle(
        self, start: Start, centre: tuple[float, float] | None, height: float, radius_m: float = 0.0
    ) -> np.void:
        """Return the path from a start into a circle.

        Args:
            start: Where it begins.
            centre: North and east [m]; None: the circle is beside the start.
            height: [m].
            radius_m: Positive clockwise; 0: as of a turn [m].

        Raises:
            ItemError: The circle is too small.
        """
        if (text := too_tight(radius_m, start.airspeed, self.limits)) is not None:
            raise ItemError(0, dialect.MAV_MISSION_INVALID_PARAM3, text)
        circle = MissionTarget(mission_item(0, LOITER), centre, height, radius=radius_m)
        return _record(mission_path((circle,), self.limits, Home(), start))

    def take_off(self, start: Start, height: float) -> np.void:
        """Return the path of a take-off into a circle at its end.

        Args:
            start: Where it stands.
            height: [m].

        Raises:
            ItemError: It does not stand, or cannot take off.
        """
        if not start.stands:
            raise ItemError(0, dialect.MAV_MISSION_INVALID, "the aircraft is in the air")
        take_off = MissionTarget(mission_item(1, TAKEOFF), height=height)
        circle = MissionTarget(mission_item(2, LOITER), height=height)
        path = mission_path((take_off, circle), self.limits, Home(), start)
        if path.remarks:
            raise ItemError(0, dialect.MAV_MISSION_INVALID_PARAM7, path.remarks[0])
        return _record(path)

    def landing(
        self, start: Start, touchdown: Pose, ground: float, height: float, home: Home
    ) -> np.void:
        """Return the path down into a circle beside the line of a landing, and along that line.

        Args:
            start: Where it begins.
            touchdown: Place of touchdown, and the course there.
            ground: Height of the centre of gravity there [m].
            height: Of the circle, unless that is too low for an approach [m].
            home: What heights are checked against.

        Raises:
            ItemError: The aircraft stands, or cannot land.
        """
        check_gear(self.limits)
        assert self.limits.runway is not None
        if start.stands:
            raise ItemError(0, dialect.MAV_MISSION_INVALID, "the aircraft stands on the ground")
        flare = self.limits.runway.flare_height(self.limits.runway.slope)
        height = max(height, ground + flare + LEAST_CLIMB_M)
        land = MissionTarget(mission_item(2, LAND), touchdown[:2], ground, length=math.inf)
        land = land._replace(airspeed=start.airspeed)
        c, s = math.cos(touchdown.course), math.sin(touchdown.course)
        beside = c * (start.pose.east - touchdown.east) - s * (start.pose.north - touchdown.north)
        circle = landing_circle(touchdown, beside, height, land, self.limits)
        before = MissionTarget(mission_item(1, LOITER_TO_ALT), circle[:2], height)
        way = before._replace(radius=circle.radius), land
        return _record(mission_path(way, self.limits, home, start))

    def way_home(self, start: Start, home: Home) -> np.void:
        """Return the path from a start into the circle around home."""
        way = MissionTarget(mission_item(0, RETURN))
        return _record(mission_path((way,), self.limits, home, start))

    def start_of(self, measured: np.void, airspeed: float) -> Start:
        """Return the start of a path at a measured state.

        Args:
            measured: Record of dtype `mavlink_defs.framing.codec.SIM_STATE`.
            airspeed: Until the mission says another [m/s].
        """
        north, east, down = map(float, measured["position"])
        attitude, velocity = vec3(measured["attitude"]), vec3(measured["velocity"])
        v_north, v_east, _ = mul(R1(attitude), velocity)
        stall = 0.0 if self.limits.runway is None else self.limits.runway.stall
        through_air = norm(sub(velocity, vec3(measured["wind"])))
        if through_air < stall and norm(velocity) < STANDS * stall:
            return Start(Pose(north, east, attitude[2]), -down, airspeed, stands=True)
        return Start(Pose(north, east, math.atan2(v_east, v_north)), -down, airspeed)


def _from_one_runway(path: MissionPath, mission: Sequence[MissionTarget]) -> MissionPath:
    """Return the path of a formation with its take-off: along the first leg, from home.

    It begins at its height, as members in the air are past the take-off.
    """
    take_off = next((one for one in mission if one.item.command == TAKEOFF), None)
    if take_off is None or math.isnan(take_off.height):
        return path
    if path.legs[0].curvature_1_m or not math.isfinite(path.legs[0].length_m):
        text = "a formation takes off from home straight to the first place; lead away from home"
        raise ItemError(take_off.item.seq, dialect.MAV_MISSION_INVALID, text)
    return path._replace(marks=path.marks._replace(climb=1, climb_to=take_off.height))


def _record(path: MissionPath) -> np.void:
    return path_record(path.legs, path.loop, path.marks, path.commands)


def _farthest_right(formation: Formation) -> float:
    """Return how far to the side of the path a member may get by its slot [m]."""
    policies = (formation.on_lost, formation.on_degraded, formation.on_silent)
    wider = formation.widen_m if "widen" in policies else 0.0
    leaves = abs(formation.leave_right_m) if "leave" in policies else 0.0
    slots = (slot for plan in formation.plans() for slot in plan.values())
    return max(abs(slot.right_m) for slot in slots) + max(wider, leaves)
