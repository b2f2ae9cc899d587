"""Which sensors can be trusted: tests of their samples, with counters.

A sensor is excluded when samples stop, when they stay the same, or when several in a row fail their
innovation test; it is taken back when as many as in `take_back_s` pass.
"""

from typing import Final

import numpy as np

from ftc_autopilot.estimation.parameters import EstimatorParameters
from ftc_autopilot.estimation.state import N_SENSORS
from mavlink_defs.constants import BAROMETER, GNSS, MAGNETOMETER, PITOT
from mavlink_defs.runtime.jit import compiled
from sitl_plant.sensing.config import NavigationSensors
from sitl_plant.sensing.units import periods_between
from sitl_plant.vec3 import square

WELL: Final = 0
ABSENT: Final = 1
SILENT: Final = 2
STUCK: Final = 3
INCONSISTENT: Final = 4
NOISY: Final = 5

REASONS = ("well", "not fitted", "silent", "stuck", "inconsistent", "noisy")
"""What is the matter with a sensor, by the numbers above."""

SENSOR = np.dtype(
    [
        ("reason", "i8"),  # why it is excluded; 0: it is not
        ("fresh", "i8"),  # 1: a sample came in this step
        ("silent", "i8"),  # steps without a sample
        ("same", "i8"),  # samples in a row that are the same as before
        ("failed", "i8"),  # samples in a row that fail their test
        ("passed", "i8"),  # that pass it
        ("value", "f8", (3,)),  # the last sample
        # limits
        ("most_silent", "i8"),
        ("most_same", "i8"),  # 0: no limit
        ("most_failed", "i8"),
        ("take_back", "i8"),  # passed samples after which an excluded one is taken back
    ]
)
"""Magnetometer, barometer, pitot tube or GNSS receiver, and what tells whether it is well."""

_MIN_SAMPLES = 3


def new_sensor_health(
    sensors: NavigationSensors, parameters: EstimatorParameters, step_us: int
) -> np.ndarray:
    """Return the state of the sensors beside the IMUs, by their numbers, shape (N_SENSORS,)."""
    health = np.zeros(N_SENSORS, SENSOR)
    for number, model, noise in (
        (MAGNETOMETER, sensors.magnetometer, sensors.magnetometer.noise_gauss),
        (BAROMETER, sensors.barometer, sensors.barometer.noise_pa),
        (PITOT, sensors.pitot, sensors.pitot.noise_pa),
        (GNSS, sensors.gnss, sensors.gnss.horizontal_velocity_noise_m_s),
    ):
        own = health[number]
        period_s = max(periods_between(model.rate_hz, step_us), 1) * step_us / 1e6
        own["reason"] = WELL if model.fitted else ABSENT
        silent_s = max(parameters.silent_s, 4.0 * period_s)
        own["most_silent"] = round(silent_s * 1e6 / step_us)
        own["most_same"] = max(round(parameters.same_s / period_s), 5) if noise > 0.0 else 0
        own["most_failed"] = max(round(parameters.failed_s / period_s), _MIN_SAMPLES)
        own["take_back"] = max(round(parameters.take_back_s / period_s), _MIN_SAMPLES)
    return health


@compiled
def note_sample(sensor: np.void, fresh: bool, x: float, y: float, z: float) -> None:
    """Note whether a sensor has a new sample, and count how often that stays the same."""
    sensor["fresh"] = fresh
    if not fresh:
        sensor["silent"] += 1
        if sensor["silent"] > sensor["most_silent"] and sensor["reason"] != ABSENT:
            exclude(sensor, SILENT)
        return
    sensor["silent"] = 0
    value = sensor["value"]
    same = value[0] == x and value[1] == y and value[2] == z
    sensor["same"] = sensor["same"] + 1 if same else 0
    value[0], value[1], value[2] = x, y, z
    if sensor["most_same"] > 0 and sensor["same"] > sensor["most_same"]:
        exclude(sensor, STUCK)


@compiled
def note_test(sensor: np.void, ratio: float, assumed: np.void) -> None:
    """Note the squared normalised innovation of a sample, and exclude or take back the sensor."""
    gate = assumed["gate"] if sensor["reason"] == WELL else square(assumed["take_back_sigma"])
    if ratio < gate and (sensor["most_same"] == 0 or sensor["same"] < 3):
        sensor["failed"] = 0
        sensor["passed"] += 1
        if sensor["reason"] > ABSENT and sensor["passed"] >= sensor["take_back"]:
            sensor["reason"] = WELL
        return
    sensor["passed"] = 0
    if ratio < assumed["gate"]:
        return
    sensor["failed"] += 1
    if sensor["failed"] >= sensor["most_failed"] and sensor["reason"] == WELL:
        exclude(sensor, INCONSISTENT)


@compiled
def exclude(sensor: np.void, reason: int) -> None:
    """Exclude a sensor for one of the reasons above."""
    sensor["reason"], sensor["passed"] = reason, 0


@compiled
def is_used(sensor: np.void) -> bool:
    """Return whether a sensor's samples are fused."""
    return bool(sensor["reason"] == WELL)
