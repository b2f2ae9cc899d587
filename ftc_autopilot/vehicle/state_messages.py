"""Standard messages about the aircraft, made from the last measured state.

Nothing of what happens in flight may raise here: numbers that a field cannot hold are cut off.
"""

import math
import operator
from collections.abc import Sequence

import numpy as np

from ftc_autopilot.common.angles import wrap
from ftc_autopilot.common.geography import Origin, Place, place_of
from ftc_autopilot.control.controllers import Controllers
from ftc_autopilot.hot.hot_state import HotState
from ftc_autopilot.vehicle.clock import VehicleClock
from ftc_autopilot.vehicle.flight_path import VehicleHome
from ftc_autopilot.vehicle.message import message
from mavlink_defs import dialect
from mavlink_defs.constants import THROTTLE
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.float32 import float32s, whole_within
from sitl_plant.airframe.rigid_body import R1
from sitl_plant.vec3 import Vec3, mul

_VECTORS = ("position", "velocity", "attitude", "rates", "specific_force", "wind")
_INT16, _UINT16 = 2**15 - 1, 2**16 - 1
_UNKNOWN_U16 = _UINT16
_GPS_SATELLITES = 14
_GPS_DILUTION = 80  # of precision, horizontal and vertical [1/100]
_GPS_ACCURACY_MM, _GPS_ACCURACY_MM_S = 800, 100
_ZERO_PWM_US, _SPAN_PWM_US = 1500, 500
_ZEROS = (0.0, 0.0, 0.0)
_GIVEN_IMU = 0b111111  # HIGHRES_IMU.fields_updated: accelerations and rates


