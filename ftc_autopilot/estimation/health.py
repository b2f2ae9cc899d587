"""Which sensors can be trusted: tests of their samples, with counters.

A sensor is excluded when samples stop, when they stay the same, or when several in a row fail their
innovation test and `judge` finds that it is the one to blame. It goes on being compared, and is
taken back when as many as in `take_back_s` pass; for twice as long after each exclusion, up to
eight times.
"""

from typing import Final

import numpy as np

from ftc_autopilot.estimation.parameters import EstimatorParameters
from ftc_autopilot.estimation.state import (
    GNSS_HEIGHT,
    GNSS_VELOCITY,
    N_SENSORS,
)
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
        ("steady", "i8"),  # samples since it was silent
        ("same", "i8"),  # samples in a row that are the same as before
        ("failed", "i8"),  # samples in a row that fail their test
        ("passed", "i8"),  # that pass it
        ("doubt", "f8"),  # share of the last samples beyond 2 standard deviations, before it failed
        ("times", "i8"),  # that it was excluded as inconsistent
        ("value", "f8", (3,)),  # the last sample
        # limits
        ("most_silent", "i8"),
        ("most_same", "i8"),  # 0: no limit
        ("most_failed", "i8"),
        ("take_back", "i8"),  # passed samples after which an excluded one is taken back
        ("doubt_gain", "f8"),  # of the mean `doubt`
    ]
)
"""Magnetometer, barometer, pitot tube or part of a GNSS fix, and what tells whether it is well."""

_MIN_SAMPLES = 3
_MOST_DOUBLINGS = 3
_DOUBT_S = 0.3
_DOUBTFUL = 4.0  # squared standard deviations


def new_sensor_health(
    sensors: NavigationSensors, parameters: EstimatorParameters, step_us: int
) -> np.ndarray:
    """Return the state of the sensors beside the IMUs, by their numbers, shape (N_SENSORS,)."""
    health = np.zeros(N_SENSORS, SENSOR)
    gnss = sensors.gnss
    for number, model, noise in (
        (MAGNETOMETER, sensors.magnetometer, sensors.magnetometer.noise_gauss),
        (BAROMETER, sensors.barometer, sensors.barometer.noise_pa),
        (PITOT, sensors.pitot, sensors.pitot.noise_pa),
        (GNSS, gnss, gnss.horizontal_velocity_noise_m_s),
        (GNSS_VELOCITY, gnss, gnss.horizontal_velocity_noise_m_s),
        (GNSS_HEIGHT, gnss, gnss.vertical_velocity_noise_m_s),
    ):
        own = health[number]
        period_s = max(periods_between(model.rate_hz, step_us), 1) * step_us / 1e6
        own["reason"] = WELL if model.fitted else ABSENT
        silent_s = max(parameters.silent_s, 4.0 * period_s)
        own["most_silent"] = round(silent_s * 1e6 / step_us)
        own["most_same"] = max(round(parameters.same_s / period_s), 5) if noise > 0.0 else 0
        own["most_failed"] = max(round(parameters.failed_s / period_s), _MIN_SAMPLES)
        own["take_back"] = max(round(parameters.take_back_s / period_s), _MIN_SAMPLES)
        own["steady"] = 1_000_000_000
        own["doubt_gain"] = min(period_s / _DOUBT_S, 1.0)
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
    sensor["steady"] = 0 if sensor["silent"] > sensor["most_silent"] // 2 else sensor["steady"] + 1
    sensor["silent"] = 0
    value = sensor["value"]
    same = value[0] == x and value[1] == y and value[2] == z
    sensor["same"] = sensor["same"] + 1 if same else 0
    value[0], value[1], value[2] = x, y, z
    if sensor["most_same"] > 0 and sensor["same"] > sensor["most_same"]:
        exclude(sensor, STUCK)


@compiled
def note_test(sensor: np.void, ratio: float, assumed: np.void) -> bool:
    """Note the squared normalised innovation of a sample, and take the sensor back if it is well.

    Returns:
        Whether it has failed for too long: somebody is to blame, see `judging.judge`.
    """
    excluded = sensor["reason"] == INCONSISTENT or sensor["reason"] == STUCK
    gate = square(assumed["take_back_sigma"]) if excluded else assumed["gate"]
    if sensor["failed"] == 0:
        beyond = 1.0 if ratio > _DOUBTFUL else 0.0
        sensor["doubt"] += sensor["doubt_gain"] * (beyond - sensor["doubt"])
    if ratio < gate and not is_repeating(sensor):
        sensor["failed"] = 0
        sensor["passed"] += 1
        doublings = min(max(sensor["times"] - 1, 0), _MOST_DOUBLINGS)
        if sensor["reason"] > ABSENT and sensor["passed"] >= sensor["take_back"] << doublings:
            sensor["reason"] = WELL
        return False
    sensor["passed"] = 0
    if ratio < assumed["gate"]:
        return False
    sensor["failed"] += 1
    return bool(sensor["failed"] >= sensor["most_failed"])


@compiled
def is_repeating(sensor: np.void) -> bool:
    """Return whether the last samples of a sensor that has noise are the same."""
    return bool(sensor["most_same"] > 0 and sensor["same"] >= _MIN_SAMPLES)


@compiled
def exclude(sensor: np.void, reason: int) -> None:
    """Exclude a sensor for one of the reasons above."""
    if reason == INCONSISTENT and sensor["reason"] != INCONSISTENT:
        sensor["times"] += 1
    sensor["reason"], sensor["passed"] = reason, 0


@compiled
def is_used(sensor: np.void) -> bool:
    """Return whether a sensor's samples are fused: of one that was silent, nothing is doubted."""
    return bool(sensor["reason"] == WELL or sensor["reason"] == SILENT)
