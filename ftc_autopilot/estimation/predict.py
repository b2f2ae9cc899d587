"""From one sample of the IMU to the next: the estimate each step, its covariance every 10 ms.

The estimate follows Solà (2017), section 5.4, here with the rotation in the middle of the step. The
covariance takes the sums of the steps in between as one transition, which is exact to first order:
with the global error, section 7, the matrices that depend on the attitude are sums of R and of R f.
Earth's rate and curvature are left out, as in the plant.
"""

import math

import numpy as np

from ftc_autopilot.estimation.state import (
    BARO_ERROR,
    FORCE_BIAS,
    GNSS_ERROR,
    GYRO_BIAS,
    HISTORY_S,
    MAG_BIAS,
    PHI,
    PITOT_SCALE,
    POS,
    VEL,
    WIND,
    N,
    of_second_order,
    rotation,
    turn_body,
)
from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import Vec3, mul, norm, scale, square, vec3

_UNKNOWN_RATES = 2.0 * math.radians(20.0) ** 2 * 0.3
_UNKNOWN_FORCES = 2.0 * 4.0**2 * 0.5
"""Densities of rates of 20°/s over 0.3 s [rad²/s], of 4 m/s² over 0.5 s [m²/s³]: of an aircraft
without a gyro, or accelerometer, that works."""
_LASTS_S = 2.0  # for which what the attitude's error adds in second order stays
_STRAIGHT = math.radians(1.0)  # rad/s: what is less is noise, or to and fro


@compiled
def predict(kalman: np.void, rates: Vec3, force: Vec3, assumed: np.void) -> None:
    """Advance the estimate by one step.

    Args:
        kalman: Record of dtype `FILTER`.
        rates: Sample of the gyro [rad/s].
        force: Sample of the accelerometer [m/s²].
        assumed: Record of dtype `PARAMETERS`.
    """
    x, dt = kalman["x"], assumed["step_us"] / 1e6
    omega = (rates[0] - x[GYRO_BIAS], rates[1] - x[GYRO_BIAS + 1], rates[2] - x[GYRO_BIAS + 2])
    f = (force[0] - x[FORCE_BIAS], force[1] - x[FORCE_BIAS + 1], force[2] - x[FORCE_BIAS + 2])
    turn_body(kalman["quaternion"], scale(0.5 * dt, omega))
    R = rotation(kalman["quaternion"])
    turn_body(kalman["quaternion"], scale(0.5 * dt, omega))
    pushed = mul(R, f)
    travel = kalman["travel"]
    for i in range(3):
        change = pushed[i] * dt
        kalman["sum_force"][i] += change
        if i == 2:
            change += assumed["gravity"] * dt
        x[POS + i] += (x[VEL + i] + 0.5 * change) * dt
        travel[3 + i] += (travel[i] + 0.5 * change) * dt
        x[VEL + i] += change
        travel[i] += change
        kalman["rates"][i] += assumed["rate_filter"] * (omega[i] - kalman["rates"][i])
        kalman["force"][i] += assumed["force_filter"] * (f[i] - kalman["force"][i])
        for j in range(3):
            kalman["sum_R"][i, j] += R[i][j] * dt
    travel[6] += dt
    kalman["elapsed"] += dt
    kalman["turned"] += max(norm(vec3(kalman["rates"])) - _STRAIGHT, 0.0) * dt
    if kalman["elapsed"] > HISTORY_S - 0.5 * dt:
        propagate(kalman, assumed)


@compiled
def propagate(kalman: np.void, assumed: np.void) -> None:
    """Advance the covariance by the time since the last call: P ← F P Fᵀ + Q."""
    P = kalman["P"]
    _rows(P, kalman)
    _columns(P, kalman)
    _add_noise(P, kalman, assumed)
    kalman["elapsed"], kalman["turned"] = 0.0, 0.0
    for i in range(3):
        kalman["sum_force"][i] = 0.0
        for j in range(3):
            kalman["sum_R"][i, j] = 0.0


