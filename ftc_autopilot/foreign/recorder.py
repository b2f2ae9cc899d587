"""What is recorded of a foreign autopilot: what its aircraft measured, and what it commanded.

What it tracks is its own: references and errors are NaN.
"""

import contextlib
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ftc_autopilot.config import AutopilotConfig
from ftc_autopilot.control.signals import no_signals
from ftc_autopilot.foreign.base import PlantStep
from ftc_autopilot.hot.link import RECORD
from ftc_autopilot.hot.recorder import ESTIMATED_RECORD, RECORD_ROWS
from mavlink_defs.constants import N_CHANNELS
from mavlink_defs.runtime.jit import in_python
from mavlink_defs.runtime.spool import Spool, unwritten
from sitl_plant.airframe import stops
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.vec3 import Vec3

_position_of, _range_of = in_python(stops.position_of), in_python(stops.range_of)


class ForeignRecorder:
    """Writes the steps of one foreign autopilot into a folder, as an autopilot of ours does."""

    def __init__(
        self,
        config: AutopilotConfig,
        folder: Path | None,
        optional: bool,
        notify: Callable[[str], None],
        resumes: bool,
    ) -> None:
        """Make the folder.

        Args:
            config: Of its bridge.
            folder: Where it records; None: it does not.
            optional: Fly on if the folder cannot be written.
            notify: Called with a line for the log.
            resumes: Go on with what a bridge before this one has written.

        Raises:
            OSError: It cannot be made; it is named.
        """
        self._spool = None if folder is None else Spool(folder, resumes)
        self._optional, self._notify = optional, notify
        aircraft = aircraft_record(config.aircraft)
        self._ranges = [_range_of(aircraft, c) for c in range(N_CHANNELS)]
        estimated = config.navigation == "estimated"
        self._rows = np.zeros(RECORD_ROWS, ESTIMATED_RECORD if estimated else RECORD)
        self._rows["signals"] = no_signals(1)[0]
        if estimated:
            self._rows["estimate"] = np.nan
        self._count = 0
        self._held = np.zeros(N_CHANNELS)

    def add(
        self,
        sent: PlantStep,
        shares: np.ndarray,
        mask: int,
        place: tuple[float, Vec3] | None = None,
    ) -> None:
        """Record a step: what was sent, what is commanded, which channels had an event.

        Args:
            sent: What was sent.
            shares: What is commanded.
            mask: Of the channels that had an event.
            place: Of its slot on the path [m], and its offset [m]; None: it keeps none now.
        """
        if self._spool is None:
            return
        row, state = self._rows[self._count], sent.state
        row["step"] = sent.step
        signals = row["signals"]
        if state is not None:
            signals["V"] = np.linalg.norm(state["velocity"] - state["wind"])
            signals["attitude"] = state["attitude"]
        if mask:
            pairs = zip(shares.tolist(), self._ranges, strict=True)
            self._held[:] = [_position_of(share, *ends) for share, ends in pairs]
        signals["path_position"], signals["slot"] = place or (np.nan, np.nan)
        signals["held"] = self._held
        signals["events"] = mask
        self._count += 1
        if self._count == len(self._rows):
            self._write()

    def _write(self) -> None:
        if self._spool is None or not self._count:
            return
        rows = self._rows[: self._count]
        try:
            self._spool.write(int(rows["step"][0]), rows)
        except OSError as problem:
            if not self._optional:
                raise
            self._spool = None
            self._notify(f"{unwritten(problem)}; flying on without recording")
        self._count = 0

    def flush(self) -> None:
        """Write the rest of a flight that goes on with another bridge."""
        with contextlib.suppress(OSError):  # its rows are missing then
            self._write()

    def finish(
        self, loss: str | None, repeats: list[int], heard_end: bool, failure: str | None
    ) -> str | None:
        """Write the rest and how the flight ended; return why that cannot be written."""
        try:
            self._write()
            if self._spool is not None:
                self._spool.finish(loss=loss, repeats=repeats, heard_end=heard_end, failure=failure)
        except OSError as problem:
            return None if self._optional else unwritten(problem)
        return None
