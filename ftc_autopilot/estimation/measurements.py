"""What the filter expects of each measurement, and how that depends on its errors.

For the global attitude error, a column c of R, which is a body axis in NED, has the true direction
c + phi × c; so the component of a vector a along it changes by phi · (c × a).
"""

import math

import numpy as np

from ftc_autopilot.estimation.fuse import (
    clear,
    correct,
    correct_air,
    innovation_variance,
    normalised,
)
from ftc_autopilot.estimation.state import (
    BARO_ERROR,
    DELAY,
    FORCE_BIAS,
    GNSS_ERROR,
    GNSS_HEIGHT,
    GNSS_VELOCITY,
    MAG_BIAS,
    PHI,
    PITOT_SCALE,
    POS,
    VEL,
    WIND,
    of_second_order,
    rotation,
)
from mavlink_defs.constants import GNSS
from mavlink_defs.runtime.jit import compiled, inlined
from sitl_plant.vec3 import Mat3, Vec3, cross, dot, norm, square, sub, vec3

TREND_OF_FIELD, TREND_OF_VELOCITY = 0.05, 0.5
"""Gains of running means of innovations, over 0.2 s each at their usual rates."""
_GUST_GAIN = 0.0033  # of the pitot tube's, over 3 s at 100 samples per second
_MAX_NORMAL = 10.0
_SETTLED = math.radians(4.0)
SETTLING_S = 3.0
"""Longest time for which a filter is settling after a coarse guess."""
_ROBUST = 9.0  # squared standard deviations of what is fused while the filter is settling
UNKNOWN_ACCELERATION = 5.0
"""Of an aircraft, in a time that is not remembered [m/s²]: a turn with 30° of bank."""
_AROUND_S = 0.1  # the time of a fix, in which an acceleration is its own
_MIN_AIRSPEED = 3.0  # m/s: below it, a pitot tube and the side force say nothing
_LASTS = 200.0  # samples for which what a turn adds in second order stays
_SIDE_CORRELATION_S, _TRIM_S = 0.5, 200.0  # of errors of the side force; of deflections in trim


@compiled
def column(R: Mat3, k: int) -> Vec3:
    """Return a column of a rotation matrix: a body axis in NED."""
    return R[0][k], R[1][k], R[2][k]


@compiled
def is_settled(kalman: np.void) -> bool:
    """Return whether the attitude is known well enough to split a velocity through the air."""
    P = kalman["P"]
    variance = P[PHI, PHI] + P[PHI + 1, PHI + 1] + P[PHI + 2, PHI + 2]
    return bool(variance < square(_SETTLED) or kalman["unsettled"] <= 0.0)


@compiled
def through_air(x: np.ndarray) -> Vec3:
    """Return the velocity through the air, NED [m/s]."""
    return x[VEL] - x[WIND], x[VEL + 1] - x[WIND + 1], x[VEL + 2] - x[WIND + 2]


@compiled
def _fuse_tested(
    kalman: np.void, innovation: float, variance: float, assumed: np.void, use: bool
) -> float:
    """Fuse one value if it is to be used and passes its test; return the normalised square."""
    S = innovation_variance(kalman, variance)
    ratio = normalised(innovation, S)
    kalman["normal"] = innovation / math.sqrt(S)
    if use and ratio < assumed["gate"]:
        correct(kalman, innovation, S)
    elif use and math.isfinite(ratio) and kalman["unsettled"] > 0.0:
        correct(kalman, innovation, S * ratio / _ROBUST)  # nobody is to blame for a coarse guess
    return ratio


@compiled
def _note_trend(kalman: np.void, k: int, gain: float) -> None:
    """Take the last normalised innovation into its running mean."""
    normal = min(max(kalman["normal"], -_MAX_NORMAL), _MAX_NORMAL)
    kalman["trends"][k] += gain * (normal - kalman["trends"][k])


@compiled
def fuse_magnetometer(kalman: np.void, sample: Vec3, assumed: np.void, use: bool) -> float:
    """Fuse the magnetic field [gauss, body axes]: m = Rᵀ B + b, with B of the place and a bias b.

    Returns:
        The largest squared normalised innovation of the three axes.
    """
    B, worst = vec3(assumed["field"]), 0.0
    for axis in range(3):  # tests come first: a bad sample is left out as a whole
        worst = max(worst, _magnetic(kalman, axis, sample, B, assumed, False))
        _note_trend(kalman, axis, TREND_OF_FIELD)
    if use and worst < assumed["gate"]:
        for axis in range(3):
            _magnetic(kalman, axis, sample, B, assumed, True)
    return worst


