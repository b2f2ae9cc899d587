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
from ftc_autopilot.estimation.estimator import Estimator, EstimatorConfig, estimate, new_estimator
from ftc_autopilot.hot.checkpoint import map_array
from mavlink_defs.dialect import FTC_SIM_FLAGS_GPS, FTC_SIM_FLAGS_LOCKSTEP
from mavlink_defs.framing.codec import HIL_GPS, HIL_SENSOR, SIM_STEP, copy_step
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.runtime.jit import compiled
from mavlink_defs.runtime.memory import copy_record

_NONE = -1

ESTIMATED = 15
"""Numbers of an estimate: position, velocity, attitude, rates, wind, as of SIM_STATE."""

ARRIVALS = np.dtype(
    [
        ("step", "i8"),  # the newest that was estimated, -1: none
        ("step_us", "i8"),
        ("sensor_usec", "i8"),  # time of the newest HIL_SENSOR [µs], -1: none
        ("gps_usec", "i8"),  # time of the last HIL_GPS [µs], -1: none
        ("has_gps", "i8"),  # 1: it is not used yet
    ]
)
"""What has come of the sensors' messages."""


class Navigation(NamedTuple):
    """Sensors as they were heard last, and the estimator; without IMUs none is used."""

    arrivals: np.ndarray  # (1,), dtype ARRIVALS
    imus: np.ndarray  # (m,), dtype HIL_SENSOR
    gps: np.ndarray  # (1,), dtype HIL_GPS
    sim_step: np.ndarray  # (1,), dtype SIM_STEP
    estimator: Estimator


def new_navigation(config: AutopilotConfig) -> Navigation:
    """Return the navigation of an autopilot that has heard of no sensor."""
    arrivals = np.zeros(1, ARRIVALS)
    arrivals["step"] = arrivals["sensor_usec"] = arrivals["gps_usec"] = _NONE
    arrivals["step_us"] = config.step_us
    estimated = config.navigation == "estimated"
    imus = np.zeros(config.sensors.imus if estimated else 0, HIL_SENSOR)
    imus["time_usec"] = np.iinfo(np.uint64).max  # of no step
    return Navigation(
        arrivals,
        imus,
        np.zeros(1, HIL_GPS),
        np.zeros(1, SIM_STEP),
        estimator_of(config),
    )


def estimator_of(config: AutopilotConfig) -> Estimator:
    """Return the estimator of an autopilot, before its first sample."""
    known = EstimatorConfig(config.sensors, config.origin, config.step_us, config.aircraft)
    return new_estimator(known)


def reset_navigation(navigation: Navigation, config: AutopilotConfig) -> None:
    """Forget the flight: sensors and estimate."""
    fresh = new_navigation(config)
    for array, initial in zip(
        (*navigation[:-1], *navigation.estimator), (*fresh[:-1], *fresh.estimator), strict=True
    ):
        array[:] = initial


@compiled
def is_estimated(navigation: Navigation) -> bool:
    """Return whether the state is estimated; else the plant sends the true one."""
    return len(navigation.imus) > 0


@compiled
def note_sensor(navigation: Navigation, sensor: np.void, measured: np.void) -> int:
    """Note a received HIL_SENSOR unless a newer one has come; return 0, or a `DropReason`.

    If it is of the next step, and the FTC_SIM_STEP of the one before was lost, as in real time one
    can be, that step is estimated first: so no sample is left out.

    Args:
        navigation: Of the autopilot.
        sensor: Payload of dtype HIL_SENSOR.
        measured: The estimated state, of dtype SIM_STATE.
    """
    arrivals, imu = navigation.arrivals[0], np.int64(sensor["id"])
    if imu >= len(navigation.imus) or not _is_finite(sensor):
        return DropReason.OUT_OF_RANGE
    time_usec, newest_usec = np.int64(sensor["time_usec"]), arrivals["sensor_usec"]
    if time_usec < newest_usec:
        return 0
    if time_usec > newest_usec > arrivals["step"] * arrivals["step_us"] and arrivals["step"] >= 0:
        _estimate(navigation, newest_usec, measured)
    arrivals["sensor_usec"] = time_usec
    copy_record(navigation.imus[imu], sensor)
    return 0


@compiled
def _is_finite(sensor: np.void) -> bool:
    """Return whether all values of a HIL_SENSOR are numbers whose squares are finite."""
    total = np.float32(0.0)
    total += sensor["xacc"] ** 2 + sensor["yacc"] ** 2 + sensor["zacc"] ** 2
    total += sensor["xgyro"] ** 2 + sensor["ygyro"] ** 2 + sensor["zgyro"] ** 2
    total += sensor["xmag"] ** 2 + sensor["ymag"] ** 2 + sensor["zmag"] ** 2
    total += sensor["abs_pressure"] ** 2 + sensor["diff_pressure"] ** 2
    total += sensor["pressure_alt"] ** 2 + sensor["temperature"] ** 2
    return bool(np.isfinite(total))


