"""Ways back for a filter: to its first place, and to a GNSS receiver that it has lost.

As PX4's EKF2 does when nothing was fused for too long. The covariance is one that such an estimate
deserves: velocity and place are the receiver's, the attitude is doubted, and so are the biases.
"""

import math

import numpy as np

from ftc_autopilot.estimation.fuse import clear, correct, innovation_variance
from ftc_autopilot.estimation.measurements import SETTLING_S, column, fuse_gnss, through_air
from ftc_autopilot.estimation.state import (
    BARO_ERROR,
    DELAY,
    FORCE_BIAS,
    GNSS_ERROR,
    GYRO_BIAS,
    MAG_BIAS,
    PHI,
    POS,
    VEL,
    WIND,
    N,
    rotation,
    turn_world,
)
from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import Vec3, hypot, square

_DOUBTED_TILT, _DOUBTED_HEADING = math.radians(5.0), math.radians(10.0)
_DOUBTED_GYRO, _DOUBTED_FORCE = math.radians(3.0), 1.0
"""Biases that a fault can have, as by MAV_CMD_INJECT_FAILURE [rad/s, m/s²]."""
_COARSE_AIR = 4.0  # m/s, of the first velocity through the air, by a pitot tube
_ANY_VELOCITY = 300.0  # m/s
_ODD_HEIGHT = 3.0  # standard deviations between barometer and receiver
_ODD_WIND = 2.5  # times what is to be expected: then the magnetometer may be wrong
RESTORED = 0.5
"""Standard deviation of the wind after it has been set back to its mean [m/s]."""


@compiled
def place_of_now(kalman: np.void, fix: np.void, past: np.ndarray, i: int) -> float:
    """Return where a fix says that the aircraft is now, on one axis [m], by `travel` then."""
    travel = kalman["travel"]
    age = travel[6] - past[6]
    since = travel[3 + i] - past[3 + i] - past[i] * age
    return float(fix["position"][i] + fix["velocity"][i] * age + since)


@compiled
def place_first(
    kalman: np.void,
    fix: np.void,
    past: np.ndarray,
    gap: float,
    has_heading: bool,
    has_airspeed: bool,
    assumed: np.void,
) -> None:
    """Give a filter its first place and velocity; wind is what the velocity through the air is not.

    Without a magnetometer, the aircraft heads where it goes. A heading that would need a wind that
    is not to be expected is doubted, and so is the magnetometer: a turn will show it.

    Args:
        kalman: Record of dtype `FILTER`, with a coarse attitude.
        fix: Record of dtype `receiver.FIX`.
        past: `travel` then, shape (7,).
        gap: Time of which `travel` was not remembered [s].
        has_heading: Whether there is a magnetometer that is used.
        has_airspeed: The same of a pitot tube; without it, no wind is the best guess.
        assumed: Record of dtype `PARAMETERS`.
    """
    x, P, velocity = kalman["x"], kalman["P"], fix["velocity"]
    air = through_air(x)
    speed, course = hypot(air[0], air[1]), math.atan2(velocity[1], velocity[0])
    heading = math.atan2(air[1], air[0])
    if not has_heading:
        turn_world(kalman["quaternion"], (0.0, 0.0, course - heading))
        air = speed * math.cos(course), speed * math.sin(course), air[2]
        wind = assumed["wind_m_s"] / max(speed, 1.0)
        _forget(P, PHI + 2)
        P[PHI + 2, PHI + 2] = wind * wind + square(assumed["tilt_rad"])
    wind = hypot(velocity[0] - air[0], velocity[1] - air[1])
    kalman["odd"] = has_heading and wind > _ODD_WIND * assumed["wind_m_s"]
    if kalman["odd"] == 1:
        off = abs((course - heading + math.pi) % (2.0 * math.pi) - math.pi)
        P[PHI + 2, PHI + 2] += square(0.5 * off)
        field = hypot(assumed["field"][0], assumed["field"][1])
        for k in range(3):
            P[MAG_BIAS + k, MAG_BIAS + k] += square(0.5 * field * off)
    down = place_of_now(kalman, fix, past, 2)
    off = down - x[POS + 2]
    if off * off > square(_ODD_HEIGHT) * (P[POS + 2, POS + 2] + assumed["gnss_error"][2]):
        reset_height(kalman, down, assumed)
    _take(kalman, fix, past, gap, 2, assumed)
    if not has_airspeed:
        for i in range(2):
            x[WIND + i] = 0.0
            _forget(P, WIND + i)
            P[WIND + i, WIND + i] = square(assumed["wind_m_s"])
        return
    _take_wind(kalman, air, _COARSE_AIR)
    if wind < _ODD_WIND * assumed["wind_m_s"]:  # then what is to be expected says something, too
        for i in range(2):
            h = clear(kalman)
            h[WIND + i] = 1.0
            correct(kalman, -x[WIND + i], innovation_variance(kalman, square(assumed["wind_m_s"])))


