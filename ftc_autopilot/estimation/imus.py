"""Which IMU to fly by: tests of each one's samples, and of the difference between two.

Each IMU drives a filter of its own, as in PX4's EKF2 with several instances: the magnetometer and
the GNSS receiver show which of two that differ is wrong.
"""

import math

import numpy as np

from ftc_autopilot.estimation.health import INCONSISTENT, NOISY, SILENT, STUCK, WELL
from ftc_autopilot.estimation.measurements import TREND_OF_FIELD, TREND_OF_VELOCITY
from ftc_autopilot.estimation.state import FORCE_BIAS, GYRO_BIAS
from mavlink_defs.constants import ACCELEROMETER, GYRO
from mavlink_defs.runtime.jit import compiled
from sitl_plant.sensing.units import is_updated
from sitl_plant.vec3 import Vec3, square

IMU = np.dtype(
    [
        ("reason", "i8"),  # why it is excluded; 0: it is not
        ("silent", "i8"),  # steps without a sample of gyro and accelerometer
        ("quiet", "i8", (2,)),  # the same of each of them
        ("same", "i8", (2,)),  # samples in a row that are the same: gyro, accelerometer
        ("samples", "f8", (3, 6)),  # the last three of gyro and accelerometer
        ("fresh", "i8", (2,)),  # 1: a sample came in this step
        ("square", "f8", (2,)),  # squared second difference over its variance in healthy ones
        ("wild", "f8", (2,)),  # share of the last samples that are none of a motion
        ("noise", "f8", (2,)),  # its mean, over another IMU's where motion makes it large
        ("fast", "f8", (6,)),  # filtered samples, over 15 ms and over 0.2 s
        ("slow", "f8", (6,)),
        ("jump", "f8"),  # what the two differed in when a difference between IMUs appeared
        ("apart", "f8", (6,)),  # filtered difference from the one flown by
        ("differs", "i8"),  # steps for which that has been too large
        ("well", "i8"),  # steps for which nothing is the matter
    ]
)
"""One IMU and what tells whether it is well."""

_NOISE_S, _APART_S, _FAST_S, _SLOW_S = 0.05, 0.03, 0.015, 0.2  # time constants
_JUMPED = 4.0  # what a jump of one of two IMUs counts against it, as a misfit of its filter
_RECONSIDER_S = 3.0  # for which the filter of an IMU that differs runs on
_WILD = 5.0, 100.0  # second differences that no aircraft makes [rad/s, m/s²]
_MOST_WILD = 0.3  # share of such samples
_MAX_SQUARE = 30.0  # of one second difference, so that one sample alone is no noise
_SIGNIFICANT = 6.0  # difference of the filters' misfits


@compiled
def note_imu(imu: np.void, sample: np.void, assumed: np.void) -> None:
    """Take a sample of an IMU, hold the last one if there is none, and test it.

    Args:
        imu: Record of dtype `IMU`.
        sample: Payload of HIL_SENSOR.
        assumed: Record of dtype `PARAMETERS`.
    """
    rows, new = imu["samples"], (is_updated(sample, GYRO), is_updated(sample, ACCELEROMETER))
    imu["silent"] = 0 if new[0] and new[1] else imu["silent"] + 1
    rates = float(sample["xgyro"]), float(sample["ygyro"]), float(sample["zgyro"])
    force = float(sample["xacc"]), float(sample["yacc"]), float(sample["zacc"])
    noises = assumed["gyro_noise"], assumed["force_noise"]
    step_s = assumed["step_us"] / 1e6
    for part in range(2):
        imu["quiet"][part] = 0 if new[part] else imu["quiet"][part] + 1
        imu["fresh"][part] = new[part]
        if not new[part]:
            continue
        value = rates if part == 0 else force
        same, wild, mean = True, False, 0.0
        for axis in range(3):
            k = 3 * part + axis
            same = same and value[axis] == rows[0, k]
            rows[2, k], rows[1, k], rows[0, k] = rows[1, k], rows[0, k], value[axis]
            imu["fast"][k] += step_s / _FAST_S * (value[axis] - imu["fast"][k])
            imu["slow"][k] += step_s / _SLOW_S * (value[axis] - imu["slow"][k])
            second = rows[0, k] - 2.0 * rows[1, k] + rows[2, k]
            mean += second * second / (18.0 * square(noises[part]))
            wild = wild or abs(second) > _WILD[part]
        imu["same"][part] = imu["same"][part] + 1 if same else 0
        imu["square"][part] = mean
        imu["wild"][part] += step_s / _NOISE_S * ((1.0 if wild else 0.0) - imu["wild"][part])


