"""Standard messages of sensors: in a flight by sensors what these report, not what is made of it.

By the true state there are no sensors: receiver and IMU show that state.
"""

import math
from collections.abc import Callable

import numpy as np

from ftc_autopilot.estimation.health import ABSENT
from ftc_autopilot.hot.hot_state import HotState
from ftc_autopilot.vehicle.clock import VehicleClock
from ftc_autopilot.vehicle.message import message
from ftc_autopilot.vehicle.shown_state import ShownState, centidegrees
from mavlink_defs import dialect
from mavlink_defs.constants import ACCELEROMETER, BAROMETER, GNSS, GYRO, MAGNETOMETER, PITOT
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.float32 import float32s, whole_within
from sitl_plant.sensing.units import UPDATED, is_updated

_INT16, _UINT16, _UINT8 = 2**15 - 1, 2**16 - 1, 2**8 - 1
_TRUE_SATELLITES = 14
_TRUE_DILUTION = 80  # of precision, horizontal and vertical [1/100]
_TRUE_ACCURACY_MM, _TRUE_ACCURACY_MM_S = 800, 100
_MILLI_G = 1e3 / 9.80665
_FIELDS = {  # of HIL_SENSOR and HIGHRES_IMU, whose bits are the same
    ACCELEROMETER: ("xacc", "yacc", "zacc"),
    GYRO: ("xgyro", "ygyro", "zgyro"),
    MAGNETOMETER: ("xmag", "ymag", "zmag"),
    BAROMETER: ("abs_pressure", "pressure_alt", "temperature"),
    PITOT: ("diff_pressure",),
}
_POSITION = "fix_type", "lat", "lon", "alt", "eph", "epv"
_OF_RECEIVER = (*_POSITION, "vel", "cog", "satellites_visible", "yaw")  # as in HIL_GPS
_EVERY_S = 0.5  # GPS_RAW_INT
_RAW = dialect.MAV_DATA_STREAM_RAW_SENSORS


class HeardSensors:
    """Which sensors have been heard of late, by the estimator's limits of silence."""

    def __init__(self, hot: HotState) -> None:
        self._navigation = hot.navigation
        estimator = hot.navigation["estimator"]
        self._sensors, self._imus = estimator["sensors"], estimator["imus"]
        self._imu_silent_s = float(estimator["parameters"]["imu_silent_s"])
        self._step_s, self._count = hot.step_us * 1e-6, int(hot.navigation["count"])

    def is_heard(self, sensor: int) -> bool:
        """Return whether a sensor beside the IMUs has reported of late; a receiver, a fix."""
        one = self._sensors[sensor]
        if self._navigation["step"] < 0 or (sensor == GNSS and self._navigation["gps_step"] < 0):
            return False
        return bool(one["reason"] != ABSENT and one["silent"] <= one["most_silent"])

    def is_imu_heard(self, imu: int) -> bool:
        """Return whether gyro and accelerometer of an IMU, from 0, have reported of late."""
        if imu >= self._count or self._navigation["step"] < 0:
            return False
        return bool(self._imus[imu]["silent"] * self._step_s <= self._imu_silent_s)

    def is_receiver_heard(self) -> bool:
        """Return whether HIL_GPS has come of late, with a fix or without."""
        since = self._navigation["step"] - self._navigation["gps_step"]
        return bool(
            self._navigation["gps_step"] >= 0 and since <= self._sensors[GNSS]["most_silent"]
        )


