"""A flight as thin as a figure can show it, gathered while it is flown in bounded memory.

Or from its recording.
"""

from typing import TYPE_CHECKING

import numpy as np

from ftc_autopilot.control.signals import SIGNALS
from gcs.results.columns import COLUMNS
from gcs.results.recording import Ending, Events, Recording, Steps
from gcs.scenario.model import Scenario
from mavlink_defs.constants import ACTUATORS, N_CHANNELS

if TYPE_CHECKING:
    import pyarrow as pa

_MAX_ROWS = 30_000  # of all UAVs
_MIN_STEPS = 1000
_MAX_GAPS = 300_000  # of all UAVs
_FIELDS = ("V", "command", "reference", "held", "path_position", "slot")


def recorded_steps(table: "pa.Table", n: int) -> tuple[Steps, int]:
    """Return a trajectory thinned out for a figure, and how many of its steps are apart.

    Args:
        table: Rows of `trajectory.arrows`, light or full.
        n: Number of UAVs.

    Returns:
        The steps; of the signals only those that figures show, NaN where they were not recorded.
    """
    length = len(table) // n
    every = max(1, -(-length // max(_MAX_ROWS // n, _MIN_STEPS)))
    steps = _room(-(-length // every), n)
    steps.signals.view("f8").fill(np.nan)
    for column in COLUMNS:
        if column.field in {"", *_FIELDS} and column.name in table.column_names:
            values = table.column(column.name).to_numpy().reshape(length, n)
            column.of(steps)[:] = values[::every]
    return steps, every


def recorded_gaps(
    events: "pa.Table", uav_ids: tuple[int, ...]
) -> dict[tuple[int, int], np.ndarray]:
    """Return the intervals between events by system id and channel, as `Preview.gaps` does.

    Args:
        events: Rows of `events.arrows`.
        uav_ids: System ids.
    """
    uav, time_s = events.column("uav").to_numpy(), events.column("time_s").to_numpy()
    actuator = np.array(events.column("actuator").cast("string").to_pylist(), str)
    every = max(1, -(-len(uav) // _MAX_GAPS))
    found = {}
    for system in uav_ids:
        for channel, name in enumerate(ACTUATORS):
            times = time_s[(uav == system) & (actuator == name)]
            found[system, channel] = np.stack([times[1:], np.diff(times)])[:, ::every]
    return found


def _room(steps: int, n: int) -> Steps:
    fields = [(name, SIGNALS[name]) for name in _FIELDS]
    return Steps.room(steps, n)._replace(signals=np.zeros((steps, n), fields))


class Preview:
    """Steps of a flight that are evenly apart, and the intervals between events."""

    def __init__(self, scenario: Scenario) -> None:
        """Gather a flight of a scenario."""
        self._ids = tuple(uav.id for uav in scenario.uavs)
        self._step_us, n = scenario.step_us, len(self._ids)
        most = max(_MAX_ROWS // n, _MIN_STEPS)
        self._every = -(-scenario.steps // most)
        self._steps = _room(-(-scenario.steps // self._every), n)
        self._count = 0
        self._last_event = np.full(n * N_CHANNELS, np.nan)
        self._gaps: list[np.ndarray] = []  # each (3, k): channel of a UAV, time [s], length [s]
        self._gap_count = 0

    def add(self, steps: Steps, events: Events) -> None:
        """Gather the next steps, given their events."""
        self._add_gaps(events)
        chosen = slice(-steps.first % self._every, None, self._every)
        end = self._count + len(steps.states[chosen])
        for to, values in zip(self._steps[1:4], steps[1:4], strict=True):
            to[self._count : end] = values[chosen]
        for name in _FIELDS:
            self._steps.signals[name][self._count : end] = steps.signals[name][chosen]
        self._count = end

    def recording(self, ending: Ending) -> Recording:
        """Return the flight with the period of the chosen steps; it has no events."""
        kept = self._steps.part(0, self._count)
        return Recording.of(kept, ending, self._ids, self._step_us * self._every)

    def gaps(self) -> dict[tuple[int, int], np.ndarray]:
        """Return the intervals between events by system id and channel.

        Each has shape (2, k): the times at which they end, and their lengths [s]. Of very many,
        there is every second, fourth, eighth ... one.
        """
        key, *gaps = np.concatenate([np.zeros((3, 0)), *self._gaps], axis=1)
        return {
            (system, c): np.array(gaps)[:, key == i * N_CHANNELS + c]
            for i, system in enumerate(self._ids)
            for c in range(N_CHANNELS)
        }

    def _add_gaps(self, events: Events) -> None:
        if not len(events["step"]):
            return
        index = np.searchsorted(self._ids, events["uav"], sorter=np.argsort(self._ids))
        key = np.argsort(self._ids)[index] * N_CHANNELS + events["channel"]
        order = np.argsort(key.astype(np.uint16), kind="stable")  # NumPy's radix sort is for these
        key, times = key[order], events["time_s"][order]
        first = np.diff(key, prepend=-1) != 0
        gaps = np.diff(times, prepend=0.0)
        gaps[first] = times[first] - self._last_event[key[first]]
        self._last_event[key] = times  # the last one of each channel stays
        known = np.isfinite(gaps)  # a channel's very first event has no gap
        self._gaps.append(np.array([key, times, gaps])[:, known])
        self._gap_count += len(key)
        if self._gap_count > _MAX_GAPS:
            every = np.concatenate(self._gaps, axis=1)
            halved = every[:, np.argsort(every[0], kind="stable")][:, ::2]
            self._gaps, self._gap_count = [halved], halved.shape[1]
