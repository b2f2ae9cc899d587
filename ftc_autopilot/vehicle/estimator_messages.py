"""What an estimated state reports to ground stations: messages, texts, health of the sensors.

A vehicle that is handed its true state has no estimator: it says that all is known, exactly.
"""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from ftc_autopilot.estimation.health import ABSENT, INCONSISTENT, REASONS, SILENT, WELL
from ftc_autopilot.estimation.state import GNSS_HEIGHT, GNSS_VELOCITY, N_SENSORS
from ftc_autopilot.hot.hot_state import HotState
from ftc_autopilot.vehicle.changes import Change
from ftc_autopilot.vehicle.clock import VehicleClock
from ftc_autopilot.vehicle.message import message
from ftc_autopilot.vehicle.sensor_messages import HeardSensors
from ftc_autopilot.vehicle.shown_state import ShownState, quaternion_of
from mavlink_defs import dialect
from mavlink_defs.constants import BAROMETER, GNSS, MAGNETOMETER, PITOT
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.float32 import float32s

_SHARED = 0b11_1111_1111
"""ESTIMATOR_STATUS_FLAGS and EKF_STATUS_FLAGS have the same values up to here."""
_ALL_KNOWN = _SHARED & ~dialect.ESTIMATOR_CONST_POS_MODE
_EKF_UNINITIALIZED, _EKF_GPS_GLITCHING = 1024, 32768  # of ardupilotmega.xml
_MOVING = (
    dialect.ESTIMATOR_VELOCITY_HORIZ
    | dialect.ESTIMATOR_POS_HORIZ_REL
    | dialect.ESTIMATOR_PRED_POS_HORIZ_REL
)
_PLACED = dialect.ESTIMATOR_POS_HORIZ_ABS | dialect.ESTIMATOR_PRED_POS_HORIZ_ABS
_HIGH = dialect.ESTIMATOR_VELOCITY_VERT | dialect.ESTIMATOR_POS_VERT_ABS

_HEALTH = {
    MAGNETOMETER: dialect.MAV_SYS_STATUS_SENSOR_3D_MAG,
    BAROMETER: dialect.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE,
    PITOT: dialect.MAV_SYS_STATUS_SENSOR_DIFFERENTIAL_PRESSURE,
    GNSS: dialect.MAV_SYS_STATUS_SENSOR_GPS,
    GNSS_VELOCITY: dialect.MAV_SYS_STATUS_SENSOR_GPS,
    GNSS_HEIGHT: dialect.MAV_SYS_STATUS_SENSOR_GPS,
}
_INERTIAL = dialect.MAV_SYS_STATUS_SENSOR_3D_GYRO | dialect.MAV_SYS_STATUS_SENSOR_3D_ACCEL

_LATENCY_S = 0.1  # least change of a latency that is worth a text
_NAMES = {
    MAGNETOMETER: "magnetometer",
    BAROMETER: "barometer",
    PITOT: "pitot",
    GNSS: "GNSS",
    GNSS_VELOCITY: "GNSS velocity",
    GNSS_HEIGHT: "GNSS height",
}
_INSTEAD = {
    MAGNETOMETER: "heading by course and gyros",
    BAROMETER: "height by GNSS",
    PITOT: "airspeed by wind and model",
    GNSS: "dead reckoning",
    GNSS_VELOCITY: "velocity by air and IMU",
    GNSS_HEIGHT: "height by barometer",
}


