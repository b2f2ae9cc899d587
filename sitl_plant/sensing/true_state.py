"""Sensors: from the true motion to what an aircraft measures of it.

A sample is the truth of an earlier step (latency), plus bias, its random walk and white noise,
rounded to the resolution; it is held until the next one is taken.
"""

import math
from collections.abc import Sequence

import numpy as np

from mavlink_defs.runtime.jit import compiled
from sitl_plant.air.gaussian import normal
from sitl_plant.sensing.config import Sensor, Sensors
from sitl_plant.sensing.units import periods_between
from sitl_plant.vec3 import norm, scale, sub, vec3

AXES = 10
"""Measured quantities: gyro x, y, z, accelerometer x, y, z, roll, pitch, yaw, airspeed."""

_AIRSPEED = 9

_DRIFT_CHANNEL = 100  # of the random numbers; the noise has the axes' own

_EACH = (AXES,)

SENSORS = np.dtype(
    [
        ("ideal", "i8"),  # 1: they measure the true values
        ("exact_airspeed", "i8"),  # 1: the sensor of the airspeed does
        ("seed", "i8"),
        ("system", "i8"),  # the aircraft's id
        ("noise", "f8", _EACH),  # errors in SI units and rad
        ("bias", "f8", _EACH),
        ("walk", "f8", _EACH),  # standard deviation of the drift's step from sample to sample
        ("resolution", "f8", _EACH),
        ("every", "i8", _EACH),  # control periods from sample to sample
        ("late", "i8", _EACH),  # control periods
        ("sampled", "i8"),  # step of the last measurement, -1: none
        ("drift", "f8", _EACH),
        ("held", "f8", _EACH),  # the last samples
    ]
)
"""The sensors of one aircraft and their state."""


def new_sensors(config: Sensors, systems: Sequence[int], seed: int, step_us: int) -> np.ndarray:
    """Return the sensors of n aircraft before their first measurement, dtype `SENSORS`, (n,)."""
    record = np.zeros(1, SENSORS)[0]
    record["ideal"] = config.exact
    record["exact_airspeed"] = config.airspeed_m_s == Sensor()
    record["seed"] = seed
    record["sampled"] = -1
    degree = math.radians(1.0)
    units = {"gyro_deg_s": degree, "accelerometer_m_s2": 1.0, "attitude_deg": degree}
    for k, (name, unit) in enumerate(units.items()):
        for axis in range(3):
            _fill(record, 3 * k + axis, getattr(config, name), unit, step_us)
    _fill(record, _AIRSPEED, config.airspeed_m_s, 1.0, step_us)
    sensors = np.array([record] * len(systems))
    sensors["system"] = systems
    return sensors


def true_motions(sensors: np.ndarray) -> np.ndarray:
    """Return a memory of what n aircraft's sensors measure, shape (n, longest delay + 1, AXES)."""
    depth = int(sensors["late"].max()) + 1
    return np.zeros((len(sensors), depth, AXES))


def _fill(record: np.void, k: int, sensor: Sensor, unit: float, step_us: int) -> None:
    """Write a sensor to a record; `unit` is the unit of the configuration in SI units."""
    every = periods_between(sensor.rate_hz, step_us)
    record["noise"][k] = sensor.noise_rms * unit
    record["bias"][k] = sensor.bias * unit
    record["walk"][k] = sensor.bias_drift * unit * math.sqrt(every * step_us / 1e6)
    record["resolution"][k] = sensor.resolution * unit
    record["every"][k] = every
    record["late"][k] = round(sensor.latency_s * 1e6 / step_us)


@compiled
def measure(sensors: np.void, truth: np.ndarray, step: int, message: np.void) -> None:
    """Replace the true motion in an FTC_SIM_STATE payload by what an aircraft's sensors show.

    A second call for the same step makes the same measurement.

    Args:
        sensors: Record of dtype `SENSORS`, updated in place.
        truth: Memory of what they measure, shape (depth, AXES), updated in place.
        step: Step number.
        message: Payload of dtype `mavlink_defs.framing.codec.SIM_STATE`.
    """
    if sensors["ideal"] == 1:
        return
    if sensors["sampled"] != step:
        _sample(sensors, truth, step, message)
        sensors["sampled"] = step
    held = sensors["held"]
    for axis in range(3):
        message["rates"][axis] = held[axis]
        message["specific_force"][axis] = held[3 + axis]
        message["attitude"][axis] = held[6 + axis]
    if sensors["exact_airspeed"] == 0:
        _set_airspeed(message, held[_AIRSPEED])


@compiled
def _set_airspeed(message: np.void, airspeed: float) -> None:
    """Scale the velocity through the air to another length; the one over ground stays."""
    v, wind = vec3(message["velocity"]), vec3(message["wind"])
    through = sub(v, wind)
    true = norm(through)
    measured = scale(airspeed / true, through) if true > 0.0 else (airspeed, 0.0, 0.0)
    for axis in range(3):
        message["wind"][axis] = v[axis] - measured[axis]


@compiled
def _sample(sensors: np.void, truth: np.ndarray, step: int, message: np.void) -> None:
    depth, first = len(truth), sensors["sampled"] < 0
    now = truth[step % depth]
    for axis in range(3):
        now[axis] = message["rates"][axis]
        now[3 + axis] = message["specific_force"][axis]
        now[6 + axis] = message["attitude"][axis]
    now[_AIRSPEED] = norm(sub(vec3(message["velocity"]), vec3(message["wind"])))
    seed, system = sensors["seed"], sensors["system"]
    for k in range(AXES):
        if first:
            truth[:, k] = now[k]
        elif step % sensors["every"][k] != 0:
            continue
        walk, noise, resolution = sensors["walk"][k], sensors["noise"][k], sensors["resolution"][k]
        if walk > 0.0 and not first:
            sensors["drift"][k] += walk * normal(seed, system, _DRIFT_CHANNEL + k, step)
        value = truth[(step - sensors["late"][k]) % depth, k]
        value += sensors["bias"][k] + sensors["drift"][k]
        if noise > 0.0:
            value += noise * normal(seed, system, k, step)
        if resolution > 0.0:
            value = round(value / resolution) * resolution
        sensors["held"][k] = value
