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

from ftc_autopilot.estimation.state import GNSS_HEIGHT, TRAVEL
from mavlink_defs.constants import BAROMETER, GNSS
from mavlink_defs.origin import EARTH_RADIUS_M
from mavlink_defs.runtime.jit import compiled
from mavlink_defs.runtime.memory import copy_record

FIX = np.dtype(
    [
        ("position", "f8", (3,)),  # m, NED
        ("velocity", "f8", (3,)),  # m/s
        ("acceleration", "f8", (3,)),  # by its IMU, over the time that it may be late [m/s²]
        ("bend", "f8", (3,)),  # of the velocity in that time, beside the acceleration [m/s]
        ("age", "f8"),  # how long ago that was, as it says [s]
        ("late", "f8"),  # how much longer it was, by what a filter has learned [s]
    ]
)
"""The last fix."""

RECEIVER = np.dtype(
    [
        ("since", "i8"),  # fixes that were compared; 0: the next one is the first
        ("fix", FIX),  # the one before
        ("travel", "f8", (TRAVEL,)),  # then
        ("altitude", "f8"),  # by the barometer, then [m]
        ("moved", "f8", (4,)),  # beyond the velocity: north, east, down; barometer, up [m]
        ("at", "f8", (4,)),  # its mean, of what is excluded [m]
        ("out", "f8", (4,)),  # time since it was excluded, or moved on [s]; 0: it is not
        ("coherent", "f8"),  # time for which the receiver has agreed with itself [s]
    ]
)
"""What the last fixes said."""

_BAROMETRIC = 3  # where in `moved` the barometer is

_LONGEST_S = 2.0  # between two fixes that can be compared
_RETURNED = 1.5  # of the largest sum: what has returned may have moved so far
_STAYS_S = 20.0  # for which something that passes its test must have stayed where it is
_REMEMBERED_S = 1.0  # a receiver that disagreed with itself is not believed for so long


@compiled
def write_fix(fix: np.void, gps: np.void, assumed: np.void) -> None:
    """Write position and velocity of an HIL_GPS payload to a record of dtype `FIX`."""
    north = math.radians(gps["lat"] / 1e7 - assumed["latitude"]) * EARTH_RADIUS_M
    degrees = (gps["lon"] / 1e7 - assumed["longitude"] + 180.0) % 360.0 - 180.0
    east = math.radians(degrees) * EARTH_RADIUS_M * math.cos(math.radians(assumed["latitude"]))
    position, velocity = fix["position"], fix["velocity"]
    position[0], position[1] = north, east
    position[2] = assumed["altitude"] - gps["alt"] / 1e3
    velocity[0], velocity[1] = gps["vn"] / 100.0, gps["ve"] / 100.0
    velocity[2] = gps["vd"] / 100.0


@compiled
def note_fix(
    receiver: np.void, fix: np.void, travel: np.ndarray, altitude: float, assumed: np.void
) -> None:
    """Compare a fix with the one before.

    Args:
        receiver: Record of dtype `RECEIVER`, updated in place.
        fix: Record of dtype `FIX`.
        travel: Integrals of the acceleration at the time of the fix, shape (7,).
        altitude: By the barometer, at the same time [m]; NaN: none.
        assumed: Record of dtype `PARAMETERS`.
    """
    before, between = receiver["fix"], travel[6] - receiver["travel"][6]
    elapsed = between + fix["late"] - before["late"]  # by its own clock: what is learned moves none
    if receiver["since"] > 0 and 0.0 < elapsed < _LONGEST_S:
        out = receiver["out"]
        agrees = True
        left = math.exp(-elapsed / assumed["receiver_memory_s"])
        for k in range(4):
            axis = min(k, 2)
            pushed = travel[3 + axis] - receiver["travel"][3 + axis]
            pushed -= 0.5 * (travel[axis] + receiver["travel"][axis]) * between
            went = 0.5 * (fix["velocity"][axis] + before["velocity"][axis]) * elapsed + pushed
            if k < _BAROMETRIC:
                beyond = fix["position"][k] - before["position"][k] - went
                agrees = agrees and abs(beyond) < assumed["receiver_jump"][k]
            else:
                beyond = altitude - receiver["altitude"] + went
                beyond = beyond if math.isfinite(beyond) else 0.0
            receiver["moved"][k] = receiver["moved"][k] * (left if out[k] == 0.0 else 1.0) + beyond
            _note_stay(receiver, k, elapsed, assumed)
        if not agrees or has_moved(receiver, GNSS, assumed):
            receiver["coherent"] = -_REMEMBERED_S
        receiver["coherent"] += elapsed
    copy_record(before, fix)
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
def _moves_of(s: int) -> tuple[int, int]:
    """Return where in `moved` a sensor's are: from an index to before another; none of others."""
    if s == GNSS:
        return 0, 2
    if s == GNSS_HEIGHT:
        return 2, 3
    return (_BAROMETRIC, 4) if s == BAROMETER else (0, 0)


@compiled
def leave_out(receiver: np.void, s: int) -> None:
    """Note that a sensor is excluded."""
    first, end = _moves_of(s)
    for k in range(first, end):
        receiver["at"][k], receiver["out"][k] = receiver["moved"][k], 1e-9


@compiled
def has_moved(receiver: np.void, s: int, assumed: np.void) -> bool:
    """Return whether what a sensor says moved further than errors explain."""
    first, end = _moves_of(s)
    for k in range(first, end):
        if abs(receiver["moved"][k]) > assumed["receiver_moved"][k]:
            return True
    return False


@compiled
def is_kept_out(receiver: np.void, s: int, assumed: np.void) -> bool:
    """Return whether a sensor that is excluded must stay so, even if its innovations pass."""
    first, end = _moves_of(s)
    for k in range(first, end):
        far = abs(receiver["moved"][k]) > _RETURNED * assumed["receiver_moved"][k]
        if far and receiver["out"][k] < _STAYS_S:
            return True
    return False


@compiled
def agrees_with_itself(receiver: np.void) -> bool:
    """Return whether the receiver's position has moved as its velocity says."""
    return bool(receiver["coherent"] > 0.0)


@compiled
def forget_moves(receiver: np.void, s: int) -> None:
    """Take what a sensor moved for settled."""
    first, end = _moves_of(s)
    for k in range(first, end):
        receiver["moved"][k], receiver["at"][k], receiver["out"][k] = 0.0, 0.0, 0.0
