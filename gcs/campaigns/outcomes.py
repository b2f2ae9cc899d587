"""Outcomes of flights, and the events that conditions and reports count."""

import numpy as np

__all__ = ["EVENTS", "OUTCOMES", "happened", "severity"]

OUTCOMES = ("completed", "heading_lost", "attitude_lost", "model_left", "crashed", "failed")
"""Outcomes from the best to the worst; a flight has the worst that applies."""

EVENTS = ("success", "failure", *OUTCOMES[1:-1])
"""Events with a probability: flown to the end with attitude and heading kept; anything else; or
an outcome as bad as this or worse, because a worse one hides it."""


def severity(outcome: np.ndarray) -> np.ndarray:
    """Return the place of each outcome in `OUTCOMES`, shape (flights,).

    Raises:
        ValueError: An outcome is unknown.
    """
    names, where = np.unique(outcome, return_inverse=True)
    return np.array([OUTCOMES.index(name) for name in names], dtype=int)[where]


def happened(event: str, outcome: np.ndarray) -> np.ndarray:
    """Return in which flights one of `EVENTS` happened, bool, shape (flights,)."""
    if event == "success":
        return severity(outcome) == 0
    least = 1 if event == "failure" else OUTCOMES.index(event)
    return severity(outcome) >= least
