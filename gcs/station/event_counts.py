"""The event counters of one vehicle and their recent history.

Times are simulated times, so that rates do not depend on the speed of the simulation.
"""

from collections import deque
from collections.abc import Sequence
from typing import TYPE_CHECKING

from mavlink_defs.capture.saving import saving
from mavlink_defs.dialect import MAVLink_ftc_events_message

if TYPE_CHECKING:
    import numpy as np

Four = tuple[int, int, int, int]
"""One number per channel: aileron, elevator, rudder, throttle."""

WINDOW_S = 10.0
"""Window of the recent events [s of simulated time]."""
SPAN_S = 120.0
"""Span that is stored for rates [s of simulated time]."""

_NONE_YET = 0xFFFFFFFF
_ZERO: Four = (0, 0, 0, 0)


class EventCounts:
    """The counters in the FTC_EVENTS of one vehicle; zeros until the first one.

    Attributes:
        time_s: Simulated time of the counters [s].
        steps: Control steps with active control: transmissions per channel of a periodic sender.
        events: Events per channel.
        repeats: Events that were sent again because they were lost, per channel.
        min_interval_s: Smallest time between two events per channel, None with fewer than two.
        messages: Actuator messages sent because of an event.
        edge_changes: Times that a neighbour was dropped or re-added.
        neighbour_messages: Messages sent to neighbours after the first step.
        oldest_state_s: Longest time for which it acted on one state lately [s]; 0 in lockstep.
    """

    def __init__(self) -> None:
        self.time_s = 0.0
        self.steps = 0
        self.events: Four = _ZERO
        self.repeats: Four = _ZERO
        self.min_interval_s: tuple[float | None, ...] = (None,) * 4
        self.messages = 0
        self.edge_changes = 0
        self.neighbour_messages = 0
        self.oldest_state_s = 0.0
        self._samples: deque[tuple[float, Four]] = deque()

    def receive(self, message: MAVLink_ftc_events_message) -> None:
        """Process a message; one older than the last is ignored."""
        time_s = message.time_boot_ms / 1e3
        if time_s < self.time_s:
            return
        self.time_s, self.steps = time_s, message.steps
        self.events, self.repeats = _four(message.events), _four(message.repeats)
        self.min_interval_s = tuple(
            None if us == _NONE_YET else us / 1e6 for us in message.min_interval_us
        )
        self.messages, self.edge_changes = message.messages, message.edge_changes
        self.neighbour_messages = message.neighbour_messages
        self.oldest_state_s = message.oldest_state_us / 1e6
        if self._samples and self._samples[-1][0] == time_s:
            self._samples.pop()
        self._samples.append((time_s, self.events))
        while self._samples[0][0] < time_s - SPAN_S:
            self._samples.popleft()

    @property
    def total(self) -> int:
        """Events of all channels."""
        return sum(self.events)

    @property
    def savings(self) -> tuple[float | None, ...]:
        """Share of periodic transmissions that was saved per channel; None before any step."""
        return tuple(saving(n, self.steps, channels=1) for n in self.events)

    @property
    def saving(self) -> float | None:
        """Share that was saved over all channels together; None before any step."""
        return saving(self.total, self.steps)

    def recent(self, window_s: float = WINDOW_S) -> Four:
        """Return the events per channel in the last `window_s` of simulated time."""
        before = self._samples[0][1] if self._samples else _ZERO
        for time_s, events in self._samples:
            if time_s > self.time_s - window_s:
                break
            before = events
        return _four([now - then for now, then in zip(self.events, before, strict=True)])

    def rates(self, bins: int = 60, bin_s: float = 1.0) -> "np.ndarray":
        """Return events per second of simulated time, shape (bins, 4), oldest first.

        Bins before the first FTC_EVENTS hold 0.
        """
        import numpy as np  # which only displays of rates need

        if not self._samples:
            return np.zeros((bins, 4))
        times = [time_s for time_s, _ in self._samples]
        counts = np.array([events for _, events in self._samples], float)
        edges = self.time_s + bin_s * np.arange(-bins, 1)
        cumulated = [np.interp(edges, times, counts[:, channel]) for channel in range(4)]
        return np.diff(np.stack(cumulated, axis=1), axis=0) / bin_s


def _four(values: Sequence[int]) -> Four:
    a, b, c, d = map(int, values)
    return a, b, c, d