@compiled
def _magnetic(
    kalman: np.void, axis: int, sample: Vec3, B: Vec3, assumed: np.void, use: bool
) -> float:
    h, c = clear(kalman), column(rotation(kalman["quaternion"]), axis)
    lever = cross(c, B)
    for k in range(3):
        h[PHI + k] = lever[k]
    h[MAG_BIAS + axis] = 1.0
    innovation = sample[axis] - dot(c, B) - kalman["x"][MAG_BIAS + axis]
    variance = assumed["magnetometer"] + _LASTS * of_second_order(kalman["P"], c, B)
    return _fuse_tested(kalman, innovation, variance, assumed, use)


@compiled
def fuse_barometer(kalman: np.void, altitude: float, assumed: np.void, use: bool) -> float:
    """Fuse a pressure altitude [m, above sea level]: altitude of the origin - D + error."""
    h, x = clear(kalman), kalman["x"]
    h[POS + 2], h[BARO_ERROR] = -1.0, 1.0
    innovation = altitude - assumed["altitude"] + x[POS + 2] - x[BARO_ERROR]
    return _fuse_tested(kalman, innovation, assumed["barometer"], assumed, use)


@compiled
def _fuse_air(
    kalman: np.void, innovation: float, variance: float, assumed: np.void, use: bool, alone: bool
) -> float:
    """Fuse one value of the motion through the air; return the normalised square.

    A gust is no error of the attitude: with a receiver, it is the wind that is learned, as PX4's
    EKF2 does. Alone, wind and airspeed show the velocity.
    """
    if alone:
        return _fuse_tested(kalman, innovation, variance, assumed, use)
    S = innovation_variance(kalman, variance)
    ratio = normalised(innovation, S)
    if use and ratio < assumed["gate"]:
        correct_air(kalman, innovation, S)
    return ratio


@compiled
def fuse_pitot(kalman: np.void, pressure: float, assumed: np.void, use: bool, alone: bool) -> float:
    """Fuse a differential pressure [Pa]: (1 + s) ρ u²/2, with u the airspeed along the x axis.

    PX4's EKF2 fuses a true airspeed instead, with the same dependence on velocity and wind.

    How u depends on the attitude changes with each correction of the velocity across, and the
    covariance does not follow: so at first nothing is fused (`is_settled`).

    Args:
        kalman: Record of dtype `FILTER`.
        pressure: The differential pressure.
        assumed: Record of dtype `PARAMETERS`.
        use: Whether it is fused if it passes its test.
        alone: Whether there is no receiver.
    """
    h, x, density = clear(kalman), kalman["x"], assumed["density"]
    c, a = column(rotation(kalman["quaternion"]), 0), through_air(x)
    u = dot(c, a)
    if u < _MIN_AIRSPEED or not is_settled(kalman):
        return 0.0
    slope = density * u * (1.0 + x[PITOT_SCALE])
    lever = cross(c, a)
    for k in range(3):
        h[PHI + k] = slope * lever[k]
        h[VEL + k] = slope * c[k]
        h[WIND + k] = -slope * c[k]
    h[PITOT_SCALE] = 0.5 * density * u * u
    expected = 0.5 * density * u * u * (1.0 + x[PITOT_SCALE])
    ratio = _fuse_air(kalman, pressure - expected, assumed["pitot"], assumed, use, alone)
    kalman["gusts"] += _GUST_GAIN * (min(ratio, assumed["gate"]) - kalman["gusts"])
    return ratio


