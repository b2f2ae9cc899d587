"""The path that the mission of a scenario asks for, as figures of a flight need it."""

import numpy as np

from gcs.scenario.model import Scenario

__all__ = ["leaders_of", "paths_of"]


def paths_of(scenario: Scenario) -> np.ndarray | None:
    """Return the path of each UAV, shape (n,), dtype `PATH`; None without a mission."""
    return None


def leaders_of(scenario: Scenario) -> tuple[int, ...]:
    """Return the indices of the UAVs that slots count from; none without a formation."""
    return ()
