"""What a UAV does for its formation: its slot, and corrections of its way along the path.

With s the path parameter of UAV i and a_i what its slot lies ahead, ξ_i = s_i - a_i is where
on the path it sees the formation. Consensus on ξ is what keeps the members together::

    Δ_i = sat( Σ a_ij (k_s (ξ_j - ξ_i) + c (ξ_j' - U)) + h_i k_s (ξ_0 - ξ_i) ) / (Σ a_ij + h_i)

is added to the speed U along the path that the mission asks for where the formation is. Only
neighbours count that fly the same path and have not left; a silent one's a_ij fades to 0. Weights
are divided by what they sum up to while everybody is heard, so that the gain does not depend on
the graph.

Virtual structure: ξ_0 is a virtual point, which a UAV with leader access h_i keeps. It moves at
U, and waits for that UAV: ξ_0' = U + k_s (ξ_i - ξ_0), and it is never further away than what
saturates Δ. So a member that is late makes all others wait. Leader and followers: UAVs with leader
access fly at U and wait for nobody.
"""

import math
from typing import NamedTuple

import numpy as np

from ftc_autopilot.common.phases import LOST as LOST_ACTUATOR
from ftc_autopilot.guidance.formation import LEADER_FOLLOWER, MAX_MEMBERS
from ftc_autopilot.guidance.members import (
    DEGRADED,
    LEAVE,
    LOST,
    NOMINAL,
    SILENT,
    SLOW,
    cause_of,
    enter,
    merge,
    occupants,
    policy_of,
)
from ftc_autopilot.guidance.places import MAX_RELAYED, NO_PLACE, PLACE
from ftc_autopilot.guidance.slots import SLOT_MOTION, move, place_of_slot
from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import Vec3, vec3

_DEGRADED_S = 1.0
"""Time for which an actuator must be degraded to count as such [s]."""
_TRUSTED = 0.7
"""Confidence that an estimated effectiveness needs to count."""

FORMATION = np.dtype(
    [
        ("table", "u1", (MAX_MEMBERS,)),  # see `ftc_autopilot.guidance.members`
        ("heard", "u1", (MAX_MEMBERS,)),  # whether each neighbour is heard, in their order
        ("member_heard", "u1", (MAX_MEMBERS,)),  # the same by member
        ("slot_of", "i8", (MAX_MEMBERS,)),  # slot that each member takes
        ("plan", "i8"),  # for which `slot_of` holds, -1: none
        ("cause", "i8"),  # why this UAV is in trouble
        ("other_cause", "i8"),  # what seems to be the cause now
        ("other_s", "f8"),  # for how long it has
        ("commanded", "f8", (3,)),  # slot by command, NaN: the planned one [m]
        ("slot", SLOT_MOTION),
        ("path_id", "i8"),  # path of the update before, 0: none
        ("virtual", "f8"),  # ξ_0 [m]
        ("xi", "f8"),  # ξ at the last update [m]
        ("xi_rate", "f8"),  # ξ' [m/s]
        ("updated", "i8"),  # step of that update
        (
            "error",
            "f8",
            (3,),
        ),  # ahead of the neighbours; right of the slot, above it; NaN: unknown [m]
        ("places", PLACE, (MAX_MEMBERS,)),  # of the other members, as heard from anyone
        ("last_relayed", PLACE, (MAX_MEMBERS,)),  # the same as relayed last
        ("relayed", "i8", (MAX_RELAYED,)),  # members that the next message relays, -1: none
        ("relay_error", "f8"),  # what the neighbours are wrong by of the others' places [m]
        ("nearest", "i8"),  # system id of the nearest member, 0: none is known
        ("distance", "f8"),  # to it [m]
        ("evading", "i8"),  # 1: the barrier acts
    ]
)
"""What a member of a formation keeps between two updates of guidance."""


