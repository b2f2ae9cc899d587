"""The event log: notifications of the vehicles and what came of the operator's actions."""

from collections import deque
from dataclasses import dataclass

from gcs.station.notifications import Notification

KINDS = ("link", "mode", "text", "ack", "faults", "profile", "action", "station")
"""Subjects of entries; "action" is the outcome of a request of this station's operator, "station" a
failure of the dashboard itself."""

_KEPT = 5000


@dataclass(frozen=True)
class Entry:
    """One line of the log.

    Attributes:
        number: Of the entry in its log, from 1.
        at: When [s since 1970].
        time_s: Simulated time of the vehicle then [s], if it had reported one.
        system: System id of the vehicle; 0 for the station itself.
        kind: One of `KINDS`.
        severity: MAV_SEVERITY.
        text: The line.
    """

    number: int
    at: float
    time_s: float | None
    system: int
    kind: str
    severity: int
    text: str


class EventLog:
    """The latest entries, oldest first."""

    def __init__(self) -> None:
        self.entries: deque[Entry] = deque(maxlen=_KEPT)
        self.count = 0

    def receive(self, notifications: Notification, at: float, time_s: float | None) -> None:
        """Take in notifications of the client."""
        one = notifications
        self.note(at, time_s, one.system, one.kind, one.severity, one.text)

    def note(
        self, at: float, time_s: float | None, system: int, kind: str, severity: int, text: str
    ) -> None:
        """Append an entry."""
        self.count += 1
        self.entries.append(Entry(self.count, at, time_s, system, kind, severity, text))

    def since(self, number: int) -> list[Entry]:
        """The entries after this number, as far as they are kept."""
        new = min(self.count - number, len(self.entries))
        return [self.entries[i] for i in range(len(self.entries) - new, len(self.entries))]

    def clear(self) -> None:
        """Forget all entries."""
        self.entries.clear()
        self.count = 0
