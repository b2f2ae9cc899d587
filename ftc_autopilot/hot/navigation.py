"""From the datagrams of sensors to the estimated state: HIL_SENSOR, HIL_GPS and FTC_SIM_STEP.

Sensors are noted as they come. The step, which is sent last, brings the estimate up to it. In
lockstep only with all sensors of the step: else the plant sends all of them again. In real time
with what has come: a HIL_SENSOR that was lost counts as one without new samples, and a step whose
FTC_SIM_STEP was lost is estimated when sensors of the next one come.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from ftc_autopilot.config import AutopilotConfig
from ftc_autopilot.estimation.estimator import (
    ESTIMATOR,
    Estimator,
    EstimatorConfig,
    estimate,
    new_estimator,
)
from ftc_autopilot.hot.checkpoint import map_array
from mavlink_defs.dialect import FTC_SIM_FLAGS_GPS, FTC_SIM_FLAGS_LOCKSTEP
from mavlink_defs.framing.codec import HIL_GPS, HIL_SENSOR, SIM_STEP, copy_step
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.runtime.jit import compiled
from mavlink_defs.runtime.memory import copy_record
from sitl_plant.sensing.config import MAX_IMUS
from sitl_plant.vec3 import square

_NONE = -1

ESTIMATED = 15
"""Numbers of an estimate: position, velocity, attitude, rates, wind, as of SIM_STATE."""

NAVIGATION = np.dtype(
    [
        ("count", "i8"),  # IMUs; 0: the state is not estimated
        ("step", "i8"),  # the newest that was estimated, -1: none
        ("step_us", "i8"),
        ("sensor_usec", "i8"),  # time of the newest HIL_SENSOR [µs], -1: none
        ("gps_usec", "i8"),  # time of the last HIL_GPS [µs], -1: none
        ("has_gps", "i8"),  # 1: it is not used yet
        ("gps_step", "i8"),  # in which the last HIL_GPS was used, -1: none
        ("imus", HIL_SENSOR, (MAX_IMUS,)),
        ("gps", HIL_GPS),
        ("sim_step", SIM_STEP),
        ("estimator", ESTIMATOR),
    ]
)
"""Sensors as they were heard last, and the estimator."""


class Navigation(NamedTuple):
    """The navigation of an autopilot."""

    state: np.ndarray  # (1,), dtype NAVIGATION
    history: np.ndarray  # the estimator's memory of past steps


def new_navigation(config: AutopilotConfig) -> Navigation:
    """Return the navigation of an autopilot that has heard of no sensor."""
    state, estimator = np.zeros(1, NAVIGATION), estimator_of(config)
    for name in ("step", "sensor_usec", "gps_usec", "gps_step"):
        state[name] = _NONE
    state["step_us"] = config.step_us
    state["count"] = config.sensors.imus if config.navigation == "estimated" else 0
    state["imus"]["time_usec"] = np.iinfo(np.uint64).max  # of no step
    state["estimator"] = estimator.state
    return Navigation(state, estimator.history)


def estimator_of(config: AutopilotConfig) -> Estimator:
    """Return the estimator of an autopilot, before its first sample."""
    known = EstimatorConfig(
        config.sensors, config.origin, config.step_us, config.aircraft, config.estimator
    )
    return new_estimator(known)


def reset_navigation(own: np.ndarray, histories: np.ndarray, config: AutopilotConfig) -> None:
    """Forget the flight: sensors and estimate.

    Args:
        own: Of one autopilot, with a field `navigation`, shape (1,), updated in place.
        histories: Its estimator's memory, shape (1, imus, entries, TRAVEL), updated in place.
        config: The configuration.
    """
    own["navigation"], histories[0] = new_navigation(config)


@compiled
def is_estimated(navigation: np.void) -> bool:
    """Return whether the state is estimated; else the plant sends the true one."""
    return bool(navigation["count"] > 0)


@compiled
def is_unplaced(navigation: np.void) -> bool:
    """Return whether the state is estimated, and there has been no fix: the place is a guess."""
    return bool(is_estimated(navigation) and navigation["estimator"]["report"]["placed"] == 0)


@compiled
def note_sensor(
    navigation: np.void, history: np.ndarray, sensor: np.void, measured: np.void
) -> int:
    """Note a received HIL_SENSOR unless a newer one has come; return 0, or a `DropReason`.

    If it is of the next step, and the FTC_SIM_STEP of the one before was lost, as in real time one
    can be, that step is estimated first: so no sample is left out.

    Args:
        navigation: Record of dtype `NAVIGATION`, updated in place.
        history: The estimator's memory.
        sensor: Payload of dtype HIL_SENSOR.
        measured: The estimated state, of dtype SIM_STATE.
    """
    imu = np.int64(sensor["id"])
    if imu >= navigation["count"] or not _is_finite(sensor):
        return DropReason.OUT_OF_RANGE
    time_usec, newest_usec = np.int64(sensor["time_usec"]), navigation["sensor_usec"]
    if time_usec < newest_usec:
        return 0
    if (
        time_usec > newest_usec > navigation["step"] * navigation["step_us"]
        and navigation["step"] >= 0
    ):
        _estimate(navigation, history, newest_usec, measured)
    navigation["sensor_usec"] = time_usec
    copy_record(navigation["imus"][imu], sensor)
    return 0


@compiled
def _is_finite(sensor: np.void) -> bool:
    """Return whether all values of a HIL_SENSOR are numbers whose squares are finite."""
    total = np.float32(0.0)
    total += square(sensor["xacc"]) + square(sensor["yacc"]) + square(sensor["zacc"])
    total += square(sensor["xgyro"]) + square(sensor["ygyro"]) + square(sensor["zgyro"])
    total += square(sensor["xmag"]) + square(sensor["ymag"]) + square(sensor["zmag"])
    total += square(sensor["abs_pressure"]) + square(sensor["diff_pressure"])
    total += square(sensor["pressure_alt"]) + square(sensor["temperature"])
    return bool(np.isfinite(total))


@compiled
def note_gps(navigation: np.void, gps: np.void) -> int:
    """Note a received HIL_GPS unless it is known; return 0, or a `DropReason`.

    Args:
        navigation: Record of dtype `NAVIGATION`, updated in place.
        gps: Payload of dtype HIL_GPS.
    """
    time_usec = np.int64(gps["time_usec"])
    if abs(np.int64(gps["lat"])) > 900_000_000 or abs(np.int64(gps["lon"])) > 1_800_000_000:
        return DropReason.OUT_OF_RANGE
    if time_usec != navigation["gps_usec"]:  # else it was sent again with the step
        navigation["gps_usec"], navigation["has_gps"] = time_usec, 1
        copy_record(navigation["gps"], gps)
    return 0


@compiled
def check_step(navigation: np.void, sim_step: np.void) -> int:
    """Return 0 if the time of a step is right, otherwise a `DropReason`.

    Args:
        navigation: Record of dtype `NAVIGATION`, updated in place.
        sim_step: Payload of dtype SIM_STEP.
    """
    time_usec = np.int64(sim_step["step"]) * navigation["step_us"]
    return 0 if np.int64(sim_step["time_usec"]) == time_usec else DropReason.OUT_OF_RANGE


@compiled
def is_complete(navigation: np.void, sim_step: np.void) -> bool:
    """Return whether a step can be flown: in lockstep, and as the first, with all of its sensors.

    Args:
        navigation: Record of dtype `NAVIGATION`, updated in place.
        sim_step: Payload of dtype SIM_STEP.
    """
    flags = np.int64(sim_step["flags"])
    real_time = flags & FTC_SIM_FLAGS_LOCKSTEP == 0
    if np.int64(sim_step["step"]) <= navigation["step"] or (real_time and navigation["step"] >= 0):
        return True
    for imu in range(navigation["count"]):
        if navigation["imus"][imu]["time_usec"] != sim_step["time_usec"]:
            return False
    return bool(flags & FTC_SIM_FLAGS_GPS == 0 or navigation["has_gps"] == 1)


@compiled
def navigate(
    navigation: np.void, history: np.ndarray, sim_step: np.void, measured: np.void
) -> None:
    """Bring the estimate up to a step; a step that was estimated is but noted again.

    Args:
        navigation: Record of dtype `NAVIGATION`, updated in place.
        history: The estimator's memory.
        sim_step: Payload of dtype SIM_STEP.
        measured: The estimated state, of dtype SIM_STATE.
    """
    own = navigation["sim_step"]
    copy_record(own, sim_step)
    own["flags"] = np.int64(own["flags"]) & ~FTC_SIM_FLAGS_GPS
    if np.int64(own["step"]) <= navigation["step"]:
        copy_step(own, measured)
    else:
        _estimate(navigation, history, np.int64(own["time_usec"]), measured)


@compiled
def _estimate(
    navigation: np.void, history: np.ndarray, time_usec: np.int64, measured: np.void
) -> None:
    """Bring the estimate up to a time [µs] with the sensors that have come."""
    own = navigation["sim_step"]
    step = time_usec // navigation["step_us"]
    own["time_usec"], own["step"] = time_usec, step
    for k in range(navigation["count"]):
        imu = navigation["imus"][k]
        if imu["time_usec"] != own["time_usec"]:
            imu["fields_updated"] = 0  # it was lost: no sample is new
    has_gps = navigation["has_gps"] == 1
    estimate(
        navigation["estimator"],
        history,
        navigation["imus"],
        navigation["gps"],
        has_gps,
        own,
        measured,
    )
    if has_gps:
        navigation["gps_step"] = step
    navigation["step"], navigation["has_gps"] = step, 0


@compiled
def write_estimate(measured: np.void, row: np.ndarray) -> None:
    """Write an estimated state to a row of a recording, shape (ESTIMATED,)."""
    for k in range(3):
        row[k] = measured["position"][k]
        row[3 + k] = measured["velocity"][k]
        row[6 + k] = measured["attitude"][k]
        row[9 + k] = measured["rates"][k]
        row[12 + k] = measured["wind"][k]


def with_shared_history(
    histories: np.ndarray, path: Path, estimated: bool, resumes: bool
) -> np.ndarray:
    """Return the estimator's memory of past steps in a file, too large for the checkpoint.

    Args:
        histories: Of one autopilot, shape (1, imus, entries, TRAVEL).
        path: The file.
        estimated: Whether the state is estimated; else the memory stays as it is.
        resumes: Whether the autopilot resumes with what is in the file.

    Raises:
        OSError: The file cannot be made; it is named.
    """
    shared = map_array(path, histories.dtype, histories.size if estimated else 0)
    if not estimated:
        return histories
    shared = shared.reshape(histories.shape)
    if not resumes:
        shared[:] = histories
    return shared
