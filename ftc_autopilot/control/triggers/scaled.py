"""Trigger `scaled`: thresholds that grow with the noise and the gusts in a command.

A trigger on a noisy command counts noise. Two changes of the command u are watched, over a time P
and over a quarter of it, each by its running median: turns and faults are brief and hardly move it.
With S and s the standard deviations that these medians mean, of normal changes, an event is

    |u - u₀| >= max(rel |u₀| + abs, sqrt(S² + 8 s²)).

Where gusts make the command a random walk, s² = S²/4, and the square root is √3 S. A random walk
that is sent when it has moved by √3 S has the mean square error of one that is sent every P, and is
sent every 3 P (Åström and Bernhardsson, "Comparison of Riemann and Lebesgue sampling for first
order stochastic systems", CDC 2002). White noise has s = S, so the root is 3 S, three standard
deviations of the difference of two samples: one sample in 370 is beyond it.
"""

import math
from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np

from ftc_autopilot.common.tuples import Four
from ftc_autopilot.control.triggers.base import Candidates, TriggerParameters, in_steps, threshold
from mavlink_defs.config.models import Loc
from mavlink_defs.config.quantity import quantity
from mavlink_defs.constants import N_CHANNELS
from mavlink_defs.runtime.jit import compiled

_DEPTH = 64
"""Control periods that are remembered, at least P."""
_DEVIATION = 1.4826
"""Standard deviation of a normal variable by the median of its absolute value."""
_MIN_SHARE = 0.1
"""By which share of the paper's threshold a median of 0 begins to move."""


class Scaled(TriggerParameters):
    """Raises the thresholds of `per_channel` with the noise of the commands.

    Choose it with noisy sensors, where `per_channel` sends noise.

    Attributes:
        mode: Name of the trigger.
        within_s: Time P over which changes are watched: about the period of a clock at which the
            law tracks as well as at the control rate, and at most a tenth of its loops'
            oscillation.
        memory_s: Time constant of the medians.
    """

    PAGE: ClassVar[str] = "explanation/triggers.md"
    STATE: ClassVar[np.dtype] = np.dtype(
        [
            ("steps", "i8"),  # made so far
            ("past", "f8", (N_CHANNELS, _DEPTH)),  # commands [rad, rad, rad, N]
            ("slow", "f8", (N_CHANNELS,)),  # median of |change| over P
            ("fast", "f8", (N_CHANNELS,)),  # the same over P/4
        ]
    )

    mode: Literal["scaled"] = "scaled"

    within_s: float = quantity("s", default=0.02, gt=0.0)
    memory_s: float = quantity("s", default=1.0, gt=0.0)

    def misfits(self, step_us: int) -> Iterator[tuple[Loc, str]]:
        """Yield a time longer than what is remembered, in control periods [µs]."""
        longest_s = _DEPTH * step_us / 1e6
        if self.within_s > longest_s * (1.0 + 1e-9):
            text = f"expected <= {longest_s:g} s, {_DEPTH} control periods, got {self.within_s!r}"
            yield ("within_s",), text


@compiled
def scaled(now: Candidates, parameters: np.void, state: np.void) -> int:
    """Return the mask of the channels that transmit.

    Args:
        now: The present step.
        parameters: Record made of `Scaled`.
        state: Record of dtype `Scaled.STATE`, updated in place.
    """
    least = (
        threshold(now, 0, now.held[0]),
        threshold(now, 1, now.held[1]),
        threshold(now, 2, now.held[2]),
        threshold(now, 3, now.held[3]),
    )
    watch(now.commanded, least, parameters["within_s"], parameters["memory_s"], now.dt, state)
    mask = 0
    for i in range(N_CHANNELS):
        limit = least[i] if now.examined & (1 << i) else max(least[i], noise_threshold(i, state))
        if now.first or abs(now.commanded[i] - now.held[i]) >= limit:
            mask |= 1 << i
    return mask


@compiled
def watch(
    commanded: Four, least: Four, within_s: float, memory_s: float, dt: float, state: np.void
) -> None:
    """Move the medians by the next commands.

    Args:
        commanded: Saturated [rad, rad, rad, N].
        least: Thresholds without noise [rad, rad, rad, N].
        within_s: Time P [s].
        memory_s: Time constant of the medians [s].
        dt: Control period [s].
        state: Record of dtype `Scaled.STATE`, updated in place.
    """
    n = state["steps"]
    state["steps"] = n + 1
    lag = min(in_steps(within_s, dt), _DEPTH)
    short = max(lag // 4, 1)
    # large at first, so that medians are found in some 20 steps, whatever they are
    share = max(dt / memory_s, min(3.0 / max(n - lag + 1, 1), 0.5))
    for i in range(N_CHANNELS):
        u, past = commanded[i], state["past"][i]
        if n >= lag:
            change, brief = u - past[(n - lag) % _DEPTH], u - past[(n - short) % _DEPTH]
            floor = _MIN_SHARE * least[i]
            state["slow"][i] = _moved(state["slow"][i], abs(change), share, floor)
            state["fast"][i] = _moved(state["fast"][i], abs(brief), share, floor)
        past[n % _DEPTH] = u


@compiled
def noise_threshold(i: int, state: np.void) -> float:
    """Return sqrt(S² + 8 s²) of channel i; 0 before there are changes."""
    S, s = _DEVIATION * state["slow"][i], _DEVIATION * state["fast"][i]
    return math.sqrt(S * S + 8.0 * s * s)


@compiled
def _moved(median: float, sample: float, share: float, floor: float) -> float:
    """Return a running median after a sample, a share of itself nearer to it."""
    step = share * max(median, floor)
    return median + step if sample > median else max(median - step, 0.0)
