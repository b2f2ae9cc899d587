"""Effectiveness by the dither alone, which is known and answers nothing: an instrumental variable.

A loop that counteracts a swinging offset moves u against it, so that y hardly moves although the
actuator works: the regression of y on u then finds ρ ≤ 0. The dither z, through the model of the
servo and the filter of the measurement, is independent of the swing. Beside a trend that is
quadratic in time, with exponential forgetting:

    ρ = cov(z, y)/cov(z, u),   σ_ρ² = s² · var(z)/cov(z, u)² / n,   s² = var(y - ρ u)

n counts independent samples, less the four numbers that are found from them: closer than the
filter's time constant they are not. Where the
offset swings faster than the trend can follow, s shows it, and nothing is decided.

Source: Söderström and Stoica, Instrumental Variable Methods for System Identification, 1983.
"""

import math

import numpy as np

from mavlink_defs.runtime.jit import compiled

TERMS = 6
"""1, t, t², z, y, u."""
_TREND, _Z, _Y, _U = 3, 3, 4, 5
_UNIT_S = 0.1  # of the trend's time
_LEAST = 1e-12


@compiled
def restart_instrument(actuator: np.void) -> None:
    """Forget all; y and u count from their present values."""
    actuator["z"], actuator["z_position"] = 0.0, 0.0
    actuator["z_s"], actuator["z_samples"] = 0.0, 0.0
    actuator["z_y"], actuator["z_u"] = actuator["measured"], actuator["commanded"]
    actuator["moments"][:] = 0.0


@compiled
def learn_instrument(
    actuator: np.void, lag_s: float, filter_s: float, memory_s: float, dt: float
) -> None:
    """Take the present dither, u and y into the moments.

    Args:
        actuator: Record of dtype `ACTUATOR`, updated in place.
        lag_s: Lag of the servo [s].
        filter_s: Filter of the measurement [s].
        memory_s: Of the moments [s].
        dt: Control period [s].
    """
    change = actuator["dither"] - actuator["z_position"]
    if lag_s > 0.0:
        change *= 1.0 - math.exp(-dt / lag_s)
    actuator["z_position"] += change
    actuator["z"] += dt / filter_s * (actuator["z_position"] - actuator["z"])
    actuator["z_s"] += dt
    t = actuator["z_s"] / _UNIT_S
    x = (
        1.0,
        t,
        t * t,
        actuator["z"],
        actuator["measured"] - actuator["z_y"],
        actuator["commanded"] - actuator["z_u"],
    )
    keep, moments = 1.0 - dt / memory_s, actuator["moments"]
    actuator["z_samples"] = keep * actuator["z_samples"] + 1.0
    for i in range(TERMS):
        for k in range(i + 1):
            moments[i, k] = keep * moments[i, k] + x[i] * x[k]


@compiled
def estimate_by_dither(actuator: np.void, filter_s: float, dt: float) -> tuple[float, float]:
    """Return effectiveness ρ and its standard error; infinite where the dither has not moved u.

    Args:
        actuator: Record of dtype `ACTUATOR`.
        filter_s: Filter of the measurement [s].
        dt: Control period [s].
    """
    M = actuator["moments"].copy()
    for p in range(_TREND):  # sweeps the trend out of z, y and u
        if M[p, p] <= _LEAST:
            return 1.0, math.inf
        for i in range(p + 1, TERMS):
            share = M[i, p] / M[p, p]
            for k in range(p + 1, i + 1):
                M[i, k] -= share * M[k, p]
    zz, zy, zu = M[_Z, _Z], M[_Y, _Z], M[_U, _Z]
    if zz <= _LEAST or zu < 0.3 * zz:
        return 1.0, math.inf
    rho = zy / zu
    squares = max(M[_Y, _Y] - 2.0 * rho * M[_U, _Y] + rho * rho * M[_U, _U], 0.0)
    independent = actuator["z_samples"] * dt / filter_s
    if independent <= _TREND + 1:
        return rho, math.inf
    s = squares / actuator["z_samples"] * independent / (independent - _TREND - 1)
    return rho, math.sqrt(s * (filter_s / dt) * zz) / zu
