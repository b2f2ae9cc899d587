"""One scalar measurement into the filter.

Measurements are fused one by one, which is the same as all at once if their errors are independent
(P. D. Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd ed.,
2013, section 3.2.7). With K = P h / S the covariance after it is P - (P h)(P h)ᵀ / S, symmetric as
it stands; each pair of elements is computed once.
"""

import math

import numpy as np

from ftc_autopilot.estimation.state import PHI, PITOT_SCALE, WIND, N, turn_world
from mavlink_defs.runtime.jit import compiled, inlined
from sitl_plant.vec3 import Vec3

LARGE_TURN = 1e-4
"""Correction of the attitude beyond which the axes of its error are turned [rad]."""
_AIR = WIND, WIND + 1, WIND + 2, PITOT_SCALE
_MIN_VARIANCE = 1e-14  # variance that rounding leaves at least


@inlined
def clear(kalman: np.void) -> np.ndarray:
    """Return the row of the measurement matrix, all 0."""
    h: np.ndarray = kalman["h"]
    for k in range(N):
        h[k] = 0.0
    return h


@compiled
def innovation_variance(kalman: np.void, variance: float) -> float:
    """Return S = hᵀ P h + variance, and keep P h for `correct`."""
    P, h, Ph = kalman["P"], kalman["h"], kalman["Ph"]
    total = variance
    for k in range(N):
        Ph[k] = 0.0
    for j in range(N):
        if h[j] != 0.0:
            for k in range(N):
                Ph[k] += h[j] * P[j, k]
    for j in range(N):
        total += h[j] * Ph[j]
    return total


@compiled
def correct(kalman: np.void, innovation: float, S: float) -> None:
    """Correct the estimate by an innovation of variance S; `innovation_variance` comes before.

    The attitude is corrected at once. A large correction turns the error's axes, by the Jacobian of
    Solà's section 6.3: else what is known well would be believed of other axes.
    """
    P, Ph, x, owed = kalman["P"], kalman["Ph"], kalman["x"], kalman["owed"]
    gain = innovation / S
    turn = gain * Ph[PHI], gain * Ph[PHI + 1], gain * Ph[PHI + 2]
    turn_world(kalman["quaternion"], turn)
    for k in range(N):
        owed[k] += gain * Ph[k]
        if k > PHI + 2:
            x[k] += gain * Ph[k]
        row = Ph[k] / S
        for j in range(k, N):
            value = P[k, j] - row * Ph[j]
            P[k, j] = value
            P[j, k] = value
        if not P[k, k] > _MIN_VARIANCE:
            P[k, k] = _MIN_VARIANCE
    if abs(turn[0]) + abs(turn[1]) + abs(turn[2]) > LARGE_TURN:
        _turn_axes(P, turn)


@compiled
def correct_air(kalman: np.void, innovation: float, S: float) -> None:
    """Correct wind and pitot tube alone; of all else the uncertainty counts, as `correct` has it.

    That is the filter of Schmidt (1966), with the best gain for what is corrected.
    """
    P, Ph, x, owed = kalman["P"], kalman["Ph"], kalman["x"], kalman["owed"]
    for k in _AIR:
        owed[k] += innovation / S * Ph[k]
        x[k] += innovation / S * Ph[k]
        for j in range(N):
            if j >= k or j not in _AIR:  # each pair once
                P[k, j] -= Ph[k] / S * Ph[j]
                P[j, k] = P[k, j]
        if not P[k, k] > _MIN_VARIANCE:
            P[k, k] = _MIN_VARIANCE


@compiled
def _turn_axes(P: np.ndarray, turn: Vec3) -> None:
    """P ← G P Gᵀ with G = I + [turn]x / 2 of the attitude: Solà, section 6.3, global error."""
    u, v, w = 0.5 * turn[0], 0.5 * turn[1], 0.5 * turn[2]
    for c in range(N):
        a, b, d = P[PHI, c], P[PHI + 1, c], P[PHI + 2, c]
        P[PHI, c] += v * d - w * b
        P[PHI + 1, c] += w * a - u * d
        P[PHI + 2, c] += u * b - v * a
    for r in range(N):
        a, b, d = P[r, PHI], P[r, PHI + 1], P[r, PHI + 2]
        P[r, PHI] += v * d - w * b
        P[r, PHI + 1] += w * a - u * d
        P[r, PHI + 2] += u * b - v * a


@compiled
def normalised(innovation: float, S: float) -> float:
    """Return the squared innovation in units of its variance; inf if it is no number."""
    ratio = innovation * innovation / S
    return ratio if ratio >= 0.0 else math.inf
