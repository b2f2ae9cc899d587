"""Tracked quantities and actuator channels as reports name, order, measure and print them."""

import numpy as np

PAPER_ORDER = ("throttle", "aileron", "elevator", "rudder")
"""Actuator channels in the order of the paper's tables."""
QUANTITIES = ("airspeed", "roll", "pitch", "yaw")
"""Tracked quantities, in the order of the columns of commands, references and errors."""
UNITS = {"airspeed": "m/s", "roll": "deg", "pitch": "deg", "yaw": "deg"}
"""Unit of each quantity in reports."""
TRACKED_KEYS = ("airspeed_m_s", "roll_deg", "pitch_deg", "yaw_deg")
"""The quantities as keys and columns of files, with their units."""
IAE_UNITS = {"airspeed": "m", "roll": "deg s", "pitch": "deg s", "yaw": "deg s"}
"""Unit of the integral of each quantity's absolute error."""


def in_degrees(values: np.ndarray) -> np.ndarray:
    """Return airspeed [m/s] and three angles, shape (..., 4), with angles from rad to deg."""
    return np.concatenate([values[..., :1], np.degrees(values[..., 1:])], axis=-1)


def integrated_error(error: np.ndarray, step_us: int) -> np.ndarray:
    """Integrate the absolute error (IAE) over the steps that have one.

    Args:
        error: Of airspeed and angles [m/s, rad], shape (steps, 4); NaN in steps without one.
        step_us: Control period [µs].

    Returns:
        The integrals [m, rad s], shape (4,); NaN if no step has an error.
    """
    known = np.abs(error[np.isfinite(error).all(axis=1)])
    if not len(known):
        return np.full(len(QUANTITIES), np.nan)
    return np.asarray(known.sum(axis=0) * step_us / 1e6)


PATH_FIGURES = (
    "straight_cross_track_m",
    "turn_cross_track_m",
    "height_max_m",
    "height_rms_m",
    "slot_max_m",
    "slot_rms_m",
)
"""Figures of a UAV on a path: attributes of `gcs.results.path_following.PathSummary`."""


def percent(share: float | None) -> str:
    """Format a share, as in "86.67 %"."""
    return "-" if share is None else f"{100.0 * share:.2f} %"


def milliseconds(time_s: float | None) -> str:
    """Format a time in seconds, as in "12 ms"."""
    return "-" if time_s is None else f"{1e3 * time_s:g} ms"
