"""Effectiveness by the dither alone, which is known and answers nothing: an instrumental variable.

A loop that counteracts a swinging offset moves u against it, so that y hardly moves although the
actuator works: the regression of y on u then finds ρ ≤ 0. The dither z, through the model of the
servo and the filter of the measurement, is independent of the swing. Beside a trend that is
quadratic in time, and the jump that raised the suspicion, if one did, with exponential forgetting:

    ρ = cov(z, y)/cov(z, u),   σ_ρ² = s² · var(z)/cov(z, u)² / n,   s² = var(y - ρ u)

A jump of the offset leaves a tail (1 - dt/τ)^k in y, by the filter of the measurement. Its size is
found like the trend, and the time of the jump need not be known: that only changes the size.

n counts independent samples, less the numbers that are found from them, four, or five with a jump:
closer than the filter's time constant they are not. Where the offset swings faster than the trend
can follow, s shows it, and nothing is decided. Where servos or gyro have a dead time that nobody
has stated, z and u that are as much older explain more of y.

Source: Söderström and Stoica, Instrumental Variable Methods for System Identification, 1983.
"""

import math

import numpy as np

from mavlink_defs.runtime.jit import compiled

LAGS = 6
"""Dead times that are tried: none, and multiples of `LAG_S`."""
LAG_S = 0.008
MAX_DEAD_S = (LAGS - 1) * LAG_S
PAST = 64
"""Steps that are remembered."""
_TAIL, _Y, _Z = 3, 4, 5
_U = _Z + LAGS
TERMS = _U + LAGS
"""Of the offset 1, t, t² and the tail of a jump; y, z of each lag, u of each lag."""
_UNIT_S = 0.1  # of the trend's time
_MIN_SUM = 1e-12
_CLEARLY = 0.6


@compiled
def lag_steps(k: int, dt: float) -> int:
    """Return the control periods of lag k."""
    return min(int(k * LAG_S / dt + 0.5), PAST - 1)


@compiled
def restart_instrument(actuator: np.void, after_jump: bool) -> None:
    """Forget all; y and u count from their present values.

    Args:
        actuator: Record of dtype `ACTUATOR`, updated in place.
        after_jump: Whether a jump of the offset is passing the filter of the measurement.
    """
    actuator["z"], actuator["z_position"] = 0.0, 0.0
    actuator["z_s"], actuator["z_samples"] = 0.0, 0.0
    actuator["z_y"], actuator["z_u"] = actuator["measured"], actuator["commanded"]
    actuator["z_past"][:], actuator["u_past"][:] = 0.0, 0.0
    actuator["moments"][:] = 0.0
    actuator["z_tail"] = 1.0 if after_jump else 0.0


@compiled
def learn_instrument(
    actuator: np.void,
    dither: float,
    lags: int,
    lag_s: float,
    filter_s: float,
    memory_s: float,
    dt: float,
) -> None:
    """Take the dither, u and y into the moments.

    Args:
        actuator: Record of dtype `ACTUATOR`, updated in place.
        dither: The one that is measured now.
        lags: How many dead times are tried.
        lag_s: Lag of the servo [s].
        filter_s: Filter of the measurement [s].
        memory_s: Of the moments [s].
        dt: Control period [s].
    """
    change = dither - actuator["z_position"]
    if lag_s > 0.0:
        change *= 1.0 - math.exp(-dt / lag_s)
    actuator["z_position"] += change
    actuator["z"] += dt / filter_s * (actuator["z_position"] - actuator["z"])
    actuator["z_s"] += dt
    now, z, u = int(actuator["z_s"] / dt + 0.5), actuator["z_past"], actuator["u_past"]
    z[now % PAST] = actuator["z"]
    u[now % PAST] = actuator["commanded"] - actuator["z_u"]
    t = actuator["z_s"] / _UNIT_S
    x = np.zeros(TERMS)
    actuator["z_tail"] *= 1.0 - dt / filter_s
    x[0], x[1], x[2], x[_TAIL] = 1.0, t, t * t, actuator["z_tail"]
    x[_Y] = actuator["measured"] - actuator["z_y"]
    for k in range(lags):
        before = (now - lag_steps(k, dt)) % PAST
        x[_Z + k], x[_U + k] = z[before], u[before]
    keep, moments = 1.0 - dt / memory_s, actuator["moments"]
    actuator["z_samples"] = keep * actuator["z_samples"] + 1.0
    for i in range(TERMS):
        for k in range(i + 1):
            moments[i, k] = keep * moments[i, k] + x[i] * x[k]


@compiled
def estimate_by_dither(
    actuator: np.void, lags: int, filter_s: float, dt: float
) -> tuple[float, float, int]:
    """Return effectiveness ρ, its standard error, and with which dead time: of the largest ρ/σ.

    The error is infinite where the dither has not moved u. A dead time has to leave clearly less
    unexplained than none.

    Args:
        actuator: Record of dtype `ACTUATOR`.
        lags: How many dead times are tried.
        filter_s: Filter of the measurement [s].
        dt: Control period [s].
    """
    M = actuator["moments"].copy()
    known = _Y if M[_TAIL, _TAIL] > 0.0 else _TAIL
    for p in range(known):  # sweeps the offset's terms out of the others
        if M[p, p] <= _MIN_SUM:
            return 1.0, math.inf, 0
        for i in range(p + 1, TERMS):
            share = M[i, p] / M[p, p]
            for k in range(p + 1, i + 1):
                M[i, k] -= share * M[k, p]
    independent = actuator["z_samples"] * dt / filter_s
    free = independent - known - 1
    rho, error, lag, best = 1.0, math.inf, 0, -math.inf
    at_once = left = math.inf  # sums of squares
    for k in range(lags):
        zz, zy, zu = M[_Z + k, _Z + k], M[_Z + k, _Y], M[_U + k, _Z + k]
        if zz <= _MIN_SUM or zu < 0.3 * zz:
            continue
        found = zy / zu
        squares = M[_Y, _Y] - 2.0 * found * M[_U + k, _Y] + found * found * M[_U + k, _U + k]
        squares = max(squares, 0.0)
        s = squares / actuator["z_samples"] * independent / max(free, _MIN_SUM)
        sigma = math.sqrt(s * (filter_s / dt) * zz) / zu if free > 0.0 else math.inf
        if k == 0:
            at_once = squares
        if found / max(sigma, _MIN_SUM) > best:
            rho, error, lag, best = found, sigma, k, found / max(sigma, _MIN_SUM)
            left = squares
    return rho, error, lag if left < _CLEARLY * at_once else 0
