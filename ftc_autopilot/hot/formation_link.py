"""The formation link: own states to the neighbours, their states into the control step.

In lockstep a step uses neighbour states of the step before. A state of a later step is pending
until its turn comes, so that it does not matter which neighbour is faster. The plant reports which
autopilots sent nothing in the step before; the states of all others are waited for.

In real time a step uses the newest state of each neighbour. If it is of a later step than the own,
this autopilot is late, not the neighbour wrong, as long as the plant can be there.
"""

from collections.abc import Sequence

import numpy as np

from ftc_autopilot.control.config import Neighbour
from ftc_autopilot.control.stepping import hear
from ftc_autopilot.guidance.formation import MAX_MEMBERS
from ftc_autopilot.hot.drops import FORMATION
from mavlink_defs.dialect import FTC_NEIGHBOUR_FRAME_REFERENCE, MAV_COMP_ID_AUTOPILOT1
from mavlink_defs.endpoint import parse_address
from mavlink_defs.framing.codec import MessageId, pack_bytes, system_of, unpack
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.hot_link import DROPPED, take
from mavlink_defs.framing.hot_signing import LinkSigner, sign_frame
from mavlink_defs.runtime.jit import compiled, inlined
from mavlink_defs.runtime.memory import bytes_of, copy_record
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
MAX_SPEED = 100.0
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
        ("listening", "i8"),  # foreign UAVs that are sent the own state, and send none
        ("listeners", "u1", (MAX_MEMBERS, ADDRESS_SIZE)),  # the sockaddr of each
    ]
)


def join_neighbours(edges: np.ndarray, neighbours: Sequence[Neighbour]) -> None:
    """Write who the neighbours are; nothing was received from any of them.

    Args:
        edges: Of one UAV, dtype `EDGE`, shape (degree,), updated in place.
        neighbours: Neighbours with addresses and weights.
    """
    for edge, neighbour in zip(edges, neighbours, strict=True):
        edge["system"], edge["configured"] = neighbour.id, neighbour.weight
        edge["address"] = sockaddr(parse_address(neighbour.address))
    forget_neighbours(edges)


def join_listeners(state: np.void, addresses: Sequence[str]) -> None:
    """Write which foreign UAVs are sent the own state.

    Args:
        state: Record of dtype `FORMATION_STATE`, updated in place.
        addresses: Where their bridges receive it.
    """
    state["listening"] = len(addresses)
    for row, address in zip(state["listeners"], addresses, strict=False):
        row[:] = sockaddr(parse_address(address))


def forget_neighbours(edges: np.ndarray) -> None:
    """Forget the neighbours' states."""
    for name in ("heard_step", "pending_step", "arrived_step"):
        edges[name] = _NEVER_HEARD
    for name in ("edge", "silent", "misses"):
        edges[name] = 0


@compiled
def send_own_state(fd: int, own: np.void, edges: np.ndarray, signer: LinkSigner) -> None:
    """Send the own state to every neighbour, and to the foreign UAVs that listen.

    Args:
        fd: Socket bound to the own formation port.
        own: Record of dtype `ftc_autopilot.hot.state.AUTOPILOT`; its state is as
            `publish_own_state` or `controller_step` left it.
        edges: Of the neighbours, dtype `EDGE`.
        signer: Of the formation link.
    """
    state, datagram = own["formation"], bytes_of(own["sent"])
    if len(edges) + state["listening"] == 0:
        return
    length = pack_bytes(
        datagram,
        bytes_of(own["uav"]["own_state"]),
        MessageId.NEIGHBOUR,
        own["system"],
        MAV_COMP_ID_AUTOPILOT1,
        state["sequence"],
    )
    state["sequence"] += 1
    length = sign_frame(signer, datagram, length)
    for d in range(len(edges)):
        send_to(fd, datagram, length, edges[d]["address"])
    for d in range(state["listening"]):
        send_to(fd, datagram, length, state["listeners"][d])


@inlined
def note_plant(state: np.void, lockstep: bool, passed_over: int, step: int, heard_s: float) -> None:
    """Note how far the plant is.

    Args:
        state: Record of dtype `FORMATION_STATE`.
        lockstep: Whether it waits for this autopilot.
        passed_over: Steps that this autopilot has missed before the present one.
        step: Step that the plant is known to have reached.
        heard_s: When, as `monotonic_s` gives it [s].
    """
    state["real_time"], state["passed_over"] = 0 if lockstep else 1, passed_over
    state["plant_step"], state["plant_s"] = step, heard_s


@inlined
def note_silent_neighbours(edges: np.ndarray, silent: np.ndarray) -> None:
    """Note which neighbours sent nothing in the step before, by FTC_SIM_STATE.silent."""
    for d in range(len(edges)):
        system = edges[d]["system"]
        edges[d]["silent"] = (np.int64(silent[system >> 3]) >> (system & 7)) & 1


@inlined
def collect_neighbour_states(
    fd: int, own: np.void, edges: np.ndarray, signer: LinkSigner, step: int, lockstep: bool
) -> None:
    """Update the neighbour states in use before a step, and drop or restore edges.

    Lockstep receives no more than the step needs, and waits for that.

    Args:
        fd: Socket bound to the own formation port, with a short receive timeout.
        own: Record of dtype `AUTOPILOT`.
        edges: Of its neighbours; messages and weights are updated.
        signer: Of the formation link.
        step: Step that is about to be made.
        lockstep: Whether simulated time waits for this step.
    """
    datagram = bytes_of(own["heard"])
    newest = max(step - 1, 0)  # the first step uses the states before the start
    for d in range(len(edges)):
        edge = edges[d]
        if edge["heard_step"] < edge["pending_step"] <= newest:
            hear(own["uav"], edges, d, edge["pending"])
            edge["heard_step"] = edge["arrived_step"] = edge["pending_step"]
    if not lockstep or _some_given_up(edges):
        receive_neighbour_states(fd, own, edges, signer, newest)
    if lockstep and _some_missing(edges, newest):
        end_s = monotonic_s() + (_NEIGHBOUR_WAIT_S if step > 0 else _START_WAIT_S)
        while _some_missing(edges, newest):
            length = receive_from_soon(fd, datagram, own["sender"])
            if length >= 0:
                _take_neighbour_state(own, edges, signer, length, newest)
            elif monotonic_s() >= end_s:
                break
        for d in range(len(edges)):
            if _is_missing(edges[d], newest):
                edges[d]["misses"] += 1
    _update_edges(own["formation"], edges, step, own["uav"]["controller"]["steps"] > 0)


@compiled
def receive_neighbour_states(
    fd: int, own: np.void, edges: np.ndarray, signer: LinkSigner, newest: int
) -> None:
    """Take all datagrams that wait in the socket.

    Args:
        fd: Socket bound to the own formation port.
        own: Record of dtype `AUTOPILOT`.
        edges: Of its neighbours; messages are updated.
        signer: Of the formation link.
        newest: Last step whose states are for use; in lockstep later ones become pending.
    """
    datagram = bytes_of(own["heard"])
    while True:
        length = receive_from_now(fd, datagram, own["sender"])
        if length < 0:
            return
        _take_neighbour_state(own, edges, signer, length, newest)


@inlined
def _update_edges(state: np.void, edges: np.ndarray, step: int, flying: bool) -> None:
    """Drop a neighbour after `timeout_steps` of silence, and restore one that is heard again.

    In flight its weight fades to 0 and back to the configured one: a step of it would be a step of
    the commands. Before the law's first step it is set at once.
    """
    for d in range(len(edges)):
        edge = edges[d]
        heard = edge["arrived_step"] != _NEVER_HEARD
        fresh = 1 if heard and step - edge["arrived_step"] <= state["timeout_steps"] else 0
        if fresh != edge["edge"]:
            edge["edge"] = fresh
            if step > 0:  # the first states are no change
                state["edge_changes"] += 1
        weight, before = fresh * edge["configured"], edge["weight"]
        if flying:
            change = edge["configured"] / state["fade_steps"]
            weight = min(max(weight, before - change), before + change)
        edge["weight"] = weight


@inlined
def _some_missing(edges: np.ndarray, newest: int) -> bool:
    for d in range(len(edges)):
        if edges[d]["misses"] < _NEIGHBOUR_MISSES and _is_missing(edges[d], newest):
            return True
    return False


@inlined
def _is_missing(edge: np.void, newest: int) -> bool:
    """Return whether a neighbour has sent a state that has not arrived."""
    return bool(edge["heard_step"] < newest and edge["silent"] == 0)


@inlined
def _some_given_up(edges: np.ndarray) -> bool:
    for d in range(len(edges)):
        if edges[d]["misses"] >= _NEIGHBOUR_MISSES:
            return True
    return False


@inlined
def _take_neighbour_state(
    own: np.void, edges: np.ndarray, signer: LinkSigner, length: int, newest: int
) -> None:
    datagram, drops = bytes_of(own["heard"]), own["drops"][FORMATION]
    message_id = take(signer, datagram, length, drops)
    if message_id == DROPPED:
        return
    problem: int = DropReason.UNEXPECTED
    if message_id == MessageId.NEIGHBOUR:
        unpack(datagram, bytes_of(own["neighbour"]))
        problem = _store_neighbour_state(own, edges, newest)
    if problem != 0:
        drops[-problem] += 1


@inlined
def _store_neighbour_state(own: np.void, edges: np.ndarray, newest: int) -> int:
    """Store the received state: in use, or in lockstep pending if its step is not over here.

    Returns:
        0, or the `DropReason` for which the state was dropped.
    """
    d = _index_of_sender(own, edges)
    if d < 0:
        return DropReason.STRANGER
    received, state = own["neighbour"], own["formation"]
    step = int(received["step"])
    real_time = state["real_time"] != 0
    if not _is_finite(received) or not _is_plausible(state, step, newest, real_time):
        return DropReason.OUT_OF_RANGE
    if received["frame"] > FTC_NEIGHBOUR_FRAME_REFERENCE:  # of a newer dialect
        return DropReason.OUT_OF_RANGE
    edge = edges[d]
    edge["misses"] = 0
    if step > newest and not real_time:
        copy_record(edge["pending"], received)
        edge["pending_step"] = step
        return 0
    if step < edge["heard_step"]:
        return DropReason.NOT_NEWER
    hear(own["uav"], edges, d, received)
    edge["heard_step"] = edge["arrived_step"] = step
    if real_time:  # the time of one that is ahead is not believed when the next comes
        edge["heard_step"] = min(step, newest)
        edge["arrived_step"] = min(step + state["passed_over"], newest)
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
def _index_of_sender(own: np.void, edges: np.ndarray) -> int:
    """Return the index of the neighbour that sent the datagram from its own address, or -1."""
    system = system_of(bytes_of(own["heard"]))
    for d in range(len(edges)):
        if edges[d]["system"] == system and same_address(edges[d]["address"], own["sender"]):
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
