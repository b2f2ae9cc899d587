"""Where all members of a formation are, and how news of it spreads.

A member hears its neighbours in the communication graph only. So each FTC_NEIGHBOUR also relays
where up to two other members are, as far as its sender has heard of them: the ones of whom the
receivers know the least. A place keeps the step of the state that it was derived from, and only a
newer one replaces it. So a place is relayed along every chain of links, never in circles, and
whoever receives it predicts the member from then on by its velocity, however many links lie
between. A place that nobody has heard of for a time is forgotten.
"""

import math

import numpy as np

from mavlink_defs.dialect import MAVLink_ftc_neighbour_message
from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import Vec3, add, norm, scale, sub, vec3

MAX_RELAYED = MAVLink_ftc_neighbour_message.array_lengths[-1]
"""Members that one message relays."""
FORGOTTEN_S = 5.0
"""Age at which a place is forgotten [s]."""
REPEAT_S = 1.0
"""Time after which a place is relayed again, however well it was predicted [s]."""
_OVERDUE_M_S = 1.0
"""Error of a place that counts as much as a second since it was relayed [m/s]."""

PLACE = np.dtype(
    [
        ("step", "i8"),  # of the state that it was derived from, -1: none
        ("position", "f8", (3,)),  # NED [m]
        ("velocity", "f8", (3,)),  # over ground, NED [m/s]
    ]
)
"""Where a member was."""

NO_PLACE = -1


@compiled
def is_known(place: np.void, step: int, dt: float) -> bool:
    """Return whether a place, dtype `PLACE`, is known and not forgotten in a step."""
    return bool(place["step"] >= 0 and (step - place["step"]) * dt <= FORGOTTEN_S)


@compiled
def place_now(place: np.void, now_s: float, dt: float) -> Vec3:
    """Return where a member is now, if it has gone on as it reported, NED [m]."""
    age = now_s - place["step"] * dt
    return add(vec3(place["position"]), scale(age, vec3(place["velocity"])))


@compiled
def take_in(message: np.void, sender: int, layout: np.void, places: np.ndarray) -> None:
    """Note where a neighbour is, and which members it relays.

    Args:
        message: Payload of dtype `mavlink_defs.framing.codec.NEIGHBOUR`.
        sender: The member that sent it.
        layout: Record of dtype `ftc_autopilot.guidance.formation.LAYOUT`.
        places: By member, dtype `PLACE`, shape (MAX_MEMBERS,), updated in place.
    """
    step = np.int64(message["step"])
    if np.int64(message["path_id"]) == 0 or step == 0:  # over UDP, one of step 0 may cross it
        return
    if step > places[sender]["step"]:
        places[sender]["step"] = step
        for k in range(3):
            places[sender]["position"][k] = message["position"][k]
            places[sender]["velocity"][k] = message["ground_velocity"][k]
    _take_in_relayed(message, layout, places)


@compiled
def _take_in_relayed(message: np.void, layout: np.void, places: np.ndarray) -> None:
    """Note which members a message relays; arguments as of `take_in`."""
    for r in range(MAX_RELAYED):
        m = _member(int(np.int64(message["relayed"][r])), layout)
        step = np.int64(message["relayed_step"][r])
        if m < 0 or m == layout["own"] or step > np.int64(message["step"]):
            continue
        if step <= places[m]["step"]:
            continue
        places[m]["step"] = step
        for k in range(3):
            places[m]["position"][k] = message["relayed_position"][3 * r + k]
            places[m]["velocity"][k] = message["relayed_velocity"][3 * r + k]


@compiled
def choose_relayed(
    step: int,
    dt: float,
    layout: np.void,
    places: np.ndarray,
    last_relayed: np.ndarray,
    chosen: np.ndarray,
) -> float:
    """Choose which members to relay next: those the neighbours know least about.

    A UAV with a single neighbour has heard everything from it, and relays nothing.

    Args:
        step: Present step.
        dt: Control period [s].
        layout: Record of dtype `ftc_autopilot.guidance.formation.LAYOUT`.
        places: By member, dtype `PLACE`, shape (MAX_MEMBERS,).
        last_relayed: The same as relayed last.
        chosen: Members to relay, -1: none, shape (MAX_RELAYED,), written.

    Returns:
        Largest error of the neighbours' knowledge [m]; infinite for a member to be relayed.
    """
    links = 0
    for d in range(len(layout["neighbours"])):
        links += 1 if layout["neighbours"][d] >= 0 else 0
    worst = 0.0
    overdue = np.zeros(MAX_RELAYED)
    for r in range(MAX_RELAYED):
        chosen[r] = -1
    for m in range(layout["count"] if links > 1 else 0):
        place, last = places[m], last_relayed[m]
        if m == layout["own"] or not is_known(place, step, dt) or place["step"] <= last["step"]:
            continue
        error, wait = math.inf, (place["step"] - last["step"]) * dt
        if last["step"] >= 0 and wait < REPEAT_S:
            error = norm(sub(place_now(place, step * dt, dt), place_now(last, step * dt, dt)))
        worst = max(worst, error)
        urgency = error + _OVERDUE_M_S * wait
        at = MAX_RELAYED
        while at > 0 and (chosen[at - 1] < 0 or urgency > overdue[at - 1]):
            at -= 1
        if at < MAX_RELAYED:
            for r in range(MAX_RELAYED - 1, at, -1):
                chosen[r], overdue[r] = chosen[r - 1], overdue[r - 1]
            chosen[at], overdue[at] = m, urgency
    return worst


@compiled
def relay(chosen: np.ndarray, layout: np.void, places: np.ndarray, message: np.void) -> None:
    """Write the places of those chosen into a message that relays nobody yet."""
    for r in range(MAX_RELAYED):
        m = chosen[r]
        if m < 0:
            continue
        message["relayed"][r], message["relayed_step"][r] = layout["ids"][m], places[m]["step"]
        for k in range(3):
            message["relayed_position"][3 * r + k] = places[m]["position"][k]
            message["relayed_velocity"][3 * r + k] = places[m]["velocity"][k]


@compiled
def note_relayed(message: np.void, layout: np.void, state: np.void) -> None:
    """Note what a message that is sent relays.

    Args:
        message: Payload of dtype `mavlink_defs.framing.codec.NEIGHBOUR`.
        layout: Record of dtype `ftc_autopilot.guidance.formation.LAYOUT`.
        state: Record of dtype `ftc_autopilot.guidance.coordination.FORMATION`, updated in place.
    """
    _take_in_relayed(message, layout, state["last_relayed"])
    state["relay_error"] = 0.0
    for r in range(MAX_RELAYED):
        state["relayed"][r] = -1


@compiled
def _member(system: int, layout: np.void) -> int:
    """Return the member with a system id, -1 if there is none."""
    if system > 0:
        for m in range(layout["count"]):
            if layout["ids"][m] == system:
                return m
    return -1
