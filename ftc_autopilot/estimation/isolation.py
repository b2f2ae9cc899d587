"""What follows from the tests of the sensors: who is excluded, taken back, doubted or reset.

`judging` says who is to blame; this acts on it, in all filters.
"""

import math

import numpy as np

from ftc_autopilot.estimation.airspeed import (
    FLIGHT,
    SHORT,
    is_icing,
    is_impossible,
    is_stalled,
    lift_disagrees,
    note_lift,
)
from ftc_autopilot.estimation.health import (
    INCONSISTENT,
    STUCK,
    WELL,
    exclude,
    is_used,
    note_test,
)
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
from ftc_autopilot.estimation.measurements import fuse_gnss, is_settled, travel_at
from ftc_autopilot.estimation.predict import fade
from ftc_autopilot.estimation.receiver import (
    forget_moves,
    has_moved,
    is_kept_out,
    leave_out,
    note_fix,
)
from ftc_autopilot.estimation.resets import (
    RESTORED,
    doubt_barometer,
    doubt_biases,
    doubt_latency,
    doubt_magnetometer,
    doubt_wind,
    place_of_now,
    reset_height,
    reset_to_fix,
    restore_wind,
)
from ftc_autopilot.estimation.state import GNSS_HEIGHT, GNSS_PARTS, GNSS_VELOCITY, TESTED, VEL, WIND
from mavlink_defs.constants import BAROMETER, GNSS, MAGNETOMETER, PITOT
from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import square

_RECENT_US = 50_000  # age of a sample of the barometer that a fix can be compared with
DOUBTED_AGAIN_S = 5.0
"""Least time between two doubts of the biases [s]."""


@compiled
def isolate(estimator: np.void, history: np.ndarray, fixed: bool, assumed: np.void) -> None:
    """Exclude and take back sensors, and reset the filters if these are to blame.

    Args:
        estimator: Record of dtype `estimator.ESTIMATOR`, updated in place.
        history: Its memory of past steps.
        fixed: Whether a fix came in this step.
        assumed: Record of dtype `PARAMETERS`.
    """
    sensors, progress = estimator["sensors"], estimator["progress"]
    receiver, imus = estimator["receiver"], estimator["imus"]
    kalman = estimator["filters"][progress["imu"]]
    first = kalman["unsettled"] > 0.0 and receiver["since"] == 0
    if first or imus[progress["imu"]]["reason"] != WELL:
        receiver["since"] = 0
        return
    if fixed:
        _compare(estimator, kalman, history[progress["imu"]], assumed)
    if kalman["unsettled"] > 0.0:
        return
    for s in TESTED:
        if sensors[s]["fresh"] == 0:
            continue
        before = sensors[s]["reason"]
        if before == INCONSISTENT and _is_kept_out(s, estimator, assumed):
            sensors[s]["passed"] = 0
        failed = note_test(sensors[s], kalman["ratios"][s], assumed)
        if before == INCONSISTENT and sensors[s]["reason"] == WELL:
            forget_moves(receiver, s)
            if s == PITOT:
                estimator["airspeed"]["age"] = 0.0
        if not failed:
            continue
        rested = progress["doubted"] > DOUBTED_AGAIN_S
        who = judge(s, sensors, receiver, estimator["airspeed"], rested, assumed)
        if who == IT and not (s == GNSS_VELOCITY and _is_late(estimator, history, assumed)):
            _exclude(estimator, s, assumed)
        elif who == THE_BAROMETER:
            _exclude(estimator, BAROMETER, assumed)
        elif who not in (IT, NOBODY):
            _mend(estimator, history, who, assumed)
            for other in TESTED:
                sensors[other]["failed"] = 0
            break


@compiled
def _compare(estimator: np.void, kalman: np.void, history: np.ndarray, assumed: np.void) -> None:
    """Compare a fix with the one before, and exclude what moves without a velocity."""
    sensors, receiver, fix = estimator["sensors"], estimator["receiver"], estimator["fix"]
    past = estimator["past"]
    travel_at(kalman, fix, history, past)
    altitude = estimator["progress"]["altitude"]
    if sensors[BAROMETER]["silent"] * assumed["step_us"] > _RECENT_US:
        altitude = math.nan
    else:  # then, by the estimated velocity: the barometer's sample is of now
        altitude += kalman["x"][VEL + 2] * (kalman["travel"][6] - past[6])
    note_fix(receiver, fix, past, altitude, assumed)
    if sensors[GNSS]["reason"] == STUCK:
        forget_moves(receiver, GNSS)
        forget_moves(receiver, GNSS_HEIGHT)
    if not is_used(sensors[GNSS_VELOCITY]):
        receiver["since"] = 0
        return
    moved = has_moved(receiver, GNSS_HEIGHT, assumed) and has_moved(receiver, BAROMETER, assumed)
    if moved and sensors[GNSS_HEIGHT]["reason"] == sensors[BAROMETER]["reason"] == WELL:
        for s in (
            GNSS,
            GNSS_HEIGHT,
            BAROMETER,
        ):  # these agree: it is the velocity, which has a test
            forget_moves(receiver, s)
        return
    if kalman["unsettled"] > 0.0:
        return
    for s in (GNSS, GNSS_HEIGHT, BAROMETER):
        if sensors[s]["reason"] == WELL and has_moved(receiver, s, assumed):
            _exclude(estimator, s, assumed)


