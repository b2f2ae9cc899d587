"""The recordings of a fleet's processes, put together while it flies."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from ftc_autopilot.control.signals import SIGNALS, no_signals
from ftc_autopilot.hot.navigation import ESTIMATED
from gcs.console.errors import FlightLost
from gcs.results.recording import Ending, Mode, Recording, Steps
from gcs.scenario.model import Scenario
from mavlink_defs.runtime.spool import SpoolReader

_MAX_WAITING = 3
"""Pieces of the plant's recording after a piece that waits for an autopilot's."""
_REMEMBERED = 65_536
"""Missing steps of an autopilot that are remembered; rows of older ones count as missing, too."""
_WHOLE = np.dtype((np.void, SIGNALS.itemsize))
"""Signals as one block of bytes; numpy copies a record by its fields, ten times as slowly."""


@dataclass(frozen=True)
class Gap:
    """Steps whose rows are missing, though the process has flown them.

    Attributes:
        rows: How many.
        first: The first step among them.
        last: The last one.
    """

    rows: int
    first: int
    last: int


class Collector:
    """Takes what the processes have written, so that little of it lies on disk at a time.

    The plant's steps are the flight's. A step is handed on when every autopilot has recorded
    it or a later one; one that it has not recorded is missing.

    Attributes:
        gaps: Rows that are gone or came after their steps had been handed on, by process.
    """

    def __init__(self, scenario: Scenario, folder_of: Callable[[str], Path]) -> None:
        """Collect the recordings of the fleet of a scenario.

        Args:
            scenario: What it flies.
            folder_of: Gives the folder in which a process ("plant", "uav3") records.
        """
        self._scenario = scenario
        self.gaps: dict[str, Gap] = {}
        self._plant = SpoolReader(folder_of("plant"))
        names = (f"uav{uav.id}" for uav in scenario.uavs)
        self._autopilots = [
            _Autopilot(SpoolReader(folder_of(name)), partial(self._note_gap, name))
            for name in names
        ]
        self._waiting: tuple[int, np.ndarray] | None = None  # steps of the plant
        self._next = 0

    def pass_on(self, on_steps: Callable[[Steps], None], over: bool = False) -> None:
        """Hand on the steps that are complete; with `over`, no process writes any more."""
        for steps in self._complete(over):
            on_steps(steps)
        if over:
            for autopilot in self._autopilots:
                autopilot.read_to(math.inf)  # notes what is too late

    def pass_on_without_stragglers(self, on_steps: Callable[[Steps], None]) -> None:
        """Hand on the steps that are complete, and those that an autopilot has not had for long.

        For flights in which an autopilot may be gone for good: nothing piles up on disk.
        """
        for steps in self._complete(over=False, most_waiting=_MAX_WAITING):
            on_steps(steps)

    def discard(self) -> None:
        """Remove what has been written and not handed on; then nothing can be handed on."""
        for reader in self._readers():
            reader.discard()

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
        if (
            plant is None
            or len(complete) < len(ids)
            or plant["steps"] != self._next
            or "plant" in self.gaps
        ):
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
            contacts=plant.get("contacts") or (),
        )

    def remove(self) -> None:
        """Remove the recordings of the processes."""
        for reader in self._readers():
            reader.remove()

    def recording(self, mode: Mode) -> Recording:
        """Return the whole flight, of which nothing has been handed on; raises as `ending`."""
        ids = tuple(uav.id for uav in self._scenario.uavs)
        steps = Steps.joined(list(self._complete(over=True)), len(ids))
        return Recording.of(steps, self.ending(mode), ids, self._scenario.step_us)

    def _note_gap(self, name: str, steps: np.ndarray) -> None:
        """Note steps of a process that are missing, ascending; at least one."""
        rows, first, last = len(steps), int(steps[0]), int(steps[-1])
        if (gap := self.gaps.get(name)) is not None:
            rows += gap.rows
            first, last = min(first, gap.first), max(last, gap.last)
        self.gaps[name] = Gap(rows, first, last)

    def _readers(self) -> Iterator[SpoolReader]:
        yield self._plant
        yield from (autopilot.reader for autopilot in self._autopilots)

    def _complete(self, over: bool, most_waiting: float = math.inf) -> Iterator[Steps]:
        while (piece := self._piece()) is not None:
            begin, plant = piece
            count = len(plant)
            complete = [a.read_to(begin + count) for a in self._autopilots]
            if not (all(complete) or over or self._plant.waiting >= most_waiting):
                return
            n, estimated = len(self._autopilots), self._scenario.navigation == "estimated"
            signals = np.empty((count, n), SIGNALS)
            estimates = np.full((count, n, ESTIMATED if estimated else 0), np.nan)
            for i, autopilot in enumerate(self._autopilots):
                taken = autopilot.signals(begin, begin + count, estimates[:, i])
                signals.view(_WHOLE)[:, i] = taken.view(_WHOLE)
            if begin > self._next:
                self._note_gap("plant", np.arange(self._next, begin))
            self._waiting, self._next = None, begin + count
            yield Steps(
                begin,
                np.ascontiguousarray(plant["states"]),
                np.ascontiguousarray(plant["wind"]),
                np.ascontiguousarray(plant["applied"]),
                signals,
                estimates,
            )

    def _piece(self) -> tuple[int, np.ndarray] | None:
        """Return the plant's next steps that are not handed on yet, and the first one's number."""
        while self._waiting is None and (piece := self._plant.take()) is not None:
            first, rows = piece
            known = max(self._next - first, 0)  # it came twice
            if known < len(rows):
                self._waiting = first + known, rows[known:]
        return self._waiting


class _Autopilot:
    """The rows that an autopilot has recorded and that are not handed on yet."""

    def __init__(self, reader: SpoolReader, on_gap: Callable[[np.ndarray], None]) -> None:
        self.reader = reader
        self._on_gap = on_gap
        self._rows: np.ndarray | None = None  # ascending, each step once
        self._taken = 0  # steps before this one are handed on
        self._missing = np.empty(0, np.int64)  # of these, those without a row; the newest

    def read_to(self, end: float) -> bool:
        """Read rows until the steps before `end` are complete; return whether they are."""
        while self._rows is None or not len(self._rows) or self._rows["step"][-1] + 1 < end:
            piece = self.reader.take()
            if piece is None:
                return False
            self._keep(piece[1])
        return True

    def signals(self, begin: int, end: int, estimates: np.ndarray) -> np.ndarray:
        """Take the signals of steps that have been read; no signals where there are none.

        Args:
            begin: The first step.
            end: The step after the last.
            estimates: Where what was estimated in these steps is written, if anything was.
        """
        self._taken = end
        if self._rows is None:
            self._note_missing(np.arange(begin, end))
            return no_signals(end - begin)
        first, until = np.searchsorted(self._rows["step"], (begin, end))
        taken, rest = self._rows[first:until], self._rows[until:]
        self._rows = rest if len(rest) else rest.copy()  # of which no file is kept open
        if estimates.shape[-1] > 0:
            estimates[taken["step"] - begin] = taken["estimate"]
        if len(taken) == end - begin:  # each of these steps once
            return np.asarray(taken["signals"])
        self._note_missing(np.setdiff1d(np.arange(begin, end), taken["step"], assume_unique=True))
        signals = no_signals(end - begin)
        signals[taken["step"] - begin] = taken["signals"]
        return signals

    def _keep(self, rows: np.ndarray) -> None:
        """Keep rows of steps that are not handed on; the first one of each step counts.

        After a restart an autopilot may write again what it had.
        """
        is_late = rows["step"] < self._taken
        if is_late.any():
            self._note_late(np.unique(rows["step"][is_late]))
            rows = rows[~is_late]
        if self._rows is not None and len(self._rows):
            rows = np.concatenate([self._rows, rows])
        if (np.diff(rows["step"]) <= 0).any():
            rows = rows[np.unique(rows["step"], return_index=True)[1]]
        self._rows = rows

    def _note_missing(self, steps: np.ndarray) -> None:
        self._missing = np.concatenate([self._missing, steps])[-_REMEMBERED:]

    def _note_late(self, steps: np.ndarray) -> None:
        forgotten = self._missing[0] if len(self._missing) == _REMEMBERED else 0
        steps = steps[np.isin(steps, self._missing) | (steps < forgotten)]
        if len(steps):  # else they are recorded
            self._missing = np.setdiff1d(self._missing, steps)
            self._on_gap(steps)
