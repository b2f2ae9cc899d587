"""Values as the reports print them; what is unknown is a dash."""

__all__ = ["milliseconds", "percent"]


def percent(share: float | None) -> str:
    """Format a share, as in "86.67 %"."""
    return "-" if share is None else f"{100.0 * share:.2f} %"


def milliseconds(time_s: float | None) -> str:
    """Format a time in seconds, as in "12 ms"."""
    return "-" if time_s is None else f"{1e3 * time_s:g} ms"
