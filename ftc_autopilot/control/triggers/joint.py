"""Trigger `joint`: any surface's threshold updates all three, (29) as printed."""

from typing import Literal

from pydantic import Field

from ftc_autopilot.control.triggers.base import Candidates, TriggerParameters
from ftc_autopilot.control.triggers.per_channel import per_channel
from mavlink_defs.constants import THROTTLE
from mavlink_defs.runtime.jit import compiled

_SURFACES = (1 << THROTTLE) - 1


class Joint(TriggerParameters):
    """Thresholds of the trigger `joint`."""

    mode: Literal["joint"] = Field(default="joint", description="Name of the trigger.")


@compiled
def joint(now: Candidates) -> int:
    """Return the mask of the channels that (25) and (29) ask to transmit."""
    mask = per_channel(now)
    return mask | _SURFACES if mask & _SURFACES else mask
