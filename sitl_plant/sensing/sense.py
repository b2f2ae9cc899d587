"""From the true motion of an aircraft to what its sensors report: HIL_SENSOR and HIL_GPS.

MAVLink's units and definitions: https://mavlink.io/en/messages/common.html#HIL_SENSOR. The record
of IMU 0 has magnetometer, barometer and pitot as well. A value that is not new stays in its record,
and its bit in `fields_updated` is not set.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from mavlink_defs.constants import ACCELEROMETER, BAROMETER, GNSS, GYRO, MAGNETOMETER, PITOT
from mavlink_defs.framing.codec import HIL_GPS, HIL_SENSOR, SIM_STATE
from mavlink_defs.origin import Origin, degrees_at
from mavlink_defs.runtime.jit import apart, compiled
from sitl_plant.airframe.rigid_body import R1
from sitl_plant.sensing.config import NavigationSensors
from sitl_plant.sensing.errors import AXES, CHANNELS, ERRORS, corrupt, is_due, turn_on
from sitl_plant.sensing.failures import Failures, SensorRange, fail, new_failures
from sitl_plant.sensing.geomagnetism import magnetic_field
from sitl_plant.sensing.standard_air import altitude_of, pressure_at, temperature_at
from sitl_plant.sensing.units import FAULT_NAMES, UPDATED, Unit, units_of
from sitl_plant.vec3 import Vec3, hypot, mul, mul_t, vec3

_CHANNEL = 300  # of the random numbers: this one and the next 360
_MOTION = 18  # rates, specific force, attitude, position, velocity, wind: three values each
_RATES, _FORCE, _ATTITUDE, _POSITION, _VELOCITY, _WIND = range(0, _MOTION, 3)

_HPA = 0.01  # of one Pa
_FIX_3D = 3
_UNKNOWN_YAW = 0

_degrees_at = compiled(degrees_at)

SITE = np.dtype(
    [
        ("latitude", "f8"),  # of the origin [deg]
        ("longitude", "f8"),
        ("altitude", "f8"),  # above mean sea level [m]
        ("field", "f8", (3,)),  # magnetic, NED [gauss]
        ("density", "f8"),  # of the air that the aircraft flies in [kg/m³]
        ("hdop", "f8"),
        ("vdop", "f8"),
        ("satellites", "i8"),
        ("step_us", "i8"),
        ("step", "i8"),  # of the last call of `sense`, -1: none
        ("delivered", "i8"),  # 1: it delivered a GNSS sample
    ]
)
"""Where an aircraft flies, as far as its sensors show it, and what they last did."""


class Sensing(NamedTuple):
    """The sensors of n aircraft, m IMUs and u sensors each, and what they report."""

    imus: np.ndarray  # (n, m), dtype HIL_SENSOR
    gps: np.ndarray  # (n,), dtype HIL_GPS
    sites: np.ndarray  # (n,), dtype SITE
    sensors: np.ndarray  # (n, u), dtype ERRORS
    samples: np.ndarray  # (n, u, AXES), the last sample of each
    motions: np.ndarray  # (n, longest delay + 1, _MOTION), the true motion of the last steps
    faults: Failures  # of the same sensors, in the same order


def sensing_of(
    navigation: NavigationSensors,
    origin: Origin,
    density_kg_m3: Mapping[int, float],
    seed: int,
    step_us: int,
) -> Sensing:
    """Return the sensors of aircraft before their first sample.

    Args:
        navigation: What each of them carries.
        origin: Where north = east = down = 0 is.
        density_kg_m3: Of the air in which each flies, by its system id.
        seed: Of their errors.
        step_us: Control period [µs].
    """
    n, systems = len(density_kg_m3), list(density_kg_m3)
    units = units_of(navigation, step_us)
    sites = np.zeros(n, SITE)
    for name, value in _site(origin).items():
        sites[name] = value
    sites["density"] = list(density_kg_m3.values())
    sites["hdop"], sites["vdop"] = navigation.gnss.hdop, navigation.gnss.vdop
    sites["satellites"] = navigation.gnss.satellites
    sites["step_us"], sites["step"] = step_us, -1
    sensors = np.zeros((n, len(units)), ERRORS)
    for i, system in enumerate(systems):
        for k, unit in enumerate(units):
            _set(sensors[i, k], unit, seed, system, step_us)
    imus = np.zeros((n, navigation.imus), HIL_SENSOR)
    imus["id"] = range(navigation.imus)
    depth = max(unit.late for unit in units) + 1
    return Sensing(
        imus,
        np.zeros(n, HIL_GPS),
        sites,
        sensors,
        np.zeros((n, len(units), AXES)),
        np.zeros((n, depth, _MOTION)),
        new_failures([range_of(unit) for unit in units], systems, seed, step_us),
    )


def _site(origin: Origin) -> dict[str, object]:
    return {
        "latitude": origin.latitude_deg,
        "longitude": origin.longitude_deg,
        "altitude": origin.altitude_m,
        "field": magnetic_field(origin),
    }


def _set(sensor: np.void, unit: Unit, seed: int, system: int, step_us: int) -> None:
    sensor["kind"], sensor["imu"] = unit.kind, unit.imu
    sensor["axes"] = len(unit.errors.noise)
    sensor["seed"], sensor["system"] = seed, system
    sensor["channel"] = _CHANNEL + CHANNELS * (len(FAULT_NAMES) * unit.imu + unit.kind - 1)
    sensor["every"], sensor["late"] = unit.every, unit.late
    turn_on(sensor, unit.errors, unit.every * step_us / 1e6)


def range_of(unit: Unit) -> SensorRange:
    """Return a sensor as its faults know it."""
    errors = unit.errors
    return SensorRange(FAULT_NAMES[unit.kind], unit.imu + 1, errors.noise, errors.low, errors.high)


@apart(sensing=sensing_of(NavigationSensors(), Origin(), {}, 0, 1000), message=SIM_STATE)
def sense(sensing: Sensing, i: int, step: int, message: np.void) -> bool:
    """Write what the sensors of an aircraft report in a step.

    A second call for the same step makes the same.

    Args:
        sensing: Sensors of all aircraft; `imus[i]` and `gps[i]` are what this one reports.
        i: Index of the aircraft.
        step: Step number.
        message: The true motion, of dtype `mavlink_defs.framing.codec.SIM_STATE`.

    Returns:
        Whether `gps[i]` is a new sample, whose `time_usec` is the time of its measurement.
    """
    site = sensing.sites[i]
    if site["step"] == step:
        return bool(site["delivered"] == 1)
    site["step"], site["delivered"] = step, 0
    _remember(sensing.motions[i], step, message)
    for imu in range(sensing.imus.shape[1]):
        sensing.imus[i, imu]["time_usec"] = message["time_usec"]
        sensing.imus[i, imu]["fields_updated"] = 0
    t = message["time_usec"] / 1e6
    for k in range(sensing.sensors.shape[1]):
        sensor, values = sensing.sensors[i, k], sensing.samples[i, k]
        measured = max(step - sensor["late"], 0)
        fresh = is_due(sensor, step)
        if fresh:
            motion = sensing.motions[i, measured % sensing.motions.shape[1]]
            _measure(sensor["kind"], site, motion, values)
            corrupt(sensor, measured, values)
        if not fail(sensing.faults, i, k, step, t, values, fresh):
            continue
        if sensor["kind"] == GNSS:
            _write_gps(sensing.gps[i], site, measured, values)
            site["delivered"] = 1
        else:
            _write(sensing.imus[i, sensor["imu"]], sensor["kind"], values)
    return bool(site["delivered"] == 1)


@compiled
def _remember(motions: np.ndarray, step: int, message: np.void) -> None:
    now = motions[step % len(motions)]
    for axis in range(3):
        now[_RATES + axis] = message["rates"][axis]
        now[_FORCE + axis] = message["specific_force"][axis]
        now[_ATTITUDE + axis] = message["attitude"][axis]
        now[_POSITION + axis] = message["position"][axis]
        now[_VELOCITY + axis] = message["velocity"][axis]
        now[_WIND + axis] = message["wind"][axis]


@compiled
def _measure(kind: int, site: np.void, motion: np.ndarray, values: np.ndarray) -> None:
    """Write the true values that a sensor measures, in the units of its samples."""
    if kind == GYRO:
        _put(values, 0, vec3(motion[_RATES:]))
    elif kind == ACCELEROMETER:
        _put(values, 0, vec3(motion[_FORCE:]))
    elif kind == MAGNETOMETER:
        _put(values, 0, mul_t(R1(vec3(motion[_ATTITUDE:])), vec3(site["field"])))
    elif kind == BAROMETER:
        values[0] = pressure_at(site["altitude"] - motion[_POSITION + 2])
    elif kind == PITOT:
        ahead = max(motion[_VELOCITY] - motion[_WIND], 0.0)  # through the air, along x
        values[0] = 0.5 * site["density"] * ahead * ahead * _HPA
    else:
        _put(values, 0, vec3(motion[_POSITION:]))
        _put(values, 3, mul(R1(vec3(motion[_ATTITUDE:])), vec3(motion[_VELOCITY:])))


@compiled
def _put(values: np.ndarray, first: int, vector: Vec3) -> None:
    for axis in range(3):
        values[first + axis] = vector[axis]


@compiled
def _write(imu: np.void, kind: int, values: np.ndarray) -> None:
    """Write a sample to an HIL_SENSOR payload."""
    if kind == GYRO:
        imu["xgyro"], imu["ygyro"], imu["zgyro"] = values[0], values[1], values[2]
    elif kind == ACCELEROMETER:
        imu["xacc"], imu["yacc"], imu["zacc"] = values[0], values[1], values[2]
    elif kind == MAGNETOMETER:
        imu["xmag"], imu["ymag"], imu["zmag"] = values[0], values[1], values[2]
    elif kind == BAROMETER:
        altitude = altitude_of(values[0])
        imu["abs_pressure"], imu["pressure_alt"] = values[0], altitude
        imu["temperature"] = temperature_at(altitude)
    else:
        imu["diff_pressure"] = values[0]
    imu["fields_updated"] |= UPDATED[kind]


@compiled
def _write_gps(gps: np.void, site: np.void, measured: int, values: np.ndarray) -> None:
    """Write a sample of the GNSS receiver to an HIL_GPS payload."""
    latitude, longitude = _degrees_at(values[0], values[1], site["latitude"], site["longitude"])
    north, east, down = values[3], values[4], values[5]
    course = math.degrees(math.atan2(east, north)) % 360.0
    gps["time_usec"] = measured * site["step_us"]
    gps["fix_type"] = _FIX_3D
    gps["lat"] = round(min(max(latitude, -90.0), 90.0) * 1e7)
    gps["lon"] = round(longitude * 1e7)
    gps["alt"] = round((site["altitude"] - values[2]) * 1e3)
    gps["eph"], gps["epv"] = round(site["hdop"] * 100.0), round(site["vdop"] * 100.0)
    gps["vel"] = round(hypot(north, east) * 100.0)
    gps["vn"], gps["ve"] = round(north * 100.0), round(east * 100.0)
    gps["vd"] = round(down * 100.0)
    gps["cog"] = round(course * 100.0) % 36000
    gps["satellites_visible"] = site["satellites"]
    gps["yaw"] = _UNKNOWN_YAW
