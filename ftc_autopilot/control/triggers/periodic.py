"""Trigger `periodic`: by the clock, whatever the commands are."""

from collections.abc import Iterator
from typing import Any, ClassVar, Literal, TypeAlias

import numpy as np

from ftc_autopilot.control.triggers.base import Candidates, TriggerParameters, in_steps
from mavlink_defs.config.models import Loc
from mavlink_defs.config.periods import period_problems
from mavlink_defs.config.quantity import quantity
from mavlink_defs.constants import ACTUATORS, N_CHANNELS, Actuator
from mavlink_defs.runtime.jit import compiled

Times: TypeAlias = tuple[float, float, float, float]
"""Times of the channels [s], as in FTC_ACTUATOR."""


def _period(doc: str) -> Any:
    return quantity("s", doc, 0.0, ge=0.0, le=3600.0)


class Periodic(TriggerParameters):
    """Sends by the clock, whatever the commands are.

    Choose it as the yardstick of every saving; each channel may have a period of its own.

    Attributes:
        mode: Name of the trigger.
    """

    PAGE: ClassVar[str] = "explanation/triggers.md"
    STATE: ClassVar[np.dtype] = np.dtype([("steps", "i8")])  # made so far
    BY_THRESHOLD: ClassVar[bool] = False
    BY_CLOCK: ClassVar[bool] = True

    mode: Literal["periodic"] = "periodic"

    period_s: float = _period("Time between transmissions; 0: one in every control period.")
    aileron_period_s: float = _period("The same of the aileron; 0: `period_s`.")
    elevator_period_s: float = _period("The same of the elevator; 0: `period_s`.")
    rudder_period_s: float = _period("The same of the rudder; 0: `period_s`.")
    throttle_period_s: float = _period("The same of the throttle; 0: `period_s`.")

    def by_channel(self) -> dict[Actuator, float]:
        """Return the period of each channel [s]; 0: every control period."""
        return {name: getattr(self, f"{name}_period_s") or self.period_s for name in ACTUATORS}

    def misfits(self, step_us: int) -> Iterator[tuple[Loc, str]]:
        """Yield the periods that are no whole number of control periods [µs]."""
        for key in ("period_s", *(f"{name}_period_s" for name in ACTUATORS)):
            yield from period_problems((key,), getattr(self, key), step_us)


@compiled
def periodic(now: Candidates, periods: np.void, state: np.void) -> int:
    """Return the mask of the channels whose time it is; the first step has all of them.

    Args:
        now: The present step.
        periods: Record made of `Periodic`.
        state: Record of dtype `Periodic.STATE`, updated in place.
    """
    due, _ = clock(now.dt, periods, state)
    state["steps"] += 1
    return due


@compiled
def clock(dt: float, periods: np.void, state: np.void) -> tuple[int, Times]:
    """Return the mask of the channels whose time it is, and the period of each [s].

    Args:
        dt: Control period [s].
        periods: Record made of `Periodic`.
        state: Record of dtype `Periodic.STATE`; read only.
    """
    of_all = max(periods["period_s"], dt)
    period_s = (
        _either(periods["aileron_period_s"], of_all),
        _either(periods["elevator_period_s"], of_all),
        _either(periods["rudder_period_s"], of_all),
        _either(periods["throttle_period_s"], of_all),
    )
    due = 0
    for i in range(N_CHANNELS):
        if state["steps"] % in_steps(period_s[i], dt) == 0:
            due |= 1 << i
    return due, period_s


@compiled
def _either(own_s: float, of_all_s: float) -> float:
    return own_s if own_s > 0.0 else of_all_s
