"""A flight as a table whose columns have times of their own."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from functools import cached_property

import numpy as np

from gcs.console.errors import BadInput
from gcs.results.logs.names import AIRSPEEDS, GNSS_PLACE, PLACE, UNITS, is_held, turn_of
from mavlink_defs.visible import visible

_GAP_STEPS, _GAP_S = 5.0, 0.5
"""A gap is longer than so many of a channel's usual steps, and than this [s]."""
_MOST_TIMES = 10_000_000
"""Rows of a grid: 1000 Hz for some 3 h. More is of a damaged log."""
_SAME_S = 1e-6
"""Times that are closer are one: logs have microseconds [s]."""


@dataclass(frozen=True)
class LogChannel:
    """One quantity of a flight.

    Attributes:
        name: Of `gcs.results.logs.names` if it has such a meaning.
        unit: Of the values; empty for counts, shares and flags.
        time_s: Time of each value from the flight's start, strictly ascending, shape (n,) [s].
        values: Finite numbers, shape (n,).
        source: What the log calls it.
        clock: Whose time it has: "boot", "UTC", "simulated" or "log"; "heard" is the time of
            reception, later than the others by what the link took.
        by_event: Whether a value is stored when it changes only, and holds until the next.
    """

    name: str
    unit: str
    time_s: np.ndarray
    values: np.ndarray
    source: str = ""
    clock: str = "log"
    by_event: bool = False

    @cached_property
    def step_s(self) -> float:
        """The usual time between two values, their median [s]; 0 with fewer than two."""
        return float(np.median(np.diff(self.time_s))) if len(self.time_s) > 1 else 0.0

    @property
    def rate_hz(self) -> float:
        """Values per second, gaps left out."""
        return 1.0 / self.step_s if self.step_s else 0.0

    @property
    def renewed_hz(self) -> float:
        """How often the value changes per second: tables that were merged repeat old ones."""
        if len(self.time_s) < 2:
            return 0.0
        changes = np.count_nonzero(np.diff(self.values))
        return float(changes / (self.time_s[-1] - self.time_s[0]))

    @property
    def gaps(self) -> tuple[tuple[float, float], ...]:
        """Begin and end of each time without values between two of them [s]."""
        after = np.flatnonzero(self._is_gap)
        pairs = zip(self.time_s[after].tolist(), self.time_s[after + 1].tolist(), strict=True)
        return tuple(pairs)

    @property
    def _is_gap(self) -> np.ndarray:
        long = np.diff(self.time_s) > max(_GAP_STEPS * self.step_s, _GAP_S)
        return np.asarray(long & (not self.by_event))

    def at(self, time_s: np.ndarray) -> np.ndarray:
        """Return the values at other times.

        Commands and flags hold until the next; all others go straight, angles by the short way.

        Args:
            time_s: The times [s], any shape.

        Returns:
            The same shape; NaN before the first value, after the last, and inside gaps.
        """
        last = np.searchsorted(self.time_s, time_s + _SAME_S, side="right") - 1
        known = (last >= 0) & ((time_s <= self.time_s[-1] + _SAME_S) | self.by_event)
        last = np.clip(last, 0, None)
        following = np.minimum(last + 1, len(self.time_s) - 1)
        known &= ~(np.append(self._is_gap, False)[last] & (time_s > self.time_s[last] + _SAME_S))
        found = self.values[last]
        if not is_held(self.name):
            step = self.time_s[following] - self.time_s[last]
            since = np.maximum(time_s - self.time_s[last], 0.0)
            share = np.divide(since, step, out=np.zeros(np.shape(time_s)), where=step > 0.0)
            change = self.values[following] - found
            if (turn := turn_of(self.name)) is not None:
                change = wrapped(change, turn)
            found = found + share * change
            if turn is not None:
                found = wrapped(found, turn)
        return np.where(known, found, np.nan)


def wrapped(angle: np.ndarray, turn: float) -> np.ndarray:
    """Return angles in [-turn/2, turn/2)."""
    return np.asarray((angle + turn / 2.0) % turn - turn / 2.0)


@dataclass(frozen=True)
class LogText:
    """A text of a log.

    Attributes:
        time_s: When [s].
        severity: As MAV_SEVERITY: 0 emergency to 7 debugging.
        text: What it says.
    """

    time_s: float
    severity: int
    text: str


