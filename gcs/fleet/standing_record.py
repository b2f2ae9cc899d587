"""What `gcs up` records of its fleet: a telemetry log and a light recording, the newest of both."""

import contextlib
import time
from collections.abc import Callable
from pathlib import Path

from gcs.fleet.collector import Collector
from gcs.results.choices import Record
from gcs.results.recorder import streams_of
from gcs.results.recording import Steps, events_of
from gcs.results.store import EVENTS, TRAJECTORY
from gcs.scenario.model import Scenario
from mavlink_defs.capture.tlog import TlogWriter

LOG, PREVIOUS = "flight.tlog", "previous"
LIMIT_BYTES = 128_000_000
"""Size of log and recording together at which they begin again; the ones before are kept, too."""
_FILES = (LOG, TRAJECTORY, EVENTS)
_CHECK_S = 1.0


class StandingRecord:
    """Log and recording of a flight without an end, in two generations of bounded size.

    When the files have reached their limit they move to the folder `previous`, in place of those
    before them. A file that cannot be written ends the recording, not the flight.
    """

    def __init__(
        self,
        scenario: Scenario,
        folder: Path,
        on_message: Callable[[str], None],
        limit_bytes: int = LIMIT_BYTES,
    ) -> None:
        """Make the files.

        Args:
            scenario: What is flown.
            folder: Run folder, exists.
            on_message: Called with the reason if the recording ends.
            limit_bytes: Size of a generation.

        Raises:
            OSError: A file cannot be written; it is named.
        """
        self._scenario, self._folder, self._on_message = scenario, folder, on_message
        self._limit_bytes = limit_bytes
        self._ids = tuple(uav.id for uav in scenario.uavs)
        self._ended = False
        self._check_due_s = 0.0
        self._collector = Collector(scenario, lambda name: folder / "processes" / name)
        self._open()

    def log(self, frame: bytes) -> None:
        """Append a frame of a vehicle, with the present time."""
        if not self._ended:
            try:
                self._log.write(frame, time.time_ns() // 1000)
            except OSError as problem:
                self._end(problem)

    def collect(self, now: float) -> None:
        """Record what the processes have written since the last call; call it often.

        Args:
            now: A time [s].
        """
        try:
            self._collector.pass_on_without_stragglers(self._add)
            self._limit(now)
        except OSError as problem:
            self._end(problem)

    def _add(self, steps: Steps) -> None:
        if not self._ended:
            step_us = self._scenario.step_us
            self._events.add(events_of(steps.signals, steps.first, self._ids, step_us))
            self._trajectory.add(steps)

    def _limit(self, now: float) -> None:
        """Begin again if the files are as large as they may be."""
        if self._ended or now < self._check_due_s:
            return
        self._check_due_s = now + _CHECK_S
        if sum((self._folder / name).stat().st_size for name in _FILES) < self._limit_bytes:
            return
        self._close()
        previous = self._folder / PREVIOUS
        previous.mkdir(exist_ok=True)
        for name in _FILES:
            (self._folder / name).replace(previous / name)
        self._open()

    def close(self) -> None:
        """Complete the files with what is left; no process writes any more."""
        try:
            self._collector.pass_on(self._add, over=True)
            self._collector.remove()
            if not self._ended:
                self._close()
        except OSError as problem:
            self._end(problem)

    def _open(self) -> None:
        self._log = TlogWriter(self._folder / LOG)
        self._events, self._trajectory = streams_of(self._scenario, self._folder, Record.LIGHT)

    def _close(self) -> None:
        for file in (self._log, self._events, self._trajectory):
            file.close()

    def _end(self, problem: OSError) -> None:
        if self._ended:
            return
        self._ended = True
        for file in (self._log, self._events, self._trajectory):
            with contextlib.suppress(OSError):
                file.close()
        self._on_message(
            f"recording ended: cannot write {problem.filename}: {problem.strerror}; "
            "the fleet flies on"
        )
