"""Whether a GNSS receiver, and the barometer, agree with the velocity that the receiver reports.

A receiver measures its velocity by itself, from the shift of the carrier: a place that jumps, or
drifts away, moves and its velocity does not. So does the altitude of a leaking static port. What
each moved beyond the velocity is summed: neither the filter nor its covariance has a part in it.
Between two fixes the IMU says how the velocity went. The sum fades with a time constant; of what is
excluded it stays, so that what returns to where it was is known again, and what stays away without
moving on is believed after a while.
"""

import math

import numpy as np

from ftc_autopilot.estimation.state import TRAVEL
from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import Vec3

RECEIVER = np.dtype(
    [
        ("since", "i8"),  # fixes that were compared; 0: the next one is the first
        ("position", "f8", (3,)),  # of the last fix, NED [m]
        ("velocity", "f8", (3,)),
        ("travel", "f8", (TRAVEL,)),  # then
        ("altitude", "f8"),  # by the barometer, then [m]
        ("moved", "f8", (4,)),  # beyond the velocity: north, east, down; barometer, up [m]
        ("at", "f8", (4,)),  # its mean, of what is excluded [m]
        ("out", "f8", (4,)),  # time since it was excluded, or moved on [s]; 0: it is not
        ("coherent", "f8"),  # time for which the receiver has agreed with itself [s]
    ]
)
"""What the last fixes said."""

BAROMETRIC = 3
"""Where in `moved` the barometer is."""

_LONGEST_S = 2.0  # between two fixes that can be compared
_RETURNED = 1.5  # of the largest sum: what has returned may have moved so far
_STAYS_S = 20.0  # for which something that passes its test must have stayed where it is
_REMEMBERED_S = 1.0  # a receiver that disagreed with itself is not believed for so long


@compiled
def note_fix(
    receiver: np.void,
    position: Vec3,
    velocity: Vec3,
    travel: np.ndarray,
    altitude: float,
    assumed: np.void,
) -> None:
    """Compare a fix with the one before.

    Args:
        receiver: Record of dtype `RECEIVER`, updated in place.
        position: NED [m].
        velocity: NED [m/s].
        travel: Integrals of the acceleration at the time of the fix, shape (7,).
        altitude: By the barometer, at the same time [m]; NaN: none.
        assumed: Record of dtype `PARAMETERS`.
    """
    elapsed = travel[6] - receiver["travel"][6]
    if receiver["since"] > 0 and 0.0 < elapsed < _LONGEST_S:
        out = receiver["out"]
        agrees = True
        left = math.exp(-elapsed / assumed["receiver_memory_s"])
        for k in range(4):
            axis = min(k, 2)
            pushed = travel[3 + axis] - receiver["travel"][3 + axis]
            pushed -= 0.5 * (travel[axis] + receiver["travel"][axis]) * elapsed
            went = 0.5 * (velocity[axis] + receiver["velocity"][axis]) * elapsed + pushed
            if k < BAROMETRIC:
                beyond = position[k] - receiver["position"][k] - went
                agrees = agrees and abs(beyond) < assumed["receiver_jump"][k]
            else:
                beyond = altitude - receiver["altitude"] + went
                beyond = beyond if math.isfinite(beyond) else 0.0
            receiver["moved"][k] = receiver["moved"][k] * (left if out[k] == 0.0 else 1.0) + beyond
            _note_stay(receiver, k, elapsed, assumed)
        if not agrees or has_moved(receiver, 0, assumed) or has_moved(receiver, 1, assumed):
            receiver["coherent"] = -_REMEMBERED_S
        receiver["coherent"] += elapsed
    for k in range(3):
        receiver["position"][k], receiver["velocity"][k] = position[k], velocity[k]
    for k in range(TRAVEL):
        receiver["travel"][k] = travel[k]
    receiver["altitude"] = altitude
    receiver["since"] += 1


@compiled
def _note_stay(receiver: np.void, k: int, elapsed: float, assumed: np.void) -> None:
    """Note for how long what is excluded has stayed where it is, and believe it at last."""
    if receiver["out"][k] == 0.0:
        return
    receiver["out"][k] += elapsed
    off = receiver["moved"][k] - receiver["at"][k]
    receiver["at"][k] += elapsed / assumed["receiver_memory_s"] * off
    if abs(off) > assumed["receiver_moved"][k]:
        receiver["at"][k], receiver["out"][k] = receiver["moved"][k], elapsed
    elif receiver["out"][k] > assumed["receiver_believed_s"]:
        receiver["moved"][k], receiver["at"][k] = 0.0, 0.0


@compiled
def leave_out(receiver: np.void, first: int, last: int) -> None:
    """Note that something is excluded: from one index to another."""
    for k in range(first, last + 1):
        receiver["at"][k], receiver["out"][k] = receiver["moved"][k], 1e-9


@compiled
def has_moved(receiver: np.void, k: int, assumed: np.void) -> bool:
    """Return whether a place, or the barometer's, moved further than its errors explain."""
    return bool(abs(receiver["moved"][k]) > assumed["receiver_moved"][k])


@compiled
def is_kept_out(receiver: np.void, k: int, assumed: np.void) -> bool:
    """Return whether what is excluded must stay so, even if its innovations pass."""
    far = abs(receiver["moved"][k]) > _RETURNED * assumed["receiver_moved"][k]
    return bool(far and receiver["out"][k] < _STAYS_S)


@compiled
def agrees_with_itself(receiver: np.void) -> bool:
    """Return whether the receiver's position has moved as its velocity says."""
    return bool(receiver["coherent"] > 0.0)


@compiled
def forget_moves(receiver: np.void, first: int, last: int) -> None:
    """Take what was moved for settled: from one index to another."""
    for k in range(first, last + 1):
        receiver["moved"][k], receiver["at"][k], receiver["out"][k] = 0.0, 0.0, 0.0
