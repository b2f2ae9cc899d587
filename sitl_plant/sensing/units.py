"""The sensors of an aircraft one by one, from its configuration: their errors and their times.

Samples have the units of the messages that carry them: gyro rad/s, accelerometer m/s², magnetometer
gauss, barometer and pitot hPa; of the GNSS receiver position [m] and velocity [m/s], NED.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple, TypeAlias

import numpy as np

from mavlink_defs import dialect
from mavlink_defs.constants import ACCELEROMETER, BAROMETER, GNSS, GYRO, MAGNETOMETER, PITOT
from mavlink_defs.faults.sensors import SENSOR_NAMES
from mavlink_defs.runtime.jit import compiled
from sitl_plant.sensing.config import (
    Accelerometer,
    Barometer,
    Gnss,
    Gyro,
    Magnetometer,
    NavigationSensors,
    Pitot,
)
from sitl_plant.sensing.errors import SensorErrors, gauss_markov, white_noise

FAULT_NAMES = ("", *SENSOR_NAMES)
"""Names of the kinds in faults of sensors."""

_DERIVED = dialect.HIL_SENSOR_UPDATED_PRESSURE_ALT | dialect.HIL_SENSOR_UPDATED_TEMPERATURE
UPDATED = (
    0,
    dialect.HIL_SENSOR_UPDATED_XGYRO
    | dialect.HIL_SENSOR_UPDATED_YGYRO
    | dialect.HIL_SENSOR_UPDATED_ZGYRO,
    dialect.HIL_SENSOR_UPDATED_XACC
    | dialect.HIL_SENSOR_UPDATED_YACC
    | dialect.HIL_SENSOR_UPDATED_ZACC,
    dialect.HIL_SENSOR_UPDATED_XMAG
    | dialect.HIL_SENSOR_UPDATED_YMAG
    | dialect.HIL_SENSOR_UPDATED_ZMAG,
    dialect.HIL_SENSOR_UPDATED_ABS_PRESSURE | _DERIVED,
    0,  # a GNSS receiver has a message of its own
    dialect.HIL_SENSOR_UPDATED_DIFF_PRESSURE,
)
"""Bits of HIL_SENSOR's `fields_updated` that a sample of each kind sets."""

AnySensor: TypeAlias = Gyro | Accelerometer | Magnetometer | Barometer | Pitot | Gnss

_HPA = 0.01  # of one Pa
_FARTHEST_M = 1e6  # from the origin: what `ftc_autopilot.common.geography` can place
_MAX_SPEED_M_S = 327.0  # what HIL_GPS can hold


class Unit(NamedTuple):
    """One sensor of an aircraft.

    Attributes:
        kind: What it measures, `mavlink_defs.constants.GYRO` and so on.
        imu: Which IMU it belongs to, from 0.
        every: Control periods from sample to sample.
        late: Control periods from measurement to report.
        errors: Its errors.
    """

    kind: int
    imu: int
    every: int
    late: int
    errors: SensorErrors


@compiled
def is_updated(message: np.void, kind: int) -> bool:
    """Return whether an HIL_SENSOR payload has a new sample of a kind, all that is measured."""
    measured = UPDATED[kind] & ~_DERIVED
    return int(message["fields_updated"]) & measured == measured


def units_of(sensors: NavigationSensors, step_us: int) -> list[Unit]:
    """Return the sensors that an aircraft has, at a control period [us]."""
    return [
        Unit(
            kind,
            imu,
            periods_between(sensor.rate_hz, step_us),
            round(sensor.latency_s * 1e6 / step_us),
            _errors(sensor, periods_between(sensor.rate_hz, step_us) * step_us / 1e6),
        )
        for kind, imu, sensor in _fitted(sensors)
    ]


def periods_between(rate_hz: float | None, step_us: int) -> int:
    """Return the control periods [us] from sample to sample, at least 1; without a rate, 1."""
    return 1 if rate_hz is None else max(round(1e6 / (rate_hz * step_us)), 1)


