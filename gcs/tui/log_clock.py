"""The clock that a log is replayed by: simulated time, where the log has it."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gcs.station.telemetry import PRIVATE, ReportedClock
from mavlink_defs.framing.frames import parse
from mavlink_defs.framing.header import FrameHeader


@dataclass(frozen=True)
class LogClock:
    """When each frame of a log was heard, and its position on the clock of the replay.

    Attributes:
        heard_s: Time since 1970 of each frame, ascending [s].
        positions_s: Position of each frame, ascending: simulated time, or time since the first
            frame [s].
        is_simulated: Which of the two.
    """

    heard_s: list[float]
    positions_s: list[float]
    is_simulated: bool

    @property
    def name(self) -> str:
        """The clock, in a word."""
        return "simulated" if self.is_simulated else "log"

    def heard_at(self, position_s: float, after: int) -> float:
        """Return the time since 1970 at a position between frame `after - 1` and the next [s]."""
        before, until = max(after - 1, 0), min(after, len(self.heard_s) - 1)
        ends = self.positions_s[before], self.positions_s[until]
        share = (position_s - ends[0]) / (ends[1] - ends[0]) if ends[1] > ends[0] else 0.0
        heard = self.heard_s[before], self.heard_s[until]
        return heard[0] + min(max(share, 0.0), 1.0) * (heard[1] - heard[0])


def read_clock(frames: Sequence[tuple[int, bytes]]) -> LogClock:
    """Place the frames of a log on the clock of its replay.

    Frames between two with simulated time are placed between them as they were heard; those before
    the first and after the last at its ends. A log without simulated time, or with one that
    went back and stayed back because the fleet was started again, has its own clock.

    Args:
        frames: Time [µs since 1970] and frame of each record, at least one.
    """
    times_us = np.maximum.accumulate([time_us for time_us, _ in frames])
    heard_s = (times_us - times_us[0]) / 1e6
    anchors = _simulated_times(frames, heard_s.tolist())
    positions = heard_s if anchors is None else _between(heard_s, *anchors)
    return LogClock((times_us / 1e6).tolist(), positions.tolist(), anchors is not None)


def _simulated_times(
    frames: Sequence[tuple[int, bytes]], heard_s: Sequence[float]
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the frames with simulated time, and the newest such time at each of them [s]."""
    clocks: dict[int, ReportedClock] = defaultdict(ReportedClock)
    at, newest_s = [], [0.0]
    for k, (_, frame) in enumerate(frames):
        header = FrameHeader.read(frame)
        if header is None or header.message_id not in PRIVATE:
            continue
        time_ms = getattr(parse(frame), "time_boot_ms", None)  # none: not a whole frame
        if time_ms is None:
            continue
        if clocks[header.system].goes_back(time_ms, heard_s[k]):
            return None
        at.append(k)
        newest_s.append(max(time_ms / 1e3, newest_s[-1]))
    return (np.array(at), np.array(newest_s[1:])) if at else None


def _between(heard_s: np.ndarray, at: np.ndarray, times_s: np.ndarray) -> np.ndarray:
    """Return the position of each frame: between its neighbours with simulated time."""
    counts = np.zeros(len(heard_s), int)
    counts[at] = 1
    following = np.cumsum(counts)  # anchors up to each frame, itself included
    before = times_s[np.maximum(following - 1, 0)]
    until = times_s[np.minimum(following - counts, len(times_s) - 1)]
    between: np.ndarray = np.interp(heard_s, heard_s[at], times_s).clip(before, until)
    return between
