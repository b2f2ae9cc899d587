"""Synchronisation errors between the true states: what the formation does, not what it believes."""

import math

import numpy as np

from gcs.scenario.model import Scenario
from mavlink_defs.runtime.jit import compiled


class Synchronisation:
    """Sums of absolute synchronisation errors (31) and (32), taken while a flight is flown.

    Each edge counts as configured, also while a neighbour is not heard.

    Attributes:
        sums: Shape (n, 4), of Ṽ' and e' [m/s, rad].
        counted: Shape (n,), steps at which they are known.
    """

    def __init__(self, scenario: Scenario) -> None:
        ids = [uav.id for uav in scenario.uavs]
        law = scenario.controller
        self._own = np.array([law.lambda1, law.lambda3, law.lambda3, law.lambda3])
        self._others = np.array([law.lambda2, law.lambda4, law.lambda4, law.lambda4])
        self._weights = np.zeros((len(ids), len(ids)))  # 0: no edge
        for i, uav_id in enumerate(ids):
            for neighbour, weight in scenario.neighbours(uav_id):
                self._weights[i, ids.index(neighbour)] = weight
        self.sums = np.zeros((len(ids), 4))
        self.counted = np.zeros(len(ids), np.int64)

    def add(self, errors: np.ndarray) -> None:
        """Add the next steps' errors against each UAV's reference, in the order of the steps.

        Args:
            errors: Of airspeed, roll, pitch, yaw, shape (steps, n, 4) [m/s, rad].
        """
        add_synchronisation(errors, self._weights, self._own, self._others, self.sums, self.counted)


@compiled
def add_synchronisation(
    errors: np.ndarray,
    weights: np.ndarray,
    own: np.ndarray,
    others: np.ndarray,
    sums: np.ndarray,
    counted: np.ndarray,
) -> None:
    """Add (31) and (32), where no error is missing, from the true errors of all.

    Args:
        errors: Shape (steps, n, 4) [m/s, rad].
        weights: a_ij, shape (n, n); 0 without an edge.
        own: Weights of the own errors, shape (4,).
        others: Weights of the differences from the neighbours' errors, shape (4,).
        sums: Shape (n, 4), updated in place [m/s, rad].
        counted: Shape (n,), updated in place.
    """
    found = np.empty(4)
    for k in range(len(errors)):
        for i in range(len(weights)):
            for c in range(4):
                found[c] = own[c] * errors[k, i, c]
            for j in range(len(weights)):
                if weights[i, j] == 0.0:
                    continue
                for c in range(4):
                    difference = errors[k, i, c] - errors[k, j, c]
                    if c > 0:
                        difference = (difference + math.pi) % (2.0 * math.pi) - math.pi
                    found[c] += others[c] * weights[i, j] * difference
            if np.isfinite(found).all():
                counted[i] += 1
                for c in range(4):
                    sums[i, c] += abs(found[c])
