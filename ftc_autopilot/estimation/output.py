"""What leaves the estimator: the motion that the laws fly by, and a report on the estimate.

The filter's corrections come in steps, ten a second from the GNSS receiver alone; the output takes
each over with a time constant, as the output predictor of PX4's EKF2 does, so that no law sees a
step that the aircraft did not make.
"""

import math

import numpy as np

from ftc_autopilot.estimation.health import WELL
from ftc_autopilot.estimation.state import (
    DELAY,
    FORCE_BIAS,
    GYRO_BIAS,
    N_SENSORS,
    PHI,
    POS,
    SIDESLIP,
    TESTED,
    VEL,
    WIND,
    N,
    euler,
    rotation,
    turn_world,
)
from mavlink_defs.constants import GNSS, PITOT
from mavlink_defs.runtime.jit import compiled
from sitl_plant.sensing.config import MAX_IMUS
from sitl_plant.vec3 import hypot, mul_t, square, vec3

REPORT = np.dtype(
    [
        ("imu", "i8"),  # the IMU flown by
        ("aligned", "i8"),  # 1: there is an estimate
        ("placed", "i8"),  # 1: it had a first fix
        ("resets", "i8"),  # times that the estimate began again in flight, or jumped
        ("bad_imus", "i8"),  # bit k: IMU k is excluded
        ("bad_sensors", "i8"),  # bit k: the sensor of that number is excluded
        ("dead_reckoning", "i8"),  # 1: without a GNSS receiver
        ("synthetic_airspeed", "i8"),  # 1: without a pitot tube
        ("imu_reasons", "i8", (MAX_IMUS,)),  # of `health.REASONS`
        ("reasons", "i8", (N_SENSORS,)),
        ("ratios", "f8", (SIDESLIP + 1,)),  # squared normalised innovations, the last of each
        ("attitude_std", "f8", (3,)),  # about NED axes, of the output [rad]
        ("velocity_std", "f8", (3,)),
        ("position_std", "f8", (3,)),
        ("wind_std", "f8", (3,)),
        ("gyro_bias", "f8", (3,)),
        ("force_bias", "f8", (3,)),
        ("wind", "f8", (3,)),  # NED [m/s]
        ("airspeed", "f8"),
        ("delay", "f8"),  # of the GNSS receiver, beyond what it says, once settled [s]
        ("delay_std", "f8"),
        ("step", "i8"),
        ("run", "i8"),
        ("quaternion", "f8", (4,)),  # of the output
    ]
)
"""What an operator, or telemetry, may want to know of an estimate; SI units and rad."""

_JUMP_M = 20.0  # a correction of the position that is shown at once


@compiled
def pay(kalman: np.void, assumed: np.void) -> None:
    """Let a step's share of past corrections into the output."""
    owed = kalman["owed"]
    left = 1.0 - assumed["step_us"] / 1e6 / assumed["smoothing_s"]
    for k in range(N):
        owed[k] *= left
    far = max(abs(owed[POS]), abs(owed[POS + 1]), abs(owed[POS + 2]))
    if far > _JUMP_M:
        for k in range(3):
            owed[POS + k] = 0.0
            owed[VEL + k] = 0.0


@compiled
def hand_over(old: np.void, new: np.void) -> None:
    """Let the output go on from another filter: what they differ in is owed."""
    for k in range(N):
        if k > PHI + 2:
            new["owed"][k] = old["owed"][k] + new["x"][k] - old["x"][k]
    # rotation vector from the old to the new attitude, of a small angle
    R, S = rotation(old["quaternion"]), rotation(new["quaternion"])
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        turn = 0.0
        for c in range(3):
            turn += R[i][c] * S[j][c] - R[j][c] * S[i][c]
        new["owed"][PHI + k] = old["owed"][PHI + k] + 0.5 * turn
    for k in range(3):
        new["rates"][k], new["force"][k] = old["rates"][k], old["force"][k]


