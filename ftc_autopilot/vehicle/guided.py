"""GUIDED: attitudes and places that a ground station sets, one at a time."""

import math
from typing import NamedTuple

from ftc_autopilot.common.geography import Origin
from ftc_autopilot.guidance.mission_items import refusal
from ftc_autopilot.guidance.mission_places import (
    ANYWHERE_M,
    Home,
    check_height,
    height_of,
    north_east_of,
)
from ftc_autopilot.vehicle.flight_path import Way
from ftc_autopilot.vehicle.modes import Modes, Say
from ftc_autopilot.vehicle.path_messages import NO_POSITION
from mavlink_defs import dialect
from mavlink_defs.constants import GUIDED, INT32_MAX
from mavlink_defs.float32 import whole_within
from mavlink_defs.profile import ItemError
from mavlink_defs.services.command import CommandMessage
from mavlink_defs.services.mission import MissionItem

_ACCEPTED, _DENIED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_DENIED


class _GivenPlace(NamedTuple):
    """A place as a message has it; None or NaN is the present one."""

    latitude: int | None  # degE7
    longitude: int | None  # degE7
    altitude: float  # [m]
    frame: int


class Guided:
    """Executes what sets a target in GUIDED, and a new home."""

    def __init__(self, origin: Origin, modes: Modes, say: Say) -> None:
        self._origin, self._modes, self._say = origin, modes, say

    def set_attitude_target(self, message: dialect.MAVLink_set_attitude_target_message) -> None:
        """Follow an attitude set-point in GUIDED; its quaternion is body to NED, scalar first."""
        if self._modes.mode != GUIDED:
            return
        w, x, y, z = map(float, message.q)
        length = math.sqrt(w * w + x * x + y * y + z * z)
        if not 0.9 < length < 1.1 or message.type_mask & (
            dialect.ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE
        ):
            return
        w, x, y, z = w / length, x / length, y / length, z / length
        self._modes.point(
            (
                math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
                math.asin(min(max(2.0 * (w * y - z * x), -1.0), 1.0)),
                math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
            )
        )

    def set_position_target(
        self, message: dialect.MAVLink_set_position_target_global_int_message
    ) -> None:
        """Fly to a place and circle there, in GUIDED; it has no answer."""
        if self._modes.mode != GUIDED or message.type_mask & NO_POSITION:
            return
        place = _GivenPlace(message.lat_int, message.lon_int, message.alt, message.coordinate_frame)
        try:
            self._modes.guide(self._way_to(place))
        except ItemError as error:
            self._refuse(f"Target: {error.reason}")

    def fly_to_item(self, item: MissionItem) -> int:
        """Fly to a mission item that is sent on its own; return MAV_MISSION_RESULT."""
        if item.command != dialect.MAV_CMD_NAV_WAYPOINT:
            self._refuse(f"Target: {refusal(item.command)}")
            return dialect.MAV_MISSION_UNSUPPORTED
        try:
            self._modes.guide(self._way_to(_GivenPlace(item.x, item.y, item.z, item.frame)))
        except ItemError as error:
            self._refuse(f"Target: {error.reason}")
            return error.mav_mission_result
        return dialect.MAV_MISSION_ACCEPTED

    def reposition(self, message: CommandMessage) -> int:
        """Execute MAV_CMD_DO_REPOSITION.

        Params: 1 speed, 2 flags, 3 radius, 4 whether anticlockwise, 5 to 7 place; those that are
        not given stay as they are.
        """
        flags = int(message.param2) if math.isfinite(message.param2) else 0
        changes_mode = flags & dialect.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE
        if self._modes.mode != GUIDED and not changes_mode:
            return self._refuse("Reposition: not in GUIDED, and no flag to change to it")
        radius = 0.0 if math.isnan(message.param3) else abs(message.param3)
        if radius > ANYWHERE_M:
            text = f"radius {message.param3:g}, must be at most {ANYWHERE_M:g} m"
            return self._refuse(f"Reposition: {text}")
        side = -1.0 if message.param4 == 1.0 else 1.0
        limits = self._modes.path.planner.airspeeds
        low, high = limits.min_m_s, limits.max_m_s
        airspeed = message.param1 if message.param1 > 0.0 else None
        if airspeed is not None and not low <= airspeed <= high:
            return self._refuse(
                f"Reposition: speed is {airspeed:g}, must be {low:g} to {high:g} m/s"
            )
        place = _place_of(message, dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT)
        try:
            self._modes.guide(self._way_to(place, side * radius, airspeed))
        except ItemError as error:
            return self._refuse(f"Target: {error.reason}")
        return _ACCEPTED

    def land(self, message: CommandMessage) -> int:
        """Execute MAV_CMD_NAV_LAND: params 5 and 6 are the place; none: as the mission does."""
        place = _place_of(message, dialect.MAV_FRAME_GLOBAL)
        if place.latitude is None or place.longitude is None or place[:2] == (0, 0):
            return self._modes.land()
        try:
            north, east = north_east_of(place.latitude, place.longitude, self._origin)
        except ItemError as error:
            return self._refuse(f"Land: {error.reason}")
        return self._modes.land((north, east))

    def set_home(self, message: CommandMessage) -> int:
        """Execute MAV_CMD_DO_SET_HOME: param 1 = 1 takes the present place, else 5 to 7 are it."""
        here = message.param1 == 1.0
        place = _place_of(message, dialect.MAV_FRAME_GLOBAL)
        if here:
            place = _GivenPlace(None, None, math.nan, dialect.MAV_FRAME_GLOBAL)
        elif place.latitude is None or place.longitude is None or math.isnan(place.altitude):
            return self._refuse("Set home: latitude, longitude and altitude must be given")
        try:
            self._modes.move_home(Home(*self._resolve(place)))
        except ItemError as error:
            reason = f"the mission could not be flown, {error.text}" if error.seq else error.reason
            return self._refuse(f"Set home: {reason}")
        self._say(dialect.MAV_SEVERITY_INFO, "home set")
        return _ACCEPTED

    def _way_to(
        self, place: _GivenPlace, radius_m: float = 0.0, airspeed: float | None = None
    ) -> Way:
        """Return the way to a place and around it; ItemError if it cannot be flown."""
        path = self._modes.path
        resolved = self._resolve(place)
        if not math.isnan(place.altitude):
            check_height(resolved[2], path.home.at, path.planner.limits)
        return path.way_to(resolved, radius_m, airspeed)

    def _resolve(self, place: _GivenPlace) -> tuple[float, float, float]:
        """Return north, east and height of a place [m]; ItemError if there is none."""
        path = self._modes.path
        north, east, height = path.here()
        if place.latitude is not None and place.longitude is not None:
            north, east = north_east_of(place.latitude, place.longitude, self._origin)
        if not math.isnan(place.altitude):
            height = height_of(place.frame, place.altitude, self._origin, path.home.at)
        return north, east, height

    def _refuse(self, text: str) -> int:
        self._say(dialect.MAV_SEVERITY_WARNING, text)
        return _DENIED


def _place_of(message: CommandMessage, frame: int) -> _GivenPlace:
    """Return the place of a command: degrees in COMMAND_LONG, in a frame that it does not name."""
    if isinstance(message, dialect.MAVLink_command_int_message):
        x, y = (None if value == INT32_MAX else value for value in (message.x, message.y))
        return _GivenPlace(x, y, message.z, message.frame)
    x, y = (
        None if math.isnan(value) else whole_within(value * 1e7, -INT32_MAX, INT32_MAX)
        for value in (message.param5, message.param6)
    )
    return _GivenPlace(x, y, message.param7, frame)
