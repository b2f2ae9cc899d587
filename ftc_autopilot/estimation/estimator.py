"""The estimator: what an autopilot with sensors flies by in place of the true state."""

import math
from typing import NamedTuple

import numpy as np

from ftc_autopilot.estimation.airspeed import (
    AIRSPEED,
    RESTORED,
    forget,
    is_icing,
    is_impossible,
    lift_disagrees,
    lift_ratio,
    restore_wind,
)
from ftc_autopilot.estimation.alignment import align
from ftc_autopilot.estimation.config import PARAMETERS, EstimatorConfig, parameters_of
from ftc_autopilot.estimation.health import (
    INCONSISTENT,
    SENSOR,
    STUCK,
    WELL,
    exclude,
    is_used,
    new_sensor_health,
    note_sample,
    note_test,
)
from ftc_autopilot.estimation.imus import IMU, is_useless, judge_imus, note_imu, runs, sample_of
from ftc_autopilot.estimation.judging import (
    IT,
    NOBODY,
    THE_BAROMETER,
    THE_BIASES,
    THE_FILTER,
    THE_HEIGHT,
    THE_OFFSET,
    THE_WIND,
    judge,
)
from ftc_autopilot.estimation.latency import LATENCY, LONGEST_S, note_velocity
from ftc_autopilot.estimation.measurements import (
    SETTLING_S,
    fuse_barometer,
    fuse_gnss,
    fuse_magnetometer,
    fuse_pitot,
    fuse_sideslip,
    is_settled,
    past_travel,
)
from ftc_autopilot.estimation.output import REPORT, hand_over, pay, write_motion, write_report
from ftc_autopilot.estimation.predict import fade, predict
from ftc_autopilot.estimation.receiver import (
    BAROMETRIC,
    RECEIVER,
    forget_moves,
    has_moved,
    is_kept_out,
    leave_out,
    note_fix,
)
from ftc_autopilot.estimation.resets import (
    doubt_barometer,
    doubt_biases,
    doubt_magnetometer,
    doubt_wind,
    now_of,
    place_first,
    reset_height,
    reset_to_fix,
)
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
    WIND,
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
_MAX_GAP_US = 200_000  # time without data after which the estimate begins again
_MEMORY_S = 0.1 + LONGEST_S  # longer than the latency
_VELOCITY_ERROR = 1.0  # m/s, of dead reckoning, when a receiver is back

_RECENT_US = 50_000  # age of a sample of the barometer that a fix can be compared with
_DOUBTED_AGAIN_S = 5.0  # biases

