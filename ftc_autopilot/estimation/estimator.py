"""The estimator: what an autopilot with sensors flies by in place of the true state."""

import math
from typing import NamedTuple

import numpy as np

from ftc_autopilot.estimation.alignment import align
from ftc_autopilot.estimation.config import PARAMETERS, EstimatorConfig, parameters_of
from ftc_autopilot.estimation.health import (
    INCONSISTENT,
    SENSOR,
    exclude,
    is_used,
    new_sensor_health,
    note_sample,
    note_test,
)
from ftc_autopilot.estimation.icing import ICING, is_icing, restore_wind
from ftc_autopilot.estimation.imus import IMU, judge_imus, note_imu, runs, sample_of
from ftc_autopilot.estimation.measurements import (
    fuse_barometer,
    fuse_gnss,
    fuse_magnetometer,
    fuse_pitot,
    fuse_sideslip,
    past_travel,
)
from ftc_autopilot.estimation.output import REPORT, hand_over, pay, write_motion, write_report
from ftc_autopilot.estimation.predict import predict
from ftc_autopilot.estimation.state import (
    AIDING,
    FILTER,
    FORCE_BIAS,
    GYRO_BIAS,
    HISTORY_S,
    N_SENSORS,
    POS,
    SIDESLIP,
    TRAVEL,
    VEL,
    N,
)
from mavlink_defs.constants import BAROMETER, GNSS, MAGNETOMETER, PITOT
from mavlink_defs.framing.codec import HIL_GPS, HIL_SENSOR, SIM_STATE, SIM_STEP, copy_step
from mavlink_defs.origin import EARTH_RADIUS_M
from mavlink_defs.runtime.jit import apart, compiled
from mavlink_defs.runtime.memory import copy_record
from sitl_plant.sensing.config import MAX_IMUS
from sitl_plant.sensing.standard_air import altitude_of
from sitl_plant.sensing.units import is_updated
from sitl_plant.vec3 import Vec3, square, vec3

__all__ = ["ESTIMATOR", "Estimator", "EstimatorConfig", "estimate", "new_estimator"]

_FIX_3D = 3
_PA = 100.0  # in one hPa
_SIDESLIP_EVERY_S = 0.05
_MAX_GAP = 200  # steps without data after which the estimate begins again
_MEMORY_S = 0.2  # longer than the latency
_VELOCITY_ERROR = 1.0  # m/s, of dead reckoning, when a receiver is back

PROGRESS = np.dtype([("step", "i8"), ("run", "i8"), ("imu", "i8"), ("without_gnss", "f8")])
"""Last step [number], its run, the IMU flown by, time since the last GNSS sample [s]."""


ESTIMATOR = np.dtype(
    [
        ("parameters", PARAMETERS),
        ("progress", PROGRESS),
        ("sensors", SENSOR, (N_SENSORS,)),
        ("icing", ICING),
        ("report", REPORT),
        ("past", "f8", (TRAVEL,)),
        ("imus", IMU, (MAX_IMUS,)),  # the first `parameters["imus"]` are in use
        ("filters", FILTER, (MAX_IMUS,)),  # one for each of them
    ]
)
"""All that an estimator knows but its memory of past steps."""


class Estimator(NamedTuple):
    """An estimator and its memory."""

    state: np.ndarray  # (1,), dtype ESTIMATOR
    history: np.ndarray  # (imus, entries, TRAVEL)


def new_estimator(config: EstimatorConfig) -> Estimator:
    """Return an estimator before its first sample."""
    entries = math.ceil((config.sensors.gnss.latency_s + _MEMORY_S) / HISTORY_S)
    state = np.zeros(1, ESTIMATOR)
    state["parameters"] = parameters_of(config)
    state["progress"]["step"] = -1
    state["sensors"] = new_sensor_health(config.sensors, config.parameters, config.step_us)
    return Estimator(state, np.zeros((config.sensors.imus, entries, TRAVEL)))


@apart(
    estimator=ESTIMATOR,
    history=np.zeros((1, 1, 1)),
    imus=np.zeros(1, HIL_SENSOR),
    gps=HIL_GPS,
    sim_step=SIM_STEP,
    measured=SIM_STATE,
)
def estimate(
    estimator: np.void,
    history: np.ndarray,
    imus: np.ndarray,
    gps: np.void,
    has_gps: bool,
    sim_step: np.void,
    measured: np.void,
) -> None:
    """Take what the sensors report in a step, and write the motion that the laws fly by.

    A second call for the same step changes nothing.

    Args:
        estimator: Record of dtype `ESTIMATOR`, updated in place; its `report` is of this step.
        history: Its memory, as of `Estimator`, updated in place.
        imus: Payloads of HIL_SENSOR, one for each IMU, shape (imus,) or longer.
        gps: Payload of HIL_GPS.
        has_gps: Whether that came in this step.
        sim_step: Payload of FTC_SIM_STEP.
        measured: Payload of FTC_SIM_STATE, written.
    """
    progress, assumed = estimator["progress"], estimator["parameters"]
    step, run = int(sim_step["step"]), int(sim_step["run"])
    gap = step - progress["step"]
    if progress["step"] < 0 or run != progress["run"] or gap < 0 or gap > _MAX_GAP:
        _begin(estimator, history, imus, assumed)
        gap = 1
    elif gap > 0:
        for k in range(assumed["imus"]):
            note_imu(estimator["imus"][k], imus[k], assumed)
        for _ in range(gap):
            _advance(estimator, history, assumed)
    if gap > 0:
        _aid(estimator, history, imus[0], gps, has_gps, int(sim_step["time_usec"]), assumed, step)
        _switch(estimator, history, assumed)
    progress["step"], progress["run"] = step, run
    kalman, report = estimator["filters"][progress["imu"]], estimator["report"]
    write_motion(kalman, report["quaternion"], measured)
    write_report(kalman, estimator["imus"], estimator["sensors"], progress["imu"], assumed, report)
    report["step"], report["run"] = step, run
    copy_step(sim_step, measured)


