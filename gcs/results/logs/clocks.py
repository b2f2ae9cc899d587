"""Clocks of logs: where they jump, and how far one is from another."""

from collections.abc import Iterable
from datetime import UTC, datetime
from itertools import pairwise

import numpy as np

_BACK_S = 1.0
"""A clock that goes back by less is of messages that were stored out of order [s]."""
_AHEAD_S = 3600.0
"""One that jumps ahead by more was set, as by the first GNSS fix, or is of another flight [s]."""
_SLOW_S = 1.0
"""By which slow messages may begin earlier, or end later, than the fastest [s]."""


def longest_stretch(time_s: np.ndarray) -> tuple[slice, list[str]]:
    """Return where a clock runs without a jump for the longest time.

    Args:
        time_s: Times as they were stored, finite, shape (n,), at least one [s].

    Returns:
        The place of that stretch, and a remark for people if there is a jump.
    """
    step = np.diff(time_s)
    jumps = np.flatnonzero((step < -_BACK_S) | (step > _AHEAD_S)) + 1
    if not len(jumps):
        return slice(0, len(time_s)), []
    edges = [0, *jumps.tolist(), len(time_s)]
    spans = [time_s[b - 1] - time_s[a] for a, b in pairwise(edges)]
    longest = int(np.argmax(spans))
    chosen = slice(edges[longest], edges[longest + 1])
    first = int(jumps[0])
    more = f", and {len(jumps) - 1} times more" if len(jumps) > 1 else ""
    left_out = len(time_s) - (chosen.stop - chosen.start)
    return chosen, [
        f"the clock jumps by {step[first - 1]:+.6g} s after {time_s[first - 1] - time_s[0]:.6g} s"
        f"{more}: only the longest stretch, of {spans[longest]:.6g} s, is read, {left_out} of "
        f"{len(time_s)} rows are left out"
    ]


def longest_span(times: Iterable[np.ndarray]) -> tuple[float, float, list[str]]:
    """Return begin and end of what is read of a log [s], and a remark if its clock jumps.

    Args:
        times: Of each kind of messages, as they were stored, finite, shapes (n,) [s].

    Returns:
        From the first to the last message of the longest stretch of the fastest kind, with what
        others have beside it; 0 and 0 of none.
    """
    kinds = list(times)
    fastest = max(kinds, key=len, default=np.empty(0))
    if not len(fastest):
        return 0.0, 0.0, []
    stretch, jumps = longest_stretch(fastest)
    low, high = fastest[stretch].min() - _SLOW_S, fastest[stretch].max() + _SLOW_S
    stored = np.concatenate(kinds)
    near = stored[(stored >= low) & (stored <= high)]
    return float(near.min()), float(near.max()), jumps


def utc(since_1970_s: float) -> datetime | None:
    """Return a date; None of a time that is none, as of a damaged log."""
    try:
        return datetime.fromtimestamp(since_1970_s, UTC)
    except (OverflowError, ValueError, OSError):
        return None
