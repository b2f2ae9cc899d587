"""Stand-in for the estimator: dead reckoning from level flight, corrected by GNSS."""

import math
from typing import NamedTuple

import numpy as np

from mavlink_defs.origin import EARTH_RADIUS_M, Origin
from mavlink_defs.runtime.jit import compiled
from sitl_plant.aircraft_config import Aircraft
from sitl_plant.navigation_sensors import NavigationSensors
from sitl_plant.rigid_body import R1
from sitl_plant.vec3 import mul, mul_t, vec3

STATUS = np.dtype(
    [
        ("step", "i8"),
        ("latitude", "f8"),
        ("longitude", "f8"),
        ("altitude", "f8"),
        ("step_us", "i8"),
        ("attitude", "f8", (3,)),
        ("velocity", "f8", (3,)),
        ("position", "f8", (3,)),
    ]
)


class EstimatorConfig(NamedTuple):
    """What an estimator needs to know."""

    sensors: NavigationSensors
    origin: Origin
    step_us: int
    aircraft: Aircraft


class Estimator(NamedTuple):
    """The estimator of one aircraft."""

    status: np.ndarray  # (1,), dtype STATUS


def new_estimator(config: EstimatorConfig) -> Estimator:
    """Return an estimator before its first sample."""
    status = np.zeros(1, STATUS)
    status["step"], status["step_us"] = -1, config.step_us
    status["latitude"] = config.origin.latitude_deg
    status["longitude"] = config.origin.longitude_deg
    status["altitude"] = config.origin.altitude_m
    return Estimator(status)


@compiled
def estimate(
    estimator: Estimator,
    imus: np.ndarray,
    gps: np.void,
    has_gps: bool,
    sim_step: np.void,
    measured: np.void,
) -> None:
    """Bring the estimate up to a step."""
    own, imu = estimator.status[0], imus[0]
    step = np.int64(sim_step["step"])
    a = own["attitude"]
    rates = (np.float64(imu["xgyro"]), np.float64(imu["ygyro"]), np.float64(imu["zgyro"]))
    force = (np.float64(imu["xacc"]), np.float64(imu["yacc"]), np.float64(imu["zacc"]))
    if own["step"] < 0:
        own["velocity"][0] = math.sqrt(2.0 * max(np.float64(imu["diff_pressure"]), 0.0) * 1e2 / 1.2)
        own["position"][2] = own["altitude"] - np.float64(imu["pressure_alt"])
    elif step > own["step"]:
        dt = (step - own["step"]) * own["step_us"] / 1e6
        p, q, r = rates
        roll, pitch = a[0], a[1]
        a[0] += dt * (p + math.tan(pitch) * (q * math.sin(roll) + r * math.cos(roll)))
        a[1] += dt * (q * math.cos(roll) - r * math.sin(roll))
        a[2] += dt * (q * math.sin(roll) + r * math.cos(roll)) / math.cos(pitch)
        push = mul(R1(vec3(a)), force)
        for k in range(3):
            own["velocity"][k] += dt * (push[k] + (9.81 if k == 2 else 0.0))
            own["position"][k] += dt * own["velocity"][k]
    if has_gps:
        scale = math.radians(1e-7) * EARTH_RADIUS_M
        cosine = math.cos(math.radians(own["latitude"]))
        own["position"][0] = (np.float64(gps["lat"]) - own["latitude"] * 1e7) * scale
        own["position"][1] = (np.float64(gps["lon"]) - own["longitude"] * 1e7) * scale * cosine
        own["position"][2] = own["altitude"] - np.float64(gps["alt"]) / 1e3
        own["velocity"][0] = np.float64(gps["vn"]) / 100.0
        own["velocity"][1] = np.float64(gps["ve"]) / 100.0
        own["velocity"][2] = np.float64(gps["vd"]) / 100.0
    own["step"] = step
    velocity = mul_t(R1(vec3(a)), vec3(own["velocity"]))
    for k in range(3):
        measured["position"][k] = own["position"][k]
        measured["velocity"][k] = velocity[k]
        measured["attitude"][k] = a[k]
        measured["rates"][k] = rates[k]
        measured["specific_force"][k] = force[k]
        measured["wind"][k] = 0.0
    measured["step"], measured["time_usec"] = sim_step["step"], sim_step["time_usec"]
    measured["actuator_time_usec"] = sim_step["actuator_time_usec"]
    measured["run"], measured["flags"] = sim_step["run"], sim_step["flags"]
    for k in range(len(measured["silent"])):
        measured["silent"][k] = sim_step["silent"][k]