class StateMessages:
    """Makes messages of position, attitude, motion and actuators; times are on its clock."""

    def __init__(
        self,
        hot: HotState,
        controllers: Controllers,
        origin: Origin,
        home: VehicleHome,
        clock: VehicleClock,
    ) -> None:
        self._origin, self._home, self._clock = origin, home, clock
        # views, which always show the last state
        self._vectors: dict[str, np.ndarray] = {name: hot.measured[name] for name in _VECTORS}
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
    def local_position_ned(self) -> MAVLink_message:
        """Return LOCAL_POSITION_NED."""
        numbers = float32s((*self._vector("position"), *self._velocity_ned()))
        return dialect.MAVLink_local_position_ned_message(self._clock.boot_ms, *numbers)

    @message(
        dialect.MAVLink_global_position_int_message,
        every_s=0.2,
        stream=dialect.MAV_DATA_STREAM_POSITION,
    )
    def global_position_int(self) -> MAVLink_message:
        """Return GLOBAL_POSITION_INT."""
        place = self._place()
        vx, vy, vz = (whole_within(100.0 * v, -_INT16, _INT16) for v in self._velocity_ned())
        return dialect.MAVLink_global_position_int_message(
            self._clock.boot_ms, *place, vx, vy, vz, _centidegrees(self._yaw())
        )

    @message(
        dialect.MAVLink_gps_raw_int_message,
        every_s=0.5,
        stream=dialect.MAV_DATA_STREAM_EXTENDED_STATUS,
    )
    def gps_raw_int(self) -> MAVLink_message:
        """Return GPS_RAW_INT: the true position, stated as accurately as a receiver would."""
        place, (north, east, _) = self._place(), self._velocity_ned()
        return dialect.MAVLink_gps_raw_int_message(
            self._clock.boot_us,
            dialect.GPS_FIX_TYPE_3D_FIX,
            place.latitude,
            place.longitude,
            place.altitude,
            eph=_GPS_DILUTION,
            epv=_GPS_DILUTION,
            vel=whole_within(100.0 * math.hypot(north, east), 0, _UINT16 - 1),
            cog=_centidegrees(math.atan2(east, north)),
            satellites_visible=_GPS_SATELLITES,
            alt_ellipsoid=place.altitude,
            h_acc=_GPS_ACCURACY_MM,
            v_acc=_GPS_ACCURACY_MM,
            vel_acc=_GPS_ACCURACY_MM_S,
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
        height = self._height()
        amsl, above_home = self._origin.altitude_m + height, height - self._home.at.height_m
        altitudes = float32s((amsl, amsl, height, above_home, self._origin.altitude_m, height))
        return dialect.MAVLink_altitude_message(self._clock.boot_us, *altitudes)

    # attitude and motion

    @message(dialect.MAVLink_attitude_message, every_s=0.1, stream=dialect.MAV_DATA_STREAM_EXTRA1)
    def attitude(self) -> MAVLink_message:
        """Return ATTITUDE."""
        roll, pitch, yaw = self._vector("attitude")
        numbers = float32s((_wrap(roll), pitch, _wrap(yaw), *self._vector("rates")))
        return dialect.MAVLink_attitude_message(self._clock.boot_ms, *numbers)

    @message(dialect.MAVLink_attitude_quaternion_message, every_s=0.2)
    def attitudequaternion_of(self) -> MAVLink_message:
        """Return ATTITUDE_QUATERNION: body to NED, scalar first."""
        q1, q2, q3, q4, p, q, r = float32s(
            (*quaternion_of(*self._vector("attitude")), *self._vector("rates"))
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
        north, east, down = self._velocity_ned()
        altitude = self._origin.altitude_m + self._height()
        airspeed, groundspeed, alt, climb = float32s(
            (self._airspeed(), math.hypot(north, east), altitude, -down)
        )
        heading = _centidegrees(self._yaw()) // 100
        throttle = whole_within(100.0 * self._thrust(), 0, 100)
        return dialect.MAVLink_vfr_hud_message(airspeed, groundspeed, heading, throttle, alt, climb)

    @message(dialect.MAVLink_wind_cov_message)
    def wind_cov(self) -> MAVLink_message:
        """Return WIND_COV: the wind that velocity and airspeed make; no accuracy is stated."""
        altitude = self._origin.altitude_m - self._vector("position")[2]
        north, east, down, amsl = float32s((*self._in_ned("wind"), altitude))
        unknown = (math.nan, math.nan)
        return dialect.MAVLink_wind_cov_message(
            self._clock.boot_us, north, east, down, *unknown, amsl, *unknown
        )

    @message(dialect.MAVLink_highres_imu_message)
    def highres_imu(self) -> MAVLink_message:
        """Return HIGHRES_IMU: specific force and rates; there is no other sensor."""
        ax, ay, az, p, q, r = float32s((*self._vector("specific_force"), *self._vector("rates")))
        unknown = (math.nan,) * 7
        return dialect.MAVLink_highres_imu_message(
            self._clock.boot_us, ax, ay, az, p, q, r, *unknown, _GIVEN_IMU
        )

    @message(dialect.MAVLink_odometry_message)
    def odometry(self) -> MAVLink_message:
        """Return ODOMETRY: position in the local frame, velocity and rates in the body's."""
        unknown = [math.nan, *[0.0] * 20]
        x, y, z, u, v, w, p, q, r = float32s(
            (*self._vector("position"), *self._vector("velocity"), *self._vector("rates"))
        )
        return dialect.MAVLink_odometry_message(
            self._clock.boot_us,
            dialect.MAV_FRAME_LOCAL_NED,
            dialect.MAV_FRAME_BODY_FRD,
            *(x, y, z),
            float32s(quaternion_of(*self._vector("attitude"))),
            *(u, v, w, p, q, r),
            unknown,
            unknown,
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

    def _vector(self, name: str) -> Vec3:
        """Return a vector of the last state."""
        x, y, z = self._vectors[name].tolist()
        return x, y, z

    def _in_ned(self, name: str) -> Vec3:
        """Return a vector of the body's axes in the local frame's."""
        return mul(R1(self._vector("attitude")), self._vector(name))

    def _velocity_ned(self) -> Vec3:
        return self._in_ned("velocity")

    def _airspeed(self) -> float:
        u, v, w = map(operator.sub, self._vector("velocity"), self._vector("wind"))
        return math.sqrt(u * u + v * v + w * w)

    def _height(self) -> float:
        """Return the height above the origin [m]."""
        return -self._vector("position")[2]

    def _yaw(self) -> float:
        return self._vector("attitude")[2]

    def _place(self) -> Place:
        """Return where it is; the height is that above home."""
        place = place_of(self._origin, *self._vector("position"))
        return place._replace(height=place.height - round(1e3 * self._home.at.height_m))

    def _held(self) -> list[float]:
        controls: list[float] = self._controls[:4].tolist()
        return controls

    def _thrust(self) -> float:
        return self._held()[THROTTLE]


def _wrap(angle: float) -> float:
    return wrap(angle) if math.isfinite(angle) else math.nan


def _centidegrees(angle: float) -> int:
    """Return an angle [rad] as 0 to 35999 cdeg; unknown if it is NaN or inf."""
    if not math.isfinite(angle):
        return _UNKNOWN_U16
    return round(math.degrees(wrap(angle)) * 100.0) % 36000


def _pulse(share: float) -> int:
    """Return a share of -1 to 1 as a pulse of 1000 to 2000 µs."""
    return whole_within(_ZERO_PWM_US + _SPAN_PWM_US * share, 1000, 2000)


def quaternion_of(roll: float, pitch: float, yaw: float) -> Sequence[float]:
    """Return body to NED, scalar first, from angles [rad]; NaN if one is not finite."""
    if not math.isfinite(roll + pitch + yaw):
        return (math.nan,) * 4
    cr, sr = math.cos(roll / 2.0), math.sin(roll / 2.0)
    cp, sp = math.cos(pitch / 2.0), math.sin(pitch / 2.0)
    cy, sy = math.cos(yaw / 2.0), math.sin(yaw / 2.0)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )
