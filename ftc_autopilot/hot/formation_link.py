"""The formation link: own states to the neighbours, their states into the control step.

In lockstep a step uses neighbour states of the step before. A state of a later step is pending
until its turn comes, so that it does not matter which neighbour is faster. The plant reports which
autopilots sent nothing in the step before; the states of all others are waited for.

In real time a step uses the newest state of each neighbour. If it is of a later step than the own,
this autopilot is late, not the neighbour wrong, as long as the plant can be there.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ftc_autopilot.control.config import Neighbour
from ftc_autopilot.control.controllers import Controllers
from ftc_autopilot.control.stepping import hear
from mavlink_defs.dialect import FTC_NEIGHBOUR_FRAME_REFERENCE, MAV_COMP_ID_AUTOPILOT1
from mavlink_defs.endpoint import parse_address
from mavlink_defs.framing import codec
from mavlink_defs.framing.codec import (
    NEIGHBOUR_SIZE,
    MessageId,
    expand,
    pack,
    system_of,
)
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.hot_link import DROPPED, take
from mavlink_defs.framing.hot_signing import LinkSigner, sign_frame
from mavlink_defs.runtime.jit import compiled, inlined
from mavlink_defs.runtime.memory import copy_record
from mavlink_defs.runtime.native import (
    ADDRESS_SIZE,
    monotonic_s,
    receive_from_now,
    receive_from_soon,
    same_address,
    send_to,
)
from mavlink_defs.runtime.sockaddr import sockaddr

_NEIGHBOUR_WAIT_S = 0.05
"""Longest wait of a lockstep step for a neighbour state in transit, over a slow relay, say [s]."""
_START_WAIT_S = 2.0
"""The same of the first step, for whose state a neighbour may still wait for the processor [s]."""
_NEIGHBOUR_MISSES = 5
"""Messages of a neighbour missed in a row before later steps stop waiting for them."""
_NEVER_HEARD = -1
_FASTEST = 100.0
"""Real time: simulated time does not pass faster than this, by the clock."""

FORMATION_STATE = np.dtype(
    [
        ("sequence", "i8"),  # frames sent
        ("timeout_steps", "i8"),  # silence after which a neighbour is dropped
        ("fade_steps", "i8"),  # steps in which a dropped neighbour's weight goes to 0, and back
        ("edge_changes", "i8"),  # neighbours dropped or restored
        ("most_steps_per_s", "f8"),  # that a plant makes in real time
        ("real_time", "i8"),  # 1: simulated time waits for nobody
        ("passed_over", "i8"),  # steps missed before the present one, whose messages have waited
        ("plant_step", "i8"),  # that the plant is known to have reached
        ("plant_s", "f8"),  # when it was heard of [s]
    ]
)


class FormationLink(NamedTuple):
    """Neighbours, their states that are not in use yet, counters and buffers."""

    state: np.ndarray  # (1,), dtype FORMATION_STATE
    system: int
    neighbours: np.ndarray  # (degree,), system ids
    addresses: np.ndarray  # (degree, ADDRESS_SIZE), their sockaddr
    weights: np.ndarray  # (degree,), a_ij as configured
    edges: np.ndarray  # (degree,), 1: the neighbour is heard, 0: it is dropped
    heard_step: np.ndarray  # (degree,), step of each neighbour's state in use
    arrived_step: np.ndarray  # (degree,), that step and how long the state waited to be taken
    pending: np.ndarray  # (degree,), dtype NEIGHBOUR: its state of a step that is not over here
    pending_step: np.ndarray  # (degree,), the step of that state
    silent: np.ndarray  # (degree,), 1: it sent no message in the step before
    misses: np.ndarray  # (degree,), messages in a row that were waited for in vain
    drops: np.ndarray  # (DROPS_SIZE,), datagrams dropped, by negated `DropReason`
    sent: np.ndarray  # datagram buffer
    received: np.ndarray  # datagram buffer
    neighbour_state: np.ndarray  # view of `received`
    sender: np.ndarray  # (ADDRESS_SIZE,), where it came from
    signer: LinkSigner


def new_formation_link(
    system: int,
    neighbours: Sequence[Neighbour],
    timeout_steps: int,
    fade_steps: int,
    steps_per_s: float,
    drops: np.ndarray,
    signer: LinkSigner,
) -> FormationLink:
    """Return a formation link that has received nothing from any neighbour.

    Args:
        system: Own system id.
        neighbours: Neighbours with addresses and weights.
        timeout_steps: Steps of silence after which a neighbour is dropped.
        fade_steps: Steps in which its weight then goes to 0, and back when it is heard again.
        steps_per_s: Control periods in a second.
        drops: Counts datagrams dropped, shape (DROPS_SIZE,).
        signer: Signs the link.
    """
    degree = len(neighbours)
    addresses = np.zeros((degree, ADDRESS_SIZE), np.uint8)
    for d, neighbour in enumerate(neighbours):
        addresses[d] = sockaddr(parse_address(neighbour.address))
    state = np.zeros(1, FORMATION_STATE)
    state["timeout_steps"], state["fade_steps"] = timeout_steps, fade_steps
    state["most_steps_per_s"] = _FASTEST * steps_per_s
    received = codec.new_buffer()
    link = FormationLink(
        state=state,
        system=system,
        neighbours=np.array([neighbour.id for neighbour in neighbours], np.int64),
        addresses=addresses,
        weights=np.array([neighbour.weight for neighbour in neighbours], np.float64),
        edges=np.zeros(degree, np.int64),
        heard_step=np.zeros(degree, np.int64),
        arrived_step=np.zeros(degree, np.int64),
        pending=np.zeros(degree, codec.NEIGHBOUR),
        pending_step=np.zeros(degree, np.int64),
        silent=np.zeros(degree, np.int64),
        misses=np.zeros(degree, np.int64),
        drops=drops,
        sent=codec.new_buffer(),
        received=received,
        neighbour_state=codec.payload_view(received, codec.NEIGHBOUR),
        sender=np.zeros(ADDRESS_SIZE, np.uint8),
        signer=signer,
    )
    reset_formation_link(link)
    return link


def reset_formation_link(link: FormationLink) -> None:
    """Forget the neighbours' states; frames and drops are counted on."""
    link.state["edge_changes"] = 0
    link.heard_step[:] = link.pending_step[:] = link.arrived_step[:] = _NEVER_HEARD
    link.edges[:] = link.silent[:] = link.misses[:] = 0


