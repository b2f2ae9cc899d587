"""Standard messages about the path that is flown; all zero while none is."""

import math

from ftc_autopilot.common.angles import wrap
from ftc_autopilot.common.geography import place_of
from ftc_autopilot.control.controllers import Controllers
from ftc_autopilot.vehicle.clock import VehicleClock
from ftc_autopilot.vehicle.flight_path import FlightPath
from ftc_autopilot.vehicle.message import message
from ftc_autopilot.vehicle.shown_state import ShownState
from mavlink_defs import dialect
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.float32 import float32s, whole_within

NO_POSITION = (
    dialect.POSITION_TARGET_TYPEMASK_X_IGNORE
    | dialect.POSITION_TARGET_TYPEMASK_Y_IGNORE
    | dialect.POSITION_TARGET_TYPEMASK_Z_IGNORE
)
"""Of a `type_mask`: no place is given."""
_ONLY_POSITION = (
    dialect.POSITION_TARGET_TYPEMASK_VX_IGNORE
    | dialect.POSITION_TARGET_TYPEMASK_VY_IGNORE
    | dialect.POSITION_TARGET_TYPEMASK_VZ_IGNORE
    | dialect.POSITION_TARGET_TYPEMASK_AX_IGNORE
    | dialect.POSITION_TARGET_TYPEMASK_AY_IGNORE
    | dialect.POSITION_TARGET_TYPEMASK_AZ_IGNORE
    | dialect.POSITION_TARGET_TYPEMASK_YAW_IGNORE
    | dialect.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
)


class PathMessages:
    """Makes the messages about where a path leads, and how far the vehicle is from it."""

    def __init__(
        self, shown: ShownState, controllers: Controllers, path: FlightPath, clock: VehicleClock
    ) -> None:
        self._shown, self._controllers = shown, controllers
        self._path, self._clock = path, clock

    @message(
        dialect.MAVLink_nav_controller_output_message,
        stream=dialect.MAV_DATA_STREAM_EXTENDED_STATUS,
    )
    def nav_controller_output(self) -> MAVLink_message:
        """Return NAV_CONTROLLER_OUTPUT; before the first fix, as without a path."""
        _, roll, pitch, _ = map(float, self._controllers.uavs[0]["guidance"]["command"])
        if not (self._path.flown and self._shown.is_placed):
            bank, climb = float32s((math.degrees(roll), math.degrees(pitch)))
            nothing = (0, 0, 0, 0.0, 0.0, 0.0)
            return dialect.MAVLink_nav_controller_output_message(bank, climb, *nothing)
        point, (north, east, height) = self._path.point(), self._path.here()
        to_north, to_east, _ = self._path.target()
        airspeed = float(self._controllers.uavs[0]["signals"]["V"])
        numbers = float32s(
            (
                math.degrees(roll),
                math.degrees(pitch),
                point.height - height,
                point.airspeed - airspeed,
                self._path.cross_track(),
            )
        )
        return dialect.MAVLink_nav_controller_output_message(
            numbers[0],
            numbers[1],
            _whole_degrees(point.course),
            _whole_degrees(math.atan2(to_east - east, to_north - north)),
            whole_within(self._path.way_left(), 0, 2**16 - 1),
            *numbers[2:],
        )

    @message(
        dialect.MAVLink_position_target_global_int_message,
        stream=dialect.MAV_DATA_STREAM_EXTENDED_STATUS,
    )
    def position_target_global_int(self) -> MAVLink_message | None:
        """Return POSITION_TARGET_GLOBAL_INT: where the path's present item leads.

        Without a path no place is flown to: its type_mask says that all are to be ignored. None
        before the first fix.
        """
        if not self._shown.is_placed:
            return None
        flown = self._path.flown
        north, east, height = self._path.target() if flown else self._path.here()
        place = place_of(self._shown.origin, north, east, -height)
        (altitude,) = float32s((place.altitude / 1e3,))
        nothing = (0.0,) * 8
        return dialect.MAVLink_position_target_global_int_message(
            self._clock.boot_ms,
            dialect.MAV_FRAME_GLOBAL_INT,
            _ONLY_POSITION if flown else _ONLY_POSITION | NO_POSITION,
            place.latitude,
            place.longitude,
            altitude,
            *nothing,
        )


def _whole_degrees(angle: float) -> int:
    """Return an angle [rad] in whole degrees within ±180; 0 if it is none."""
    return round(math.degrees(wrap(angle))) if math.isfinite(angle) else 0