@compiled
def _take_wind(kalman: np.void, air: Vec3, error: float) -> None:
    """Let the wind be what a velocity through the air leaves of the velocity: w = v - a.

    Args:
        kalman: Record of dtype `FILTER`, updated in place.
        air: Velocity through the air, NED [m/s]: known in body axes, it turns with the attitude.
        error: Its standard deviation [m/s].
    """
    x, P = kalman["x"], kalman["P"]
    J = ((0.0, -air[2], air[1]), (air[2], 0.0, -air[0]))
    for i in range(2):
        kalman["owed"][WIND + i] += x[VEL + i] - air[i] - x[WIND + i]
        x[WIND + i] = x[VEL + i] - air[i]
        _forget(P, WIND + i)
        for c in range(N):
            if c < WIND or c > WIND + 1:
                total = P[VEL + i, c]
                for m in range(3):
                    total += J[i][m] * P[PHI + m, c]
                P[WIND + i, c] = P[c, WIND + i] = total
    for i in range(2):
        for k in range(2):
            total = P[WIND + i, VEL + k] + (square(error) if i == k else 0.0)
            for m in range(3):
                total += J[k][m] * P[WIND + i, PHI + m]
            P[WIND + i, WIND + k] = total


@compiled
def wind_of_now(kalman: np.void, pressure: float, assumed: np.void) -> None:
    """Take the wind once more when the attitude is known: the first one was of a wrong heading.

    Of the velocity through the air a pitot tube says how much is ahead; no wind is vertical, and of
    the sideslip nothing is known but its size.

    Args:
        kalman: Record of dtype `FILTER`, updated in place.
        pressure: Of the pitot tube [Pa].
        assumed: Record of dtype `PARAMETERS`.
    """
    R, x = rotation(kalman["quaternion"]), kalman["x"]
    u = math.sqrt(2.0 * max(pressure, 0.0) / assumed["density"])
    w = (x[VEL + 2] - R[2][0] * u) / max(R[2][2], 0.5)
    air = R[0][0] * u + R[0][2] * w, R[1][0] * u + R[1][2] * w, x[VEL + 2]
    _take_wind(kalman, air, max(_COARSE_AIR, u * assumed["sideslip_rad"]))
    kalman["odd"] = 0


@compiled
def _take(
    kalman: np.void,
    fix: np.void,
    past: np.ndarray,
    gap: float,
    axes: int,
    assumed: np.void,
) -> None:
    """Take velocity, and the place along the first axes, from a fix alone."""
    x, P = kalman["x"], kalman["P"]
    for i in range(3):
        speed = fix["velocity"][i] + kalman["travel"][i] - past[i]
        kalman["owed"][VEL + i] += speed - x[VEL + i]
        x[VEL + i] = speed
        _forget(P, VEL + i)
        P[VEL + i, VEL + i] = square(_ANY_VELOCITY)
        if i < axes:
            place = place_of_now(kalman, fix, past, i)
            kalman["owed"][POS + i] += place - x[POS + i]
            x[POS + i], x[GNSS_ERROR + i] = place, 0.0
            _forget(P, POS + i)
            _forget(P, GNSS_ERROR + i)
            P[POS + i, POS + i] = square(assumed["place_m"])
            P[GNSS_ERROR + i, GNSS_ERROR + i] = assumed["gnss_error"][i]
    fuse_gnss(kalman, fix, past, gap, assumed, (True, True, True))


@compiled
def _forget(P: np.ndarray, k: int) -> None:
    for j in range(N):
        P[k, j] = P[j, k] = 0.0


