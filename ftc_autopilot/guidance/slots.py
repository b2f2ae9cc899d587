"""The slot of a member: where it is to be, by plan, command and what has become of the others.

A slot that changes is moved to smoothly: a point goes straight to the new place at a limited
speed, and the slot follows it as a second-order system with both poles at -1/s.
"""

import math

import numpy as np

from ftc_autopilot.guidance.members import LEAVE, WIDEN, policy_of
from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import Vec3, add, norm, scale, sub, vec3

_POLE_1_S = 1.0
_CENTRAL_M = 1.0
"""Distance from the middle of the formation below which a slot has no way outwards [m]."""

SLOT_MOTION = np.dtype(
    [
        ("point", "f8", (3,)),  # on its way to the new place [m]
        ("place", "f8", (3,)),  # slot in force: ahead, right, up [m]
        ("rate", "f8", (3,)),  # its time derivative [m/s]
    ]
)


@compiled
def place_of_slot(
    plan: int,
    layout: np.void,
    gains: np.void,
    table: np.ndarray,
    slot_of: np.ndarray,
    commanded: np.ndarray,
) -> Vec3:
    """Return where the own slot is to be: ahead, to the right, up [m].

    Args:
        plan: Index of the planned slots in force.
        layout: Record of dtype `ftc_autopilot.guidance.formation.LAYOUT`.
        gains: Record made of `ftc_autopilot.guidance.formation.FormationParameters`.
        table: States of the members, see `ftc_autopilot.guidance.members`.
        slot_of: Slot that each member takes.
        commanded: Slot by command, NaN for the planned one, shape (3,) [m].
    """
    own, count, slots = layout["own"], layout["count"], layout["slots"][plan]
    slot = vec3(commanded)
    if math.isnan(slot[0]):
        slot = vec3(slots[slot_of[own]])
    policy = policy_of(table[own])
    if policy == LEAVE:
        return add(slot, (gains["leave_ahead_m"], gains["leave_right_m"], gains["leave_up_m"]))
    if policy == WIDEN:
        middle = (0.0, 0.0, 0.0)
        for m in range(count):
            middle = add(middle, scale(1.0 / count, vec3(slots[m])))
        outwards = sub(slot, middle)
        distance = norm(outwards)
        if distance < _CENTRAL_M:
            return add(slot, (0.0, 0.0, gains["widen_m"]))
        return add(slot, scale(gains["widen_m"] / distance, outwards))
    return slot


@compiled
def move(target: Vec3, speed: float, dt: float, begins: bool, motion: np.void) -> None:
    """Move the slot towards a place.

    Args:
        target: Ahead, right, up [m].
        speed: Largest speed [m/s].
        dt: Time that has passed [s].
        begins: Whether a path begins: the slot is there at once.
        motion: Record of dtype `SLOT_MOTION`, updated in place.
    """
    point, place, rate = motion["point"], motion["place"], motion["rate"]
    distance = norm(sub(target, vec3(point)))
    share = min(speed * dt / distance, 1.0) if distance > 0.0 else 1.0
    for k in range(3):
        if begins:
            point[k], place[k], rate[k] = target[k], target[k], 0.0
            continue
        point[k] += share * (target[k] - point[k])
        pull = _POLE_1_S * (_POLE_1_S * (point[k] - place[k]) - 2.0 * rate[k])
        rate[k] += dt * pull
        place[k] += dt * rate[k]
