"""Sensors: from the true motion to what an aircraft measures of it.

A sample is the truth of an earlier step (latency), plus bias, its random walk and white noise,
rounded to the resolution; it is held until the next one is taken.
"""

import math
from typing import NamedTuple

import numpy as np

from mavlink_defs.runtime.jit import compiled
from sitl_plant.config import PlantConfig
from sitl_plant.gaussian import normal
from sitl_plant.hardware import Sensor, Sensors
from sitl_plant.vec3 import norm, scale, sub, vec3

__all__ = ["AXES", "Sensing", "measure", "new_sensing"]

AXES = 10
"""Measured quantities: gyro x, y, z, accelerometer x, y, z, roll, pitch, yaw, airspeed."""

_AIRSPEED = 9

_DRIFT_CHANNEL = 100  # of the random numbers; those of the noise are the axes' own

SENSOR = np.dtype(
    [
        ("noise", "f8"),  # errors in SI units and rad
        ("bias", "f8"),
        ("walk", "f8"),  # standard deviation of the drift's step from sample to sample
        ("resolution", "f8"),
        ("every", "i8"),  # control periods from sample to sample
        ("late", "i8"),  # control periods
    ]
)


class Sensing(NamedTuple):
    """The sensors of n aircraft, and their state."""

    ideal: bool  # nothing is done
    exact_airspeed: bool  # nothing is done to the wind
    sensors: np.ndarray  # (AXES,), dtype SENSOR
    seed: int
    systems: np.ndarray  # (n,), system ids
    sampled: np.ndarray  # (n,), step of the last measurement, -1: none
    truth: np.ndarray  # (n, depth, AXES), the true values of the last steps
    drift: np.ndarray  # (n, AXES)
    held: np.ndarray  # (n, AXES), the last samples


def new_sensing(config: PlantConfig) -> Sensing:
    """Return the sensors of a configuration's aircraft before their first measurement."""
    sensors = np.zeros(AXES, SENSOR)
    degree = math.radians(1.0)
    units = {"gyro_deg_s": degree, "accelerometer_m_s2": 1.0, "attitude_deg": degree}
    for k, (name, unit) in enumerate(units.items()):
        for axis in range(3):
            _fill(sensors[3 * k + axis], getattr(config.sensors, name), unit, config.step_us)
    _fill(sensors[_AIRSPEED], config.sensors.airspeed_m_s, 1.0, config.step_us)
    n = len(config.uavs)
    return Sensing(
        ideal=config.sensors == Sensors(),
        exact_airspeed=config.sensors.airspeed_m_s == Sensor(),
        sensors=sensors,
        seed=config.seed,
        systems=np.array([uav.id for uav in config.uavs]),
        sampled=np.full(n, -1),
        truth=np.zeros((n, int(sensors["late"].max()) + 1, AXES)),
        drift=np.zeros((n, AXES)),
        held=np.zeros((n, AXES)),
    )


def _fill(record: np.void, sensor: Sensor, unit: float, step_us: int) -> None:
    """Write a sensor to a record; `unit` is that of the configuration in SI units."""
    every = 1 if sensor.rate_hz is None else round(1e6 / (sensor.rate_hz * step_us))
    record["noise"] = sensor.noise_rms * unit
    record["bias"] = sensor.bias * unit
    record["walk"] = sensor.bias_drift * unit * math.sqrt(every * step_us / 1e6)
    record["resolution"] = sensor.resolution * unit
    record["every"] = every
    record["late"] = round(sensor.latency_s * 1e6 / step_us)


@compiled
def measure(sensing: Sensing, i: int, step: int, message: np.void) -> None:
    """Replace the true motion in an FTC_SIM_STATE payload by what aircraft i's sensors show.

    A second call for the same step makes the same measurement.

    Args:
        sensing: The sensors; their state is updated.
        i: Index of the aircraft.
        step: Step number.
        message: Payload of dtype `mavlink_defs.framing.codec.SIM_STATE`.
    """
    if sensing.ideal:
        return
    if sensing.sampled[i] != step:
        _sample(sensing, i, step, message)
        sensing.sampled[i] = step
    held = sensing.held[i]
    for axis in range(3):
        message["rates"][axis] = held[axis]
        message["specific_force"][axis] = held[3 + axis]
        message["attitude"][axis] = held[6 + axis]
    if not sensing.exact_airspeed:
        _set_airspeed(message, held[_AIRSPEED])


@compiled
def _set_airspeed(message: np.void, airspeed: float) -> None:
    """Scale the velocity through the air to another length; the one over ground stays."""
    v, wind = vec3(message["velocity"]), vec3(message["wind"])
    through = sub(v, wind)
    measured = scale(airspeed / norm(through), through)
    for axis in range(3):
        message["wind"][axis] = v[axis] - measured[axis]


@compiled
def _sample(sensing: Sensing, i: int, step: int, message: np.void) -> None:
    truth, held, drift = sensing.truth[i], sensing.held[i], sensing.drift[i]
    depth, system, first = len(truth), sensing.systems[i], sensing.sampled[i] < 0
    for axis in range(3):
        truth[step % depth, axis] = message["rates"][axis]
        truth[step % depth, 3 + axis] = message["specific_force"][axis]
        truth[step % depth, 6 + axis] = message["attitude"][axis]
    through = sub(vec3(message["velocity"]), vec3(message["wind"]))
    truth[step % depth, _AIRSPEED] = norm(through)
    for k in range(AXES):
        sensor = sensing.sensors[k]
        if first:
            truth[:, k] = truth[step % depth, k]
        if step % sensor["every"] != 0 and not first:
            continue
        if sensor["walk"] > 0.0 and not first:
            drift[k] += sensor["walk"] * normal(sensing.seed, system, _DRIFT_CHANNEL + k, step)
        value = truth[(step - sensor["late"]) % depth, k] + sensor["bias"] + drift[k]
        if sensor["noise"] > 0.0:
            value += sensor["noise"] * normal(sensing.seed, system, k, step)
        if sensor["resolution"] > 0.0:
            value = round(value / sensor["resolution"]) * sensor["resolution"]
        held[k] = value
