"""When an error leaves its tube, and the change of a command that keeps it in for longest."""

from typing import NamedTuple

import numpy as np

from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import clamp

_NO_INFLUENCE = 1e-9  # of a command on an output


class CommandChange(NamedTuple):
    """A change of one command."""

    change: float
    first: int  # first row that it counts
    leaves: int  # row in which the error leaves its share of the tube; the number of rows: never


@compiled
def first_exit(error: np.ndarray, width: np.ndarray) -> int:
    """Return the first row with |error| > width; their number if there is none."""
    for k in range(len(error)):
        if not abs(error[k]) <= width[k]:
            return k
    return len(error)


@compiled
def best_change(
    error: np.ndarray,
    influence: np.ndarray,
    width: np.ndarray,
    first: int,
    share: float,
    low: float,
    high: float,
) -> CommandChange:
    """Plan the change Δu that keeps |E + S Δu| within a share of the tube for longest.

    The intervals of changes that do so in each row from `first` on are cut with each other until
    nothing is left; the last interval left holds the changes that stay in for longest. Of these it
    takes the one with the least ∑ (E + S Δu)²/D² up to the exit.

    Args:
        error: E under the command in force, shape (rows,).
        influence: S, change of the error by the change of the command, shape (rows,).
        width: D, half the width of the tube, shape (rows,).
        first: First row that counts.
        share: Of the tube that is used.
        low: Least change that the actuator's stops allow.
        high: Largest one.
    """
    rows = len(error)
    leaves = rows
    for k in range(first, rows):
        if abs(influence[k]) < _NO_INFLUENCE:
            continue
        one = (-share * width[k] - error[k]) / influence[k]
        other = (share * width[k] - error[k]) / influence[k]
        if min(one, other) > high or max(one, other) < low:
            low = high = high if min(one, other) > high else low
            leaves = k
            break
        low, high = max(low, min(one, other)), min(high, max(one, other))
    along, squared = 0.0, 0.0
    for k in range(first, min(leaves + 1, rows)):
        weight = 1.0 / (width[k] * width[k])
        along -= weight * influence[k] * error[k]
        squared += weight * influence[k] * influence[k]
    change = along / squared if squared > 0.0 else 0.0
    return CommandChange(clamp(change, low, high), first, leaves)
