"""Trigger `periodic_event`: thresholds that are checked by the clock.

Periodic event-triggered control after Heemels, Donkers and Teel, "Periodic event-triggered
control for linear systems", IEEE Transactions on Automatic Control 58(4), 2013: (25) and (29)
are checked every `check_s` only, which is then the least time between two events.
"""

from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np

from ftc_autopilot.control.triggers.base import Candidates, TriggerParameters, in_steps
from ftc_autopilot.control.triggers.static import per_channel
from mavlink_defs.config.models import Loc
from mavlink_defs.config.periods import period_problems
from mavlink_defs.config.quantity import quantity
from mavlink_defs.runtime.jit import compiled


class PeriodicEvent(TriggerParameters):
    """Looks at the thresholds of `per_channel` by a clock only.

    Choose it where nothing can be watched all the time; events are at least a check apart.

    Attributes:
        mode: Name of the trigger.
        check_s: Time from one check to the next.
    """

    PAGE: ClassVar[str] = "explanation/triggers.md"
    STATE: ClassVar[np.dtype] = np.dtype([("steps", "i8")])  # made so far

    mode: Literal["periodic_event"] = "periodic_event"

    check_s: float = quantity("s", default=0.01, gt=0.0)

    def misfits(self, step_us: int) -> Iterator[tuple[Loc, str]]:
        """Yield the time if it is no whole number of control periods [µs]."""
        yield from period_problems(("check_s",), self.check_s, step_us)


@compiled
def periodic_event(now: Candidates, parameters: np.void, state: np.void) -> int:
    """Return the mask of the channels that transmit, none between two checks.

    Args:
        now: The present step.
        parameters: Record made of `PeriodicEvent`.
        state: Record of dtype `PeriodicEvent.STATE`, updated in place.
    """
    mask = 0
    if now.first or state["steps"] % in_steps(parameters["check_s"], now.dt) == 0:
        mask = per_channel(now)
    state["steps"] += 1
    return mask
