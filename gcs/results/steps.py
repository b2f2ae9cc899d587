"""What a flight hands over while it is flown, and what is known at its end."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, Self

import numpy as np

from ftc_autopilot.control.controller import SIGNALS
from mavlink_defs.constants import N_CHANNELS

Mode = Literal["lockstep", "real_time", "in_process"]


class Steps(NamedTuple):
    """Consecutive steps of all n UAVs of a flight; the arrays are as of `Recording`."""

    first: int  # step number of row 0
    states: np.ndarray  # (steps, n, 12)
    wind: np.ndarray  # (steps, n, 3)
    applied: np.ndarray  # (steps, n, 4)
    signals: np.ndarray  # (steps, n), dtype SIGNALS

    @classmethod
    def joined(cls, parts: Sequence[Self], n: int) -> Self:
        """Return consecutive steps of n UAVs, from step 0 on, in arrays of their own."""
        arrays = zip(*(part[1:] for part in (cls.room(0, n), *parts)), strict=True)
        return cls(0, *(np.concatenate(same) for same in arrays))

    @property
    def length(self) -> int:
        """Number of steps."""
        return len(self.states)

    @classmethod
    def room(cls, steps: int, n: int) -> Self:
        """Return room for so many steps of n UAVs, from step 0 on."""
        return cls(
            0,
            np.zeros((steps, n, 12)),
            np.zeros((steps, n, 3)),
            np.zeros((steps, n, N_CHANNELS)),
            np.zeros((steps, n), SIGNALS),
        )

    def part(self, begin: int, end: int) -> Self:
        """Return the rows from `begin` to `end`, as views."""
        return type(self)(
            self.first + begin,
            self.states[begin:end],
            self.wind[begin:end],
            self.applied[begin:end],
            self.signals[begin:end],
        )


@dataclass(frozen=True)
class Ending:
    """What is known of a flight when it is over, besides its steps.

    Attributes:
        mode: How it was flown.
        steps: Control periods flown.
        repeats: Shape (n, 4), events sent again because the plant had not applied them.
        wall_s: Wall-clock time that the simulated time took [s].
        loss: Why the flight was lost; None if it was not.
        restarts: How often each autopilot was started again; empty: none could be.
    """

    mode: Mode
    steps: int
    repeats: np.ndarray
    wall_s: float
    loss: str | None
    restarts: tuple[int, ...] = ()
