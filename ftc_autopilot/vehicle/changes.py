"""What a vehicle announces of itself, and how often: what alternates is counted, not repeated."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

_PAUSE_US = 1_000_000


class Change(NamedTuple):
    """Something of the vehicle that has changed.

    Attributes:
        subject: What has changed, such as "IMU 1": texts of one subject are bounded together.
        severity: MAV_SEVERITY.
        text: What is sent to stations.
    """

    subject: str
    severity: int
    text: str


class Changes:
    """Passes on at most one text of each subject in a second of simulated time.

    The first goes out at once. Of those that follow within the second, the newest goes out when it
    is over, with the number of all of them.
    """

    def __init__(self) -> None:
        self._sent_us: dict[str, int] = {}
        self._held: dict[str, tuple[Change, int]] = {}  # the newest, and how many there were

    def bounded(self, changes: Iterable[Change], time_us: int) -> Iterator[tuple[int, str]]:
        """Yield severity and text of what may be sent.

        Args:
            changes: What has changed since the last call.
            time_us: Simulated time [µs].
        """
        for change in changes:
            _, count = self._held.get(change.subject, (change, 0))
            self._held[change.subject] = change, count + 1
        for subject in list(self._held):
            if time_us - self._sent_us.get(subject, -_PAUSE_US) >= _PAUSE_US:
                self._sent_us[subject] = time_us
                yield self._next(subject)

    def left(self) -> Iterator[tuple[int, str]]:
        """Yield severity and text of what was held back: the flight ends."""
        yield from map(self._next, list(self._held))

    def _next(self, subject: str) -> tuple[int, str]:
        change, count = self._held.pop(subject)
        counted = f" ({count} changes since the last text)" if count > 1 else ""
        return change.severity, change.text + counted
