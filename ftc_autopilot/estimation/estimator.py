"""The estimator: what an autopilot with sensors flies by in place of the true state."""

import math
from typing import NamedTuple

import numpy as np

from ftc_autopilot.estimation.airspeed import AIRSPEED
from ftc_autopilot.estimation.alignment import align
from ftc_autopilot.estimation.config import PARAMETERS, EstimatorConfig, parameters_of
from ftc_autopilot.estimation.health import (
    INCONSISTENT,
    SENSOR,
    WELL,
    is_used,
    new_sensor_health,
    note_sample,
)
from ftc_autopilot.estimation.imus import IMU, is_useless, judge_imus, note_imu, runs, sample_of
from ftc_autopilot.estimation.isolation import DOUBTED_AGAIN_S, isolate, watch_air
from ftc_autopilot.estimation.measurements import (
    SETTLING_S,
    fuse_barometer,
    fuse_gnss,
    fuse_magnetometer,
    fuse_pitot,
    fuse_sideslip,
    is_settled,
    travel_at,
)
from ftc_autopilot.estimation.output import REPORT, hand_over, pay, write_motion, write_report
from ftc_autopilot.estimation.predict import predict
from ftc_autopilot.estimation.receiver import FIX, RECEIVER, forget_moves, write_fix
from ftc_autopilot.estimation.resets import place_first, wind_of_now
from ftc_autopilot.estimation.state import (
    FILTER,
    FORCE_BIAS,
    GNSS_HEIGHT,
    GNSS_VELOCITY,
    GYRO_BIAS,
    HISTORY_S,
    N_SENSORS,
    POS,
    SIDESLIP,
    TESTED,
    TRAVEL,
    VEL,
    N,
)
from mavlink_defs.constants import BAROMETER, GNSS, MAGNETOMETER, PITOT
from mavlink_defs.framing.codec import HIL_GPS, HIL_SENSOR, SIM_STATE, SIM_STEP, copy_step
from mavlink_defs.runtime.jit import apart, compiled
from mavlink_defs.runtime.memory import copy_record
from sitl_plant.sensing.config import MAX_IMUS
from sitl_plant.sensing.standard_air import altitude_of
from sitl_plant.sensing.units import is_updated
from sitl_plant.vec3 import square, vec3

__all__ = ["ESTIMATOR", "Estimator", "EstimatorConfig", "estimate", "new_estimator"]

_FIX_3D = 3
_PA = 100.0  # in one hPa
_SIDESLIP_EVERY_S = 0.05
_MAX_GAP_US = 200_000  # time without data after which the estimate begins again
_MEMORY_S = 0.7  # more than the latency that a receiver says: it may be later
_OLDEST_S = 5.0  # of a fix that says something: velocity by then ± 25 m/s
_ALONE_S = 1.0  # without a receiver
_VELOCITY_ERROR = 1.0  # m/s, of dead reckoning, when a receiver is back


PROGRESS = np.dtype(
    [
        ("step", "i8"),
        ("run", "i8"),
        ("imu", "i8"),  # flown by
        ("without_gnss", "f8"),  # time since a velocity or place of the receiver was fused [s]
        ("doubted", "f8"),  # time since biases were doubted [s]
        ("late", "f8"),  # the same of the receiver's latency [s]
        ("altitude", "f8"),  # by the barometer, NaN: none
        ("pressure", "f8"),  # of the pitot tube [Pa]
    ]
)
"""Where an estimator is."""


