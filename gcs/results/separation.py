"""The least distance between the UAVs of a flight, from their true positions."""

import math
from dataclasses import dataclass

import numpy as np

from mavlink_defs.runtime.jit import compiled


@dataclass(frozen=True)
class SeparationSummary:
    """The least distance between two UAVs in a flight.

    Attributes:
        least_m: Between their centres of mass [m].
        time_s: When it was first reached [s].
        uavs: System ids of the two.
    """

    least_m: float
    time_s: float
    uavs: tuple[int, int]


class Separation:
    """The least distance of a flight, found while it is flown."""

    def __init__(self, uav_ids: tuple[int, ...], step_us: int) -> None:
        self._ids, self._step_us = uav_ids, step_us
        self._least_m, self._step, self._pair = math.inf, 0, (0, 0)

    def add(self, first: int, states: np.ndarray) -> None:
        """Take the next steps; see `gcs.results.recording.Steps`."""
        distances, pairs = least_distances(states)
        if len(distances) and distances.min() < self._least_m:
            k = int(distances.argmin())
            self._least_m, self._step = float(distances[k]), first + k
            self._pair = (int(pairs[k, 0]), int(pairs[k, 1]))

    def summary(self) -> SeparationSummary | None:
        """Return what was found; None for less than two UAVs, or before the first step."""
        if not math.isfinite(self._least_m):
            return None
        a, b = (self._ids[i] for i in self._pair)
        return SeparationSummary(self._least_m, self._step * self._step_us / 1e6, (a, b))


@compiled
def least_distances(states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the least distance between two UAVs at each step, and which two these are.

    Args:
        states: Shape (steps, n, 12), north, east, down first [m].

    Returns:
        Distances [m], shape (steps,), infinite where no two positions are finite; indices of the
        two UAVs, shape (steps, 2).
    """
    steps, n = states.shape[0], states.shape[1]
    least = np.full(steps, np.inf)
    pairs = np.zeros((steps, 2), np.int64)
    for k in range(steps):
        nearest = np.inf
        for i in range(n):
            for j in range(i + 1, n):
                d_north = states[k, i, 0] - states[k, j, 0]
                d_east = states[k, i, 1] - states[k, j, 1]
                d_down = states[k, i, 2] - states[k, j, 2]
                square = d_north * d_north + d_east * d_east + d_down * d_down
                if square < nearest:
                    nearest = square
                    pairs[k, 0], pairs[k, 1] = i, j
        least[k] = math.sqrt(nearest)
    return least, pairs