def _fitted(sensors: NavigationSensors) -> Iterator[tuple[int, int, AnySensor]]:
    """Yield kind, IMU and configuration of each sensor that there is."""
    for imu in range(sensors.imus):
        yield GYRO, imu, sensors.gyro
        yield ACCELEROMETER, imu, sensors.accelerometer
    if sensors.magnetometer.fitted:
        yield MAGNETOMETER, 0, sensors.magnetometer
    if sensors.barometer.fitted:
        yield BAROMETER, 0, sensors.barometer
    if sensors.gnss.fitted:
        yield GNSS, 0, sensors.gnss
    if sensors.pitot.fitted:
        yield PITOT, 0, sensors.pitot


def _errors(sensor: AnySensor, period_s: float) -> SensorErrors:
    """Return the errors of a sensor with a sample each period [s]."""
    if isinstance(sensor, Gyro):
        return _of_gyro(sensor, period_s)
    if isinstance(sensor, Accelerometer):
        return _of_accelerometer(sensor, period_s)
    if isinstance(sensor, Magnetometer):
        return SensorErrors(
            noise=(sensor.noise_gauss,) * 3,
            drift=(sensor.bias_instability_gauss,) * 3,
            correlation_s=sensor.correlation_s,
            bias=(sensor.hard_iron_gauss,) * 3,
            low=(-sensor.range_gauss,) * 3,
            high=(sensor.range_gauss,) * 3,
            resolution=(sensor.resolution_gauss,) * 3,
            scale=sensor.scale_error,
            misalignment=math.radians(sensor.misalignment_deg),
        )
    if isinstance(sensor, Gnss):
        return _of_gnss(sensor)
    is_pitot = isinstance(sensor, Pitot)
    return SensorErrors(
        noise=(sensor.noise_pa * _HPA,),
        drift=(sensor.bias_instability_pa * _HPA,),
        correlation_s=sensor.correlation_s,
        bias=(sensor.turn_on_bias_pa * _HPA,),
        low=(-sensor.range_pa * _HPA if is_pitot else 1.0,),  # a barometer has no vacuum to show
        high=(sensor.range_pa * _HPA,),
        resolution=(sensor.resolution_pa * _HPA,),
        scale=sensor.scale_error if isinstance(sensor, Pitot) else 0.0,
    )


def _of_gyro(gyro: Gyro, period_s: float) -> SensorErrors:
    return SensorErrors(
        noise=(white_noise(math.radians(gyro.noise_density_deg_s_sqrt_hz), period_s),) * 3,
        drift=(gauss_markov(math.radians(gyro.bias_instability_deg_h) / 3600.0),) * 3,
        correlation_s=gyro.correlation_s,
        bias=(math.radians(gyro.turn_on_bias_deg_s),) * 3,
        low=(-math.radians(gyro.range_deg_s),) * 3,
        high=(math.radians(gyro.range_deg_s),) * 3,
        resolution=(math.radians(gyro.resolution_deg_s),) * 3,
        scale=gyro.scale_error,
        misalignment=math.radians(gyro.misalignment_deg),
    )


def _of_accelerometer(accelerometer: Accelerometer, period_s: float) -> SensorErrors:
    return SensorErrors(
        noise=(white_noise(accelerometer.noise_density_m_s2_sqrt_hz, period_s),) * 3,
        drift=(gauss_markov(accelerometer.bias_instability_m_s2),) * 3,
        correlation_s=accelerometer.correlation_s,
        bias=(accelerometer.turn_on_bias_m_s2,) * 3,
        low=(-accelerometer.range_m_s2,) * 3,
        high=(accelerometer.range_m_s2,) * 3,
        resolution=(accelerometer.resolution_m_s2,) * 3,
        scale=accelerometer.scale_error,
        misalignment=math.radians(accelerometer.misalignment_deg),
    )


def _of_gnss(gnss: Gnss) -> SensorErrors:
    farthest = (_FARTHEST_M,) * 3 + (_MAX_SPEED_M_S,) * 3
    flat, level = gnss.horizontal_noise_m, gnss.horizontal_velocity_noise_m_s
    return SensorErrors(
        noise=(flat, flat, gnss.vertical_noise_m, level, level, gnss.vertical_velocity_noise_m_s),
        drift=(gnss.horizontal_error_m,) * 2 + (gnss.vertical_error_m,) + (0.0,) * 3,
        correlation_s=gnss.correlation_s,
        bias=(0.0,) * 6,
        low=tuple(-most for most in farthest),
        high=farthest,
        resolution=(0.0,) * 6,  # the message has its own
    )