@dataclass(frozen=True)
class FlightTable:
    """What a log has of one flight.

    Attributes:
        title: What was read.
        kind: Of the file: "tlog", "bin", "ulg", "csv", "parquet", "mat", or "recording", ours.
        channels: By name.
        modes: Time and name of each mode that was entered.
        texts: In the order of time.
        parameters: Of the autopilot, by name.
        started: When time was 0, in UTC; None if the log does not say.
        remarks: What is missing, was left out or is doubtful, each a line.
    """

    title: str
    kind: str
    channels: Mapping[str, LogChannel]
    modes: Sequence[tuple[float, str]] = ()
    texts: Sequence[LogText] = ()
    parameters: Mapping[str, float] = field(default_factory=dict)
    started: datetime | None = None
    remarks: Sequence[str] = ()

    @cached_property
    def begin_s(self) -> float:
        """The first time of any channel [s]: 0 unless time is simulated."""
        return min(float(one.time_s[0]) for one in self.channels.values())

    @cached_property
    def end_s(self) -> float:
        """The last time of any channel [s]."""
        return max(float(one.time_s[-1]) for one in self.channels.values())

    @property
    def duration_s(self) -> float:
        """From the first value to the last [s]."""
        return self.end_s - self.begin_s

    @property
    def airspeed(self) -> LogChannel | None:
        """True airspeed, else what the pitot tube shows, else None."""
        return next((self.channels[name] for name in AIRSPEEDS if name in self.channels), None)

    def __contains__(self, name: str) -> bool:
        return name in self.channels

    def __getitem__(self, name: str) -> LogChannel:
        """Return a channel.

        Raises:
            BadInput: The log does not have it.
        """
        if name not in self.channels:
            raise BadInput(f"{self.title} has no {name}", f"it has {', '.join(self.channels)}")
        return self.channels[name]

    def has(self, names: Iterable[str]) -> bool:
        """Return whether it has all of some channels."""
        return all(name in self.channels for name in names)

    def grid(self, rate_hz: float | None = None, names: Iterable[str] | None = None) -> np.ndarray:
        """Return even times over the flight [s].

        Args:
            rate_hz: How many in a second; None: as many as the fastest channel has.
            names: Channels that count, and over whose common time the grid is; None: all, and over
                the whole flight.

        Raises:
            BadInput: The log has no such channel, they have no common time, or it is too long.
        """
        chosen = list(self.channels.values()) if names is None else [self[name] for name in names]
        rate = rate_hz or max(one.rate_hz for one in chosen)
        begin, end = self.begin_s, self.end_s
        if names is not None:
            begin = max(float(one.time_s[0]) for one in chosen)
            end = min(float(one.time_s[-1]) for one in chosen)
        if rate <= 0.0 or end <= begin:
            listed = ", ".join(one.name for one in chosen[:5])
            raise BadInput(f"{self.title}: {listed} have no time in common")
        step = max(round(1.0 / rate / _SAME_S), 1) * _SAME_S
        count = int((end - begin + _SAME_S) / step) + 1
        if count > _MOST_TIMES:
            text = f"{self.title} has {end - begin:.6g} s at {1.0 / step:.6g} Hz: {count:.3g} rows"
            raise BadInput(f"{text}, expected {_MOST_TIMES:.0e} at most", "npz has it as it is")
        return np.asarray(begin + np.arange(count) * step)

    def on(self, time_s: np.ndarray, names: Iterable[str]) -> dict[str, np.ndarray]:
        """Return channels at common times, as `LogChannel.at`; BadInput if one is not there."""
        return {name: self[name].at(time_s) for name in names}


def channel(
    name: str,
    time_s: np.ndarray,
    values: np.ndarray,
    source: str = "",
    clock: str = "log",
    unit: str | None = None,
) -> LogChannel | None:
    """Make a channel of what a log has: in order, without NaN and repeated times.

    Args:
        name: Its name.
        time_s: Times in any order, shape (n,) [s].
        values: Numbers, shape (n,).
        source: What the log calls it.
        clock: As of `LogChannel`.
        unit: Of one without a name of ours.

    Returns:
        The channel; None if no value is left.
    """
    values = np.asarray(values, float)
    known = np.isfinite(values) & np.isfinite(time_s)
    if not known.any():
        return None
    time_s, values = time_s[known], values[known]
    if (np.diff(time_s) <= 0.0).any():
        order = np.argsort(time_s, kind="stable")
        time_s, values = time_s[order], values[order]
        last = np.append(np.diff(time_s) > 0.0, True)  # of equal times the later value
        time_s, values = time_s[last], values[last]
    if (turn := turn_of(name)) is not None and np.abs(values).max() > turn / 2.0:
        values = wrapped(values, turn)
    return LogChannel(name, UNITS.get(name, unit or ""), time_s, values, visible(source), clock)


def by_name(channels: Iterable[LogChannel | None]) -> dict[str, LogChannel]:
    """Return channels by name: the first of those with one name, in the order of their names.

    A place at 0° north, 0° east is none: so says a receiver that has no fix yet.
    """
    found: dict[str, LogChannel] = {}
    for one in channels:
        if one is not None:
            found.setdefault(one.name, one)
    for names in (PLACE, GNSS_PLACE):
        found |= _with_fix([found[name] for name in names if name in found])
    order = {name: place for place, name in enumerate(UNITS)}
    return dict(sorted(found.items(), key=lambda item: order.get(item[0], len(order))))


def _with_fix(place: list[LogChannel]) -> dict[str, LogChannel]:
    """Return latitude, longitude and altitude without the values before a fix."""
    if len({len(one.values) for one in place}) != 1 or len(place) < 2:
        return {}
    fixed = (place[0].values != 0.0) | (place[1].values != 0.0)
    if fixed.all() or not fixed.any():
        return {}
    return {
        one.name: replace(one, time_s=one.time_s[fixed], values=one.values[fixed]) for one in place
    }
