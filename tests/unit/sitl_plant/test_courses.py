"""A plant with everything that it can have, against recorded numbers."""

import math
from typing import Any

import numpy as np
import pytest
from courses import Course
from plain_faults import actuator_fault, add_fault

from gcs.scenario.model import Scenario
from mavlink_defs.constants import AILERON, ELEVATOR, RUDDER, THROTTLE
from sitl_plant.loop.fleet import fly, new_plant_state, observe

_SURFACE = {
    "lag_s": 0.03,
    "rate_limit_deg_s": 120.0,
    "dead_time_s": 0.008,
    "backlash_deg": 0.4,
    "resolution_deg": 0.1,
}
SERVOS = {
    "aileron": _SURFACE,
    "elevator": _SURFACE | {"rate_limit_deg_s": None},
    "rudder": _SURFACE | {"lag_s": 0.0, "dead_time_s": 0.0},
    "throttle": {"lag_s": 0.2, "rate_limit_n_s": 2000.0, "dead_time_s": 0.016, "resolution_n": 2.0},
}
SENSORS = {
    "gyro_deg_s": {"noise_rms": 0.1, "bias": 0.2, "bias_drift": 0.05},
    "accelerometer_m_s2": {"noise_rms": 0.1, "rate_hz": 125.0, "latency_s": 0.012},
    "attitude_deg": {"bias": 0.3, "resolution": 0.05, "latency_s": 0.004},
    "airspeed_m_s": {"noise_rms": 0.5, "bias_drift": 0.1, "rate_hz": 62.5},
}
WIND = {
    "steady": {"north_m_s": 2.0, "east_m_s": -1.0, "down_m_s": 0.5},
    "shear": {"north_1_s": 0.01, "east_1_s": 0.02, "altitude_m": 50.0},
    "gust": {
        "start_s": 0.1,
        "duration_s": 0.3,
        "north_m_s": 3.0,
        "east_m_s": 2.0,
        "down_m_s": -2.0,
    },
    "turbulence": "moderate",
}
FAULTS = (
    actuator_fault(AILERON, 0.6, 3.0, 2.5, 0.05, 0.4),
    actuator_fault(AILERON, 0.0, 1.0, 0.0, 0.4, math.inf),
    actuator_fault(ELEVATOR, 0.8, 4.0, 0.0, 0.1, 0.5, 1),  # drift
    actuator_fault(RUDDER, 1.0, 20.0, 0.0, 0.2, 0.35, 2),  # hard-over
    actuator_fault(THROTTLE, 0.5, 100.0, 5.0, 0.1, math.inf, 3),  # intermittent
)
PLANTS: dict[str, dict[str, Any]] = {
    "everything": {"servos": SERVOS, "sensors": SENSORS, "wind": WIND, "seed": 5},
    "plain": {"wind": {"steady": {"east_m_s": 3.0}}},
}


@pytest.mark.parametrize("name", PLANTS)
def test_a_plant_along_a_course(name: str, scenario1: Scenario) -> None:
    tree = scenario1.model_dump() | {"faults": (), "step_us": 4000} | PLANTS[name]
    plant = new_plant_state(Scenario.model_validate(tree).plant_config())
    for fault in FAULTS:
        add_fault(plant.uavs[0]["faults"], fault, now_s=0.0)
    plant.uavs[2]["state"][9:12] = 0.5, 0.3, -0.2
    course = Course(f"plant_{name}")
    for k in range(150):
        for i in range(3):
            t = 0.004 * k + 0.1 * i
            plant.uavs[i]["controls"] = (
                0.06 * math.sin(9.0 * t) + 0.07,
                0.05 * math.sin(11.0 * t) - 0.02,
                0.36 + 0.05 * (t % 0.2 > 0.1),
                900.0 + 300.0 * math.sin(8.0 * t),
            )
        for i in range(3):
            observe(plant, i, k, 4000)
        if k in (0, 1, 2) or k % 15 == 0:
            for i in range(2, -1, -2):
                course.note(plant.uavs[i]["message"], f"{i}.")
                course.note(plant.uavs[i]["servos"], f"{i}.servos.")
                course.note(plant.uavs[i]["turbulence"], f"{i}.turbulence.")
                course.note(plant.uavs[i]["sensors"], f"{i}.sensors.")
                course.note(
                    _named(x=plant.uavs[i]["state"], applied=plant.uavs[i]["applied"]), f"{i}."
                )
        assert fly(plant, k, 4000) < 0
    course.check()


def _named(**arrays: np.ndarray) -> np.ndarray:
    """Arrays as the fields of one record."""
    record = np.zeros(1, [(name, "f8", array.shape) for name, array in arrays.items()])[0]
    for name, array in arrays.items():
        record[name] = array
    return record
