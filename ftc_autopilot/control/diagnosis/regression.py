"""Regression y = ρ u + f of one actuator over a short window.

A loop that rejects a disturbance moves the command against it, so over seconds a healthy
actuator looks stuck: y stays where it is while u moves. Only short increments show that, in which u
has not yet answered; an event-triggered command is a staircase and supplies them. The window's
moments forget exponentially, after a plain mean over the first samples:

    k = max(1/n, dt/window)
    mean += k (x - mean),   cov = (1 - k)(cov + k Δu Δy)

A prior of variance p0 pulls ρ to 1 where there is no excitation:

    ρ = (cov + p0)/(var_u + p0),   σ_ρ = σ / sqrt((var_u + p0) n_eff)
"""

import math

import numpy as np

from mavlink_defs.runtime.jit import compiled

_LONG_PRIOR = 3.0


@compiled
def restart(actuator: np.void) -> None:
    """Restart the window at the present pair."""
    actuator["mean_u"], actuator["mean_y"] = actuator["commanded"], actuator["measured"]
    actuator["samples"] = 0.0
    actuator["var_u"], actuator["cov"], actuator["var_y"] = 0.0, 0.0, 0.0


@compiled
def learn(actuator: np.void, window_s: float, long_s: float, dt: float) -> None:
    """Take the present pair u, y into the window's moments, and these into the longer memory."""
    actuator["samples"] += 1.0
    k = max(1.0 / actuator["samples"], dt / window_s)
    du = actuator["commanded"] - actuator["mean_u"]
    dy = actuator["measured"] - actuator["mean_y"]
    actuator["mean_u"] += k * du
    actuator["mean_y"] += k * dy
    actuator["var_u"] = (1.0 - k) * (actuator["var_u"] + k * du * du)
    actuator["cov"] = (1.0 - k) * (actuator["cov"] + k * du * dy)
    actuator["var_y"] = (1.0 - k) * (actuator["var_y"] + k * dy * dy)
    share = dt / long_s
    actuator["long_var_u"] += share * (actuator["var_u"] - actuator["long_var_u"])
    actuator["long_cov"] += share * (actuator["cov"] - actuator["long_cov"])
    actuator["long_var_y"] += share * (actuator["var_y"] - actuator["long_var_y"])


@compiled
def estimate(
    actuator: np.void, prior: float, window_s: float, filter_s: float, dt: float
) -> tuple[float, float]:
    """Return effectiveness ρ of the window and its standard error.

    Args:
        actuator: Record of dtype `ACTUATOR`.
        prior: Standard deviation of the command that counts as evidence of ρ = 1.
        window_s: Memory of the window [s].
        filter_s: Filter of the measurement [s]: samples closer than twice that are not independent.
        dt: Control period [s].
    """
    evidence = actuator["var_u"] + prior * prior
    effectiveness = (actuator["cov"] + prior * prior) / evidence
    independent = max(1.0, min(actuator["samples"] * dt, window_s) / (2.0 * filter_s))
    return effectiveness, math.sqrt(actuator["variance"] / evidence / independent)


@compiled
def long_estimate(actuator: np.void, prior: float) -> float:
    """Return the effectiveness over the longer memory, with more of the prior."""
    p0 = _LONG_PRIOR * prior * prior
    effectiveness: float = (actuator["long_cov"] + p0) / (actuator["long_var_u"] + p0)
    return effectiveness
