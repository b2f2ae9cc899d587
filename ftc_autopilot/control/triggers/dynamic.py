"""Trigger `dynamic`: a threshold that may be exceeded for a while.

Dynamic event generator after Girard, "Dynamic triggering mechanisms for event-triggered
control", IEEE Transactions on Automatic Control 60(7), 2015. With the distance to the threshold
s = rel |held| + abs - |commanded - held|, each channel has an internal variable η in the unit of
its command,

    η' = -λ η + s,  η(0) = 0,        event when η + θ s <= 0.

η grows while the command is within its threshold, and is used up beyond it. Since η >= 0, an
event means s <= 0: it is never earlier than an event of (25), (29) from the same held command.
"""

from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np

from ftc_autopilot.control.triggers.base import Candidates, TriggerParameters, threshold
from mavlink_defs.config.models import Loc
from mavlink_defs.config.quantity import quantity
from mavlink_defs.constants import N_CHANNELS
from mavlink_defs.runtime.jit import compiled


class Dynamic(TriggerParameters):
    """Lets a command pass its threshold for a while, by a variable that fills in quiet flight.

    Choose it for fewer events than `per_channel` at about the same thresholds.

    Attributes:
        mode: Name of the trigger.
        decay_hz: Decay λ of the variable.
        theta_s: Weight θ of the present distance to the threshold.
    """

    PAGE: ClassVar[str] = "explanation/triggers.md"
    STATE: ClassVar[np.dtype] = np.dtype([("eta", "f8", (N_CHANNELS,))])  # rad s, rad s, rad s, N s

    mode: Literal["dynamic"] = "dynamic"

    decay_hz: float = quantity("1/s", default=10.0, ge=0.0)
    theta_s: float = quantity("s", default=0.01, gt=0.0)

    def misfits(self, step_us: int) -> Iterator[tuple[Loc, str]]:
        """Yield a weight that would let η become negative in a control period [µs]."""
        dt = step_us / 1e6
        if dt * self.decay_hz >= 1.0:
            text = f"expected < {1.0 / dt:g} 1/s, the control rate, got {self.decay_hz!r}"
            yield ("decay_hz",), text
        elif self.theta_s * (1.0 - dt * self.decay_hz) < dt * (1.0 - 1e-9):
            least = dt / (1.0 - dt * self.decay_hz)
            text = f"expected >= {least:.6g} s, so that η stays positive, got {self.theta_s!r}"
            yield ("theta_s",), text


@compiled
def dynamic(now: Candidates, parameters: np.void, state: np.void) -> int:
    """Return the mask of the channels that transmit, and advance η by one Euler step.

    Args:
        now: The present step.
        parameters: Record made of `Dynamic`.
        state: Record of dtype `Dynamic.STATE`, updated in place.
    """
    mask = 0
    for i in range(N_CHANNELS):
        eta = state["eta"][i]
        distance = threshold(now, i, now.held[i]) - abs(now.commanded[i] - now.held[i])
        if now.first or eta + parameters["theta_s"] * distance <= 0.0:
            mask |= 1 << i
            distance = threshold(now, i, now.commanded[i])
        state["eta"][i] = eta + now.dt * (distance - parameters["decay_hz"] * eta)
    return mask
