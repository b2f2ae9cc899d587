"""Where a flight moves its surfaces: what is identified from, in windows side by side."""

from dataclasses import dataclass

import numpy as np

from ftc_lab.identification.log_signals import LogSignals
from gcs.console.errors import BadInput

SURFACE_TRACKS = {"da": "aileron", "de": "elevator", "dr": "rudder"}
_LEAST_DEG = 0.2  # from end to end in a window: less is a servo's play
_SPANS = 16.0  # of travel in a window: rates have forgotten how they began within a few
_LEAST_STEPS = 8  # in a window
_LEAST_WINDOWS, _MOST_WINDOWS = 8, 320
_MOST_GROUPS = 40


@dataclass(frozen=True)
class LogSegment:
    """A stretch of flight in which surfaces move.

    Attributes:
        begin_s: When it begins.
        end_s: When it ends.
        moved_deg: Standard deviation of aileron, elevator and rudder [deg].
    """

    begin_s: float
    end_s: float
    moved_deg: tuple[float, float, float]


@dataclass(frozen=True)
class LogWindows:
    """Windows of equal length, none with a gap in it.

    Attributes:
        steps: The steps of each window, shape (m, n).
        group: Of each window, shape (m,): errors of one group are not independent.
    """

    steps: np.ndarray
    group: np.ndarray

    def parts(self, count: int) -> "LogWindows":
        """Return shorter windows, about so many of each."""
        each = max(round(self.steps.shape[1] / count), min(_LEAST_STEPS, self.steps.shape[1]))
        count = self.steps.shape[1] // each
        steps = self.steps[:, : count * each].reshape(-1, each)
        return LogWindows(steps, np.repeat(self.group, count))

    def halves(self) -> tuple["LogWindows", "LogWindows"]:
        """Return the earlier and the later windows, each with groups of its own."""
        middle = len(self.steps) // 2
        return _grouped(self.steps[:middle]), _grouped(self.steps[middle:])


def windows_of_log(signals: LogSignals) -> LogWindows:
    """Return the windows in which a surface moves; of many, those in which they move most.

    Raises:
        BadInput: There are too few.
    """
    if not signals.good.any():
        text = "the log has no flight in which all that is needed is there"
        raise BadInput(text, "`gcs log FILE --list` shows gaps, and channels")
    length_s = _SPANS * signals.record["b"] / np.median(signals.airspeed[signals.good])
    n = max(round(float(length_s) / signals.step_s), _LEAST_STEPS)
    bad = np.concatenate([[0], np.cumsum(~signals.good)])
    starts, at = [], 0
    while at + n <= len(signals.good):
        if bad[at + n] == bad[at]:
            starts.append(at)
            at += n
        else:
            at += 1
    steps = np.array(starts, int)[:, None] + np.arange(n)
    moved = np.degrees([np.ptp(signals.mean(name, steps), axis=1) for name in SURFACE_TRACKS])
    chosen = np.flatnonzero((moved >= _LEAST_DEG).any(axis=0)) if len(steps) else np.empty(0, int)
    if len(chosen) < _LEAST_WINDOWS:
        had, needed = (count * n * signals.step_s for count in (len(chosen), _LEAST_WINDOWS))
        text = f"only {had:.3g} s of flight have a surface that moves by {_LEAST_DEG:g} deg or more"
        raise BadInput(f"{text}, expected {needed:.3g} s", "fly longer, and move the controls")
    much = (moved / np.maximum(moved.mean(axis=1, keepdims=True), _LEAST_DEG)).sum(axis=0)[chosen]
    return _grouped(steps[np.sort(chosen[np.argsort(-much, kind="stable")[:_MOST_WINDOWS]])])


def _grouped(steps: np.ndarray) -> LogWindows:
    each = -(-len(steps) // _MOST_GROUPS)
    return LogWindows(steps, np.arange(len(steps)) // each)


def segments_of(signals: LogSignals, windows: LogWindows) -> list[LogSegment]:
    """Return the stretches that windows make."""
    steps = windows.steps
    cuts = np.flatnonzero(np.diff(steps[:, 0]) > 2 * steps.shape[1]) + 1
    found = []
    for part in np.split(steps, cuts):
        inside = np.arange(part[0, 0], part[-1, -1] + 1)
        da, de, dr = (
            float(np.degrees(np.std(signals.mean(name, inside)))) for name in SURFACE_TRACKS
        )
        ends = signals.ends_s[[inside[0], inside[-1] + 1]]
        found.append(LogSegment(float(ends[0]), float(ends[1]), (da, de, dr)))
    return found
