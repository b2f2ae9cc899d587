"""Edges of a formation's graph, by what neighbours reported."""

import numpy as np

from ftc_autopilot.control.edges import EDGE


def edges_of(reports: np.ndarray, weights: np.ndarray | None = None) -> np.ndarray:
    """Return edges over which these messages are known, by default of weight 1."""
    edges = np.zeros(len(reports), EDGE)
    edges["known"], edges["weight"] = reports, 1.0 if weights is None else weights
    return edges