@compiled
def note_gps(navigation: Navigation, gps: np.void) -> int:
    """Note a received HIL_GPS unless it is known; return 0, or a `DropReason`.

    Args:
        navigation: Of the autopilot.
        gps: Payload of dtype HIL_GPS.
    """
    arrivals = navigation.arrivals[0]
    time_usec = np.int64(gps["time_usec"])
    if abs(np.int64(gps["lat"])) > 900_000_000 or abs(np.int64(gps["lon"])) > 1_800_000_000:
        return DropReason.OUT_OF_RANGE
    if time_usec != arrivals["gps_usec"]:  # else it was sent again with the step
        arrivals["gps_usec"], arrivals["has_gps"] = time_usec, 1
        copy_record(navigation.gps[0], gps)
    return 0


@compiled
def check_step(navigation: Navigation, sim_step: np.void) -> int:
    """Return 0 if the time of a step is right, otherwise a `DropReason`.

    Args:
        navigation: Of the autopilot.
        sim_step: Payload of dtype SIM_STEP.
    """
    time_usec = np.int64(sim_step["step"]) * navigation.arrivals[0]["step_us"]
    return 0 if np.int64(sim_step["time_usec"]) == time_usec else DropReason.OUT_OF_RANGE


@compiled
def is_complete(navigation: Navigation, sim_step: np.void) -> bool:
    """Return whether a step can be flown: in lockstep, and as the first, with all of its sensors.

    Args:
        navigation: Of the autopilot.
        sim_step: Payload of dtype SIM_STEP.
    """
    flags, arrivals = np.int64(sim_step["flags"]), navigation.arrivals[0]
    real_time = flags & FTC_SIM_FLAGS_LOCKSTEP == 0
    if np.int64(sim_step["step"]) <= arrivals["step"] or (real_time and arrivals["step"] >= 0):
        return True
    for imu in range(len(navigation.imus)):
        if navigation.imus[imu]["time_usec"] != sim_step["time_usec"]:
            return False
    return bool(flags & FTC_SIM_FLAGS_GPS == 0 or arrivals["has_gps"] == 1)


@compiled
def navigate(navigation: Navigation, sim_step: np.void, measured: np.void) -> None:
    """Bring the estimate up to a step; a step that was estimated is but noted again.

    Args:
        navigation: Of the autopilot.
        sim_step: Payload of dtype SIM_STEP.
        measured: The estimated state, of dtype SIM_STATE.
    """
    own = navigation.sim_step[0]
    copy_record(own, sim_step)
    own["flags"] = np.int64(own["flags"]) & ~FTC_SIM_FLAGS_GPS
    if np.int64(own["step"]) <= navigation.arrivals[0]["step"]:
        copy_step(own, measured)
    else:
        _estimate(navigation, np.int64(own["time_usec"]), measured)


@compiled
def _estimate(navigation: Navigation, time_usec: np.int64, measured: np.void) -> None:
    """Bring the estimate up to a time [µs] with the sensors that have come."""
    arrivals, own = navigation.arrivals[0], navigation.sim_step[0]
    step = time_usec // arrivals["step_us"]
    own["time_usec"], own["step"] = time_usec, step
    for k in range(len(navigation.imus)):
        imu = navigation.imus[k]
        if imu["time_usec"] != own["time_usec"]:
            imu["fields_updated"] = 0  # it was lost: no sample is new
    has_gps = arrivals["has_gps"] == 1
    estimate(navigation.estimator, navigation.imus, navigation.gps[0], has_gps, own, measured)
    arrivals["step"], arrivals["has_gps"] = step, 0


@compiled
def write_estimate(measured: np.void, row: np.ndarray) -> None:
    """Write an estimated state to a row of a recording, shape (ESTIMATED,)."""
    for k in range(3):
        row[k] = measured["position"][k]
        row[3 + k] = measured["velocity"][k]
        row[6 + k] = measured["attitude"][k]
        row[9 + k] = measured["rates"][k]
        row[12 + k] = measured["wind"][k]


def with_shared_history(navigation: Navigation, path: Path, resumes: bool) -> Navigation:
    """Return the navigation with the estimator's memory of past steps in a file.

    It is too large for the checkpoint, which is written in each step.

    Args:
        navigation: Of the autopilot.
        path: The file.
        resumes: Whether the autopilot resumes with what is in it.

    Raises:
        OSError: The file cannot be made; it is named.
    """
    history = navigation.estimator.history
    shared = map_array(path, history.dtype, history.size if len(navigation.imus) else 0)
    if not len(navigation.imus):
        return navigation
    shared = shared.reshape(history.shape)
    if not resumes:
        shared[:] = history
    return navigation._replace(estimator=navigation.estimator._replace(history=shared))
