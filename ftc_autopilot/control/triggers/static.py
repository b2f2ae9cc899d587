"""Triggers without memory: the paper's two, and the law's own choice.

- `per_channel`: each channel by its own threshold, as the paper counts events.
- `joint`: any surface's threshold updates all three, (29) as printed.
- `consequence`: the law selects what is sent, by what follows from not sending it.
"""

from typing import ClassVar, Literal

from ftc_autopilot.control.step import ALL
from ftc_autopilot.control.triggers.base import Candidates, TriggerParameters, fires
from mavlink_defs.constants import N_CHANNELS, THROTTLE
from mavlink_defs.runtime.jit import compiled

_SURFACES = (1 << THROTTLE) - 1


class PerChannel(TriggerParameters):
    """Sends a command when it differs from the held one by more than a threshold, each by itself.

    Choose it first: it is the paper's, (25) and (29) by surface.

    Attributes:
        mode: Name of the trigger.
    """

    PAGE: ClassVar[str] = "explanation/triggers.md"

    mode: Literal["per_channel"] = "per_channel"


class Joint(TriggerParameters):
    """Sends all three surfaces when one of them passes its threshold.

    Choose it to reproduce (29) as printed, or where a message carries them all anyway.

    Attributes:
        mode: Name of the trigger.
    """

    PAGE: ClassVar[str] = "explanation/triggers.md"

    mode: Literal["joint"] = "joint"


class Consequence(TriggerParameters):
    """Leaves to the law which commands are sent, and when.

    Choose it with `tube`, or another law that selects; the law may use the thresholds.

    Attributes:
        mode: Name of the trigger.
    """

    PAGE: ClassVar[str] = "explanation/triggers.md"
    BY_THRESHOLD: ClassVar[bool] = False
    LAW_SELECTS: ClassVar[bool] = True

    mode: Literal["consequence"] = "consequence"


@compiled
def per_channel(now: Candidates) -> int:
    """Return the mask of the channels that (25), or (29) by surface, asks to transmit."""
    mask = 0
    for i in range(N_CHANNELS):
        if now.first or fires(now, i):
            mask |= 1 << i
    return mask


@compiled
def joint(now: Candidates) -> int:
    """Return the mask of the channels that (25) and (29) ask to transmit."""
    mask = per_channel(now)
    return mask | _SURFACES if mask & _SURFACES else mask


@compiled
def consequence(now: Candidates) -> int:
    """Return the mask of the channels that the law has selected; in the first step all."""
    return ALL if now.first else now.selected
