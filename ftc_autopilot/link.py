"""The autopilot's hot path: the compiled loop from a received state to the datagrams it causes.

For each running state: take the neighbour states of the step before, make the control step, send
an actuator message if a trigger fired (or if the plant has not acknowledged one), send the own
state to the neighbours, and in lockstep report the step done. `run` returns to Python between
steps: for a datagram that is not hot, when a time or step is reached, or when the simulation has
ended or was restarted.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ftc_autopilot.config import Neighbour
from ftc_autopilot.control.controller import no_signals
from ftc_autopilot.control.controllers import Controllers, announce, controller_step
from mavlink_defs.constants import N_CHANNELS
from mavlink_defs.dialect import (
    FTC_SIM_FLAGS_ENDED,
    FTC_SIM_FLAGS_LOCKSTEP,
    FTC_SIM_FLAGS_RUNNING,
    MAV_COMP_ID_AUTOPILOT1,
)
from mavlink_defs.endpoint import parse_address, sockaddr
from mavlink_defs.framing import codec
from mavlink_defs.framing.codec import (
    FOREIGN,
    ID_ACTUATORS,
    ID_NEIGHBOUR,
    ID_SIM_STATE,
    ID_STEP_DONE,
    NEIGHBOUR_SIZE,
    NOT_NEWER,
    OUT_OF_RANGE,
    SIGNED,
    SIM_STATE_SIZE,
    STRANGER,
    UNEXPECTED,
    expand,
    pack,
    system_of,
)
from mavlink_defs.framing.hot_signing import LinkSigner, new_link_signer, sign_frame, verify_frame
from mavlink_defs.framing.signing import FORMATION_LINK, PLANT_LINK
from mavlink_defs.runtime.jit import compiled
from mavlink_defs.runtime.native import (
    ADDRESS_SIZE,
    monotonic_s,
    receive,
    receive_from_now,
    receive_from_soon,
    receive_soon,
    same_address,
    send,
    send_to,
)

__all__ = ["FORMATION", "GCS", "OVER", "PLANT", "RESTARTED", "SERVICE", "SIMULATOR", "TICK",
           "AutopilotLink", "new_link", "reset_link", "run"]  # fmt: skip

# what `run` comes back with
SERVICE = 1  # link.received holds a datagram of state["received"] bytes that is not hot
TICK = 2  # the time or the step until which it should run has come
OVER = 3  # the plant has ended the simulation
RESTARTED = 4  # link.measured is of another plant process; nothing of the last flight holds

# rows of `AutopilotLink.drops`; the last is what the plant says of its own
GCS, FORMATION, SIMULATOR, PLANT = range(4)

_NEIGHBOUR_WAIT_S = 0.05
"""How long a lockstep step waits for a neighbour state on its way [s], over a slow relay, say."""
_NEIGHBOUR_MISSES = 5
"""Steps in a row that miss a neighbour's state before later steps stop waiting for it."""
_PATIENCE_S = 0.02
"""Real time: wait for the plant's acknowledgement [s, wall time]. In lockstep the next state has
it."""
_NEVER_HEARD = -1
_NONE = -1

LINK_STATE = np.dtype(
    [
        ("step", "i8"),  # last running step worked on, -1: none
        ("step_us", "i8"),
        ("flags", "i8"),  # FTC_SIM_FLAGS of the last state
        ("heard_s", "f8"),  # wall-clock time of the last state [s], 0: none
        ("run", "i8"),  # the plant's, -1: no state yet
        (
            "pending_usec",
            "i8",
            (N_CHANNELS,),
        ),  # time_usec of each channel's unacknowledged event, -1: none
        ("pending_s", "f8", (N_CHANNELS,)),  # wall-clock time at which it was sent last [s]
        ("repeated", "i8", (N_CHANNELS,)),  # events sent again, per channel
        ("edge_changes", "i8"),
        ("timeout_steps", "i8"),  # silence after which a neighbour is dropped
        ("sequence", "i8"),  # frames sent to the plant
        ("formation_sequence", "i8"),
        ("received", "i8"),  # length of the datagram in `received`
    ]
)


