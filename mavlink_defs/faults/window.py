"""When a fault acts, whether of an actuator or of a sensor."""

import math
from typing import NamedTuple, Self


class Window(NamedTuple):
    """A window of simulated time.

    Attributes:
        start_s: Start, exclusive; NaN for now [s].
        end_s: End, inclusive; NaN for until cleared [s].
    """

    start_s: float
    end_s: float

    def __str__(self) -> str:
        if math.isfinite(self.end_s) and math.isfinite(self.start_s):
            return f"in ({self.start_s:g}, {self.end_s:g}] s"
        start = f"after {self.start_s:g} s" if math.isfinite(self.start_s) else "from now"
        if math.isfinite(self.end_s):
            return f"{start} to {self.end_s:g} s"
        return f"{start}, until cleared"

    def contains(self, time_s: float) -> bool:
        """Return whether it contains a simulation time [s]."""
        return self.start_s < time_s <= self.end_s

    def overlaps(self, other: "Window") -> bool:
        """Return whether two windows that are `resolved` have a time in common."""
        return self.start_s < other.end_s and other.start_s < self.end_s

    def resolved(self, now_s: float) -> Self:
        """Return it as set at `now_s` [s]: NaN becomes now or, for the end, infinity."""
        return self._replace(
            start_s=now_s if math.isnan(self.start_s) else self.start_s,
            end_s=math.inf if math.isnan(self.end_s) else self.end_s,
        )

    def as_dict(self, time_s: float | None) -> dict[str, float | bool | None]:
        """Return it as plain data; its end is None if it lasts until cleared.

        Args:
            time_s: Simulation time [s]; None if unknown.
        """
        return {
            "start_s": self.start_s,
            "end_s": self.end_s if math.isfinite(self.end_s) else None,
            "active": time_s is not None and self.contains(time_s),
        }
