"""A flight as thin as a figure can show it, gathered while it is flown in bounded memory."""

import numpy as np

from ftc_autopilot.control.controller import SIGNALS
from gcs.results.events import events_of
from gcs.results.recording import Recording
from gcs.results.steps import Ending, Steps
from gcs.scenario.model import Scenario
from mavlink_defs.constants import N_CHANNELS

__all__ = ["Preview"]

_MOST_ROWS = 100_000  # of all UAVs: 20 MB; scenario 1 is kept at full rate
_MOST_GAPS = 30_000  # of one channel of one UAV
_FIELDS = ("V", "command", "reference", "held")


class Preview:
    """Every step of a short flight, and every second, fourth, eighth ... one of a long one.

    Attributes:
        gaps: Intervals between events of each UAV and channel: the times at which they end, and
            their lengths [s]; of many, every second, fourth, eighth ... one.
    """

    def __init__(self, scenario: Scenario) -> None:
        """Gather a flight of a scenario."""
        self._ids = tuple(uav.id for uav in scenario.uavs)
        self._step_us, n = scenario.step_us, len(self._ids)
        capacity = min(max(_MOST_ROWS // n, 1000), scenario.steps + 1)
        signals = np.zeros((capacity, n), [(name, SIGNALS[name]) for name in _FIELDS])
        room = Steps.room(0, n)._replace(signals=signals)
        for name in ("states", "wind", "applied"):
            shape = (capacity, *getattr(room, name).shape[1:])
            room = room._replace(**{name: np.zeros(shape)})
        self._kept, self._every, self._count = room, 1, 0
        self.gaps = {
            (i, c): (np.zeros(0), np.zeros(0)) for i in self._ids for c in range(N_CHANNELS)
        }
        self._last_event = dict.fromkeys(self.gaps, np.nan)

    def add(self, steps: Steps) -> None:
        """Gather the next steps."""
        self._add_gaps(steps)
        for begin in range(0, steps.length, 500):  # fewer than there is room for in half of it
            self._add_steps(steps.part(begin, begin + 500))

    def recording(self, ending: Ending) -> Recording:
        """Return the flight with the period of the steps that were kept; it has no events."""
        kept = self._kept.part(0, self._count)
        return Recording.of(kept, ending, self._ids, self._step_us * self._every)

    def _add_steps(self, steps: Steps) -> None:
        if self._count + steps.length > self._kept.length:
            for array in self._kept[1:]:
                half = array[: self._count : 2].copy()
                array[: len(half)] = half
            self._count, self._every = -(-self._count // 2), self._every * 2
        chosen = slice(-steps.first % self._every, None, self._every)
        new = len(steps.states[chosen])
        end = self._count + new
        for to, values in zip(self._kept[1:4], steps[1:4], strict=True):
            to[self._count : end] = values[chosen]
        for name in _FIELDS:
            self._kept.signals[name][self._count : end] = steps.signals[name][chosen]
        self._count = end

    def _add_gaps(self, steps: Steps) -> None:
        events = events_of(steps.signals, steps.first, self._ids, self._step_us)
        for (system, c), (times, gaps) in self.gaps.items():
            own = (events["uav"] == system) & (events["channel"] == c)
            ends = events["time_s"][own]
            if not len(ends):
                continue
            lengths = np.diff(ends, prepend=self._last_event[system, c])
            self._last_event[system, c] = ends[-1]
            known = np.isfinite(lengths)  # not that of the very first event
            times = np.concatenate([times, ends[known]])
            gaps = np.concatenate([gaps, lengths[known]])
            if len(times) > _MOST_GAPS:
                times, gaps = times[::2], gaps[::2]
            self.gaps[system, c] = times, gaps
