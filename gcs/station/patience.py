"""How long a station waits for a vehicle: by whether it is heard, not by the clock alone."""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Patience:
    """How long a vehicle is waited for that does not answer, beyond the usual repetitions.

    Attributes:
        silence_s: Time since it was last heard after which it is given up [s].
        answer_s: Longest wait for an answer of one that is still heard [s].
    """

    silence_s: float = 5.0
    answer_s: float = 60.0

    def lasts(self, silent_s: float, waited_s: float) -> bool:
        """Return whether to wait on for a vehicle, given for how long it was not heard [s].

        Args:
            silent_s: Time since it was last heard [s].
            waited_s: Time since it was asked [s].
        """
        return silent_s < self.silence_s and waited_s < self.answer_s


USUAL = Patience()

HASTY = Patience(0.0, 0.0)
"""For requests that others should not wait for; they are made again later."""

ENDLESS = Patience(math.inf, math.inf)
"""For whoever knows otherwise whether a vehicle still lives."""