class AutopilotLink(NamedTuple):
    """Peers, counters and buffers of one autopilot."""

    state: np.ndarray  # (1,), dtype LINK_STATE
    system: int
    neighbours: np.ndarray  # (degree,), system ids
    addresses: np.ndarray  # (degree, ADDRESS_SIZE), their sockaddr
    sender: np.ndarray  # (ADDRESS_SIZE,), where `formation_received` came from
    weights: np.ndarray  # (degree,), a_ij as configured
    heard_step: np.ndarray  # (degree,), step of each neighbour's state in use
    pending: np.ndarray  # (degree,), dtype NEIGHBOUR: its state of a step that is not over here
    pending_step: np.ndarray  # (degree,), the step of that state
    misses: np.ndarray  # (degree,), steps in a row that waited for its state in vain
    drops: np.ndarray  # (4, DROPS_SIZE), datagrams dropped, by link and negated code
    sent: np.ndarray  # datagram buffer
    received: np.ndarray  # datagram buffer
    sim_state: np.ndarray  # view of `received`
    measured: np.ndarray  # (1,), dtype SIM_STATE: the last state, kept
    formation_received: np.ndarray  # datagram buffer of the formation link
    neighbour_state: np.ndarray  # view of `formation_received`
    step_done: np.ndarray  # (1,), payload
    signals: np.ndarray  # (steps,), recorded, NaN where no state came; no steps: nothing is
    plant_signer: LinkSigner
    formation_signer: LinkSigner


def new_link(
    system: int,
    neighbours: Sequence[Neighbour],
    step_us: int,
    neighbour_timeout_s: float,
    record_steps: int,
    plant_signer: LinkSigner | None = None,
    formation_signer: LinkSigner | None = None,
) -> AutopilotLink:
    """The link of an autopilot that has not heard of the plant.

    Args:
        system: Own system id.
        neighbours: Neighbours with addresses and weights.
        step_us: Control period [µs].
        neighbour_timeout_s: Simulated silence after which a neighbour is dropped [s].
        record_steps: Number of steps to keep signals of.
        plant_signer: Signs the simulator link.
        formation_signer: Signs the formation link.
    """
    degree = len(neighbours)
    state = np.zeros(1, LINK_STATE)
    state["run"] = _NONE
    state["step_us"] = step_us
    state["timeout_steps"] = round(neighbour_timeout_s * 1e6 / step_us)
    addresses = np.zeros((degree, ADDRESS_SIZE), np.uint8)
    for d, neighbour in enumerate(neighbours):
        addresses[d] = sockaddr(parse_address(neighbour.address))
    received, formation_received = codec.new_buffer(), codec.new_buffer()
    link = AutopilotLink(
        state,
        system,
        np.array([neighbour.id for neighbour in neighbours], np.int64),
        addresses,
        np.zeros(ADDRESS_SIZE, np.uint8),
        np.array([neighbour.weight for neighbour in neighbours], np.float64),
        np.zeros(degree, np.int64),
        np.zeros(degree, codec.NEIGHBOUR),
        np.zeros(degree, np.int64),
        np.zeros(degree, np.int64),
        np.zeros((4, codec.DROPS_SIZE), np.int64),
        codec.new_buffer(),
        received,
        codec.payload_view(received, codec.SIM_STATE),
        np.zeros(1, codec.SIM_STATE),
        formation_received,
        codec.payload_view(formation_received, codec.NEIGHBOUR),
        np.zeros(1, codec.STEP_DONE),
        no_signals(record_steps),
        plant_signer or new_link_signer(b"", PLANT_LINK),
        formation_signer or new_link_signer(b"", FORMATION_LINK),
    )
    reset_link(link)
    return link


