"""Values as the reports print them; what is unknown is a dash."""

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gcs.lab.campaigns.statistics import Estimate


def percent(share: float | None) -> str:
    """Format a share, as in "86.67 %"."""
    return "-" if share is None else f"{100.0 * share:.2f} %"


def milliseconds(time_s: float | None) -> str:
    """Format a time in seconds, as in "12 ms"."""
    return "-" if time_s is None else f"{1e3 * time_s:g} ms"


def probability(value: float) -> str:
    """Format a probability, as in "86.7 %"; a dash if it is unknown."""
    return "-" if math.isnan(value) else f"{100.0 * value:.1f} %"


def number(value: float) -> str:
    """Format a figure with four digits; a dash if it is unknown or unbounded."""
    if not math.isfinite(value):
        return "-"
    return f"{value:.4g}" if abs(value) < 1e4 else f"{value:.0f}"


def p_value(value: float) -> str:
    """Format a p-value."""
    return "< 0.0001" if value < 1e-4 else f"{value:.4f}" if value < 0.1 else f"{value:.2f}"


def interval(estimate: "Estimate", of: str = "number") -> str:
    """Format an estimate with its interval, of a figure or of a probability."""
    show = probability if of == "probability" else number
    if not math.isfinite(estimate.value):
        return "-"
    return f"{show(estimate.value)} [{show(estimate.low)}, {show(estimate.high)}]"