class Coordination(NamedTuple):
    """Where guidance is to fly, relative to the path, and with which corrections."""

    slot: Vec3  # ahead, to the right, up, of the point of the path that the formation is at [m]
    slot_rate: Vec3  # its time derivative [m/s]
    speed: float  # added to the ground speed along the path [m/s]
    right: float  # velocity added to the right of the path, which keeps UAVs apart [m/s]
    up: float  # the same upwards [m/s]


class Progress(NamedTuple):
    """Where a UAV is on its path, and what of it matters to the formation."""

    step: int  # present step
    dt: float  # control period [s]
    since: float  # time since the update before [s]
    clock: float  # time on the mission's clock [s]
    in_slot: bool  # whether it flies in its slot, not on the path itself
    path_id: int  # of the path that is flown
    s: float  # path parameter [m]
    s_dot: float  # its time derivative [m/s]
    speed: float  # U, which the mission asks for where the formation is [m/s]


@compiled
def no_coordination() -> Coordination:
    """Return what a UAV does that is alone: it flies on the path."""
    return Coordination((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0, 0.0)


def new_formation() -> np.void:
    """Return the state before the first update, dtype `FORMATION`."""
    state: np.void = np.zeros(1, FORMATION)[0]
    state["plan"] = -1
    state["commanded"] = math.nan
    state["distance"] = math.nan
    state["places"]["step"] = state["last_relayed"]["step"] = NO_PLACE
    state["relayed"] = -1
    return state


@compiled
def coordinate(
    now: Progress,
    edges: np.ndarray,
    signals: np.void,
    layout: np.void,
    gains: np.void,
    state: np.void,
) -> Coordination:
    """Make one update; nobody is evaded yet.

    Args:
        now: Progress of the own UAV.
        edges: What is known of each neighbour, dtype `ftc_autopilot.control.edges.EDGE`, shape
            (degree,).
        signals: Of the step before, dtype `ftc_autopilot.control.signals.SIGNALS`.
        layout: Record of dtype `ftc_autopilot.guidance.formation.LAYOUT`.
        gains: Record made of `ftc_autopilot.guidance.formation.FormationParameters`.
        state: Record of dtype `FORMATION`, updated in place.
    """
    if _note_members(now, edges, signals, layout, gains, state):
        state["plan"] = -1
    plan = 0
    while plan + 1 < layout["plans"] and now.clock >= layout["at"][plan + 1]:
        plan += 1
    if plan != state["plan"]:
        state["plan"] = plan
        occupants(layout["slots"][plan], state["table"], layout["count"], state["slot_of"])
    target = place_of_slot(
        plan, layout, gains, state["table"], state["slot_of"], state["commanded"]
    )
    if not now.in_slot:
        target = (0.0, 0.0, 0.0)
    begins = now.since == 0.0 or state["path_id"] != now.path_id
    move(target, gains["slot_speed_m_s"], now.since, begins, state["slot"])
    slot, rate = vec3(state["slot"]["place"]), vec3(state["slot"]["rate"])
    xi = now.s - slot[0]
    if begins:
        state["path_id"] = now.path_id
        state["virtual"] = xi
    state["xi"], state["xi_rate"], state["updated"] = xi, now.s_dot - rate[0], now.step

    speed = now.speed
    for m in range(layout["count"]):
        if policy_of(state["table"][m]) == SLOW:
            speed = (1.0 - gains["slow_share"]) * now.speed
    correction = _consensus(now, speed, edges, layout, gains, state)
    return Coordination(slot, rate, speed - now.speed + correction + rate[0], 0.0, 0.0)


@compiled
def _consensus(
    now: Progress, speed: float, edges: np.ndarray, layout: np.void, gains: np.void, state: np.void
) -> float:
    """Return Δ, and move the virtual point."""
    ks, limit, access = gains["ks"], gains["speed_limit_m_s"], layout["access"]
    xi = state["xi"]
    total, sum_of_weights, behind = 0.0, 0.0, 0.0
    for d in range(len(edges)):
        m, message, weight = layout["neighbours"][d], edges[d]["known"], edges[d]["weight"]
        if m < 0 or weight <= 0.0 or np.int64(message["path_id"]) != now.path_id:
            continue
        if policy_of(state["table"][m]) == LEAVE:
            continue
        age = (now.step - np.int64(message["step"])) * now.dt
        ahead = message["path_position"] + age * message["path_rate"] - xi
        excess = message["path_rate"] - speed
        total += weight * (ks * ahead + gains["rate_share"] * excess)
        sum_of_weights += weight
        behind += weight * ahead
    state["error"][0] = -behind / sum_of_weights if sum_of_weights > 0.0 else math.nan
    if gains["kind"] == LEADER_FOLLOWER and access > 0.0:
        return 0.0
    if access > 0.0:
        ahead = _limited(state["virtual"] - xi, limit / ks)
        total += access * ks * ahead
        state["virtual"] = xi + ahead + (speed - ks * ahead) * now.since
    return _limited(total / layout["weight"] if layout["weight"] > 0.0 else 0.0, limit)


@compiled
def _note_members(
    now: Progress,
    edges: np.ndarray,
    signals: np.void,
    layout: np.void,
    gains: np.void,
    state: np.void,
) -> bool:
    """Bring the table up to date; return whether it has changed."""
    table, own, changed = state["table"], layout["own"], False
    links, heard, lost = 0, 0, 0
    for d in range(len(edges)):
        m = layout["neighbours"][d]
        if m < 0:
            continue
        links += 1
        hears = edges[d]["weight"] > 0.0
        heard += 1 if hears else 0
        lost += 1 if state["heard"][d] != 0 else 0
        state["member_heard"][m] = 1 if hears else 0
    for d in range(len(edges)):
        m = layout["neighbours"][d]
        if m < 0:
            continue
        hears = edges[d]["weight"] > 0.0
        # a member that hears none is cut off itself, and reports nothing of the others
        if not hears and state["heard"][d] != 0 and heard > 0 and cause_of(table[m]) == NOMINAL:
            changed |= enter(table, m, 4 * SILENT + gains["on_silent"])
        state["heard"][d] = 1 if hears else 0
        known = edges[d]["known"]
        if hears and np.int64(known["path_id"]) != 0:
            changed |= merge(table, known["report"], own, state["member_heard"], layout["count"])
    cut_off = links > 0 and heard == 0
    cause = _cause(now.since, cut_off, signals, gains, state)
    policy = 0
    if cause == DEGRADED:
        policy = gains["on_degraded"]
    elif cause == LOST:
        policy = gains["on_lost"]
    elif cause == SILENT:
        policy = gains["on_silent"]
    changed |= enter(table, own, 4 * cause + policy)
    return changed


@compiled
def _cause(since: float, cut_off: bool, signals: np.void, gains: np.void, state: np.void) -> int:
    """Return why this UAV is in trouble; a change must last for a time before it counts."""
    cause = SILENT if cut_off else NOMINAL
    for c in range(len(signals["phase"])):
        if signals["phase"][c] == LOST_ACTUATOR:
            cause = LOST
        trusted = signals["confidence"][c] > _TRUSTED
        if cause != LOST and trusted and signals["effectiveness"][c] < gains["degraded_below"]:
            cause = DEGRADED
    if cause != state["other_cause"]:
        state["other_cause"], state["other_s"] = cause, 0.0
    else:
        state["other_s"] += since
    needed = 0.0
    if cause == NOMINAL:
        needed = gains["recovered_s"]
    elif cause == DEGRADED:
        needed = _DEGRADED_S
    if cause != state["cause"] and state["other_s"] >= needed:
        state["cause"] = cause
    return int(state["cause"])


@compiled
def _limited(x: float, limit: float) -> float:
    return min(max(x, -limit), limit)
