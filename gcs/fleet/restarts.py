"""When an autopilot that has failed is started again: at once, then after growing pauses.

No processes and no clock: names and times go in.
"""

from collections import Counter

MAX_IN_A_ROW = 5
"""Most restarts in a row of a process that fails soon after each start; then it is given up."""
_STABLE_S = 10.0  # a process that ran for so long is restarted at once again
_FIRST_PAUSE_S = 0.5  # before the second restart in a row; each later one takes twice as long


class Restarts:
    """The restarts of the processes of a fleet.

    Attributes:
        counts: Restarts so far, by process.
    """

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self._in_a_row: Counter[str] = Counter()
        self._started: dict[str, float] = {}
        self._due: dict[str, float] = {}

    def started(self, name: str, now: float) -> None:
        """Note the start of a process at a time [s], the first one or another."""
        if self._due.pop(name, None) is not None:
            self.counts[name] += 1
        self._started[name] = now

    def is_due(self, name: str, now: float) -> bool | None:
        """Return whether to start a dead process now; None if it is given up.

        Call it again and again until the process is started.

        Args:
            name: The process.
            now: The time [s].
        """
        if name not in self._due:
            was_stable = now - self._started[name] >= _STABLE_S
            self._in_a_row[name] = 1 if was_stable else self._in_a_row[name] + 1
            deaths = self._in_a_row[name]
            self._due[name] = now + (_FIRST_PAUSE_S * 2.0 ** (deaths - 2) if deaths > 1 else 0.0)
        if self._in_a_row[name] > MAX_IN_A_ROW:
            return None
        return now >= self._due[name]