@compiled
def _is_late(estimator: np.void, history: np.ndarray, assumed: np.void) -> bool:
    """Return whether a velocity passes if the receiver may be late; its latency is doubted then."""
    progress, fix, none = estimator["progress"], estimator["fix"], (False, False, False)
    rested = progress["late"] > DOUBTED_AGAIN_S
    progress["late"] = 0.0
    for k in range(assumed["imus"]):
        doubt_latency(estimator["filters"][k], assumed)
    kalman = estimator["filters"][progress["imu"]]
    gap = travel_at(kalman, fix, history[progress["imu"]], estimator["past"])
    fuse_gnss(kalman, fix, estimator["past"], gap, assumed, none)
    if not rested or kalman["ratios"][GNSS_VELOCITY] > assumed["gate"]:
        return False
    estimator["sensors"][GNSS_VELOCITY]["failed"] = 0
    return True


@compiled
def _exclude(estimator: np.void, s: int, assumed: np.void) -> None:
    """Exclude a sensor that is inconsistent."""
    exclude(estimator["sensors"][s], INCONSISTENT)
    leave_out(estimator["receiver"], s)
    if s == PITOT and estimator["airspeed"]["age"] > 0.0:  # it may have had its wind before
        for k in range(assumed["imus"]):
            restore_wind(estimator["filters"][k], estimator["airspeed"])
    if s == GNSS_VELOCITY:  # by which the barometer was judged
        estimator["receiver"]["since"] = 0
        if estimator["sensors"][BAROMETER]["reason"] == WELL:
            forget_moves(estimator["receiver"], BAROMETER)
    elif s == MAGNETOMETER:
        for k in range(assumed["imus"]):
            doubt_magnetometer(estimator["filters"][k], assumed)


@compiled
def _is_kept_out(s: int, estimator: np.void, assumed: np.void) -> bool:
    """Return whether there is more than its innovations against an inconsistent sensor."""
    if s == PITOT:
        airspeed = estimator["airspeed"]
        return lift_disagrees(airspeed, SHORT, assumed) or is_stalled(airspeed, assumed)
    return is_kept_out(estimator["receiver"], s, assumed)


@compiled
def _mend(estimator: np.void, history: np.ndarray, who: int, assumed: np.void) -> None:
    """Doubt, or reset, what is to blame in all filters."""
    progress, fix, past = estimator["progress"], estimator["fix"], estimator["past"]
    for k in range(assumed["imus"]):
        kalman = estimator["filters"][k]
        if who == THE_WIND:
            doubt_wind(kalman, progress["pressure"], assumed)
        elif who == THE_BIASES:
            doubt_biases(kalman)
        elif who == THE_OFFSET:
            doubt_barometer(kalman, assumed)
        else:
            gap = travel_at(kalman, fix, history[k], past)
            if who == THE_HEIGHT:
                reset_height(kalman, place_of_now(kalman, fix, past, 2), assumed)
            else:
                reset_to_fix(kalman, fix, past, gap, assumed)
    if who in (THE_BIASES, THE_FILTER):
        progress["doubted"] = 0.0
    if who == THE_FILTER:
        estimator["report"]["resets"] += 1
        for s in GNSS_PARTS:
            estimator["sensors"][s]["reason"] = WELL
            forget_moves(estimator["receiver"], s)
        progress["without_gnss"] = 0.0


@compiled
def watch_air(estimator: np.void, period_s: float, assumed: np.void) -> None:
    """Exclude a pitot tube that ices up; let the wind return to its mean without a receiver.

    Args:
        estimator: Record of dtype `estimator.ESTIMATOR`, updated in place.
        period_s: Time since the last call [s].
        assumed: Record of dtype `PARAMETERS`.
    """
    airspeed, sensors = estimator["airspeed"], estimator["sensors"]
    kalman = estimator["filters"][estimator["progress"]["imu"]]
    without, pressure = estimator["progress"]["without_gnss"], estimator["progress"]["pressure"]
    if kalman["blind"][1] == 1 or not is_settled(kalman):
        airspeed["means"][:FLIGHT, :] = 0.0  # until they are of samples that come after
        return
    if not math.isnan(pressure):
        note_lift(kalman, airspeed, pressure, period_s, assumed)
    if is_used(sensors[PITOT]) and without < 1.0:
        icing = is_icing(kalman, airspeed, period_s, assumed)
        if icing:
            for k in range(assumed["imus"]):
                restore_wind(estimator["filters"][k], airspeed)
        impossible = is_impossible(airspeed, assumed)
        if icing or impossible:
            exclude(sensors[PITOT], INCONSISTENT)
            airspeed["suspicious"] = 0.0
        if impossible:
            airspeed["means"][FLIGHT, :] = 0.0  # of a tube that was wrong from the start
    elif without >= 1.0 and airspeed["age"] > 0.0:
        for k in range(assumed["imus"]):
            own = estimator["filters"][k]
            for j in range(2):
                mean = airspeed["wind"][j]
                own["x"][WIND + j] -= mean
                share = period_s / assumed["wind_return_s"]
                fade(own, WIND + j, share, airspeed["gusts"][j] + square(RESTORED))
                own["x"][WIND + j] += mean