@compiled
def is_useless(imu: np.void, part: int, assumed: np.void) -> bool:
    """Return whether samples of a gyro (part 0), or accelerometer (1), say nothing at all."""
    can_be_stuck = assumed["gyro_density"] > 1e-10
    return bool(
        imu["quiet"][part] * assumed["step_us"] / 1e6 > assumed["imu_silent_s"]
        or (can_be_stuck and imu["same"][part] > assumed["imu_same"])
        or imu["wild"][part] > _MOST_WILD
    )


@compiled
def sample_of(imu: np.void) -> tuple[Vec3, Vec3]:
    """Return the last sample of an IMU: angular velocity [rad/s], specific force [m/s²]."""
    row = imu["samples"][0]
    return (row[0], row[1], row[2]), (row[3], row[4], row[5])


@compiled
def judge_imus(imus: np.ndarray, filters: np.ndarray, primary: int, assumed: np.void) -> int:
    """Test all IMUs; return the one to fly by.

    Args:
        imus: Records of dtype `IMU`, shape (imus,) or longer.
        filters: Their filters, dtype `FILTER`, shape (n,).
        primary: The one flown by so far.
        assumed: Record of dtype `PARAMETERS`.
    """
    step_s, can_be_stuck = assumed["step_us"] / 1e6, assumed["gyro_density"] > 1e-10
    for k in range(assumed["imus"]):
        imu = imus[k]
        for part in range(2):
            _note_noise(imus, k, part, assumed)
        reason = WELL
        if imu["silent"] * step_s > assumed["imu_silent_s"]:
            reason = SILENT
        elif can_be_stuck and max(imu["same"][0], imu["same"][1]) > assumed["imu_same"]:
            reason = STUCK
        elif max(imu["noise"][0], imu["noise"][1]) > assumed["imu_noise"]:
            reason = NOISY
        _conclude(imu, reason, step_s, assumed)
    if imus[primary]["reason"] != WELL:
        for k in range(assumed["imus"]):
            if imus[k]["reason"] == WELL:
                primary = k
                break
    return _compare(imus, filters, primary, assumed)


@compiled
def _note_noise(imus: np.ndarray, k: int, part: int, assumed: np.void) -> None:
    """Compare the last sample of an IMU's part with the least noisy other one's.

    All of them see the same motion at the same time, which has second differences as well. Without
    another one that has a new sample, nothing is known of the noise.
    """
    imu, least = imus[k], math.inf
    if imu["fresh"][part] == 0:
        return
    for j in range(assumed["imus"]):
        if j != k and imus[j]["fresh"][part] == 1 and imus[j]["same"][part] == 0:
            least = min(least, imus[j]["square"][part])
    found = 1.0
    if least < math.inf:
        found = min(imu["square"][part] / max(least, 1.0), _MAX_SQUARE)
    imu["noise"][part] += assumed["step_us"] / 1e6 / _NOISE_S * (found - imu["noise"][part])


@compiled
def _conclude(imu: np.void, reason: int, step_s: float, assumed: np.void) -> None:
    """Exclude an IMU at once; take it back when it has been well for some time."""
    differs = imu["reason"] == INCONSISTENT and imu["differs"] > 0
    if reason != WELL:
        imu["reason"], imu["well"] = reason, 0
    elif differs:
        imu["well"] = 0
    else:
        imu["well"] += 1
        if imu["well"] * step_s > assumed["imu_take_back_s"]:
            imu["reason"] = WELL


