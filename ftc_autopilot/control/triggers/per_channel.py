"""Trigger `per_channel`: each channel by its own threshold, as the paper counts events."""

from typing import Literal

from pydantic import Field

from ftc_autopilot.control.triggers.base import Candidates, TriggerParameters, fires
from mavlink_defs.constants import N_CHANNELS
from mavlink_defs.runtime.jit import compiled


class PerChannel(TriggerParameters):
    """Thresholds of the trigger `per_channel`."""

    mode: Literal["per_channel"] = Field(default="per_channel", description="Name of the trigger.")


@compiled
def per_channel(now: Candidates) -> int:
    """Return the mask of the channels that (25), or (29) by surface, asks to transmit."""
    mask = 0
    for i in range(N_CHANNELS):
        if now.first or fires(now, i):
            mask |= 1 << i
    return mask
