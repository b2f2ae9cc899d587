"""A trigger by clock and change."""

from typing import ClassVar

import numpy as np

from ftc_autopilot.control.triggers.base import Candidates, TriggerParameters
from mavlink_defs.config.quantity import whole
from mavlink_defs.runtime.jit import compiled


class EveryNth(TriggerParameters):
    """Every nth command, if it has changed at all."""

    STATE: ClassVar[np.dtype] = np.dtype([("steps", "i8")])
    BY_THRESHOLD: ClassVar[bool] = False

    nth: int = whole("", ge=1, default=7, doc="Steps between two messages.")

    @staticmethod
    @compiled
    def step(now: Candidates, parameters: np.void, state: np.void) -> int:
        """Return the mask of the channels that transmit."""
        state["steps"] += 1
        if now.first:
            return 15
        if state["steps"] % parameters["nth"] != 0:
            return 0
        mask = 0
        for i in range(4):
            if now.commanded[i] != now.held[i]:
                mask |= 1 << i
        return mask