@compiled
def write_motion(kalman: np.void, quaternion: np.ndarray, measured: np.void) -> None:
    """Write the motion to an FTC_SIM_STATE payload.

    Args:
        kalman: Record of dtype `FILTER`.
        quaternion: Written: the attitude of the output, shape (4,).
        measured: Payload of dtype `mavlink_defs.framing.codec.SIM_STATE`.
    """
    x, owed = kalman["x"], kalman["owed"]
    for k in range(4):
        quaternion[k] = kalman["quaternion"][k]
    turn_world(quaternion, (-owed[PHI], -owed[PHI + 1], -owed[PHI + 2]))
    R = rotation(quaternion)
    angles = euler(R)
    v = (x[VEL] - owed[VEL], x[VEL + 1] - owed[VEL + 1], x[VEL + 2] - owed[VEL + 2])
    w = (x[WIND] - owed[WIND], x[WIND + 1] - owed[WIND + 1], x[WIND + 2] - owed[WIND + 2])
    v, w = mul_t(R, v), mul_t(R, w)
    for k in range(3):
        measured["position"][k] = x[POS + k] - owed[POS + k]
        measured["velocity"][k] = v[k]
        measured["attitude"][k] = angles[k]
        measured["rates"][k] = kalman["rates"][k]
        measured["specific_force"][k] = kalman["force"][k]
        measured["wind"][k] = w[k]


@compiled
def write_report(
    kalman: np.void,
    imus: np.ndarray,
    sensors: np.ndarray,
    primary: int,
    assumed: np.void,
    report: np.void,
) -> None:
    """Write the report.

    Args:
        kalman: The filter flown by, dtype `FILTER`.
        imus: Records of dtype `imus.IMU`, shape (n,).
        sensors: Records of dtype `health.SENSOR`, by the sensors' numbers.
        primary: The IMU flown by.
        assumed: Record of dtype `config.PARAMETERS`.
        report: Record of dtype `REPORT`, written.
    """
    x, P, owed = kalman["x"], kalman["P"], kalman["owed"]
    report["imu"], report["aligned"] = primary, kalman["aligned"]
    report["placed"] = kalman["placed"]
    bad = 0
    for k in range(assumed["imus"]):
        report["imu_reasons"][k] = imus[k]["reason"]
        if imus[k]["reason"] != WELL:
            bad |= 1 << k
    report["bad_imus"] = bad
    bad = 0
    for k in TESTED:
        report["reasons"][k] = sensors[k]["reason"]
        if sensors[k]["reason"] != WELL:
            bad |= 1 << k
    report["bad_sensors"] = bad
    report["synthetic_airspeed"] = int(sensors[PITOT]["reason"] != WELL)
    report["dead_reckoning"] = int(sensors[GNSS]["reason"] != WELL)
    for k in range(SIDESLIP + 1):
        report["ratios"][k] = kalman["ratios"][k]
    for k in range(3):
        report["attitude_std"][k] = hypot(math.sqrt(P[PHI + k, PHI + k]), owed[PHI + k])
        report["velocity_std"][k] = hypot(math.sqrt(P[VEL + k, VEL + k]), owed[VEL + k])
        report["position_std"][k] = hypot(math.sqrt(P[POS + k, POS + k]), owed[POS + k])
        report["wind_std"][k] = hypot(math.sqrt(P[WIND + k, WIND + k]), owed[WIND + k])
        report["wind"][k] = x[WIND + k]
        report["gyro_bias"][k] = x[GYRO_BIAS + k]
        report["force_bias"][k] = x[FORCE_BIAS + k]
    a = vec3(x[VEL:])
    total = 0.0
    for k in range(3):
        total += square(a[k] - x[WIND + k])
    report["airspeed"] = math.sqrt(total)
    if kalman["unsettled"] <= 0.0:
        report["delay"], report["delay_std"] = x[DELAY], math.sqrt(P[DELAY, DELAY])
