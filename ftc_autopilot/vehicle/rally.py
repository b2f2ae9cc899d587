"""The rally points of one vehicle: where RTL leads in place of home."""

import math
from collections.abc import Sequence

import numpy as np

from ftc_autopilot.common.geography import Origin
from ftc_autopilot.guidance.fence import RallyPoint, decode_rally
from ftc_autopilot.guidance.limits import turn_radius
from ftc_autopilot.guidance.mission_places import Home
from ftc_autopilot.vehicle.fence import VehicleFence
from ftc_autopilot.vehicle.flight_path import FlightPath
from ftc_autopilot.vehicle.modes import Say
from mavlink_defs import dialect
from mavlink_defs.config.problems import counted
from mavlink_defs.constants import MAX_MISSION_ITEMS
from mavlink_defs.profile import ItemError
from mavlink_defs.services.machine import SystemId
from mavlink_defs.services.mission import MissionItem
from mavlink_defs.services.mission_server import MissionAccepted, MissionRefused, MissionServer


class VehicleRally:
    """Holds the rally points, and chooses one.

    Attributes:
        server: Serves their items.
    """

    def __init__(
        self,
        own: SystemId,
        origin: Origin,
        record: np.ndarray,
        path: FlightPath,
        fence: VehicleFence,
        say: Say,
    ) -> None:
        """Hold none.

        Args:
            own: SystemId of the vehicle.
            origin: Of the simulation's world.
            record: Its parameters, `FenceRecords.rally`.
            path: What the vehicle flies along; its RTL leads to what is chosen here.
            fence: Points outside are not chosen while it is enabled.
            say: Announces a text.
        """
        self._origin, self._record, self._path = origin, record, path
        self._fence, self._say = fence, say

        def validate(items: Sequence[MissionItem]) -> None:
            self._decoded(items, path.home.at)

        self.server = MissionServer(
            own, validate, MAX_MISSION_ITEMS, mission_type=dialect.MAV_MISSION_TYPE_RALLY
        )
        path.refuge = self.refuge

    def handle_events(self) -> bool:
        """Announce what was uploaded; return whether the points have changed."""
        changes = False
        for event in self.server.events():
            match event:
                case MissionAccepted(items):
                    changes = True
                    if items:
                        text = f"{counted(len(items), 'rally point')} in force"
                        self._say(dialect.MAV_SEVERITY_INFO, text)
                case MissionRefused(_, text) if text:
                    self._warn(text)
        return changes

    def tell_if_outside(self) -> None:
        """Warn of points outside the fence, and of those, and a home, whose circles leave it."""
        limits, home = self._path.planner.limits, self._path.home.at
        radius = turn_radius(limits.cruise_m_s, limits)
        watch = self._fence.watch
        if watch.room((home.north_m, home.east_m, home.height_m)) < radius:
            self._warn(f"the circle around home, {radius:.0f} m, leaves the fence")
        for point in self._points(home):
            name = f"rally point {point.item}"
            if watch.clearance(point[:3]) < 0.0:
                self._warn(f"{name} is outside the fence, not used while that is enabled")
            elif watch.room(point[:3]) < radius:
                self._warn(f"the circle around {name}, {radius:.0f} m, leaves the fence")

    def refuge(self, home: Home) -> tuple[float, float, float] | None:
        """Return where RTL leads, north, east, height [m]; None: home at the present height.

        As in ArduPlane it is the nearest rally point; home, if that is nearer and RALLY_INCL_HOME
        is 1, or if all are farther than RALLY_LIMIT_KM.
        """
        north, east, height = self._path.here()

        def away(place: tuple[float, ...]) -> float:
            return math.hypot(place[0] - north, place[1] - east)

        limit_m = 1e3 * float(self._record["limit_km"][0]) or math.inf
        usable = [point for point in self._points(home) if self._is_inside(point)]
        nearest = min(usable, key=away, default=None)
        includes_home = bool(self._record["incl_home"][0])
        at_home = (home.north_m, home.east_m, self._fence.held_height(height))
        if (
            nearest is None
            or away(nearest) > limit_m
            or (includes_home and away(at_home) <= away(nearest))
        ):
            return None if at_home[2] == height else at_home
        self._say(dialect.MAV_SEVERITY_INFO, f"RTL leads to rally point {nearest.item}")
        return nearest[:3]

    def state(self) -> bytes:
        """Return the parameters, for a checkpoint."""
        return self._record.tobytes()

    def resume(self, items: Sequence[MissionItem], state: bytes) -> None:
        """Restore what a checkpoint has: items, and the bytes of `state`."""
        self.server.restore(tuple(items), 0)
        if len(state) == self._record.nbytes:
            self._record[:] = np.frombuffer(state, self._record.dtype)

    def _warn(self, text: str) -> None:
        self._say(dialect.MAV_SEVERITY_WARNING, text)

    def _is_inside(self, point: RallyPoint) -> bool:
        return not self._fence.enabled or self._fence.watch.clearance(point[:3]) >= 0.0

    def _points(self, home: Home) -> tuple[RallyPoint, ...]:
        """Return the points that can be flown to, with altitudes above the home of now."""
        points: tuple[RallyPoint, ...] = ()
        for item in self.server.items:
            try:
                points += self._decoded((item,), home)
            except ItemError:
                continue
        return points

    def _decoded(self, items: Sequence[MissionItem], home: Home) -> tuple[RallyPoint, ...]:
        return decode_rally(items, self._origin, home, self._path.planner.limits)
