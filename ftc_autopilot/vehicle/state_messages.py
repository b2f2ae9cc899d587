"""Standard messages about the aircraft, made from the last state.

Nothing of what happens in flight may raise here: numbers that a field cannot hold are cut off.
"""

import math

import numpy as np

from ftc_autopilot.common.angles import wrap
from ftc_autopilot.control.controllers import Controllers
from ftc_autopilot.vehicle.clock import VehicleClock
from ftc_autopilot.vehicle.flight_path import VehicleHome
from ftc_autopilot.vehicle.message import message
from ftc_autopilot.vehicle.shown_state import ShownState, centidegrees, quaternion_of
from mavlink_defs import dialect
from mavlink_defs.constants import THROTTLE
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.float32 import float32s, whole_within

_INT16 = 2**15 - 1
_ZERO_PWM_US, _SPAN_PWM_US = 1500, 500
_ZEROS = (0.0, 0.0, 0.0)
_UNKNOWN_COVARIANCE = [math.nan, *[0.0] * 20]


class StateMessages:
    """Makes messages of position, attitude, motion and actuators; times are on its clock."""

    def __init__(
        self, shown: ShownState, controllers: Controllers, home: VehicleHome, clock: VehicleClock
    ) -> None:
        self._shown, self._home, self._clock = shown, home, clock
        self._signals = controllers.uavs[0]["signals"]
        self._controls = controllers.uavs[0]["actuators"]["controls"]

    # time and place

    @message(
        dialect.MAVLink_system_time_message, every_s=1.0, stream=dialect.MAV_DATA_STREAM_EXTRA3
    )
    def system_time(self) -> MAVLink_message:
        """Return SYSTEM_TIME."""
        return dialect.MAVLink_system_time_message(self._clock.unix_us, self._clock.boot_ms)

    @message(
        dialect.MAVLink_local_position_ned_message,
        every_s=0.1,
        stream=dialect.MAV_DATA_STREAM_POSITION,
    )
    def local_position_ned(self) -> MAVLink_message | None:
        """Return LOCAL_POSITION_NED; none before the first fix, as PX4 and ArduPilot have it."""
        if not self._shown.is_placed:
            return None
        numbers = float32s((*self._shown.vector("position"), *self._shown.velocity_ned))
        return dialect.MAVLink_local_position_ned_message(self._clock.boot_ms, *numbers)

    @message(
        dialect.MAVLink_global_position_int_message,
        every_s=0.2,
        stream=dialect.MAV_DATA_STREAM_POSITION,
    )
    def global_position_int(self) -> MAVLink_message | None:
        """Return GLOBAL_POSITION_INT; none before the first fix, as PX4 has it."""
        if not self._shown.is_placed:
            return None
        place = self._shown.place
        vx, vy, vz = (whole_within(100.0 * v, -_INT16, _INT16) for v in self._shown.velocity_ned)
        return dialect.MAVLink_global_position_int_message(
            self._clock.boot_ms, *place, vx, vy, vz, centidegrees(self._shown.yaw)
        )

    @message(dialect.MAVLink_home_position_message, every_s=1.0)
    def home_position(self) -> MAVLink_message:
        """Return HOME_POSITION."""
        return dialect.MAVLink_home_position_message(
            *self._home.place[:3], *_ZEROS, [1.0, *_ZEROS], *_ZEROS, self._clock.boot_us
        )

    @message(dialect.MAVLink_altitude_message)
    def altitude(self) -> MAVLink_message:
        """Return ALTITUDE; the terrain is flat, as high as the origin."""
        height = self._shown.height
        amsl, above_home = self._shown.origin.altitude_m + height, height - self._home.at.height_m
        altitudes = float32s(
            (amsl, amsl, height, above_home, self._shown.origin.altitude_m, height)
        )
        return dialect.MAVLink_altitude_message(self._clock.boot_us, *altitudes)

    # attitude and motion

    @message(dialect.MAVLink_attitude_message, every_s=0.1, stream=dialect.MAV_DATA_STREAM_EXTRA1)
    def attitude(self) -> MAVLink_message:
        """Return ATTITUDE."""
        roll, pitch, yaw = self._shown.vector("attitude")
        numbers = float32s((_wrap(roll), pitch, _wrap(yaw), *self._shown.vector("rates")))
        return dialect.MAVLink_attitude_message(self._clock.boot_ms, *numbers)

    @message(dialect.MAVLink_attitude_quaternion_message, every_s=0.2)
    def attitudequaternion_of(self) -> MAVLink_message:
        """Return ATTITUDE_QUATERNION: body to NED, scalar first."""
        q1, q2, q3, q4, p, q, r = float32s(
            (*quaternion_of(*self._shown.vector("attitude")), *self._shown.vector("rates"))
        )
        return dialect.MAVLink_attitude_quaternion_message(
            self._clock.boot_ms, q1, q2, q3, q4, p, q, r
        )

    @message(dialect.MAVLink_attitude_target_message)
    def attitude_target(self) -> MAVLink_message:
        """Return ATTITUDE_TARGET: the filtered reference; the airspeed is in FTC_TRACKING."""
        q = quaternion_of(*self._signals["reference"][1:4].tolist())
        mask = (
            dialect.ATTITUDE_TARGET_TYPEMASK_BODY_ROLL_RATE_IGNORE
            | dialect.ATTITUDE_TARGET_TYPEMASK_BODY_PITCH_RATE_IGNORE
            | dialect.ATTITUDE_TARGET_TYPEMASK_BODY_YAW_RATE_IGNORE
        )
        return dialect.MAVLink_attitude_target_message(
            self._clock.boot_ms, mask, float32s(q), 0.0, 0.0, 0.0, self._thrust()
        )

    @message(dialect.MAVLink_vfr_hud_message, every_s=0.2, stream=dialect.MAV_DATA_STREAM_EXTRA2)
    def vfr_hud(self) -> MAVLink_message:
        """Return VFR_HUD."""
        north, east, down = self._shown.velocity_ned
        altitude = self._shown.origin.altitude_m + self._shown.height
        airspeed, groundspeed, alt, climb = float32s(
            (self._shown.airspeed, math.hypot(north, east), altitude, -down)
        )
        heading = centidegrees(self._shown.yaw) // 100
        throttle = whole_within(100.0 * self._thrust(), 0, 100)
        return dialect.MAVLink_vfr_hud_message(airspeed, groundspeed, heading, throttle, alt, climb)

    @message(dialect.MAVLink_wind_cov_message)
    def wind_cov(self) -> MAVLink_message:
        """Return WIND_COV: the wind that velocity and airspeed make.

        Of an estimate with its variances, where PX4 has them, and accuracies; else none is stated.
        """
        altitude = self._shown.origin.altitude_m + self._shown.height
        horizontal, vertical = math.nan, math.nan
        if self._shown.report is not None:
            n, e, vertical = self._shown.report["wind_std"].tolist()
            horizontal = math.hypot(n, e)
        wind = (*self._shown.in_ned("wind"), horizontal**2, vertical**2, altitude)
        numbers = float32s((*wind, horizontal, vertical))
        return dialect.MAVLink_wind_cov_message(self._clock.boot_us, *numbers)

    @message(dialect.MAVLink_odometry_message)
    def odometry(self) -> MAVLink_message | None:
        """Return ODOMETRY: position in the local frame, velocity and rates in the body's.

        Of an estimate with its covariance, but for the rates; none before the first fix.
        """
        shown = self._shown
        if not shown.is_placed:
            return None
        names = "position", "velocity", "rates"
        x, y, z, u, v, w, p, q, r = float32s(one for name in names for one in shown.vector(name))
        pose = velocity = _UNKNOWN_COVARIANCE
        if shown.report is not None:
            pose = _upper(shown.pose_covariance())
            velocity = _upper(shown.velocity_covariance())
        return dialect.MAVLink_odometry_message(
            self._clock.boot_us,
            dialect.MAV_FRAME_LOCAL_NED,
            dialect.MAV_FRAME_BODY_FRD,
            *(x, y, z),
            float32s(quaternion_of(*shown.vector("attitude"))),
            *(u, v, w, p, q, r),
            pose,
            velocity,
        )

    # actuators

    @message(dialect.MAVLink_actuator_output_status_message, every_s=0.1)
    def actuator_output_status(self) -> MAVLink_message:
        """Return ACTUATOR_OUTPUT_STATUS: the commands held, as HIL_ACTUATOR_CONTROLS has them."""
        return dialect.MAVLink_actuator_output_status_message(
            self._clock.boot_us, 0b1111, self._held() + [0.0] * 28
        )

    @message(
        dialect.MAVLink_servo_output_raw_message,
        every_s=0.5,
        stream=dialect.MAV_DATA_STREAM_RC_CHANNELS,
    )
    def servo_output_raw(self) -> MAVLink_message:
        """Return SERVO_OUTPUT_RAW: the same as pulses, on ArduPlane's channels."""
        aileron, elevator, rudder, throttle = self._held()
        pulses = [_pulse(aileron), _pulse(elevator), _pulse(2.0 * throttle - 1.0), _pulse(rudder)]
        return dialect.MAVLink_servo_output_raw_message(
            self._clock.boot_us % 2**32, 0, *pulses, *[0] * 4
        )

    # inside

    def _held(self) -> list[float]:
        controls: list[float] = self._controls[:4].tolist()
        return controls

    def _thrust(self) -> float:
        return self._held()[THROTTLE]


def _wrap(angle: float) -> float:
    return wrap(angle) if math.isfinite(angle) else math.nan


def _pulse(share: float) -> int:
    """Return a share of -1 to 1 as a pulse of 1000 to 2000 µs."""
    return whole_within(_ZERO_PWM_US + _SPAN_PWM_US * share, 1000, 2000)


def _upper(covariance: np.ndarray) -> list[float]:
    """Return the upper triangle, row by row, of a covariance of six values; NaN for those left."""
    whole = np.full((6, 6), math.nan)
    n = len(covariance)
    whole[:n, :n] = covariance
    return float32s(whole[np.triu_indices(6)].tolist())