@compiled
def send_own_state(fd: int, link: FormationLink, own_states: np.ndarray) -> None:
    """Send the own state, as `announce` or `controller_step` left it, to every neighbour.

    Args:
        fd: Socket bound to the own formation port.
        link: The link.
        own_states: `Controllers.own_states` of one UAV.
    """
    if len(link.neighbours) == 0:
        return
    state = link.state[0]
    length = pack(
        link.sent,
        own_states,
        MessageId.NEIGHBOUR,
        link.system,
        MAV_COMP_ID_AUTOPILOT1,
        state["sequence"],
    )
    state["sequence"] += 1
    length = sign_frame(link.signer, link.sent, length)
    for d in range(len(link.neighbours)):
        send_to(fd, link.sent, length, link.addresses[d])


@inlined
def note_plant(
    link: FormationLink, lockstep: bool, passed_over: int, step: int, heard_s: float
) -> None:
    """Note how far the plant is.

    Args:
        link: The link.
        lockstep: Whether it waits for this autopilot.
        passed_over: Steps that this autopilot has missed before the present one.
        step: Step that the plant is known to have reached.
        heard_s: When, as `monotonic_s` gives it [s].
    """
    state = link.state[0]
    state["real_time"], state["passed_over"] = 0 if lockstep else 1, passed_over
    state["plant_step"], state["plant_s"] = step, heard_s


@inlined
def note_silent_neighbours(link: FormationLink, silent: np.ndarray) -> None:
    """Note which neighbours sent nothing in the step before, by FTC_SIM_STATE.silent."""
    for d in range(len(link.neighbours)):
        system = link.neighbours[d]
        link.silent[d] = (np.int64(silent[system >> 3]) >> (system & 7)) & 1


@inlined
def collect_neighbour_states(
    fd: int, link: FormationLink, controllers: Controllers, step: int, lockstep: bool
) -> None:
    """Update the neighbour states in use before a step, and drop or restore edges.

    Lockstep receives no more than the step needs, and waits for that.

    Args:
        fd: Socket bound to the own formation port, with a short receive timeout.
        link: The link.
        controllers: The controllers of one UAV; neighbour states and weights are updated.
        step: Step that is about to be made.
        lockstep: Whether simulated time waits for this step.
    """
    newest = max(step - 1, 0)  # the first step uses the states before the start
    for d in range(len(link.neighbours)):
        if link.heard_step[d] < link.pending_step[d] <= newest:
            hear(controllers, 0, d, link.pending[d])
            link.heard_step[d] = link.arrived_step[d] = link.pending_step[d]
    if not lockstep or _some_given_up(link):
        receive_neighbour_states(fd, link, controllers, newest)
    if lockstep and _some_missing(link, newest):
        end_s = monotonic_s() + (_NEIGHBOUR_WAIT_S if step > 0 else _START_WAIT_S)
        while _some_missing(link, newest):
            length = receive_from_soon(fd, link.received, link.sender)
            if length >= 0:
                _take_neighbour_state(link, controllers, length, newest)
            elif monotonic_s() >= end_s:
                break
        for d in range(len(link.neighbours)):
            if _is_missing(link, d, newest):
                link.misses[d] += 1
    _update_edges(link, controllers, step)


@compiled
def receive_neighbour_states(
    fd: int, link: FormationLink, controllers: Controllers, newest: int
) -> None:
    """Take all datagrams that wait in the socket.

    Args:
        fd: Socket bound to the own formation port.
        link: The link.
        controllers: The controllers of one UAV; neighbour states are updated.
        newest: Last step whose states are for use; in lockstep later ones become pending.
    """
    while True:
        length = receive_from_now(fd, link.received, link.sender)
        if length < 0:
            return
        _take_neighbour_state(link, controllers, length, newest)