@compiled
def _is_apart(
    one: np.void, bias: np.ndarray, other: np.void, other_bias: np.ndarray, assumed: np.void
) -> bool:
    """Return whether two IMUs measure too different things; note the jumps of both at first."""
    step_s = assumed["step_us"] / 1e6
    apart = assumed["imu_apart_rad_s"], assumed["imu_apart_m_s2"]
    per_unit = assumed["gyros_apart"], assumed["forces_apart"]
    a, b = one["samples"][0], other["samples"][0]
    too_far, widest = False, 0.0
    for part in range(2):
        at = GYRO_BIAS if part == 0 else FORCE_BIAS
        size = 0.0
        for axis in range(3):
            size = max(size, abs(a[3 * part + axis]))
        limit = apart[part] + per_unit[part] * size
        for axis in range(3):
            j = 3 * part + axis
            gap = (b[j] - other_bias[at + axis]) - (a[j] - bias[at + axis])
            other["apart"][j] += step_s / _APART_S * (gap - other["apart"][j])
            too_far = too_far or abs(other["apart"][j]) > limit
            if abs(other["apart"][j]) > widest * limit:
                widest = abs(other["apart"][j]) / limit
                if other["differs"] == 0:
                    other["jump"] = abs(other["fast"][j] - other["slow"][j])
                    one["jump"] = abs(one["fast"][j] - one["slow"][j])
    return bool(too_far)


@compiled
def _compare(imus: np.ndarray, filters: np.ndarray, primary: int, assumed: np.void) -> int:
    """Compare each IMU with the one flown by; of two that differ, exclude the misfit."""
    step_s = assumed["step_us"] / 1e6
    chosen = primary
    for k in range(assumed["imus"]):
        if k == primary:
            imus[k]["differs"] = 0
            continue
        imu = imus[k]
        too_far = _is_apart(imus[primary], filters[primary]["x"], imu, filters[k]["x"], assumed)
        imu["differs"] = imu["differs"] + 1 if too_far else 0
        if imu["differs"] == 0 or not runs(imu, step_s) or filters[k]["unsettled"] > 0.0:
            continue
        worse = misfit(filters[primary]) - misfit(filters[k])
        if imu["reason"] != WELL:
            if worse > 2.0 * _SIGNIFICANT:  # the wrong one of the two was excluded
                chosen = k
            continue
        worse += _JUMPED if imus[primary]["jump"] > imu["jump"] else -_JUMPED
        waited = imu["differs"] * step_s > assumed["imu_decide_s"]
        if worse > _SIGNIFICANT or (waited and worse > 0.0):
            chosen = k
        elif worse < -_SIGNIFICANT or waited:
            imu["reason"], imu["well"] = INCONSISTENT, 0
    if chosen != primary:
        imus[chosen]["reason"] = WELL
        imus[primary]["reason"], imus[primary]["well"] = INCONSISTENT, 0
        imus[primary]["differs"] = 1
        imus[chosen]["differs"] = 0
        for j in range(6):
            imus[primary]["apart"][j] = -imus[chosen]["apart"][j]
    return chosen


@compiled
def runs(imu: np.void, step_s: float) -> bool:
    """Return whether the filter of an IMU runs: one that differs is watched for a while."""
    differs = imu["reason"] == INCONSISTENT and imu["differs"] > 0
    return bool(imu["reason"] == WELL or (differs and imu["differs"] * step_s < _RECONSIDER_S))


@compiled
def misfit(kalman: np.void) -> float:
    """Return how far innovations of the last 0.2 s are from a mean of 0: a sum of squares.

    Each running mean with gain a has the variance a / (2 - a) of one innovation.
    """
    total = 0.0
    for k in range(6):
        gain = TREND_OF_FIELD if k < 3 else TREND_OF_VELOCITY
        total += square(kalman["trends"][k]) * (2.0 - gain) / gain
    return total