def reset_link(link: AutopilotLink) -> None:
    """Forget the flight: steps, unacknowledged events, neighbours' states, recorded signals.

    Frames and drops are counted on, and the last state stays.
    """
    state = link.state
    state["step"] = state["pending_usec"] = _NONE
    state["pending_s"] = state["repeated"] = state["edge_changes"] = 0
    link.heard_step[:] = link.pending_step[:] = _NEVER_HEARD
    link.misses[:] = 0
    link.signals[:] = no_signals(len(link.signals))


@compiled
def run(
    plant_fd: int,
    formation_fd: int,
    link: AutopilotLink,
    controllers: Controllers,
    until_s: float,
    until_step: int,
) -> int:
    """Work on states until something needs Python.

    Args:
        plant_fd: Socket connected to the plant; its receive timeout bounds how late `until_s`
            is noticed.
        formation_fd: Socket bound to the own formation port, with a short receive timeout.
        link: The link.
        controllers: The controllers of one UAV.
        until_s: Wall-clock time, as `monotonic_s` gives it, at which to come back [s].
        until_step: Step after which to come back.

    Returns:
        SERVICE, TICK, OVER or RESTARTED; after the last, `reset_link` before the next call.
    """
    state = link.state[0]
    while True:
        if state["flags"] == FTC_SIM_FLAGS_RUNNING | FTC_SIM_FLAGS_LOCKSTEP:
            length = receive_soon(plant_fd, link.received)
        else:
            length = receive(plant_fd, link.received)
        if length >= 0:
            code = verify_frame(link.plant_signer, link.received, length)
            if code in (FOREIGN, SIGNED):
                state["received"] = length
                return SERVICE
            if code == ID_SIM_STATE:
                expand(link.received, SIM_STATE_SIZE)
                code = _objection(link)
                if code == 0:
                    if _is_of_another_run(link):
                        return RESTARTED
                    _work(plant_fd, formation_fd, link, controllers)
                    if state["flags"] & FTC_SIM_FLAGS_ENDED:
                        return OVER
            elif code > 0:
                code = UNEXPECTED
            if code < 0:
                link.drops[SIMULATOR, -code] += 1
        if state["step"] >= until_step or monotonic_s() >= until_s:
            return TICK


@compiled
def _objection(link: AutopilotLink) -> int:
    """Why the received state is not to be worked on: one of DROP_REASONS; 0 if it is.

    One NaN would spread through controller and formation. A square that is too large for a
    float is no state either.
    """
    if system_of(link.received) != link.system:
        return STRANGER
    sim_state = link.sim_state[0]
    total = 0.0
    for i in range(3):
        total += (
            sim_state["position"][i] ** 2
            + sim_state["velocity"][i] ** 2
            + sim_state["attitude"][i] ** 2
        )
        total += sim_state["rates"][i] ** 2 + sim_state["specific_force"][i] ** 2
    return 0 if np.isfinite(total) else OUT_OF_RANGE


@compiled
def _is_of_another_run(link: AutopilotLink) -> bool:
    """Keep the received state; tell whether another plant process than before has sent it."""
    state, sim_state = link.state[0], link.sim_state[0]
    before, run = state["run"], int(sim_state["run"])
    state["flags"] = int(sim_state["flags"])
    state["heard_s"] = monotonic_s()
    state["run"] = run
    link.measured[0] = sim_state
    return bool(before >= 0 and before != run)


