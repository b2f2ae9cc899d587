"""What an autopilot records: the signals of each step that it received a state of."""

from pathlib import Path

import numpy as np

from ftc_autopilot.hot.link import RECORD
from ftc_autopilot.hot.navigation import ESTIMATED
from ftc_autopilot.hot.state import Autopilots
from mavlink_defs.runtime.spool import Spool

RECORD_ROWS = 1000
"""Steps written at a time."""

ESTIMATED_RECORD = np.dtype(
    [*RECORD.descr[:1], ("signals", RECORD["signals"]), ("estimate", "f8", (ESTIMATED,))]
)
"""What is recorded of a step flown by an estimated state."""


class AutopilotRecorder:
    """Empties the record of an autopilot into a folder."""

    def __init__(self, autopilot: Autopilots, folder: Path, resume: bool) -> None:
        """Make the folder, or continue in it; OSError if it cannot be made, which it names."""
        self._state = autopilot.own["link"]
        self._record, self._estimates = autopilot.record[0], autopilot.estimates[0]
        self._spool = Spool(folder, resume)
        self._given_up = False

    def give_up(self) -> None:
        """Write nothing any more, as what follows a gap would not be what it seems."""
        self._given_up = True

    def write(self, at_least: int = RECORD_ROWS) -> None:
        """Write the record if its rows span so many steps; OSError with a file's name if it cannot.

        An autopilot that acts on few of the states has few rows, which are waited for.
        """
        if self._given_up:
            self._state["recorded"] = 0
        count = int(self._state["recorded"][0])
        steps = self._record["step"]
        if count and (count >= at_least or steps[count - 1] - steps[0] + 1 >= at_least):
            rows = self._rows(count)
            self._spool.write(int(rows["step"][0]), rows)
            self._state["recorded"] = 0  # not if it failed: nothing may be left out

    def _rows(self, count: int) -> np.ndarray:
        rows: np.ndarray = self._record[:count]
        if not len(self._estimates):
            return rows
        both = np.empty(count, ESTIMATED_RECORD)
        both["step"], both["signals"] = rows["step"], rows["signals"]
        both["estimate"] = self._estimates[:count]
        return both

    def restart(self) -> None:
        """Forget the flight; a new one begins."""
        if not self._given_up:
            self._spool.restart()

    def finish(
        self, loss: str | None, repeats: list[int], heard_end: bool, failure: str | None
    ) -> None:
        """Write the rest and how the flight ended; OSError with a file's name if it cannot."""
        self.write(at_least=1)
        if not self._given_up:
            self._spool.finish(loss=loss, repeats=repeats, heard_end=heard_end, failure=failure)