ESTIMATOR = np.dtype(
    [
        ("parameters", PARAMETERS),
        ("progress", PROGRESS),
        ("sensors", SENSOR, (N_SENSORS,)),
        ("airspeed", AIRSPEED),
        ("fix", FIX),
        ("receiver", RECEIVER),
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
    if (
        progress["step"] < 0
        or run != progress["run"]
        or gap < 0
        or gap * assumed["step_us"] > _MAX_GAP_US
    ):
        _begin(estimator, history, imus, assumed)
        gap = 1
    elif gap > 0:
        for k in range(assumed["imus"]):
            note_imu(estimator["imus"][k], imus[k], assumed)
        for _ in range(gap):
            _advance(estimator, history, assumed)
    if gap > 0:
        slip = _is_due(step, gap, assumed)
        age = (int(sim_step["time_usec"]) - int(gps["time_usec"])) / 1e6
        fixed = has_gps and gps["fix_type"] >= _FIX_3D and age < _OLDEST_S
        _note_samples(estimator, imus[0], gps, fixed)
        if fixed:
            write_fix(estimator["fix"], gps, assumed)
            estimator["fix"]["age"] = age
        _aid(estimator, history, imus[0], fixed, slip, assumed)
        isolate(estimator, history, fixed, assumed)
        if slip:
            watch_air(estimator, _SIDESLIP_EVERY_S, assumed)
        _switch(estimator, history, assumed)
    progress["step"], progress["run"] = step, run
    kalman, report = estimator["filters"][progress["imu"]], estimator["report"]
    write_motion(kalman, report["quaternion"], measured)
    write_report(kalman, estimator["imus"], estimator["sensors"], progress["imu"], assumed, report)
    report["step"], report["run"] = step, run
    copy_step(sim_step, measured)


@compiled
def _is_due(step: int, gap: int, assumed: np.void) -> bool:
    """Return whether the sideslip is to be fused in a step: once in `_SIDESLIP_EVERY_S`."""
    every, now = int(1e6 * _SIDESLIP_EVERY_S), step * assumed["step_us"]
    return bool(now // every != (now - gap * assumed["step_us"]) // every)


@compiled
def _begin(estimator: np.void, history: np.ndarray, imus: np.ndarray, assumed: np.void) -> None:
    first, progress = imus[0], estimator["progress"]
    if progress["step"] >= 0:
        estimator["report"]["resets"] += 1
    progress["imu"], progress["without_gnss"] = 0, 0.0
    progress["doubted"] = progress["late"] = DOUBTED_AGAIN_S
    progress["altitude"], progress["pressure"] = math.nan, math.nan
    estimator["receiver"]["since"], estimator["airspeed"]["age"] = 0, 0.0
    for s in TESTED:  # what another filter found inconsistent is not so for this one
        forget_moves(estimator["receiver"], s)
        if estimator["sensors"][s]["reason"] == INCONSISTENT:
            estimator["sensors"][s]["reason"] = WELL
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
        estimator["filters"][k]["unsettled"] = SETTLING_S
        history[k, :, :] = 0.0


@compiled
def _advance(estimator: np.void, history: np.ndarray, assumed: np.void) -> None:
    """Advance all filters by one step."""
    step_s = assumed["step_us"] / 1e6
    estimator["progress"]["without_gnss"] += step_s
    estimator["progress"]["doubted"] += step_s
    estimator["progress"]["late"] += step_s
    estimator["fix"]["age"] += step_s
    for k in range(assumed["imus"]):
        if not (runs(estimator["imus"][k], step_s) or k == estimator["progress"]["imu"]):
            continue
        kalman = estimator["filters"][k]
        rates, force = sample_of(estimator["imus"][k])
        kalman["blind"][0] = is_useless(estimator["imus"][k], 0, assumed)
        kalman["blind"][1] = is_useless(estimator["imus"][k], 1, assumed)
        if kalman["blind"][0] == 1:
            rates = vec3(kalman["x"][GYRO_BIAS:])
        if kalman["blind"][1] == 1:
            bias = vec3(kalman["x"][FORCE_BIAS:])
            force = bias[0], bias[1], bias[2] - assumed["gravity"]
        predict(kalman, rates, force, assumed)
        kalman["unsettled"] -= step_s
        pay(kalman, assumed)
        if kalman["elapsed"] == 0.0:
            row = kalman["entry"] % history.shape[1]
            for j in range(TRAVEL):
                history[k, row, j] = kalman["travel"][j]
            kalman["entry"] += 1


@compiled
def _note_samples(estimator: np.void, first: np.void, gps: np.void, fixed: bool) -> None:
    """Note which sensors beside the IMUs have new samples."""
    sensors, progress = estimator["sensors"], estimator["progress"]
    field = float(first["xmag"]), float(first["ymag"]), float(first["zmag"])
    note_sample(sensors[MAGNETOMETER], is_updated(first, MAGNETOMETER), *field)
    barometric = float(first["abs_pressure"])
    note_sample(sensors[BAROMETER], is_updated(first, BAROMETER), barometric, 0.0, 0.0)
    pressure = _PA * float(first["diff_pressure"])
    note_sample(sensors[PITOT], is_updated(first, PITOT), pressure, 0.0, 0.0)
    note_sample(sensors[GNSS], fixed, float(gps["lat"]), float(gps["lon"]), 0.0)
    velocity = float(gps["vn"]), float(gps["ve"]), float(gps["vd"])
    note_sample(sensors[GNSS_VELOCITY], fixed, *velocity)
    note_sample(sensors[GNSS_HEIGHT], fixed, float(gps["alt"]), 0.0, 0.0)
    if sensors[BAROMETER]["fresh"] == 1:
        progress["altitude"] = altitude_of(max(barometric, 1.0))
    if sensors[PITOT]["fresh"] == 1:
        progress["pressure"] = pressure


@compiled
def _aid(
    estimator: np.void,
    history: np.ndarray,
    first: np.void,
    fixed: bool,
    slip: bool,
    assumed: np.void,
) -> None:
    """Fuse what has come from the sensors beside the IMUs."""
    sensors, progress = estimator["sensors"], estimator["progress"]
    field = float(first["xmag"]), float(first["ymag"]), float(first["zmag"])
    primary, alone = progress["imu"], progress["without_gnss"] > _ALONE_S
    if fixed and progress["without_gnss"] > 2.0:
        _loosen(estimator, assumed)
        progress["without_gnss"] = 0.0
    for k in range(assumed["imus"]):
        if not (runs(estimator["imus"][k], assumed["step_us"] / 1e6) or k == primary):
            continue
        kalman = estimator["filters"][k]
        ratios = kalman["ratios"]
        if sensors[MAGNETOMETER]["fresh"] == 1:
            use = is_used(sensors[MAGNETOMETER])
            ratios[MAGNETOMETER] = fuse_magnetometer(kalman, field, assumed, use)
        if sensors[BAROMETER]["fresh"] == 1:
            use = is_used(sensors[BAROMETER])
            ratios[BAROMETER] = fuse_barometer(kalman, progress["altitude"], assumed, use)
        if sensors[PITOT]["fresh"] == 1:
            use = is_used(sensors[PITOT])
            if use and kalman["odd"] == 1 and is_settled(kalman):
                wind_of_now(kalman, progress["pressure"], assumed)
            ratios[PITOT] = fuse_pitot(kalman, progress["pressure"], assumed, use, alone)
        if fixed:
            _fuse_fix(estimator, kalman, history[k], assumed)
        if slip and kalman["blind"][1] == 0:
            ratios[SIDESLIP] = fuse_sideslip(kalman, _SIDESLIP_EVERY_S, assumed, alone)
    ratios, gate = estimator["filters"][primary]["ratios"], assumed["gate"]
    if fixed and is_used(sensors[GNSS_VELOCITY]) and ratios[GNSS_VELOCITY] < gate:
        progress["without_gnss"] = 0.0


@compiled
def _fuse_fix(estimator: np.void, kalman: np.void, history: np.ndarray, assumed: np.void) -> None:
    """Fuse a fix in one filter, which may get its place by it."""
    fix, past, sensors = estimator["fix"], estimator["past"], estimator["sensors"]
    gap = travel_at(kalman, fix, history, past)
    if kalman["placed"] == 0 and is_used(sensors[GNSS]):
        heading, air = sensors[MAGNETOMETER]["reason"] == WELL, sensors[PITOT]["reason"] == WELL
        place_first(kalman, fix, past, gap, heading, air, assumed)
        kalman["placed"] = 1
        kalman["owed"][:] = 0.0  # from a guess to a place, at once
        return
    use = is_used(sensors[GNSS]), is_used(sensors[GNSS_VELOCITY]), is_used(sensors[GNSS_HEIGHT])
    fuse_gnss(kalman, fix, past, gap, assumed, use)


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
def _switch(estimator: np.void, history: np.ndarray, assumed: np.void) -> None:
    """Fly by another IMU if this one is not well, and give one that is well again its filter."""
    progress, filters, imus = estimator["progress"], estimator["filters"], estimator["imus"]
    before = int(progress["imu"])
    primary = judge_imus(imus, filters, before, assumed)
    if primary != before:
        hand_over(filters[before], filters[primary])
        progress["imu"] = primary
        estimator["receiver"]["since"] = 0  # whose travel is of the other one
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
