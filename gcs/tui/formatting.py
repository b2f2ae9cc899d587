"""Numbers and states as text on the screen."""

import math
from collections.abc import Iterable, Sequence
from datetime import datetime
from typing import TypeAlias

from gcs.station.notifications import ERROR, NOTICE, WARNING

Cell: TypeAlias = tuple[str, str]
"""A text and its role: "", "good", "warn", "bad", "muted", "strong" or "accent"."""

_BARS = " ▁▂▃▄▅▆▇█"  # by eighths of a line


def number(value: float | None, digits: int = 1) -> str:
    """A number with a fixed number of digits; "–" for none or NaN."""
    if value is None or math.isnan(value):
        return "–"
    text = f"{value:.{digits}f}"
    return text if text.strip("-0.") else text.removeprefix("-")  # no "-0.0"


def count(value: int) -> str:
    """A whole number, thousands set apart: "24 800"."""
    return f"{value:,}".replace(",", " ")


def percent(share: float | None, digits: int = 1) -> str:
    """A share as per cent."""
    return "–" if share is None else f"{100.0 * share:.{digits}f} %"


def seconds(time_s: float | None) -> str:
    """A time: "12.3", or "1:02:05" from ten minutes on."""
    if time_s is None:
        return "–"
    if time_s < 600.0:
        return f"{time_s:.1f}"
    minutes, rest = divmod(int(time_s), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"


def clock(at: float) -> str:
    """Time of day of a time since 1970 [s]."""
    return datetime.fromtimestamp(at).strftime("%H:%M:%S")


def ids(systems: Iterable[int]) -> str:
    """System ids as a text: "UAV 1, 3"."""
    return "UAV " + ", ".join(map(str, sorted(systems)))


def role_of(severity: int) -> str:
    """Role of a text of this MAV_SEVERITY."""
    if severity <= ERROR:
        return "bad"
    if severity <= WARNING:
        return "warn"
    return "strong" if severity <= NOTICE else ""


def sparkline(values: Sequence[float], width: int) -> str:
    """The last `width` values as bars, the largest as high as a line; blank before the first."""
    shown = list(values)[-width:] if width > 0 else []
    first = next((i for i, value in enumerate(shown) if value > 0.0), len(shown))
    top = max(shown, default=0.0)
    bars = [_BARS[max(1, round(value / top * 8))] for value in shown[first:]]
    return "".join(bars).rjust(width)
