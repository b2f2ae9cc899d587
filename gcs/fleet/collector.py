"""The recordings of a fleet's processes, put together while it flies."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from ftc_autopilot.control.controller import SIGNALS, no_signals
from ftc_autopilot.hot.navigation import ESTIMATED
from gcs.errors import FlightLost
from gcs.results.recording import Ending, Mode, Recording, Steps
from gcs.scenario.model import Scenario
from mavlink_defs.runtime.spool import SpoolReader

_MOST_WAITING = 3
"""Pieces of the plant's recording that wait for an autopilot's."""
_WHOLE = np.dtype((np.void, SIGNALS.itemsize))
"""Signals as one block of bytes; numpy copies a record by its fields, ten times as slowly."""


class Collector:
    """Takes what the processes have written, so that little of it lies on disk at a time.

    The plant's steps are the flight's. A step is handed on when every autopilot has recorded
    it or a later one; one that it has not recorded is missing.
    """

    def __init__(self, scenario: Scenario, folder_of: Callable[[str], Path]) -> None:
        """Collect the recordings of the fleet of a scenario.

        Args:
            scenario: What it flies.
            folder_of: Gives the folder in which a process ("plant", "uav3") records.
        """
        self._scenario = scenario
        self._plant = SpoolReader(folder_of("plant"))
        self._autopilots = [
            _Autopilot(SpoolReader(folder_of(f"uav{uav.id}"))) for uav in scenario.uavs
        ]
        self._waiting: np.ndarray | None = None  # steps of the plant
        self._next = 0

    def pass_on(self, on_steps: Callable[[Steps], None], over: bool = False) -> None:
        """Hand on the steps that are complete; with `over`, no process writes any more."""
        for steps in self._complete(over):
            on_steps(steps)

    def pass_on_without_stragglers(self, on_steps: Callable[[Steps], None]) -> None:
        """Hand on the steps that are complete, and those that an autopilot has not had for long.

        For flights in which an autopilot may be gone for good: nothing piles up on disk.
        """
        self.pass_on(on_steps, over=self._plant.waiting >= _MOST_WAITING)

    def ending(self, mode: Mode, restarts: tuple[int, ...] = ()) -> Ending:
        """Return how the flight ended, and remove the recordings of the processes.

        It is lost if a process says so, and if an autopilot did not hear that the plant had come
        to the end.

        Raises:
            FlightLost: A process left no complete recording.
        """
        plant = self._plant.facts
        autopilots = [autopilot.reader.facts for autopilot in self._autopilots]
        ids = [uav.id for uav in self._scenario.uavs]
        complete = [facts for facts in autopilots if facts is not None]
        if plant is None or len(complete) < len(ids) or plant["steps"] != self._next:
            names = zip(("plant", *(f"uav{i}" for i in ids)), (plant, *autopilots), strict=True)
            torn = [name for name, facts in names if facts is None]
            which = f" ends early: {', '.join(torn)}" if torn else " lacks steps of the plant"
            raise FlightLost(f"the recording{which}")
        failures = zip(ids, (facts.get("failure") for facts in complete), strict=True)
        failed = [f"UAV {i}: {why}" for i, why in failures if why is not None]
        loss = failed[0] if failed else plant["loss"]
        for i, facts in zip(ids, complete, strict=True):
            if self._next == self._scenario.steps and not facts["heard_end"]:
                why = facts["loss"] or "its autopilot was stopped"
                loss = loss or f"UAV {i} did not hear the end of the flight: {why}"
        self.remove()
        return Ending(
            mode=mode,
            steps=self._next,
            repeats=np.array([facts["repeats"] for facts in complete]),
            wall_s=plant["wall_s"],
            loss=loss,
            restarts=restarts,
            plugin_failed=bool(failed),
        )

    def remove(self) -> None:
        """Remove the recordings of the processes."""
        for reader in (self._plant, *(autopilot.reader for autopilot in self._autopilots)):
            reader.remove()

    def recording(self, mode: Mode) -> Recording:
        """Return the whole flight, of which nothing has been handed on; raises as `ending`."""
        ids = tuple(uav.id for uav in self._scenario.uavs)
        steps = Steps.joined(list(self._complete(over=True)), len(ids))
        return Recording.of(steps, self.ending(mode), ids, self._scenario.step_us)

    def _complete(self, over: bool) -> Iterator[Steps]:
        while True:
            if self._waiting is None:
                self._waiting = self._plant.take()
            if self._waiting is None:
                return
            begin, count = self._next, len(self._waiting)
            if not all(a.read_to(begin + count) or over for a in self._autopilots):
                return
            n, estimated = len(self._autopilots), self._scenario.navigation == "estimated"
            signals = np.empty((count, n), SIGNALS)
            estimates = np.full((count, n, ESTIMATED if estimated else 0), np.nan)
            for i, autopilot in enumerate(self._autopilots):
                taken = autopilot.signals(begin, begin + count, estimates[:, i])
                signals.view(_WHOLE)[:, i] = taken.view(_WHOLE)
            plant, self._waiting = self._waiting, None
            self._next += count
            yield Steps(
                begin,
                np.ascontiguousarray(plant["states"]),
                np.ascontiguousarray(plant["wind"]),
                np.ascontiguousarray(plant["applied"]),
                signals,
                estimates,
            )


class _Autopilot:
    """The rows that an autopilot has recorded and that are not handed on yet."""

    def __init__(self, reader: SpoolReader) -> None:
        self.reader = reader
        self._rows: np.ndarray | None = None
        self._taken = 0  # steps before this one are handed on

    def read_to(self, end: int) -> bool:
        """Read rows until the steps before `end` are complete; return whether they are."""
        while self._rows is None or not len(self._rows) or self._rows["step"][-1] + 1 < end:
            rows = self.reader.take()
            if rows is None:
                return False
            if self._rows is not None:
                newest = self._rows["step"][-1] if len(self._rows) else self._taken - 1
                if rows["step"][0] <= newest:  # after a restart it may write again what it had
                    rows = rows[rows["step"] > newest]
                if len(self._rows):
                    rows = np.concatenate([self._rows, rows])
            self._rows = rows
        return True

    def signals(self, begin: int, end: int, estimates: np.ndarray) -> np.ndarray:
        """Take the signals of steps that have been read; no signals where there are none.

        Args:
            begin: The first step.
            end: The step after the last.
            estimates: Where what was estimated in these steps is written, if anything was.
        """
        if self._rows is None:
            return no_signals(end - begin)
        self._taken = end
        until = int(np.searchsorted(self._rows["step"], end))
        taken, rest = self._rows[:until], self._rows[until:]
        self._rows = rest if len(rest) else rest.copy()  # of which no file is kept open
        if estimates.shape[-1] > 0:
            estimates[taken["step"] - begin] = taken["estimate"]
        if until == end - begin:
            return np.asarray(taken["signals"])
        signals = no_signals(end - begin)
        signals[taken["step"] - begin] = taken["signals"]
        return signals