@compiled
def fuse_sideslip(kalman: np.void, period_s: float, assumed: np.void, alone: bool) -> float:
    """Fuse the sideslip that the side force shows: f_y = (S (cY_beta - cD0) / m) (ρ V²/2) beta.

    PX4's EKF2 fuses a sideslip of zero; here the nominal aircraft's side force says how much there
    is, as far as it can, and a sideslip within ±10° otherwise. Errors of the coefficient, and what
    else pushes to the side, last, a rudder in trim and a sideslip that is held longest: they count
    as white noise of the same density.

    Args:
        kalman: Record of dtype `FILTER`.
        period_s: Time between two calls [s].
        assumed: Record of dtype `PARAMETERS`.
        alone: Whether there is no receiver.
    """
    h, x = clear(kalman), kalman["x"]
    c, a = column(rotation(kalman["quaternion"]), 1), through_air(x)
    V = norm(a)
    if V < _MIN_AIRSPEED or not is_settled(kalman):
        return 0.0
    per_rad = assumed["side"] * 0.5 * assumed["density"] * V * V
    prior = square(V * assumed["sideslip_rad"])
    shown, density = 0.0, prior * _TRIM_S
    if per_rad != 0.0:
        shown = kalman["force"][1] * V / per_rad
        trim = square(assumed["side_by_surfaces"] * 0.5 * assumed["density"] * V * V * V / per_rad)
        other = trim + square(assumed["side_disturbance_m_s2"] * V / per_rad)
        error = square(assumed["side_error"])
        own = other + error * (square(shown) + other)
        lasting = own * _SIDE_CORRELATION_S + (1.0 + error) * trim * _TRIM_S
        density *= lasting / (density + lasting)  # what both say of it adds up
        shown *= prior / (prior + own)
    variance = 2.0 * density / period_s
    lever = cross(c, a)
    for k in range(3):
        h[PHI + k] = lever[k]
        h[VEL + k] = c[k]
        h[WIND + k] = -c[k]
    return _fuse_air(kalman, shown - dot(c, a), variance, assumed, True, alone)


@compiled
def past_travel(history: np.ndarray, now: np.ndarray, age: float, past: np.ndarray) -> float:
    """Write the integrals of a time in the past, between two entries linearly.

    Before the oldest entry the velocity counts as constant.

    Args:
        history: The last entries in a ring, shape (depth, 7); `travel` of dtype `FILTER`.
        now: The integrals now, shape (7,).
        age: How long ago it was [s].
        past: Written, shape (7,).

    Returns:
        How long before the oldest entry it was [s]; 0 of a time that is remembered.
    """
    time, oldest = now[6] - age, 0
    for k in range(7):
        past[k] = now[k]
    later, before = now[6], -1.0
    for row in range(len(history)):
        t = history[row, 6]
        if t < history[oldest, 6]:
            oldest = row
        if t <= time and t > before:
            before = t
    if before < 0.0:
        gap = history[oldest, 6] - time
        for k in range(3):
            past[k] = history[oldest, k]
            past[3 + k] = history[oldest, 3 + k] - history[oldest, k] * gap
        past[6] = time
        return float(gap)
    for row in range(len(history)):
        t = history[row, 6]
        if t > time and t <= later:
            later = t
            for k in range(7):
                past[k] = history[row, k]
    for row in range(len(history)):
        if history[row, 6] == before and later > before:
            share = (later - time) / (later - before)
            for k in range(7):
                past[k] += share * (history[row, k] - past[k])
            break
    return 0.0


@compiled
def travel_at(kalman: np.void, fix: np.void, history: np.ndarray, past: np.ndarray) -> float:
    """Write the integrals at the time of a fix, as late as the filter says, and what is around it.

    The velocity's change is taken over a standard deviation of the latency to both sides, as sigma
    points are: what is not linear in between counts as noise (Skog and Händel; Julier and Uhlmann).

    Args:
        kalman: Record of dtype `FILTER`.
        fix: Record of dtype `receiver.FIX`; what depends on the filter is written.
        history: Memory of the filter, shape (entries, TRAVEL).
        past: Written, shape (TRAVEL,).

    Returns:
        How long before what is remembered it was [s], as `past_travel`.
    """
    travel, doubt = kalman["travel"], math.sqrt(kalman["P"][DELAY, DELAY])
    fix["late"] = max(kalman["x"][DELAY], -fix["age"])
    age, around = fix["age"] + fix["late"], max(_AROUND_S, doubt)
    past_travel(history, travel, max(age - around, 0.0), past)
    after, time = vec3(past), past[6]
    past_travel(history, travel, age + around, past)
    before, time = vec3(past), time - past[6]
    gap = past_travel(history, travel, age, past)
    share = square(doubt / around)
    for axis in range(3):
        fix["acceleration"][axis] = (after[axis] - before[axis]) / time
        fix["bend"][axis] = share * (0.5 * (after[axis] + before[axis]) - past[axis])
    return gap