@compiled
def _work(plant_fd: int, formation_fd: int, link: AutopilotLink, controllers: Controllers) -> None:
    """Answer one received state; in lockstep nothing is left to send after FTC_STEP_DONE.

    So when the next state comes, every neighbour has been sent the state of this step. A step
    that was not flown is never reported done.
    """
    state, sim_state = link.state[0], link.sim_state[0]
    step, flags = int(sim_state["step"]), int(sim_state["flags"])
    running, ended = flags & FTC_SIM_FLAGS_RUNNING, flags & FTC_SIM_FLAGS_ENDED
    lockstep = (flags & FTC_SIM_FLAGS_LOCKSTEP) != 0
    if running and state["step"] < 0:  # the first step needs neighbour states of step 0
        announce(controllers, 0, sim_state)
        _tell_neighbours(formation_fd, link, controllers)
    fresh = running and step > state["step"]
    if fresh:
        _collect_neighbour_states(formation_fd, link, controllers, step, lockstep)
        mask = controller_step(controllers, 0, sim_state, state["step_us"])
        _send_actuators(plant_fd, link, controllers, mask, lockstep)
        _tell_neighbours(formation_fd, link, controllers)
        state["step"] = step
        if step < len(link.signals):
            link.signals[step] = controllers.signals[0]
    elif not running and not ended:  # frozen: neighbours learn of each other
        announce(controllers, 0, sim_state)
        _tell_neighbours(formation_fd, link, controllers)
        _take_neighbour_states(formation_fd, link, controllers, 0)
    if ended or (running and lockstep and step == state["step"]):
        link.step_done[0]["step"] = step
        _send(plant_fd, link, link.step_done, ID_STEP_DONE)


@compiled
def _send(plant_fd: int, link: AutopilotLink, payload: np.ndarray, message_id: int) -> None:
    state = link.state[0]
    length = pack(
        link.sent, payload, message_id, link.system, MAV_COMP_ID_AUTOPILOT1, state["sequence"]
    )
    state["sequence"] += 1
    send(plant_fd, link.sent, sign_frame(link.plant_signer, link.sent, length))


@compiled
def _send_actuators(
    plant_fd: int, link: AutopilotLink, controllers: Controllers, mask: int, lockstep: bool
) -> None:
    """Send the actuator message if there was an event, or again if one was not acknowledged.

    Each message carries all four channels, so that a channel's event is acknowledged by the
    message that carried it first and by every later one.
    """
    state, sim_state = link.state[0], link.sim_state[0]
    time_usec, now_s = int(sim_state["time_usec"]), state["heard_s"]
    applied_usec = int(np.int64(sim_state["actuator_time_usec"]))  # -1: none yet
    patience_s = 0.0 if lockstep else _PATIENCE_S
    overdue = 0
    for c in range(N_CHANNELS):
        if state["pending_usec"][c] <= applied_usec:
            state["pending_usec"][c] = _NONE
        if state["pending_usec"][c] != _NONE and now_s - state["pending_s"][c] >= patience_s:
            overdue |= 1 << c
    if mask | overdue == 0:
        return
    for c in range(N_CHANNELS):
        if (mask | overdue) & (1 << c):
            state["pending_s"][c] = now_s
        if mask & (1 << c):
            state["pending_usec"][c] = time_usec
        elif overdue & (1 << c):
            state["repeated"][c] += 1
    controllers.actuators[0]["time_usec"] = time_usec
    _send(plant_fd, link, controllers.actuators, ID_ACTUATORS)


@compiled
def _tell_neighbours(formation_fd: int, link: AutopilotLink, controllers: Controllers) -> None:
    state = link.state[0]
    if len(link.neighbours) == 0:
        return
    length = pack(
        link.sent, controllers.own_states, ID_NEIGHBOUR, link.system, MAV_COMP_ID_AUTOPILOT1,
        state["formation_sequence"],
    )  # fmt: skip
    state["formation_sequence"] += 1
    length = sign_frame(link.formation_signer, link.sent, length)
    for d in range(len(link.neighbours)):
        send_to(formation_fd, link.sent, length, link.addresses[d])


