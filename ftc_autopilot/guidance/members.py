"""What each member of a formation knows of all members, and how news of a change spreads.

Every member keeps a table with one byte for each member, in the order of system ids, and sends it
with each FTC_NEIGHBOUR: bits 0 to 3 the member's state, bits 4 to 7 how often that has changed.
As in link-state routing, the newer entry counts, so that a change reaches every member that any
chain of links reaches. The entry of a member is its own, but when it falls silent, a member
that lost it enters that; when it hears of it, it overrules it by a newer entry.

A state is the cause of the trouble and the policy that was chosen for it, 4 · cause + policy; it is
0 while all is well.
"""

import math

import numpy as np

from ftc_autopilot.guidance.formation import MAX_MEMBERS
from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import square

NOMINAL, DEGRADED, LOST, SILENT = range(4)
"""Causes, as FTC_CAUSE numbers them."""
STAY, SLOW, WIDEN, LEAVE = range(4)
"""Policies, as FTC_POLICY numbers them."""

_COUNTS = 16  # changes are counted modulo this
_NEARER_M = 1.0
"""Distance by which a free slot must be further in, for a member to move there [m]."""


@compiled
def state_of(entry: int) -> int:
    """Return the state in an entry of the table."""
    return int(np.int64(entry)) & 15


@compiled
def cause_of(entry: int) -> int:
    """Return why a member is in trouble: `NOMINAL`, `DEGRADED`, `LOST` or `SILENT`."""
    return (int(np.int64(entry)) & 15) >> 2


@compiled
def policy_of(entry: int) -> int:
    """Return what becomes of a member: `STAY`, `SLOW`, `WIDEN` or `LEAVE`."""
    return int(np.int64(entry)) & 3


@compiled
def enter(table: np.ndarray, m: int, state: int) -> bool:
    """Enter a state of member m as news, unless it is the one there; return whether it was."""
    entry = int(np.int64(table[m]))
    if state_of(entry) == state:
        return False
    table[m] = _entry((entry >> 4) + 1, state)
    return True


@compiled
def merge(table: np.ndarray, received: np.ndarray, own: int, heard: np.ndarray, count: int) -> bool:
    """Take in a neighbour's table.

    Args:
        table: The own table, shape (MAX_MEMBERS,), updated in place.
        received: The neighbour's.
        own: Index of this UAV.
        heard: Whether each member is heard by this UAV itself, shape (MAX_MEMBERS,): that it is
            silent is not believed then.
        count: Members.

    Returns:
        Whether the own table has changed.
    """
    changed = False
    for m in range(count):
        theirs, mine = int(np.int64(received[m])), int(np.int64(table[m]))
        newer = ((theirs >> 4) - (mine >> 4)) % _COUNTS
        if m == own:
            if theirs != mine and newer <= _COUNTS // 2:  # the others are to believe this UAV
                table[m] = _entry((theirs >> 4) + 1, state_of(mine))
                changed = True
            continue
        news = 0 < newer < _COUNTS // 2 or (newer == 0 and state_of(theirs) > state_of(mine))
        if news and not (cause_of(theirs) == SILENT and heard[m] != 0):
            table[m] = theirs
            changed = True
    return changed


@compiled
def occupants(slots: np.ndarray, table: np.ndarray, count: int, slot_of: np.ndarray) -> None:
    """Find which slot each member takes, so that those who have left leave no gaps.

    Slots are filled from the inside out, by distance from the point of the path that the formation
    is at, then by system id. A slot whose own member has left goes to the nearest member of
    those further out (the one with the lowest system id of several), whose slot is free then.
    Nobody moves sideways only: that would close no gap.

    Args:
        slots: Slots of all members, shape (MAX_MEMBERS, 3) [m].
        table: The table, shape (MAX_MEMBERS,).
        count: Members.
        slot_of: Index of the slot of each member, shape (MAX_MEMBERS,), written; its own
            for one that has left.
    """
    order = np.zeros(MAX_MEMBERS, np.int64)  # slots from the inside out
    for k in range(count):
        slot_of[k] = k
        place = k
        while place > 0 and _distance(slots[order[place - 1]]) > _distance(slots[k]):
            order[place] = order[place - 1]
            place -= 1
        order[place] = k
    for rank in range(count):
        k = order[rank]
        free = True
        for m in range(count):
            if slot_of[m] == k and policy_of(table[m]) != LEAVE:
                free = False
        if not free:
            continue
        nearest, least = -1, math.inf
        for m in range(count):
            outside = _distance(slots[slot_of[m]]) > _distance(slots[k]) + _NEARER_M
            if policy_of(table[m]) == LEAVE or not outside:
                continue
            distance = _between(slots[slot_of[m]], slots[k])
            if distance < least - 1e-9:
                nearest, least = m, distance
        if nearest >= 0:
            slot_of[nearest] = k


@compiled
def _entry(changes: int, state: int) -> int:
    return (changes % _COUNTS) << 4 | state


@compiled
def _distance(slot: np.ndarray) -> float:
    return math.sqrt(slot[0] * slot[0] + slot[1] * slot[1] + slot[2] * slot[2])


@compiled
def _between(a: np.ndarray, b: np.ndarray) -> float:
    return math.sqrt(square(a[0] - b[0]) + square(a[1] - b[1]) + square(a[2] - b[2]))