PROGRESS = np.dtype(
    [
        ("step", "i8"),
        ("run", "i8"),
        ("imu", "i8"),  # flown by
        ("without_gnss", "f8"),  # time since a velocity or place of the receiver was fused [s]
        ("doubted", "f8"),  # time since biases were doubted [s]
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
        ("receiver", RECEIVER),
        ("latency", LATENCY),
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
        fixed = has_gps and gps["fix_type"] >= _FIX_3D
        _note_samples(estimator, imus[0], gps, fixed, assumed)
        age = 0.0
        if fixed:
            age = (int(sim_step["time_usec"]) - int(gps["time_usec"])) / 1e6
            age = _age(estimator, history, gps, age, assumed)
        _aid(estimator, history, imus[0], gps, fixed, age, slip, assumed)
        _judge(estimator, history, gps, fixed, age, assumed)
        if slip:
            _watch_air(estimator, assumed)
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
    progress["imu"], progress["without_gnss"], progress["doubted"] = 0, 0.0, _DOUBTED_AGAIN_S
    progress["altitude"], progress["pressure"] = math.nan, math.nan
    estimator["receiver"]["since"] = 0
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
def _note_samples(
    estimator: np.void, first: np.void, gps: np.void, fixed: bool, assumed: np.void
) -> None:
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
def _age(
    estimator: np.void, history: np.ndarray, gps: np.void, stated: float, assumed: np.void
) -> float:
    """Return the age of a fix [s], by what it says and what has been learned of its latency."""
    latency, progress = estimator["latency"], estimator["progress"]
    kalman = estimator["filters"][progress["imu"]]
    if kalman["unsettled"] <= 0.0 and estimator["imus"][progress["imu"]]["reason"] == WELL:
        _, velocity = _place(gps, assumed)
        own = history[progress["imu"]]
        past = estimator["past"]
        if note_velocity(latency, own, kalman["travel"], velocity, stated, past, assumed):
            estimator["receiver"]["since"] = 0
            forget_moves(estimator["receiver"], 0, 2)
            estimator["report"]["delay"] = latency["delay"]
    else:
        latency["age"] = 0.0
    return float(max(stated + latency["delay"], 0.0))


@compiled
def _aid(
    estimator: np.void,
    history: np.ndarray,
    first: np.void,
    gps: np.void,
    fixed: bool,
    age: float,
    slip: bool,
    assumed: np.void,
) -> None:
    """Fuse what has come from the sensors beside the IMUs, a fix of some age [s] among them."""
    sensors, progress = estimator["sensors"], estimator["progress"]
    field = float(first["xmag"]), float(first["ymag"]), float(first["zmag"])
    primary = progress["imu"]
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
            ratios[PITOT] = fuse_pitot(kalman, progress["pressure"], assumed, use)
        if fixed:
            _fuse_fix(estimator, kalman, history[k], gps, age, assumed)
        if slip and kalman["blind"][1] == 0:
            ratios[SIDESLIP] = fuse_sideslip(kalman, _SIDESLIP_EVERY_S, assumed)
    ratios, gate = estimator["filters"][primary]["ratios"], assumed["gate"]
    if fixed and is_used(sensors[GNSS_VELOCITY]) and ratios[GNSS_VELOCITY] < gate:
        progress["without_gnss"] = 0.0


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
    past, sensors = estimator["past"], estimator["sensors"]
    gap = past_travel(history, kalman["travel"], age, past)
    position, velocity = _place(gps, assumed)
    if kalman["placed"] == 0 and is_used(sensors[GNSS]):
        heading, air = sensors[MAGNETOMETER]["reason"] == WELL, sensors[PITOT]["reason"] == WELL
        place_first(kalman, position, velocity, past, gap, heading, air, assumed)
        kalman["placed"] = 1
        kalman["owed"][:] = 0.0  # from a guess to a place, at once
        return
    use = is_used(sensors[GNSS]), is_used(sensors[GNSS_VELOCITY]), is_used(sensors[GNSS_HEIGHT])
    fuse_gnss(kalman, position, velocity, past, gap, assumed, use)


@compiled
def _judge(
    estimator: np.void,
    history: np.ndarray,
    gps: np.void,
    fixed: bool,
    age: float,
    assumed: np.void,
) -> None:
    """Exclude and take back sensors, and reset the filters if these are to blame."""
    sensors, progress = estimator["sensors"], estimator["progress"]
    receiver, imus = estimator["receiver"], estimator["imus"]
    kalman = estimator["filters"][progress["imu"]]
    if kalman["unsettled"] > 0.0 or imus[progress["imu"]]["reason"] != WELL:
        receiver["since"] = 0
        return
    if fixed:
        _compare(estimator, kalman, history[progress["imu"]], gps, age, assumed)
    ratio = math.nan
    if sensors[PITOT]["fresh"] == 1 and kalman["blind"][1] == 0:
        ratio = lift_ratio(kalman, estimator["airspeed"], progress["pressure"], assumed)
    late = sensors[GNSS]["silent"] * assumed["step_us"] / 1e6  # since the last fix
    for s in TESTED:
        if sensors[s]["fresh"] == 0:
            continue
        before = sensors[s]["reason"]
        if _is_kept_out(s, estimator, ratio, assumed):
            sensors[s]["passed"] = 0
        failed = note_test(sensors[s], kalman["ratios"][s], assumed)
        if before == INCONSISTENT and sensors[s]["reason"] == WELL:
            _settle_moves(receiver, s)
            if s == PITOT:
                estimator["airspeed"]["age"] = 0.0
        if not failed:
            continue
        rested = progress["doubted"] > _DOUBTED_AGAIN_S
        who = judge(s, sensors, receiver, estimator["airspeed"], ratio, rested, assumed)
        if who == IT:
            _exclude(estimator, s, assumed)
        elif who == THE_BAROMETER:
            _exclude(estimator, BAROMETER, assumed)
        elif who != NOBODY:
            _mend(estimator, history, who, gps, age + late, assumed)
            for other in TESTED:
                sensors[other]["failed"] = 0
            break


@compiled
def _compare(
    estimator: np.void,
    kalman: np.void,
    history: np.ndarray,
    gps: np.void,
    age: float,
    assumed: np.void,
) -> None:
    """Compare a fix with the one before, and exclude what moves without a velocity."""
    sensors, receiver, past = estimator["sensors"], estimator["receiver"], estimator["past"]
    past_travel(history, kalman["travel"], age, past)
    position, velocity = _place(gps, assumed)
    altitude = estimator["progress"]["altitude"]
    if sensors[BAROMETER]["silent"] * assumed["step_us"] > _RECENT_US:
        altitude = math.nan
    else:  # then, by the estimated velocity: the barometer's sample is of now
        altitude += kalman["x"][VEL + 2] * age
    note_fix(receiver, position, velocity, past, altitude, assumed)
    if sensors[GNSS]["reason"] == STUCK:
        forget_moves(receiver, 0, 2)
    if not is_used(sensors[GNSS_VELOCITY]):
        receiver["since"] = 0
        return
    flat = has_moved(receiver, 0, assumed) or has_moved(receiver, 1, assumed)
    height, barometric = has_moved(receiver, 2, assumed), has_moved(receiver, BAROMETRIC, assumed)
    if height and barometric and sensors[BAROMETER]["reason"] == WELL:  # it is the velocity
        forget_moves(receiver, 0, BAROMETRIC)
        return
    if flat and sensors[GNSS]["reason"] == WELL:
        _exclude(estimator, GNSS, assumed)
    if height and sensors[GNSS_HEIGHT]["reason"] == WELL:
        _exclude(estimator, GNSS_HEIGHT, assumed)
    if barometric and sensors[BAROMETER]["reason"] == WELL:
        _exclude(estimator, BAROMETER, assumed)


@compiled
def _exclude(estimator: np.void, s: int, assumed: np.void) -> None:
    """Exclude a sensor that is inconsistent."""
    exclude(estimator["sensors"][s], INCONSISTENT)
    receiver = estimator["receiver"]
    if s == MAGNETOMETER:
        for k in range(assumed["imus"]):
            doubt_magnetometer(estimator["filters"][k], assumed)
    if s == GNSS:
        leave_out(receiver, 0, 1)
    elif s == GNSS_HEIGHT:
        leave_out(receiver, 2, 2)
    elif s == BAROMETER:
        leave_out(receiver, BAROMETRIC, BAROMETRIC)


@compiled
def _is_kept_out(s: int, estimator: np.void, ratio: float, assumed: np.void) -> bool:
    """Return whether there is more than its innovations against an excluded sensor."""
    if estimator["sensors"][s]["reason"] != INCONSISTENT:
        return False
    receiver = estimator["receiver"]
    if s == GNSS:
        return is_kept_out(receiver, 0, assumed) or is_kept_out(receiver, 1, assumed)
    if s == GNSS_HEIGHT:
        return is_kept_out(receiver, 2, assumed)
    if s == BAROMETER:
        return is_kept_out(receiver, BAROMETRIC, assumed)
    return s == PITOT and lift_disagrees(estimator["airspeed"], ratio, assumed)


@compiled
def _settle_moves(receiver: np.void, s: int) -> None:
    if s == GNSS:
        forget_moves(receiver, 0, 1)
    elif s == GNSS_HEIGHT:
        forget_moves(receiver, 2, 2)
    elif s == BAROMETER:
        forget_moves(receiver, BAROMETRIC, BAROMETRIC)


@compiled
def _mend(
    estimator: np.void, history: np.ndarray, who: int, gps: np.void, age: float, assumed: np.void
) -> None:
    """Doubt, or reset, what is to blame in all filters."""
    sensors, progress = estimator["sensors"], estimator["progress"]
    for k in range(assumed["imus"]):
        kalman = estimator["filters"][k]
        if who == THE_WIND:
            doubt_wind(kalman, progress["pressure"], assumed)
        elif who == THE_BIASES:
            doubt_biases(kalman)
        elif who == THE_OFFSET:
            doubt_barometer(kalman, assumed)
        else:
            gap = past_travel(history[k], kalman["travel"], age, estimator["past"])
            position, velocity = _place(gps, assumed)
            past = estimator["past"]
            if who == THE_HEIGHT:
                place, _ = now_of(kalman, position, velocity, past)
                reset_height(kalman, place[2], assumed)
            else:
                reset_to_fix(kalman, position, velocity, past, gap, assumed)
    if who in (THE_BIASES, THE_FILTER):
        progress["doubted"] = 0.0
    if who == THE_FILTER:
        estimator["report"]["resets"] += 1
        for s in (GNSS, GNSS_VELOCITY, GNSS_HEIGHT):
            sensors[s]["reason"] = WELL
        forget_moves(estimator["receiver"], 0, 2)
        progress["without_gnss"] = 0.0


@compiled
def _watch_air(estimator: np.void, assumed: np.void) -> None:
    """Exclude a pitot tube that ices up; let the wind return to its mean without a receiver."""
    airspeed, sensors = estimator["airspeed"], estimator["sensors"]
    kalman = estimator["filters"][estimator["progress"]["imu"]]
    without = estimator["progress"]["without_gnss"]
    if kalman["blind"][1] == 1 or not is_settled(kalman):
        return
    if is_used(sensors[PITOT]) and without < 1.0:
        icing = is_icing(kalman, airspeed, _SIDESLIP_EVERY_S, assumed)
        if icing:
            for k in range(assumed["imus"]):
                restore_wind(estimator["filters"][k], airspeed)
        impossible = is_impossible(airspeed)
        if icing or impossible:
            exclude(sensors[PITOT], INCONSISTENT)
            airspeed["suspicious"] = 0.0
        if impossible:
            forget(airspeed)
    elif without >= 1.0 and airspeed["age"] > 0.0:
        for k in range(assumed["imus"]):
            own = estimator["filters"][k]
            for j in range(2):
                mean = airspeed["wind"][j]
                own["x"][WIND + j] -= mean
                share = _SIDESLIP_EVERY_S / assumed["wind_return_s"]
                fade(own, WIND + j, share, airspeed["gusts"][j] + square(RESTORED))
                own["x"][WIND + j] += mean


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
        estimator["receiver"]["since"] = 0  # whose travel is of the other one
        estimator["latency"]["age"] = 0.0
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