@compiled
def _collect_neighbour_states(
    formation_fd: int, link: AutopilotLink, controllers: Controllers, step: int, lockstep: bool
) -> None:
    """Update the neighbour states in use before a step, and drop or restore edges.

    A step uses states of the step before, never newer ones, so that it does not matter which
    neighbour is faster. Lockstep takes no more than it needs, and waits for that.
    """
    state = link.state[0]
    newest = max(step - 1, 0)  # the first step uses the states before the start
    for d in range(len(link.neighbours)):
        if link.heard_step[d] < link.pending_step[d] <= newest:
            controllers.neighbour_states[0, d] = link.pending[d]
            link.heard_step[d] = link.pending_step[d]
    if not lockstep or _some_given_up(link):
        _take_neighbour_states(formation_fd, link, controllers, newest)
    if lockstep and _some_missing(link, newest):
        end_s = monotonic_s() + _NEIGHBOUR_WAIT_S
        while _some_missing(link, newest):
            length = receive_from_soon(formation_fd, link.formation_received, link.sender)
            if length >= 0:
                _take_neighbour_state(link, controllers, length, newest)
            elif monotonic_s() >= end_s:
                break
        for d in range(len(link.neighbours)):
            if link.heard_step[d] < newest:
                link.misses[d] += 1
    for d in range(len(link.neighbours)):
        heard = link.heard_step[d] != _NEVER_HEARD
        fresh = heard and step - link.heard_step[d] <= state["timeout_steps"]
        weight = link.weights[d] if fresh else 0.0
        if weight != controllers.weights[0, d]:
            controllers.weights[0, d] = weight
            if step > 0:  # the first states are no change
                state["edge_changes"] += 1


@compiled
def _some_missing(link: AutopilotLink, newest: int) -> bool:
    for d in range(len(link.neighbours)):
        if link.misses[d] < _NEIGHBOUR_MISSES and link.heard_step[d] < newest:
            return True
    return False


@compiled
def _some_given_up(link: AutopilotLink) -> bool:
    for d in range(len(link.neighbours)):
        if link.misses[d] >= _NEIGHBOUR_MISSES:
            return True
    return False


@compiled
def _take_neighbour_states(
    formation_fd: int, link: AutopilotLink, controllers: Controllers, newest: int
) -> None:
    while True:
        length = receive_from_now(formation_fd, link.formation_received, link.sender)
        if length < 0:
            return
        _take_neighbour_state(link, controllers, length, newest)


@compiled
def _take_neighbour_state(
    link: AutopilotLink, controllers: Controllers, length: int, newest: int
) -> None:
    """Keep a neighbour's state: in use if its step is over here, pending if not."""
    code = verify_frame(link.formation_signer, link.formation_received, length)
    if code != ID_NEIGHBOUR:
        link.drops[FORMATION, -(code if code < SIGNED else UNEXPECTED)] += 1
        return
    expand(link.formation_received, NEIGHBOUR_SIZE)
    system = system_of(link.formation_received)
    received = link.neighbour_state[0]
    step = int(received["step"])
    for d in range(len(link.neighbours)):
        if link.neighbours[d] != system or not same_address(link.addresses[d], link.sender):
            continue
        if not _is_sane(received) or step > newest + link.state[0]["timeout_steps"]:
            link.drops[FORMATION, -OUT_OF_RANGE] += 1
            return
        link.misses[d] = 0
        if step > newest:
            link.pending[d] = received
            link.pending_step[d] = step
        elif step >= link.heard_step[d]:
            controllers.neighbour_states[0, d] = received
            link.heard_step[d] = step
        else:
            link.drops[FORMATION, -NOT_NEWER] += 1
        return
    link.drops[FORMATION, -STRANGER] += 1


@compiled
def _is_sane(neighbour_state: np.void) -> bool:
    """Return whether a state holds finite numbers only: a NaN would spread in the formation."""
    total = neighbour_state["airspeed"] + neighbour_state["airspeed_rate"]
    for i in range(3):
        total += neighbour_state["attitude"][i] + neighbour_state["attitude_rate"][i]
    return bool(np.isfinite(total))
