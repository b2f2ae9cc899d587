"""What an estimated state reports to ground stations: messages, texts, health of the sensors.

A vehicle that is handed its true state has no estimator: it says that all is known, exactly.
"""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from ftc_autopilot.common.geography import Origin, place_of
from ftc_autopilot.estimation.health import ABSENT, REASONS, WELL
from ftc_autopilot.estimation.state import N_SENSORS, PHI
from ftc_autopilot.hot.hot_state import HotState
from ftc_autopilot.vehicle.changes import Change
from ftc_autopilot.vehicle.clock import VehicleClock
from ftc_autopilot.vehicle.flight_path import VehicleHome
from ftc_autopilot.vehicle.message import message
from ftc_autopilot.vehicle.state_messages import quaternion_of
from mavlink_defs import dialect
from mavlink_defs.constants import BAROMETER, GNSS, MAGNETOMETER, PITOT
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.float32 import float32s
from sitl_plant.airframe.rigid_body import R1
from sitl_plant.vec3 import mul, vec3

# ESTIMATOR_STATUS_FLAGS and EKF_STATUS_FLAGS have the same values up to here
_ALL_KNOWN = 0b11_0111_1111
_MOVING = (
    dialect.ESTIMATOR_ATTITUDE
    | dialect.ESTIMATOR_VELOCITY_HORIZ
    | dialect.ESTIMATOR_VELOCITY_VERT
    | dialect.ESTIMATOR_POS_HORIZ_REL
    | dialect.ESTIMATOR_PRED_POS_HORIZ_REL
    | dialect.ESTIMATOR_POS_VERT_ABS
)
_PLACED = dialect.ESTIMATOR_POS_HORIZ_ABS | dialect.ESTIMATOR_PRED_POS_HORIZ_ABS

_HEALTH = {
    MAGNETOMETER: dialect.MAV_SYS_STATUS_SENSOR_3D_MAG,
    BAROMETER: dialect.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE,
    PITOT: dialect.MAV_SYS_STATUS_SENSOR_DIFFERENTIAL_PRESSURE,
    GNSS: dialect.MAV_SYS_STATUS_SENSOR_GPS,
}
_INERTIAL = dialect.MAV_SYS_STATUS_SENSOR_3D_GYRO | dialect.MAV_SYS_STATUS_SENSOR_3D_ACCEL

_NAMES = {MAGNETOMETER: "magnetometer", BAROMETER: "barometer", PITOT: "pitot", GNSS: "GNSS"}
_RATIOS = GNSS, BAROMETER, MAGNETOMETER, PITOT
_INSTEAD = {
    MAGNETOMETER: "heading by course and gyros",
    BAROMETER: "height by GNSS",
    PITOT: "airspeed by wind and model",
    GNSS: "dead reckoning",
}


