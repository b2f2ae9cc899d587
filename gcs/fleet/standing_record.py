"""What `gcs up` records of its fleet: a telemetry log and a light recording, the newest of both."""

import contextlib
import time
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path

from gcs.fleet.collector import Collector, Gap
from gcs.fleet.observer import Observer
from gcs.results.choices import Record
from gcs.results.recorder import streams_of
from gcs.results.recording import Steps, events_of
from gcs.results.store import EVENTS, TRAJECTORY
from gcs.scenario.model import Scenario
from mavlink_defs.capture.tlog import TlogWriter
from mavlink_defs.runtime.spool import unwritten

LOG, PREVIOUS = "flight.tlog", "previous"
LIMIT_BYTES = 128_000_000
"""Size of log and recording together at which they begin again; the ones before are kept, too."""
_FILES = (LOG, TRAJECTORY, EVENTS)
_CHECK_S = 1.0
_COLLECT_S = 0.1
_MAX_FRAMES = 200_000  # that wait to be written, of 280 bytes at most


class StandingRecord:
    """Log and recording of a flight without an end, in two generations of bounded size.

    When the files have reached their limit they move to the folder `previous`, in place of those
    before them. Whatever fails here ends the recording, not the flight. One thread may log, and
    another one collect.
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
        self._frames: deque[tuple[int, bytes]] = deque()
        self._frames_lost = 0
        self._gaps: dict[str, Gap] = {}  # as reported
        self._check_due_s = 0.0
        self._collector = Collector(scenario, lambda name: folder / "processes" / name)
        self._open()

    def log(self, frame: bytes) -> None:
        """Note a frame of a vehicle, with the present time; `collect` writes it."""
        if len(self._frames) < _MAX_FRAMES:
            self._frames.append((time.time_ns() // 1000, frame))
        else:
            self._frames_lost += 1

    def watch(self, observer: Observer) -> None:
        """Collect until it is over, and close."""
        while observer.goes_on(_COLLECT_S):
            self.collect(time.monotonic())
        self.close()

    def collect(self, now: float) -> None:
        """Record what vehicles and processes have written since the last call; call it often.

        Args:
            now: A time [s].
        """
        with self._ending_if_it_fails():
            self._write_frames()
            if self._ended:
                self._collector.discard()
            else:
                self._collector.pass_on_without_stragglers(self._add)
                self._tell_gaps()
                self._limit(now)

    def _add(self, steps: Steps) -> None:
        step_us = self._scenario.step_us
        self._events.add(events_of(steps.signals, steps.first, self._ids, step_us))
        self._trajectory.add(steps)

    def _write_frames(self) -> None:
        while self._frames:
            at_us, frame = self._frames.popleft()
            if not self._ended:
                self._log.write(frame, at_us)

    def _tell_gaps(self, over: bool = False) -> None:
        """Tell what is missing of each process: at the first time, and in all when it is over."""
        for name, gap in self._collector.gaps.items():
            reported = self._gaps.get(name)
            if reported is None or (over and reported != gap):
                self._gaps[name] = gap
                first_s, last_s = (k * self._scenario.step_us / 1e6 for k in (gap.first, gap.last))
                self._on_message(
                    f"recording: {gap.rows} rows of {name} are missing, which came too late, "
                    f"from {first_s:.3f} to {last_s:.3f} s"
                )

    def _limit(self, now: float) -> None:
        """Begin again if the files are as large as they may be."""
        if now < self._check_due_s:
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
        with self._ending_if_it_fails():
            self._write_frames()
            if not self._ended:
                self._collector.pass_on(self._add, over=True)
                self._tell_gaps(over=True)
                self._close()
            if self._frames_lost:
                self._on_message(f"recording: {self._frames_lost} frames are missing in {LOG}")
        self._collector.remove()

    def _open(self) -> None:
        self._log = TlogWriter(self._folder / LOG)
        self._events, self._trajectory = streams_of(self._scenario, self._folder, Record.LIGHT)

    def _close(self) -> None:
        for file in (self._log, self._events, self._trajectory):
            file.close()

    @contextlib.contextmanager
    def _ending_if_it_fails(self) -> Iterator[None]:
        try:
            yield
        except Exception as problem:
            if self._ended:
                return
            self._ended = True
            for file in (self._log, self._events, self._trajectory):
                with contextlib.suppress(Exception):
                    file.close()
            self._on_message(f"recording ended: {unwritten(problem)}; the fleet flies on")
