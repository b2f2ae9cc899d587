"""Events that conditions and reports count, in terms of the outcomes of flights."""

import numpy as np

from gcs.lab.campaigns.store import OUTCOMES

EVENTS = ("success", "failure", *OUTCOMES[1 : OUTCOMES.index("failed")])
"""Events with a probability: flown to the end with attitude and heading kept; anything else; or
an outcome as bad as this or worse, because a worse one hides it."""


def severity(outcome: np.ndarray) -> np.ndarray:
    """Return the place of each outcome in `OUTCOMES`, 0 the best, shape (flights,).

    Raises:
        ValueError: An outcome is unknown.
    """
    names, where = np.unique(outcome, return_inverse=True)
    if unknown := set(names) - set(OUTCOMES):
        raise ValueError(f"no outcome of a flight: {', '.join(sorted(unknown))}")
    return np.array([OUTCOMES.index(name) for name in names], dtype=int)[where]


def happened(event: str, outcome: np.ndarray) -> np.ndarray:
    """Return in which flights one of `EVENTS` happened, bool, shape (flights,)."""
    place = severity(outcome)
    if event == "success":
        return np.asarray(place == 0)
    return np.asarray(place >= (1 if event == "failure" else OUTCOMES.index(event)))


def in_words(event: str) -> str:
    """Return what one of `EVENTS` counts: "success", "attitude_lost or worse"."""
    return event if event in {"success", "failure"} else f"{event} or worse"