class SensorMessages:
    """Makes the messages of sensors in a flight by sensors, from their last samples."""

    def __init__(self, hot: HotState, shown: ShownState, clock: VehicleClock) -> None:
        self._hot, self._shown, self._clock = hot, shown, clock
        self._navigation, self._heard = hot.navigation, HeardSensors(hot)

    @message(
        dialect.MAVLink_gps_raw_int_message,
        every_s=_EVERY_S,
        stream=dialect.MAV_DATA_STREAM_EXTENDED_STATUS,
    )
    def gps_raw_int(self) -> MAVLink_message:
        """Return GPS_RAW_INT: the last HIL_GPS, with the time of its measurement.

        Of a receiver that is silent all is unknown, as PX4 has it; one that is fitted has no fix.
        """
        if not self._heard.is_receiver_heard():
            sensor = self._navigation["estimator"]["sensors"][GNSS]
            fitted = sensor["reason"] != ABSENT
            return dialect.MAVLink_gps_raw_int_message(
                self._clock.boot_us,
                dialect.GPS_FIX_TYPE_NO_FIX if fitted else dialect.GPS_FIX_TYPE_NO_GPS,
                *(0, 0, 0),
                *(_UINT16,) * 4,
                _UINT8,
            )
        gps = self._navigation["gps"]
        given = {name: int(gps[name]) for name in _OF_RECEIVER}
        return dialect.MAVLink_gps_raw_int_message(self._boot_us(gps), **given)

    @message(dialect.MAVLink_highres_imu_message)
    def highres_imu(self) -> MAVLink_message:
        """Return HIGHRES_IMU: the last samples of the IMU that is flown by, and of IMU 1's sensors.

        `fields_updated` has the bits of sensors that are not silent; the others' values are NaN.
        """
        assert self._shown.report is not None
        imu = int(self._shown.report["imu"])
        own, first = self._navigation["imus"][imu], self._navigation["imus"][0]
        numbers, bits = dict[str, float](), 0
        for sensor, names in _FIELDS.items():
            sample = own if sensor in {ACCELEROMETER, GYRO} else first
            heard = self._is_given(sensor, imu)
            bits |= UPDATED[sensor] if heard else 0
            numbers |= {name: float(sample[name]) if heard else math.nan for name in names}
        return dialect.MAVLink_highres_imu_message(
            self._boot_us(own), **numbers, fields_updated=bits, id=imu
        )

    @message(dialect.MAVLink_scaled_imu_message, stream=_RAW)
    def scaled_imu(self) -> MAVLink_message | None:
        """Return SCALED_IMU of IMU 1, with the magnetometer; none while that IMU is silent."""
        return self._scaled(0, dialect.MAVLink_scaled_imu_message)

    @message(dialect.MAVLink_scaled_imu2_message, stream=_RAW)
    def scaled_imu2(self) -> MAVLink_message | None:
        """Return the same of IMU 2."""
        return self._scaled(1, dialect.MAVLink_scaled_imu2_message)

    @message(dialect.MAVLink_scaled_imu3_message, stream=_RAW)
    def scaled_imu3(self) -> MAVLink_message | None:
        """Return the same of IMU 3."""
        return self._scaled(2, dialect.MAVLink_scaled_imu3_message)

    @message(dialect.MAVLink_scaled_pressure_message, stream=_RAW)
    def scaled_pressure(self) -> MAVLink_message | None:
        """Return SCALED_PRESSURE of barometer and pitot tube; none while both are silent."""
        sample = self._navigation["imus"][0]
        barometer, pitot = (self._is_given(sensor, 0) for sensor in (BAROMETER, PITOT))
        if not barometer and not pitot:
            return None
        temperature = float(sample["temperature"]) if barometer else 0.0
        return dialect.MAVLink_scaled_pressure_message(
            self._boot_us(sample) // 1000 % 2**32,
            float(sample["abs_pressure"]) if barometer else math.nan,
            float(sample["diff_pressure"]) if pitot else math.nan,
            whole_within(100.0 * temperature, -_INT16, _INT16),
        )

    def _scaled(self, imu: int, kind: Callable[..., MAVLink_message]) -> MAVLink_message | None:
        if not self._heard.is_imu_heard(imu):
            return None
        sample = self._navigation["imus"][imu]
        has_field = imu == 0 and self._heard.is_heard(MAGNETOMETER)
        factors = {ACCELEROMETER: _MILLI_G, GYRO: 1e3, MAGNETOMETER: 1e3 if has_field else 0.0}
        return kind(
            self._boot_us(sample) // 1000 % 2**32,
            *(
                whole_within(factor * float(sample[name]), -_INT16, _INT16)
                for sensor, factor in factors.items()
                for name in _FIELDS[sensor]
            ),
        )

    def _is_given(self, sensor: int, imu: int) -> bool:
        """Return whether a sensor has reported of late; of gyro and accelerometer, of this IMU."""
        if sensor in {ACCELEROMETER, GYRO}:
            sample = self._navigation["imus"][imu]
            return self._heard.is_imu_heard(imu) or is_updated(sample, sensor)
        return self._heard.is_heard(sensor)

    def _boot_us(self, sample: np.void) -> int:
        """Return the time of a sample since boot [µs]; 0 of one before that, or of none."""
        age = self._hot.time_us - int(sample["time_usec"])
        return max(self._clock.boot_us - max(age, 0), 0)


class TrueStateSensors:
    """Makes the messages of sensors in a flight by the true state, which they show."""

    def __init__(self, shown: ShownState, clock: VehicleClock) -> None:
        self._shown, self._clock = shown, clock

    @message(
        dialect.MAVLink_gps_raw_int_message,
        every_s=_EVERY_S,
        stream=dialect.MAV_DATA_STREAM_EXTENDED_STATUS,
    )
    def gps_raw_int(self) -> MAVLink_message:
        """Return GPS_RAW_INT: the true position, stated as accurately as a receiver would."""
        place, (north, east, _) = self._shown.place, self._shown.velocity_ned
        return dialect.MAVLink_gps_raw_int_message(
            self._clock.boot_us,
            dialect.GPS_FIX_TYPE_3D_FIX,
            place.latitude,
            place.longitude,
            place.altitude,
            eph=_TRUE_DILUTION,
            epv=_TRUE_DILUTION,
            vel=whole_within(100.0 * math.hypot(north, east), 0, _UINT16 - 1),
            cog=centidegrees(math.atan2(east, north)),
            satellites_visible=_TRUE_SATELLITES,
            alt_ellipsoid=place.altitude,
            h_acc=_TRUE_ACCURACY_MM,
            v_acc=_TRUE_ACCURACY_MM,
            vel_acc=_TRUE_ACCURACY_MM_S,
        )

    @message(dialect.MAVLink_highres_imu_message)
    def highres_imu(self) -> MAVLink_message:
        """Return HIGHRES_IMU: specific force and rates; there is no other sensor."""
        shown = self._shown
        ax, ay, az, p, q, r = float32s((*shown.vector("specific_force"), *shown.vector("rates")))
        unknown = (math.nan,) * 7
        given = UPDATED[ACCELEROMETER] | UPDATED[GYRO]
        return dialect.MAVLink_highres_imu_message(
            self._clock.boot_us, ax, ay, az, p, q, r, *unknown, given
        )
