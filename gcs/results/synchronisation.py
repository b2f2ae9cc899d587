"""Synchronisation errors between the true states: what the formation does, not what it believes."""

from collections.abc import Sequence

import numpy as np

from gcs.scenario.model import Scenario

__all__ = ["Synchronisation", "synchronisation_errors"]


class Synchronisation:
    """Sums of absolute synchronisation errors (31) and (32), taken while a flight is flown.

    Attributes:
        sums: Shape (n, 4), of Ṽ' and e' [m/s, rad].
        counted: Shape (n,), steps at which they are known.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._ids = tuple(uav.id for uav in scenario.uavs)
        self.sums = np.zeros((len(self._ids), 4))
        self.counted = np.zeros(len(self._ids), np.int64)

    def add(self, errors: np.ndarray) -> None:
        """Add the next steps' errors, shape (steps, n, 4), in the order of the steps."""
        for i in range(len(self._ids)):
            found = synchronisation_errors(errors, i, self._ids, self._scenario)
            known = np.abs(found[np.isfinite(found).all(axis=1)])
            self.counted[i] += len(known)
            self.sums[i] = np.cumsum(np.vstack([self.sums[i], known]), axis=0)[-1]


def synchronisation_errors(
    errors: np.ndarray, i: int, uav_ids: Sequence[int], scenario: Scenario
) -> np.ndarray:
    """Return eqs. (31) and (32) of the i-th UAV from the true errors of all, each edge in force.

    Args:
        errors: Of airspeed, roll, pitch, yaw against each UAV's reference, shape (steps, n, 4)
            [m/s, rad].
        i: Index of the UAV.
        uav_ids: System ids, length n.
        scenario: What was flown.

    Returns:
        Ṽ' and e', shape (steps, 4) [m/s, rad]; NaN where one of the errors is.
    """
    law = scenario.controller
    own = np.array([law.lambda1, law.lambda3, law.lambda3, law.lambda3])
    others = np.array([law.lambda2, law.lambda4, law.lambda4, law.lambda4])
    total: np.ndarray = own * errors[:, i]
    for uav_id, weight in scenario.neighbours(uav_ids[i]):
        difference = errors[:, i] - errors[:, uav_ids.index(uav_id)]
        difference[:, 1:] = np.remainder(difference[:, 1:] + np.pi, 2.0 * np.pi) - np.pi
        total = total + others * weight * difference
    return total
