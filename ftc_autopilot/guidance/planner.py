"""From the items of a mission to the path that one aircraft flies."""

import math
from collections.abc import Sequence

import numpy as np

from ftc_autopilot.common.geography import Origin
from ftc_autopilot.guidance.formation import Formation
from ftc_autopilot.guidance.laws import Guidance
from ftc_autopilot.guidance.limits import FlightLimits, level_airspeed
from ftc_autopilot.guidance.mission_items import Loiter, Return, Task, decode_items
from ftc_autopilot.guidance.mission_path import MissionPath, Start, mission_path, path_id_of
from ftc_autopilot.guidance.mission_places import Home
from ftc_autopilot.guidance.path import path_record
from ftc_autopilot.guidance.pieces import Pose
from mavlink_defs.profile import AirspeedLimits
from mavlink_defs.services.mission import MissionItem
from sitl_plant.config import Aircraft
from sitl_plant.rigid_body import R1
from sitl_plant.vec3 import mul, vec3

_CLIMB_RESERVE_DEG = 5.0
"""Climb that is kept for corrections [deg]."""


class Planner:
    """Makes the paths of one aircraft.

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
    ) -> None:
        """Note the limits.

        Args:
            aircraft: The nominal aircraft.
            guidance: Parameters of the guidance law.
            origin: Of the simulation's world.
            formation: What it flies in, if any.
        """
        self._origin, self._in_formation = origin, formation is not None
        self.airspeeds = AirspeedLimits(
            max(aircraft.airspeed_min_m_s, guidance.airspeed_min_m_s),
            min(aircraft.airspeed_max_m_s, guidance.airspeed_max_m_s),
        )
        climb_deg = max(guidance.climb_max_deg - _CLIMB_RESERVE_DEG, 0.5 * guidance.climb_max_deg)
        self.limits = FlightLimits(
            cruise_m_s=min(
                max(guidance.cruise_m_s, self.airspeeds.min_m_s), self.airspeeds.max_m_s
            ),
            bank_rad=math.radians(guidance.bank_max_deg),
            level_m_s=level_airspeed(aircraft, math.radians(guidance.incidence_max_deg)),
            climb=math.tan(math.radians(climb_deg)),
            wind_m_s=guidance.wind_max_m_s,
            offset_m=0.0 if formation is None else _farthest_right(formation),
            gravity_m_s2=aircraft.gravity_m_s2,
            slowest_m_s=self.airspeeds.min_m_s,
            fastest_m_s=self.airspeeds.max_m_s,
            lowest_m=guidance.min_altitude_m,
            highest_m=guidance.max_altitude_m,
        )

    def tasks(
        self,
        items: Sequence[MissionItem],
        home: Home = Home(),  # noqa: B008 - frozen
    ) -> tuple[Task, ...]:
        """Decode and check a mission, home included; its item 0 is not read.

        Raises:
            ItemError: It cannot be flown.
        """
        tasks = self.decode(items, home)
        mission_path(tasks, self.limits, home)
        return tasks

    def decode(self, items: Sequence[MissionItem], home: Home) -> tuple[Task, ...]:
        """Decode a mission, home included; its items are checked one by one only.

        Raises:
            ItemError: An item cannot be flown.
        """
        return decode_items(items, self._origin, home, self.limits)

    def first_path(self, tasks: Sequence[Task], measured: np.void, first: int = 1) -> np.void:
        """Return the path of a mission that begins with simulated time.

        The members of a formation fly the same one, from home; who flies alone begins where it is.

        Args:
            tasks: Of the mission.
            measured: The state before the first step, dtype
                `mavlink_defs.framing.codec.SIM_STATE`.
            first: Item to begin with.

        Raises:
            ItemError: It cannot be flown.
        """
        start = None if self._in_formation else start_of(measured, self.limits.cruise_m_s)
        return self.path(tasks, start, first=first)

    def path(
        self,
        tasks: Sequence[Task],
        start: Start | None = None,
        home: Home = Home(),  # noqa: B008 - frozen
        first: int = 1,
    ) -> np.void:
        """Return the path of tasks, a record of dtype `ftc_autopilot.guidance.path.PATH`.

        Args:
            tasks: Of a mission.
            start: Where it begins; None: at home, the same for all aircraft.
            home: Where RETURN_TO_LAUNCH leads.
            first: Item to begin with.

        Raises:
            ItemError: It cannot be flown.
        """
        return _record(mission_path(tasks, self.limits, home, start, first))

    def circle(self, start: Start, radius_m: float = 0.0) -> np.void:
        """Return the path that circles beside a start; radius as of `Loiter`."""
        return self.path((Loiter(0, None, start.height, radius_m),), start, first=1)

    def circle_around(
        self, start: Start, centre: tuple[float, float], height: float, radius_m: float = 0.0
    ) -> np.void:
        """Return the path from a start into a circle around a place, north and east [m].

        Raises:
            ItemError: The circle is too small.
        """
        return self.path((Loiter(0, centre, height, radius_m),), start)

    def way_home(self, start: Start, home: Home) -> np.void:
        """Return the path from a start into the circle around home."""
        return self.path((Return(0),), start, home)


def start_of(measured: np.void, airspeed: float) -> Start:
    """Return the start of a path at a measured state.

    Args:
        measured: Record of dtype `mavlink_defs.framing.codec.SIM_STATE`.
        airspeed: Until the mission says another [m/s].
    """
    north, east, down = map(float, measured["position"])
    v_north, v_east, _ = mul(R1(vec3(measured["attitude"])), vec3(measured["velocity"]))
    return Start(Pose(north, east, math.atan2(v_east, v_north)), -down, airspeed)


def _farthest_right(formation: Formation) -> float:
    """Return how far to the side of the path a member may get by its slot [m]."""
    policies = (formation.on_lost, formation.on_degraded, formation.on_silent)
    wider = formation.widen_m if "widen" in policies else 0.0
    leaves = abs(formation.leave_right_m) if "leave" in policies else 0.0
    slots = (slot for plan in formation.plans() for slot in plan.values())
    return max(abs(slot.right_m) for slot in slots) + max(wider, leaves)


def _record(path: MissionPath) -> np.void:
    return path_record(path.legs, path_id_of(path), path.loop)
