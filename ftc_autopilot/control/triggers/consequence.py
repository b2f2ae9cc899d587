"""Trigger `consequence`: the law chooses what is sent, by what follows from not sending it."""

from typing import ClassVar, Literal

from pydantic import Field

from ftc_autopilot.control.triggers.base import ALL, Candidates, TriggerParameters
from mavlink_defs.runtime.jit import compiled


class Consequence(TriggerParameters):
    """The trigger `consequence`; the law may use the thresholds, in a part of its own."""

    BY_THRESHOLD: ClassVar[bool] = False

    mode: Literal["consequence"] = Field(default="consequence", description="Name of the trigger.")


@compiled
def consequence(now: Candidates) -> int:
    """Return the mask of the channels that the law has chosen; the first step has all of them."""
    return ALL if now.first else now.chosen