@compiled
def reset_to_fix(
    kalman: np.void,
    fix: np.void,
    past: np.ndarray,
    gap: float,
    assumed: np.void,
) -> None:
    """Let a filter go on from a fix, with an attitude and biases that are doubted.

    Args:
        kalman: Record of dtype `FILTER`, updated in place.
        fix: Record of dtype `receiver.FIX`.
        past: `travel` then, shape (7,).
        gap: Time of which `travel` was not remembered [s].
        assumed: Record of dtype `PARAMETERS`.
    """
    P = kalman["P"]
    for k in range(N):
        own = P[k, k]
        _forget(P, k)
        P[k, k] = own
    for i in range(3):
        doubt = _DOUBTED_HEADING if i == 2 else _DOUBTED_TILT
        P[PHI + i, PHI + i] += square(doubt)
    for i in range(2):
        P[WIND + i, WIND + i] += square(assumed["wind_m_s"])
    doubt_biases(kalman)
    doubt_barometer(kalman, assumed)
    kalman["unsettled"] = SETTLING_S
    _take(kalman, fix, past, gap, 3, assumed)


@compiled
def doubt_biases(kalman: np.void) -> None:
    """Let gyro and accelerometer have the biases of a fault."""
    P = kalman["P"]
    for i in range(3):
        P[GYRO_BIAS + i, GYRO_BIAS + i] += square(_DOUBTED_GYRO)
        P[FORCE_BIAS + i, FORCE_BIAS + i] += square(_DOUBTED_FORCE)


@compiled
def reset_height(kalman: np.void, down: float, assumed: np.void) -> None:
    """Take the height of the receiver; what the barometer shows otherwise is its error.

    Args:
        kalman: Record of dtype `FILTER`, updated in place.
        down: By the receiver, now [m].
        assumed: Record of dtype `PARAMETERS`.
    """
    x, P = kalman["x"], kalman["P"]
    for k in (POS + 2, BARO_ERROR, GNSS_ERROR + 2):
        _forget(P, k)
    change = down - x[POS + 2]
    kalman["owed"][POS + 2] += change
    x[POS + 2] = down
    x[BARO_ERROR] += change
    x[GNSS_ERROR + 2] = 0.0
    error = assumed["gnss_error"][2]
    own = error + assumed["gnss_position"][2]
    P[GNSS_ERROR + 2, GNSS_ERROR + 2] = error
    P[POS + 2, POS + 2], P[BARO_ERROR, BARO_ERROR] = own, own + assumed["barometer"]
    P[POS + 2, BARO_ERROR] = P[BARO_ERROR, POS + 2] = own
    for k in (POS + 2, BARO_ERROR):
        P[k, GNSS_ERROR + 2] = P[GNSS_ERROR + 2, k] = -error
    P[VEL + 2, VEL + 2] += assumed["gnss_velocity"][2]


@compiled
def doubt_barometer(kalman: np.void, assumed: np.void) -> None:
    """Let the barometer's error be anything."""
    P = kalman["P"]
    _forget(P, BARO_ERROR)
    P[BARO_ERROR, BARO_ERROR] = square(assumed["place_m"])


@compiled
def doubt_latency(kalman: np.void, assumed: np.void) -> None:
    """Forget what was learned of the receiver's latency: its last samples had a part in it."""
    P = kalman["P"]
    _forget(P, DELAY)
    kalman["x"][DELAY], P[DELAY, DELAY] = 0.0, square(assumed["latency_error_s"])


@compiled
def doubt_magnetometer(kalman: np.void, assumed: np.void) -> None:
    """Forget what was learned of the magnetometer's bias: the last samples had a part in it."""
    x, P = kalman["x"], kalman["P"]
    for k in range(MAG_BIAS, MAG_BIAS + 3):
        _forget(P, k)
        x[k], P[k, k] = 0.0, assumed["magnetometer_bias"]


@compiled
def doubt_wind(kalman: np.void, pressure: float, assumed: np.void) -> None:
    """Let the wind along the x axis be what a pitot tube says that it is."""
    x, P = kalman["x"], kalman["P"]
    c, a = column(rotation(kalman["quaternion"]), 0), through_air(x)
    ahead = a[0] * c[0] + a[1] * c[1] + a[2] * c[2]
    off = math.sqrt(2.0 * max(pressure, 0.0) / assumed["density"]) - ahead
    for i in range(2):
        P[WIND + i, WIND + i] += square(off * c[i]) + 0.1


@compiled
def restore_wind(kalman: np.void, airspeed: np.void) -> None:
    """Set the wind back to its mean, of `airspeed.AIRSPEED`, with a covariance of its own."""
    x, P = kalman["x"], kalman["P"]
    for k in range(2):
        kalman["owed"][WIND + k] += airspeed["wind"][k] - x[WIND + k]
        x[WIND + k] = airspeed["wind"][k]
        _forget(P, WIND + k)
        P[WIND + k, WIND + k] = RESTORED * RESTORED + airspeed["gusts"][k]
