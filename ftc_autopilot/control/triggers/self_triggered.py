"""Trigger `self`: each transmission sets the time of the next; nothing is watched in between.

Self-triggered control (Heemels, Johansson and Tabuada, "An introduction to event-triggered and
self-triggered control", IEEE CDC 2012) requires the time at which the command will have moved by
its threshold. Here the last two transmissions of the channel show how fast it moves:

    next = share (rel |sent| + abs) (t - t_before) / |sent - sent_before|,

within `shortest_s` and `longest_s`. The command may move by more in between: unlike the other
triggers this one promises no bound on the difference to what is held.
"""

from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np

from ftc_autopilot.control.triggers.base import Candidates, TriggerParameters, in_steps, threshold
from mavlink_defs.config.models import Loc
from mavlink_defs.config.periods import period_problems
from mavlink_defs.config.quantity import quantity
from mavlink_defs.constants import N_CHANNELS
from mavlink_defs.runtime.jit import compiled


class SelfTriggered(TriggerParameters):
    """Sets the time of the next transmission at the last one, and watches nothing in between.

    Choose it where even the watching costs too much.

    Attributes:
        mode: Name of the trigger.
        share: Share of the threshold that the next time aims at.
        shortest_s: Least time to the next.
        longest_s: Longest time to the next.
    """

    PAGE: ClassVar[str] = "explanation/triggers.md"
    STATE: ClassVar[np.dtype] = np.dtype(
        [
            ("wait", "i8", (N_CHANNELS,)),  # control periods from the last transmission to the next
            ("since", "i8", (N_CHANNELS,)),  # control periods since the last transmission
        ]
    )
    BY_THRESHOLD: ClassVar[bool] = False

    mode: Literal["self"] = "self"

    share: float = quantity("", default=0.7, gt=0.0, le=1.0)
    shortest_s: float = quantity("s", default=0.004, gt=0.0)
    longest_s: float = quantity("s", default=0.05, gt=0.0)

    def misfits(self, step_us: int) -> Iterator[tuple[Loc, str]]:
        """Yield times that are no whole number of control periods [µs], or the wrong way round."""
        for key in ("shortest_s", "longest_s"):
            yield from period_problems((key,), getattr(self, key), step_us)
        if self.longest_s < self.shortest_s:
            text = f"expected >= {self.shortest_s!r} s, shortest_s, got {self.longest_s!r}"
            yield ("longest_s",), text


@compiled
def self_triggered(now: Candidates, parameters: np.void, state: np.void) -> int:
    """Return the mask of the channels whose time has come, and set their next.

    Args:
        now: The present step.
        parameters: Record made of `SelfTriggered`.
        state: Record of dtype `SelfTriggered.STATE`, updated in place.
    """
    shortest = in_steps(parameters["shortest_s"], now.dt)
    longest = in_steps(parameters["longest_s"], now.dt)
    mask = 0
    for i in range(N_CHANNELS):
        state["since"][i] += 1
        if not now.first and state["since"][i] < state["wait"][i]:
            continue
        mask |= 1 << i
        wait = shortest
        if not now.first:
            moved = abs(now.commanded[i] - now.held[i])
            goal = parameters["share"] * threshold(now, i, now.commanded[i]) * state["since"][i]
            wait = longest if goal >= longest * moved else max(int(goal / moved), shortest)
        state["wait"][i], state["since"][i] = wait, 0
    return mask