@compiled
def _begin(estimator: np.void, history: np.ndarray, imus: np.ndarray, assumed: np.void) -> None:
    first, progress = imus[0], estimator["progress"]
    if progress["step"] >= 0:
        estimator["report"]["resets"] += 1
    progress["imu"], progress["without_gnss"] = 0, 0.0
    field = float(first["xmag"]), float(first["ymag"]), float(first["zmag"])
    altitude, pressure = math.nan, math.nan
    if is_updated(first, BAROMETER):
        altitude = altitude_of(float(first["abs_pressure"]))
    if is_updated(first, PITOT):
        pressure = _PA * float(first["diff_pressure"])
    for k in range(assumed["imus"]):
        for _ in range(3):
            note_imu(estimator["imus"][k], imus[k], assumed)
        estimator["imus"][k]["noise"][:] = 1.0
        estimator["imus"][k]["same"][:] = 0
        rates, force = sample_of(estimator["imus"][k])
        align(estimator["filters"][k], rates, force, field, pressure, altitude, assumed)
        estimator["filters"][k]["trends"][:] = 0.0
        history[k, :, :] = 0.0


@compiled
def _advance(estimator: np.void, history: np.ndarray, assumed: np.void) -> None:
    """Advance all filters by one step."""
    step_s = assumed["step_us"] / 1e6
    estimator["progress"]["without_gnss"] += step_s
    for k in range(assumed["imus"]):
        if not (runs(estimator["imus"][k], step_s) or k == estimator["progress"]["imu"]):
            continue
        kalman = estimator["filters"][k]
        rates, force = sample_of(estimator["imus"][k])
        predict(kalman, rates, force, assumed)
        pay(kalman, assumed)
        if kalman["elapsed"] == 0.0:
            row = kalman["entry"] % history.shape[1]
            for j in range(TRAVEL):
                history[k, row, j] = kalman["travel"][j]
            kalman["entry"] += 1


@compiled
def _aid(
    estimator: np.void,
    history: np.ndarray,
    first: np.void,
    gps: np.void,
    has_gps: bool,
    time_us: int,
    assumed: np.void,
    step: int,
) -> None:
    """Fuse what has come from the sensors beside the IMUs."""
    sensors = estimator["sensors"]
    field = float(first["xmag"]), float(first["ymag"]), float(first["zmag"])
    note_sample(sensors[MAGNETOMETER], is_updated(first, MAGNETOMETER), *field)
    barometric = float(first["abs_pressure"])
    note_sample(sensors[BAROMETER], is_updated(first, BAROMETER), barometric, 0.0, 0.0)
    pressure = _PA * float(first["diff_pressure"])
    note_sample(sensors[PITOT], is_updated(first, PITOT), pressure, 0.0, 0.0)
    fixed = has_gps and gps["fix_type"] >= _FIX_3D
    note_sample(sensors[GNSS], fixed, float(gps["lat"]), float(gps["lon"]), float(gps["alt"]))
    age = (time_us - int(gps["time_usec"])) / 1e6 if fixed else 0.0
    step_s = assumed["step_us"] / 1e6
    slip = step * assumed["step_us"] % int(1e6 * _SIDESLIP_EVERY_S) == 0
    primary = estimator["progress"]["imu"]
    if fixed and estimator["progress"]["without_gnss"] > 2.0:
        _loosen(estimator, assumed)
    for k in range(assumed["imus"]):
        if not (runs(estimator["imus"][k], step_s) or k == primary):
            continue
        kalman = estimator["filters"][k]
        ratios = kalman["ratios"]
        if sensors[MAGNETOMETER]["fresh"] == 1:
            use = is_used(sensors[MAGNETOMETER])
            ratios[MAGNETOMETER] = fuse_magnetometer(kalman, field, assumed, use)
        if sensors[BAROMETER]["fresh"] == 1:
            altitude = altitude_of(max(barometric, 1.0))
            use = is_used(sensors[BAROMETER])
            ratios[BAROMETER] = fuse_barometer(kalman, altitude, assumed, use)
        if sensors[PITOT]["fresh"] == 1:
            ratios[PITOT] = fuse_pitot(kalman, pressure, assumed, is_used(sensors[PITOT]))
        if fixed:
            _fuse_fix(estimator, kalman, history[k], gps, age, assumed)
        if slip:
            ratios[SIDESLIP] = fuse_sideslip(kalman, _SIDESLIP_EVERY_S, assumed)
    if fixed:
        estimator["progress"]["without_gnss"] = 0.0
    if slip and is_used(sensors[PITOT]) and is_used(sensors[GNSS]):
        _watch_icing(estimator, assumed)
    for s in AIDING:
        if sensors[s]["fresh"] == 1:
            note_test(sensors[s], estimator["filters"][primary]["ratios"][s], assumed)