class EstimatorMessages:
    """Makes messages and texts from the estimate of the last step."""

    def __init__(
        self, hot: HotState, origin: Origin, home: VehicleHome, clock: VehicleClock
    ) -> None:
        self._hot, self._origin, self._home, self._clock = hot, origin, home, clock
        estimator, self._imus = hot.navigation["estimator"], int(hot.navigation["count"])
        self._report: np.void | None = estimator["report"] if self._imus else None
        self._filters, self._gate = estimator["filters"], float(estimator["parameters"]["gate"])
        self._said = [WELL] * N_SENSORS
        self._said_imus = [WELL] * self._imus
        self._said_resets = 0

    @message(dialect.MAVLink_estimator_status_message)
    def estimator_status(self) -> MAVLink_message:
        """Return ESTIMATOR_STATUS: each innovation over the limit of its test."""
        gnss, height, heading, airspeed = self._ratios()
        numbers = (gnss, gnss, height, heading, 0.0, airspeed, *self._accuracy())
        return dialect.MAVLink_estimator_status_message(
            self._clock.boot_us, self.flags(), *float32s(numbers)
        )

    @message(dialect.MAVLink_ekf_status_report_message)
    def ekf_status_report(self) -> MAVLink_message:
        """Return EKF_STATUS_REPORT: the same as ArduPilot's stations have it."""
        gnss, height, heading, airspeed = self._ratios()
        numbers = float32s((gnss, gnss, height, heading, 0.0, airspeed))
        return dialect.MAVLink_ekf_status_report_message(self.flags(), *numbers)

    @message(dialect.MAVLink_attitude_quaternion_cov_message)
    def attitude_quaternion_cov(self) -> MAVLink_message:
        """Return ATTITUDE_QUATERNION_COV: the variances of roll, pitch and yaw, too."""
        measured = self._hot.measured
        attitude = measured["attitude"].tolist()
        p, q, r = float32s(measured["rates"].tolist())
        return dialect.MAVLink_attitude_quaternion_cov_message(
            self._clock.boot_us,
            float32s(quaternion_of(*attitude)),
            *(p, q, r),
            float32s(self._attitude_covariance(attitude).ravel().tolist()),
        )

    @message(dialect.MAVLink_global_position_int_cov_message)
    def global_position_int_cov(self) -> MAVLink_message:
        """Return GLOBAL_POSITION_INT_COV: variances of position and velocity, NED."""
        measured = self._hot.measured
        position = measured["position"].tolist()
        place = place_of(self._origin, *position)
        attitude = vec3(measured["attitude"])
        vx, vy, vz = float32s(mul(R1(attitude), vec3(measured["velocity"])))
        variances = [0.0] * 6
        if self._report is not None:
            both = *self._report["position_std"].tolist(), *self._report["velocity_std"].tolist()
            variances = [one * one for one in both]
        return dialect.MAVLink_global_position_int_cov_message(
            self._clock.boot_us,
            dialect.MAV_ESTIMATOR_TYPE_GPS_INS,
            place.latitude,
            place.longitude,
            place.altitude,
            place.height - round(1e3 * self._home.at.height_m),
            *(vx, vy, vz),
            float32s(np.diag(variances).ravel().tolist()),
        )

    def flags(self) -> int:
        """Return ESTIMATOR_STATUS_FLAGS."""
        if self._report is None:
            return _ALL_KNOWN
        if not self._report["aligned"]:
            return 0
        return _MOVING if self._report["dead_reckoning"] else _MOVING | _PLACED

    def healthy(self, sensors: int) -> int:
        """Return a set of MAV_SYS_STATUS_SENSOR without the excluded ones."""
        report = self._report
        if report is None:
            return sensors
        for sensor, bit in _HEALTH.items():
            if report["reasons"][sensor] != WELL:
                sensors &= ~bit
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
        at = f"at {self._hot.time_us * 1e-6:.2f} s"
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
            reason, before = int(report["reasons"][sensor]), self._said[sensor]
            self._said[sensor] = reason
            if reason in {before, ABSENT}:
                continue
            if reason == WELL:
                yield Change(name, dialect.MAV_SEVERITY_NOTICE, f"{name} back in use {at}")
            elif before == WELL:
                text = f"{name} excluded {at}: {REASONS[reason]}, {_INSTEAD[sensor]}"
                yield Change(name, dialect.MAV_SEVERITY_WARNING, text)
        resets, self._said_resets = self._said_resets, int(report["resets"])
        if self._said_resets > resets:
            yield Change("estimate", dialect.MAV_SEVERITY_WARNING, f"estimate reset {at}")

    def _flown_by(self) -> str:
        assert self._report is not None
        imu = int(self._report["imu"])
        if self._imu_reasons()[imu] == WELL:
            return f"flying by IMU {imu + 1}"
        return f"no IMU passes its test, IMU {imu + 1} is the best"

    def _imu_reasons(self) -> Sequence[int]:
        assert self._report is not None
        reasons: list[int] = self._report["imu_reasons"][: self._imus].tolist()
        return reasons

    def _ratios(self) -> list[float]:
        """Return the last innovations over the limits of their tests: as in `_RATIOS`."""
        if self._report is None:
            return [0.0] * len(_RATIOS)
        squares = (max(float(self._report["ratios"][sensor]), 0.0) for sensor in _RATIOS)
        return [math.sqrt(square / self._gate) for square in squares]

    def _accuracy(self) -> tuple[float, float]:
        """Return the standard deviations of the position, horizontal and vertical [m]."""
        if self._report is None:
            return 0.0, 0.0
        north, east, down = self._report["position_std"].tolist()
        return math.hypot(north, east), down

    def _attitude_covariance(self, attitude: Sequence[float]) -> np.ndarray:
        """Return the covariance of roll, pitch and yaw [rad²], shape (3, 3).

        From the covariance of a small turn in NED axes, by the rates of the Euler angles in a turn:
        J. Solà, Quaternion kinematics for the error-state Kalman filter, 2017, section 4.
        """
        if self._report is None:
            return np.zeros((3, 3))
        P = self._filters[int(self._report["imu"])]["P"][PHI : PHI + 3, PHI : PHI + 3]
        _, pitch, yaw = attitude
        if not math.isfinite(pitch + yaw):
            return np.full((3, 3), math.nan)
        c, s = math.cos(yaw), math.sin(yaw)
        J = np.array(
            [
                [c / math.cos(pitch), s / math.cos(pitch), 0.0],
                [-s, c, 0.0],
                [c * math.tan(pitch), s * math.tan(pitch), 1.0],
            ]
        )
        covariance: np.ndarray = J @ P @ J.T
        return covariance
