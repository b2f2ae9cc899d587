"""The figures of a flight, drawn by a process of their own while its tables are read."""

import contextlib
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from gcs.fleet.forked import FORKS, leave_server
from gcs.fleet.local_workers import LocalWorkers
from gcs.scenario.model import Scenario

if TYPE_CHECKING:
    from gcs.reports.figures.overview import Gaps
    from gcs.results.recording import Recording


class _Flown(NamedTuple):
    recording: "Recording"
    gaps: "Gaps"


class FlightDrawing:
    """A process that loads matplotlib while a flight begins, and draws it when it is over.

    Where processes cannot be forked, and if this one was killed, the figures are drawn here.
    """

    def __init__(self, scenario: Scenario, folder: Path) -> None:
        """Start it; arguments as of `_draw`."""
        self._draw = partial(_draw, scenario, folder)
        self._shown: _Flown | None = None
        self._process: LocalWorkers[_Flown | None, bool] | None = None
        if FORKS:
            self._process = LocalWorkers(1, self._draw, forked=True)
            self._process.submit(None)

    def begin(self, recording: "Recording", gaps: "Gaps") -> None:
        """Begin to draw a flight; arguments as of `gcs.reports.figures.overview.draw_flight`."""
        self._shown = _Flown(recording, gaps)
        if self._is_done():
            assert self._process is not None
            self._process.submit(self._shown)

    def finish(self) -> None:
        """Wait until all figures are there.

        Raises:
            OSError: One cannot be written; it is named.
        """
        if not self._is_done():
            self._draw(self._shown)

    def close(self) -> None:
        """End the process, whatever it draws; nothing is left of an unfinished figure."""
        if self._process is not None:
            self._process.close()

    def _is_done(self) -> bool:
        """Wait for the process; return whether it has done its task."""
        if self._process is None:
            return False
        _, done = self._process.wait()
        if done is None:
            self._process = None
        return done is not None


@contextlib.contextmanager
def drawn(scenario: Scenario, folder: Path) -> Iterator[FlightDrawing]:
    """Draw the figures of a flight, see `FlightDrawing`, which ends with the context."""
    with contextlib.closing(FlightDrawing(scenario, folder)) as drawing:
        yield drawing


def _draw(scenario: Scenario, folder: Path, shown: _Flown | None, _worker: str = "") -> bool:
    """Draw the figures of a flight into its run folder; None: load what that takes."""
    from gcs.reports.figures.mission import draw_mission
    from gcs.reports.figures.overview import draw_flight
    from gcs.reports.figures.style import load_matplotlib
    from gcs.results.mission_paths import leaders_of, paths_of

    if shown is None:
        leave_server()
        load_matplotlib()
        return True
    draw_flight(shown.recording, scenario, shown.gaps, folder)
    if (paths := paths_of(scenario)) is not None:
        draw_mission(shown.recording, scenario, paths, leaders_of(scenario), folder)
    return True