@compiled
def _fuse_fix(
    estimator: np.void,
    kalman: np.void,
    history: np.ndarray,
    gps: np.void,
    age: float,
    assumed: np.void,
) -> None:
    """Fuse a fix of some age [s] in one filter, which may get its place by it."""
    past, use = estimator["past"], is_used(estimator["sensors"][GNSS])
    past_travel(history, kalman["travel"], age, past)
    position, velocity = _place(gps, assumed)
    ratio = fuse_gnss(kalman, position, velocity, past, assumed, use)
    kalman["ratios"][GNSS] = ratio
    if kalman["placed"] == 0 and ratio < assumed["gate"]:
        kalman["placed"] = 1
        kalman["owed"][:] = 0.0  # from a guess to a place, at once


@compiled
def _watch_icing(estimator: np.void, assumed: np.void) -> None:
    """Exclude a pitot tube that ices up, and give the filters the wind of before."""
    icing, primary = estimator["icing"], estimator["progress"]["imu"]
    if is_icing(estimator["filters"][primary], icing, _SIDESLIP_EVERY_S, assumed):
        exclude(estimator["sensors"][PITOT], INCONSISTENT)
        for k in range(assumed["imus"]):
            restore_wind(estimator["filters"][k], icing)
        icing["age"], icing["suspicious"] = 0.0, 0.0


@compiled
def _loosen(estimator: np.void, assumed: np.void) -> None:
    """Widen the covariance after dead reckoning: the wind may have turned."""
    gap = estimator["progress"]["without_gnss"]
    for k in range(assumed["imus"]):
        P = estimator["filters"][k]["P"]
        for i in range(2):
            P[POS + i, POS + i] += square(assumed["position_growth_m_s"] * gap)
            P[VEL + i, VEL + i] += square(_VELOCITY_ERROR)


@compiled
def _place(gps: np.void, assumed: np.void) -> tuple[Vec3, Vec3]:
    """Return position [m] and velocity [m/s], NED, of an HIL_GPS payload."""
    north = math.radians(gps["lat"] / 1e7 - assumed["latitude"]) * EARTH_RADIUS_M
    degrees = (gps["lon"] / 1e7 - assumed["longitude"] + 180.0) % 360.0 - 180.0
    east = math.radians(degrees) * EARTH_RADIUS_M * math.cos(math.radians(assumed["latitude"]))
    down = assumed["altitude"] - gps["alt"] / 1e3
    return (north, east, down), (gps["vn"] / 100.0, gps["ve"] / 100.0, gps["vd"] / 100.0)


@compiled
def _switch(estimator: np.void, history: np.ndarray, assumed: np.void) -> None:
    """Fly by another IMU if this one is not well, and give one that is well again its filter."""
    progress, filters, imus = estimator["progress"], estimator["filters"], estimator["imus"]
    before = int(progress["imu"])
    primary = judge_imus(imus, filters, before, assumed)
    if primary != before:
        hand_over(filters[before], filters[primary])
        progress["imu"] = primary
    for k in range(assumed["imus"]):
        if k != primary and not runs(imus[k], assumed["step_us"] / 1e6):
            _follow(estimator, history, k, primary, assumed)


@compiled
def _follow(
    estimator: np.void, history: np.ndarray, k: int, primary: int, assumed: np.void
) -> None:
    """Keep the filter of an excluded IMU like the one flown by, but for its biases."""
    kalman, other = estimator["filters"][k], estimator["filters"][primary]
    if other["elapsed"] != 0.0:
        return
    gyro, force = vec3(kalman["x"][GYRO_BIAS:]), vec3(kalman["x"][FORCE_BIAS:])
    copy_record(kalman, other)
    P = kalman["P"]
    for j in range(3):
        kalman["x"][GYRO_BIAS + j], kalman["x"][FORCE_BIAS + j] = gyro[j], force[j]
        for c in range(N):
            P[GYRO_BIAS + j, c] = P[c, GYRO_BIAS + j] = 0.0
            P[FORCE_BIAS + j, c] = P[c, FORCE_BIAS + j] = 0.0
        P[GYRO_BIAS + j, GYRO_BIAS + j] = assumed["gyro_bias"]
        P[FORCE_BIAS + j, FORCE_BIAS + j] = assumed["force_bias"]
    for row in range(history.shape[1]):
        for j in range(TRAVEL):
            history[k, row, j] = history[primary, row, j]