@inlined
def _update_edges(link: FormationLink, controllers: Controllers, step: int) -> None:
    """Drop a neighbour after `timeout_steps` of silence, and restore one that is heard again.

    In flight its weight fades to 0 and back to the configured one: a step of it would be a step of
    the commands. Before the law's first step it is set at once.
    """
    state = link.state[0]
    flying = controllers.states[0]["steps"] > 0
    for d in range(len(link.neighbours)):
        heard = link.arrived_step[d] != _NEVER_HEARD
        fresh = heard and step - link.arrived_step[d] <= state["timeout_steps"]
        edge = 1 if fresh else 0
        if edge != link.edges[d]:
            link.edges[d] = edge
            if step > 0:  # the first states are no change
                state["edge_changes"] += 1
        weight, before = edge * link.weights[d], controllers.weights[0, d]
        if flying:
            change = link.weights[d] / state["fade_steps"]
            weight = min(max(weight, before - change), before + change)
        controllers.weights[0, d] = weight


@inlined
def _some_missing(link: FormationLink, newest: int) -> bool:
    for d in range(len(link.neighbours)):
        if link.misses[d] < _NEIGHBOUR_MISSES and _is_missing(link, d, newest):
            return True
    return False


@inlined
def _is_missing(link: FormationLink, d: int, newest: int) -> bool:
    """Return whether neighbour d has sent a state that has not arrived."""
    return bool(link.heard_step[d] < newest and link.silent[d] == 0)


@inlined
def _some_given_up(link: FormationLink) -> bool:
    for d in range(len(link.neighbours)):
        if link.misses[d] >= _NEIGHBOUR_MISSES:
            return True
    return False


@inlined
def _take_neighbour_state(
    link: FormationLink, controllers: Controllers, length: int, newest: int
) -> None:
    message_id = take(link.signer, link.received, length, link.drops)
    if message_id == DROPPED:
        return
    problem: int = DropReason.UNEXPECTED
    if message_id == MessageId.NEIGHBOUR:
        expand(link.received, NEIGHBOUR_SIZE)
        problem = _store_neighbour_state(link, controllers, newest)
    if problem != 0:
        link.drops[-problem] += 1


@inlined
def _store_neighbour_state(link: FormationLink, controllers: Controllers, newest: int) -> int:
    """Store the received state: in use, or in lockstep pending if its step is not over here.

    Returns:
        0, or the `DropReason` for which the state was dropped.
    """
    d = _index_of_sender(link)
    if d < 0:
        return DropReason.STRANGER
    received = link.neighbour_state[0]
    step = int(received["step"])
    real_time = link.state[0]["real_time"] != 0
    if not _is_finite(received) or not _is_plausible(link.state[0], step, newest, real_time):
        return DropReason.OUT_OF_RANGE
    if received["frame"] > FTC_NEIGHBOUR_FRAME_REFERENCE:  # of a newer dialect
        return DropReason.OUT_OF_RANGE
    link.misses[d] = 0
    if step > newest and not real_time:
        copy_record(link.pending[d], received)
        link.pending_step[d] = step
        return 0
    if step < link.heard_step[d]:
        return DropReason.NOT_NEWER
    hear(controllers, 0, d, received)
    link.heard_step[d] = link.arrived_step[d] = step
    if real_time:  # the time of one that is ahead is not believed when the next comes
        link.heard_step[d] = min(step, newest)
        link.arrived_step[d] = min(step + link.state[0]["passed_over"], newest)
    return 0


@inlined
def _is_plausible(state: np.void, step: int, newest: int, real_time: bool) -> bool:
    """Return whether a neighbour can have come to a step.

    It is a little ahead of this autopilot at most; in real time a little ahead of the plant, which
    has gone on since it was heard of.
    """
    if step <= newest + state["timeout_steps"]:
        return True
    if not real_time:
        return False
    gone_on = (monotonic_s() - state["plant_s"]) * state["most_steps_per_s"]
    return bool(step <= state["plant_step"] + state["timeout_steps"] + gone_on)


@inlined
def _index_of_sender(link: FormationLink) -> int:
    """Return the index of the neighbour that sent the datagram from its own address, or -1."""
    system = system_of(link.received)
    for d in range(len(link.neighbours)):
        if link.neighbours[d] == system and same_address(link.addresses[d], link.sender):
            return d
    return -1


@compiled
def _is_finite(neighbour_state: np.void) -> bool:
    """Return whether a state holds finite numbers only: a NaN would spread in the formation."""
    total = neighbour_state["airspeed"] + neighbour_state["airspeed_rate"]
    total += neighbour_state["path_position"] + neighbour_state["path_rate"]
    for i in range(3):
        total += neighbour_state["attitude"][i] + neighbour_state["attitude_rate"][i]
        total += neighbour_state["position"][i] + neighbour_state["ground_velocity"][i]
    for i in range(len(neighbour_state["relayed_position"])):
        total += neighbour_state["relayed_position"][i] + neighbour_state["relayed_velocity"][i]
    return bool(np.isfinite(total))