@compiled
def fuse_gnss(
    kalman: np.void,
    fix: np.void,
    past: np.ndarray,
    gap: float,
    assumed: np.void,
    use: tuple[bool, bool, bool],
) -> None:
    """Fuse a sample of the GNSS receiver of some time ago: position, velocity, height apart.

    It is compared with where the filter says now that it was then: the estimate of now less what
    the accelerometer measured since. PX4's EKF2 runs its whole filter late instead. The noise that
    came since is left out of the covariance: in 0.2 s 1 mm/s, where the velocity has 50 mm/s.

    Args:
        kalman: Record of dtype `FILTER`; its `ratios` are the largest of each part.
        fix: Record of dtype `receiver.FIX`.
        past: `travel` then, shape (7,).
        gap: Time of which `travel` was not remembered [s].
        assumed: Record of dtype `PARAMETERS`.
        use: Whether position, velocity, height are fused if they pass their test.
    """
    ratios = kalman["ratios"]
    ratios[GNSS] = ratios[GNSS_VELOCITY] = ratios[GNSS_HEIGHT] = 0.0
    for part in range(6):
        ratio = _gnss(kalman, part, fix, past, gap, assumed, False)
        number = _part(part)
        ratios[number] = max(ratios[number], ratio)
        if part >= 3:
            _note_trend(kalman, part, TREND_OF_VELOCITY)
    settling = kalman["unsettled"] > 0.0
    for part in range(6):
        number = _part(part)
        k = 0 if number == GNSS else (1 if number == GNSS_VELOCITY else 2)
        if use[k] and (settling or ratios[number] < assumed["gate"]):
            _gnss(kalman, part, fix, past, gap, assumed, True)


@inlined
def _part(part: int) -> int:
    """Return the number of what an element of a fix belongs to."""
    if part >= 3:
        return GNSS_VELOCITY
    return GNSS if part < 2 else GNSS_HEIGHT


@compiled
def _gnss(
    kalman: np.void,
    part: int,
    fix: np.void,
    past: np.ndarray,
    gap: float,
    assumed: np.void,
    use: bool,
) -> float:
    h, x, travel = clear(kalman), kalman["x"], kalman["travel"]
    age = travel[6] - past[6]
    changed = UNKNOWN_ACCELERATION * gap  # of the velocity, as far as it is not remembered
    if part < 3:
        then = travel[3 + part] - past[3 + part] - travel[part] * age  # less v age: since then
        expected = x[POS + part] - x[VEL + part] * age - then + x[GNSS_ERROR + part]
        h[POS + part], h[VEL + part], h[GNSS_ERROR + part] = 1.0, -age, 1.0
        h[DELAY] = travel[part] - past[part] - x[VEL + part]
        expected += h[DELAY] * (x[DELAY] - fix["late"])
        noise = assumed["gnss_position"][part] + square(0.5 * changed * gap)
        return _fuse_tested(kalman, fix["position"][part] - expected, noise, assumed, use)
    axis = part - 3
    R = rotation(kalman["quaternion"])
    pushed = sub(vec3(travel), vec3(past))
    expected = x[VEL + axis] - pushed[axis]
    pushed = pushed[0], pushed[1], pushed[2] - assumed["gravity"] * (age - gap)
    h[VEL + axis], h[DELAY] = 1.0, -fix["acceleration"][axis]
    expected += h[DELAY] * (x[DELAY] - fix["late"])  # learned of the parts before
    before, after = (axis + 2) % 3, (axis + 1) % 3
    h[PHI + before] = pushed[after]  # (pushed × phi), the component of this axis
    h[PHI + after] = -pushed[before]
    for k in range(3):
        h[FORCE_BIAS + k] = R[axis][k] * (age - gap)
    noise = assumed["gnss_velocity"][axis] + changed * changed + square(fix["bend"][axis])
    return _fuse_tested(kalman, fix["velocity"][axis] - expected, noise, assumed, use)
