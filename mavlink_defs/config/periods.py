"""Which delays and rates a control period allows: whole numbers of it."""

from collections.abc import Iterator
from typing import TypeAlias

from mavlink_defs.config.models import Loc

Found: TypeAlias = Iterator[tuple[Loc, str]]
"""Place and text of each problem."""


_NEAR = 0.01
"""Share by which a rate may differ from the nearest one that there is."""


def rate_problems(loc: Loc, rate_hz: float | None, step_us: int) -> Found:
    """Yield place and text if no whole number of control periods [µs] makes nearly that rate."""
    if rate_hz is None:
        return
    periods = 1e6 / (rate_hz * step_us)
    if abs(periods / max(round(periods), 1) - 1.0) > _NEAR:
        fewer = max(int(periods), 1)
        near = " or ".join(f"{1e6 / (n * step_us):.6g}" for n in (fewer, fewer + 1))
        text = f"expected a sample every 1, 2, 3, ... control periods of {step_us} us, such as"
        yield loc, f"{text} {near} Hz, got {rate_hz!r}"


def period_problems(loc: Loc, delay_s: float, step_us: int) -> Found:
    """Yield place and text if a time [s] is no whole number of control periods [µs]."""
    if not _is_whole(delay_s * 1e6 / step_us):
        text = f"expected a whole number of control periods of {step_us} us, got {delay_s!r} s"
        yield loc, text


def _is_whole(number: float) -> bool:
    return abs(number - round(number)) < 1e-6
