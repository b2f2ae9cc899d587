"""How much later than it says a GNSS receiver measures: by its velocity against the IMU's.

What the receiver's velocity is over the integral of the acceleration is a constant, but for slow
errors, if both are of the same time; else it changes with every turn. So the two are compared with
the time of the measurement moved by each of some delays. The one with the least scatter is taken if
it is clearly better than the one in use. Of straight flight nothing is learned, and nothing needed.
"""

import math

import numpy as np

from ftc_autopilot.estimation.measurements import past_travel
from mavlink_defs.runtime.jit import compiled

_STEP_S, _EARLIEST_S = 0.05, -0.3
DELAYS = 19
"""Delays that are tried: from -0.3 to 0.6 s; the last ones show that one between is the best."""
LONGEST_S = _EARLIEST_S + _STEP_S * (DELAYS - 1)
"""The longest of them [s]."""

LATENCY = np.dtype(
    [
        ("delay", "f8"),  # in use: what is added to the age of a fix [s]
        ("age", "f8"),  # for which it has learned [s]
        ("time", "f8"),  # of the last fix, in the filter's [s]
        ("mean", "f8", (DELAYS, 3)),  # of velocity over integral, of the last 3 s [m/s]
        ("scatter", "f8", (DELAYS,)),  # sum of squares around it, of the last 10 s [m²/s²]
    ]
)
"""What is known of the latency of a receiver."""

_MEAN_S, _MEMORY_S, _LEARN_S = 3.0, 10.0, 2.0
_LONGEST_GAP_S = 2.0  # between two fixes: receivers report once a second, at the least
_CLEAR = 60.0  # variances of the receiver's velocity, by which a delay must be better
_SHARE = 0.25  # of what noise does not explain of the scatter in use, that a better one has at most
_FITS = 3.0  # times the scatter by the receiver's noise alone, that the right delay has at most


@compiled
def note_velocity(
    latency: np.void,
    history: np.ndarray,
    travel: np.ndarray,
    fix: np.void,
    age: float,
    past: np.ndarray,
    assumed: np.void,
) -> bool:
    """Learn from a fix; return whether the delay has changed.

    Args:
        latency: Record of dtype `LATENCY`, updated in place.
        history: Memory of the filter flown by, shape (entries, TRAVEL).
        travel: Its integrals now, shape (TRAVEL,).
        fix: Record of dtype `receiver.FIX`; its velocity is read.
        age: Of the fix, as it says [s].
        past: Written, scratch of shape (TRAVEL,).
        assumed: Record of dtype `PARAMETERS`.
    """
    elapsed = travel[6] - latency["time"]
    latency["time"] = travel[6]
    if not 0.0 < elapsed < _LONGEST_GAP_S:  # the first one, or after silence
        latency["age"], elapsed = 0.0, 0.0
    first = latency["age"] == 0.0
    latency["age"] += max(elapsed, 1e-3)
    fade, share = math.exp(-elapsed / _MEMORY_S), min(elapsed / _MEAN_S, 1.0)
    for k in range(DELAYS):
        late = age + _EARLIEST_S + k * _STEP_S
        if late < 0.0 or past_travel(history, travel, late, past) > 0.0:
            latency["scatter"][k] = math.inf  # not remembered
            continue
        if first or not math.isfinite(latency["scatter"][k]):
            for axis in range(3):
                latency["mean"][k, axis] = fix["velocity"][axis] - past[axis]
            latency["scatter"][k] = 0.0 if first else math.inf
            continue
        total = 0.0
        for axis in range(3):
            off = fix["velocity"][axis] - past[axis] - latency["mean"][k, axis]
            latency["mean"][k, axis] += share * off
            total += off * off
        latency["scatter"][k] = latency["scatter"][k] * fade + total
    return _choose(latency, elapsed, assumed)


@compiled
def _choose(latency: np.void, elapsed: float, assumed: np.void) -> bool:
    """Take the delay with the least scatter if it is clearly better."""
    scatter, best = latency["scatter"], 0
    own = round((latency["delay"] - _EARLIEST_S) / _STEP_S)
    for k in range(DELAYS):
        if scatter[k] < scatter[best]:
            best = k
    if best in (own, 0, DELAYS - 1) or latency["age"] < _LEARN_S:
        return False
    noise = assumed["gnss_velocity"][0]
    expected = 3.0 * noise * min(latency["age"], _MEMORY_S) / max(elapsed, 1e-3)
    gain = scatter[own] - scatter[best]
    most = min(_FITS * expected, expected + _SHARE * (scatter[own] - expected))
    if not gain > _CLEAR * noise or scatter[best] > most:
        return False
    latency["delay"] = _EARLIEST_S + best * _STEP_S
    return True