@compiled
def _rows(P: np.ndarray, kalman: np.void) -> None:
    """P ← F P: rows of position, velocity and attitude take from those that drive them."""
    R, u, dt = kalman["sum_R"], kalman["sum_force"], kalman["elapsed"]
    for c in range(N):
        a, b, d = P[PHI, c], P[PHI + 1, c], P[PHI + 2, c]
        for i in range(3):
            P[POS + i, c] += dt * P[VEL + i, c]
            for j in range(3):
                P[VEL + i, c] -= R[i, j] * P[FORCE_BIAS + j, c]
                P[PHI + i, c] -= R[i, j] * P[GYRO_BIAS + j, c]
        P[VEL, c] -= u[1] * d - u[2] * b  # -[u]x phi
        P[VEL + 1, c] -= u[2] * a - u[0] * d
        P[VEL + 2, c] -= u[0] * b - u[1] * a


@compiled
def _columns(P: np.ndarray, kalman: np.void) -> None:
    """P ← P Fᵀ."""
    R, u, dt = kalman["sum_R"], kalman["sum_force"], kalman["elapsed"]
    for r in range(N):
        a, b, d = P[r, PHI], P[r, PHI + 1], P[r, PHI + 2]
        for i in range(3):
            P[r, POS + i] += dt * P[r, VEL + i]
            for j in range(3):
                P[r, VEL + i] -= R[i, j] * P[r, FORCE_BIAS + j]
                P[r, PHI + i] -= R[i, j] * P[r, GYRO_BIAS + j]
        P[r, VEL] -= u[1] * d - u[2] * b
        P[r, VEL + 1] -= u[2] * a - u[0] * d
        P[r, VEL + 2] -= u[0] * b - u[1] * a


@compiled
def _add_noise(P: np.ndarray, kalman: np.void, assumed: np.void) -> None:
    dt, turned, pushed = kalman["elapsed"], kalman["turned"], vec3(kalman["sum_force"])
    pushed = scale(1.0 / dt, pushed)
    for i in range(3):
        axis = (1.0 if i == 0 else 0.0), (1.0 if i == 1 else 0.0), (1.0 if i == 2 else 0.0)
        P[VEL + i, VEL + i] += 2.0 * _LASTS_S * dt * of_second_order(P, axis, pushed)
    fade(kalman, GNSS_ERROR, dt / assumed["gnss_correlation"], assumed["gnss_error"][0])
    fade(kalman, GNSS_ERROR + 1, dt / assumed["gnss_correlation"], assumed["gnss_error"][1])
    fade(kalman, GNSS_ERROR + 2, dt / assumed["gnss_correlation"], assumed["gnss_error"][2])
    gusts = 1.0 + assumed["gust_growth"] * min(
        max(kalman["gusts"] - 1.0, 0.0), assumed["gust_excess"]
    )
    vertical = assumed["vertical_wind_m_s"]
    fade(kalman, WIND + 2, dt / assumed["vertical_wind_s"], gusts * square(vertical))
    fade(kalman, PITOT_SCALE, dt / assumed["pitot_scale_s"], assumed["pitot_scale"])
    for i in range(3):
        # scale and misalignment are one bias in body axes, and another one after a turn
        if P[MAG_BIAS + i, MAG_BIAS + i] < assumed["magnetometer_bias"]:
            P[MAG_BIAS + i, MAG_BIAS + i] += assumed["magnetometer_bias"] * turned
        P[PHI + i, PHI + i] += assumed["gyro_density"] * dt + assumed["turning"] * turned
        P[VEL + i, VEL + i] += assumed["force_density"] * dt
        if kalman["blind"][0] == 1:
            P[PHI + i, PHI + i] += _UNKNOWN_RATES * dt
        if kalman["blind"][1] == 1:
            P[VEL + i, VEL + i] += _UNKNOWN_FORCES * dt
        P[GYRO_BIAS + i, GYRO_BIAS + i] += assumed["gyro_walk"] * dt
        P[FORCE_BIAS + i, FORCE_BIAS + i] += assumed["force_walk"] * dt
    for i in range(2):
        P[WIND + i, WIND + i] += gusts * assumed["wind_walk"] * dt
    P[BARO_ERROR, BARO_ERROR] += assumed["barometer_walk"] * dt


@compiled
def fade(kalman: np.void, k: int, elapsed: float, variance: float) -> None:
    """Advance a first-order Gauss-Markov process.

    Args:
        kalman: Record of dtype `FILTER`.
        k: Which element of the error it is.
        elapsed: Time in units of its time constant.
        variance: Its own, in the long run.
    """
    P, left = kalman["P"], math.exp(-elapsed)
    kalman["x"][k] *= left
    for c in range(N):
        P[k, c] *= left
        P[c, k] *= left  # the diagonal twice
    P[k, k] += variance * (1.0 - left * left)