class EstimatorMessages:
    """Makes messages and texts from the estimate of the last step."""

    def __init__(self, hot: HotState, shown: ShownState, clock: VehicleClock) -> None:
        self._hot, self._shown, self._clock = hot, shown, clock
        self._imus, self._heard = int(hot.navigation["count"]), HeardSensors(hot)
        self._report = shown.report
        self._gate = float(hot.navigation["estimator"]["parameters"]["gate"])
        self._said = [WELL] * N_SENSORS
        self._said_imus = [WELL] * self._imus
        self._said_resets, self._said_delay = 0, 0.0

    @message(dialect.MAVLink_estimator_status_message)
    def estimator_status(self) -> MAVLink_message:
        """Return ESTIMATOR_STATUS: each innovation over the limit of its test.

        NaN of a sensor that has said nothing, as PX4 has it.
        """
        ratios = (*self._ratios(), *self._accuracy())
        return dialect.MAVLink_estimator_status_message(
            self._clock.boot_us, self.flags(), *float32s(ratios)
        )

    @message(dialect.MAVLink_ekf_status_report_message)
    def ekf_status_report(self) -> MAVLink_message:
        """Return EKF_STATUS_REPORT: the same as ArduPilot's stations have it, 0 for NaN."""
        numbers = [0.0 if math.isnan(ratio) else ratio for ratio in self._ratios()]
        flags = self.flags()
        more = _EKF_GPS_GLITCHING if flags & dialect.ESTIMATOR_GPS_GLITCH else 0
        more |= 0 if flags & dialect.ESTIMATOR_ATTITUDE else _EKF_UNINITIALIZED
        return dialect.MAVLink_ekf_status_report_message(flags & _SHARED | more, *float32s(numbers))

    @message(dialect.MAVLink_attitude_quaternion_cov_message)
    def attitude_quaternion_cov(self) -> MAVLink_message:
        """Return ATTITUDE_QUATERNION_COV: the variances of roll, pitch and yaw, too."""
        p, q, r = float32s(self._shown.vector("rates"))
        known = self._report is None
        covariance = np.zeros((3, 3)) if known else self._shown.attitude_covariance()
        return dialect.MAVLink_attitude_quaternion_cov_message(
            self._clock.boot_us,
            float32s(quaternion_of(*self._shown.vector("attitude"))),
            *(p, q, r),
            float32s(covariance.ravel().tolist()),
        )

    @message(dialect.MAVLink_global_position_int_cov_message)
    def global_position_int_cov(self) -> MAVLink_message | None:
        """Return GLOBAL_POSITION_INT_COV: variances of position and velocity, NED.

        None before the first fix.
        """
        if not self._shown.is_placed:
            return None
        vx, vy, vz = float32s(self._shown.velocity_ned)
        variances = [0.0] * 6
        if self._report is not None:
            both = *self._report["position_std"].tolist(), *self._report["velocity_std"].tolist()
            variances = [one * one for one in both]
        return dialect.MAVLink_global_position_int_cov_message(
            self._clock.boot_us,
            dialect.MAV_ESTIMATOR_TYPE_GPS_INS,
            *self._shown.place,
            *(vx, vy, vz),
            float32s(np.diag(variances).ravel().tolist()),
        )

    def flags(self) -> int:
        """Return ESTIMATOR_STATUS_FLAGS.

        Horizontal motion is known by a fix, or after one by the airspeed; in constant position mode
        by nothing outside. A glitch is a receiver that is heard, and excluded.
        """
        report = self._report
        if report is None:
            return _ALL_KNOWN
        if not report["aligned"]:
            return 0
        reasons = report["reasons"]
        has_fix = bool(report["placed"]) and not report["dead_reckoning"]
        has_airspeed = not report["synthetic_airspeed"]
        flags: int = dialect.ESTIMATOR_ATTITUDE
        flags |= _HIGH if has_fix or reasons[BAROMETER] == WELL else 0
        flags |= _MOVING if report["placed"] and (has_fix or has_airspeed) else 0
        flags |= _PLACED if has_fix else 0
        flags |= 0 if has_fix or has_airspeed else dialect.ESTIMATOR_CONST_POS_MODE
        flags |= dialect.ESTIMATOR_GPS_GLITCH if reasons[GNSS] > SILENT else 0
        flags |= 0 if self._flies_by_a_well_imu() else dialect.ESTIMATOR_ACCEL_ERROR
        return flags

    def healthy(self, sensors: int) -> int:
        """Return a set of MAV_SYS_STATUS_SENSOR without the excluded ones."""
        report = self._report
        if report is None:
            return sensors
        for sensor, bit in _HEALTH.items():
            if report["reasons"][sensor] != WELL:
                sensors &= ~bit
        if not report["placed"]:
            sensors &= ~dialect.MAV_SYS_STATUS_SENSOR_GPS
        if all(reason != WELL for reason in self._imu_reasons()):
            sensors &= ~_INERTIAL
        if not report["aligned"]:
            sensors &= ~dialect.MAV_SYS_STATUS_AHRS
        return sensors

    def fitted(self, sensors: int) -> int:
        """Return a set of MAV_SYS_STATUS_SENSOR without what the aircraft does not have."""
        if self._report is None:
            return sensors
        for sensor, bit in _HEALTH.items():
            if self._report["reasons"][sensor] == ABSENT:
                sensors &= ~bit
        return sensors

    def changes(self) -> Iterator[Change]:
        """Yield each sensor excluded, or taken back, since the last call."""
        report = self._report
        if report is None:
            return
        at = f"at {self._hot.time_s:.2f} s"
        for k, reason in enumerate(self._imu_reasons()):
            if reason == self._said_imus[k]:
                continue
            name = f"IMU {k + 1}"
            if reason == WELL:
                yield Change(name, dialect.MAV_SEVERITY_NOTICE, f"{name} back in use {at}")
            else:
                text = f"{name} excluded {at}: {REASONS[reason]}, {self._flown_by()}"
                yield Change(name, dialect.MAV_SEVERITY_CRITICAL, text)
            self._said_imus[k] = reason
        for sensor, name in _NAMES.items():
            reason, before = self._reason(sensor), self._said[sensor]
            self._said[sensor] = reason
            if reason in {before, ABSENT}:
                continue
            if reason == WELL:
                yield Change(name, dialect.MAV_SEVERITY_NOTICE, f"{name} back in use {at}")
            elif before == WELL:
                text = f"{name} excluded {at}: {REASONS[reason]}, {self._instead(sensor)}"
                yield Change(name, dialect.MAV_SEVERITY_WARNING, text)
        delay = float(report["delay"])
        if abs(delay - self._said_delay) >= max(_LATENCY_S, 3.0 * float(report["delay_std"])):
            self._said_delay = delay
            more = f"{abs(delay):.2f} s {'more' if delay > 0.0 else 'less'} than it says"
            text = f"GNSS latency {more if abs(delay) >= _LATENCY_S else 'as it says'} {at}"
            yield Change("GNSS latency", dialect.MAV_SEVERITY_NOTICE, text)
        resets, self._said_resets = self._said_resets, int(report["resets"])
        if self._said_resets > resets:
            yield Change("estimate", dialect.MAV_SEVERITY_WARNING, f"estimate reset {at}")

    def _reason(self, sensor: int) -> int:
        """Return why a sensor is excluded; of a part of GNSS, only what is not the receiver's."""
        assert self._report is not None
        reasons: list[int] = self._report["reasons"].tolist()
        is_part = sensor in {GNSS_VELOCITY, GNSS_HEIGHT}
        return WELL if is_part and reasons[sensor] == reasons[GNSS] else reasons[sensor]

    def _instead(self, sensor: int) -> str:
        assert self._report is not None
        reasons = self._report["reasons"]
        place_alone = reasons[GNSS] == INCONSISTENT and reasons[GNSS_VELOCITY] == WELL
        if sensor == GNSS and place_alone:
            return "place by its velocity"
        return _INSTEAD[sensor]

    def _flown_by(self) -> str:
        assert self._report is not None
        imu = int(self._report["imu"])
        if self._flies_by_a_well_imu():
            return f"flying by IMU {imu + 1}"
        return f"no IMU passes its test, IMU {imu + 1} is the best"

    def _flies_by_a_well_imu(self) -> bool:
        assert self._report is not None
        return self._imu_reasons()[int(self._report["imu"])] == WELL

    def _imu_reasons(self) -> Sequence[int]:
        assert self._report is not None
        reasons: list[int] = self._report["imu_reasons"][: self._imus].tolist()
        return reasons

    def _ratios(self) -> Sequence[float]:
        """Return the last innovations over the limits of their tests; NaN if there are none.

        Of velocity, position, height, field, height above the ground, airspeed; the larger of the
        barometer's and the receiver's height.
        """
        if self._report is None:
            return [0.0] * 6
        squares: list[float] = self._report["ratios"].tolist()
        position, velocity = squares[GNSS], squares[GNSS_VELOCITY]
        is_heard, has_fix = self._heard.is_heard, self._heard.is_heard(GNSS)
        heights = [squares[BAROMETER]] if is_heard(BAROMETER) else []
        heights += [squares[GNSS_HEIGHT]] if has_fix else []
        found = (
            velocity if has_fix else math.nan,
            position if has_fix else math.nan,
            max(heights, default=math.nan),
            squares[MAGNETOMETER] if is_heard(MAGNETOMETER) else math.nan,
            math.nan,  # nothing measures the height above the ground
            squares[PITOT] if is_heard(PITOT) else math.nan,
        )
        return [math.sqrt(max(square, 0.0) / self._gate) for square in found]

    def _accuracy(self) -> tuple[float, float]:
        """Return the standard deviations of the position, horizontal and vertical [m]."""
        if self._report is None:
            return 0.0, 0.0
        north, east, down = self._report["position_std"].tolist()
        return math.hypot(north, east), down
