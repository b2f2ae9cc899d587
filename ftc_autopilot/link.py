"""The autopilot's hot path: the compiled loop from a received state to the datagrams it causes.

For each running state: take the neighbour states of the step before, make the control step, send
an actuator message if a trigger fired (or if the plant has not acknowledged one), send the own
state to the neighbours if it is due, and in lockstep report the step done. `run` returns to Python
between steps: for a datagram that is not hot, when a time or step is reached, or when the
simulation has ended or was restarted.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ftc_autopilot.acknowledgement import ACKNOWLEDGEMENT, NONE, note_delay, note_events
from ftc_autopilot.config import Neighbour
from ftc_autopilot.control.controller import SIGNALS
from ftc_autopilot.control.controllers import Controllers
from ftc_autopilot.control.stepping import announce, controller_step, tell_neighbours
from ftc_autopilot.formation_link import (
    FormationLink,
    collect_neighbour_states,
    new_formation_link,
    note_silent_neighbours,
    receive_neighbour_states,
    reset_formation_link,
    send_own_state,
)
from ftc_autopilot.kept_state import KeptState, keep, no_kept_state
from mavlink_defs.dialect import (
    FTC_SIM_FLAGS_ENDED,
    FTC_SIM_FLAGS_LOCKSTEP,
    FTC_SIM_FLAGS_RUNNING,
    MAV_COMP_ID_AUTOPILOT1,
)
from mavlink_defs.framing import codec
from mavlink_defs.framing.codec import (
    SIM_STATE_SIZE,
    MessageId,
    expand,
    pack,
    system_of,
)
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.hot_link import DROPPED, NOT_HOT, Outcome, take
from mavlink_defs.framing.hot_signing import LinkSigner, new_link_signer, sign_frame
from mavlink_defs.framing.signing import FORMATION_LINK, PLANT_LINK
from mavlink_defs.runtime.jit import compiled, inlined
from mavlink_defs.runtime.memory import borrowed, copy_record
from mavlink_defs.runtime.native import (
    POLLED,
    READABLE,
    monotonic_s,
    receive,
    receive_soon,
    send,
    wait_for_any,
    waits,
)

__all__ = [
    "FORMATION",
    "GCS",
    "PLANT",
    "SIMULATOR",
    "AutopilotLink",
    "SimulatorLink",
    "new_link",
    "records_to_keep",
    "reset_link",
    "run",
]

# rows of `AutopilotLink.drops`; the last holds the plant's own counts, as it reports them
GCS, FORMATION, SIMULATOR, PLANT = range(4)

_LOOK_S = 0.002
"""Lockstep: time between two looks for a datagram of a ground station [s]."""
_EDGE_FADE_S = 0.5
"""Simulated time in which a dropped neighbour's weight goes to 0, and back [s]."""

LINK_STATE = np.dtype(
    [
        ("step", "i8"),  # last running step worked on, -1: none
        ("step_us", "i8"),
        ("flags", "i8"),  # FTC_SIM_FLAGS of the last state
        ("heard_s", "f8"),  # wall-clock time of the last state [s], 0: none
        ("run", "i8"),  # the plant's, -1: no state yet
        *ACKNOWLEDGEMENT,
        ("sequence", "i8"),  # frames sent to the plant
        ("received", "i8"),  # length of the datagram in `SimulatorLink.received`
        ("away", "i8"),  # lockstep: steps to let pass before control is taken up again
        ("recorded", "i8"),  # rows of the record in use
    ]
)


class SimulatorLink(NamedTuple):
    """Buffers of the link to the plant."""

    system: int
    measured: np.ndarray  # (1,), dtype SIM_STATE: the last state, kept
    drops: np.ndarray  # (DROPS_SIZE,), datagrams dropped, by negated `DropReason`
    sent: np.ndarray  # datagram buffer
    received: np.ndarray  # datagram buffer
    sim_state: np.ndarray  # view of `received`
    step_done: np.ndarray  # (1,), payload
    signer: LinkSigner


RECORD = np.dtype([("step", "i8"), ("signals", SIGNALS)])
"""What is recorded of a step."""


class AutopilotLink(NamedTuple):
    """Both hot links of one autopilot, and what is recorded of its steps."""

    state: np.ndarray  # (1,), dtype LINK_STATE
    simulator: SimulatorLink
    formation: FormationLink
    drops: np.ndarray  # (4, DROPS_SIZE), datagrams dropped, by link and negated `DropReason`
    record: np.ndarray  # dtype RECORD; empty if nothing is recorded. Python empties it
    kept: KeptState


def new_link(
    system: int,
    neighbours: Sequence[Neighbour],
    step_us: int,
    neighbour_timeout_s: float,
    record_rows: int,
    plant_signer: LinkSigner | None = None,
    formation_signer: LinkSigner | None = None,
) -> AutopilotLink:
    """Return the links of an autopilot that has received nothing from the plant.

    Args:
        system: Own system id.
        neighbours: Neighbours with addresses and weights.
        step_us: Control period [µs].
        neighbour_timeout_s: Simulated silence after which a neighbour is dropped [s].
        record_rows: Steps whose record there is room for; 0 to record nothing.
        plant_signer: Signs the simulator link.
        formation_signer: Signs the formation link.
    """
    state = np.zeros(1, LINK_STATE)
    state["run"] = NONE
    state["step_us"] = step_us
    drops = np.zeros((4, codec.DROPS_SIZE), np.int64)
    received = codec.new_buffer()
    simulator = SimulatorLink(
        system=system,
        measured=np.zeros(1, codec.SIM_STATE),
        drops=drops[SIMULATOR],
        sent=codec.new_buffer(),
        received=received,
        sim_state=codec.payload_view(received, codec.SIM_STATE),
        step_done=np.zeros(1, codec.STEP_DONE),
        signer=plant_signer or new_link_signer(b"", PLANT_LINK),
    )
    formation = new_formation_link(
        system,
        neighbours,
        timeout_steps=round(neighbour_timeout_s * 1e6 / step_us),
        fade_steps=max(round(_EDGE_FADE_S * 1e6 / step_us), 1),
        drops=drops[FORMATION],
        signer=formation_signer or new_link_signer(b"", FORMATION_LINK),
    )
    link = AutopilotLink(
        state=state,
        simulator=simulator,
        formation=formation,
        drops=drops,
        record=np.zeros(record_rows, RECORD),
        kept=no_kept_state(),
    )
    reset_link(link)
    return link


def records_to_keep(
    link: AutopilotLink, controllers: Controllers, vehicle: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Return what `ftc_autopilot.kept_state` keeps of an autopilot, its vehicle's record last."""
    return (
        link.state,
        link.formation.state,
        controllers.parameters,
        controllers.states,
        controllers.guidance,
        controllers.formations,
        controllers.profiles,
        controllers.actuators,
        controllers.neighbour_states,
        controllers.weights,
        controllers.told,
        vehicle,
    )


def reset_link(link: AutopilotLink) -> None:
    """Forget the flight: steps, unacknowledged events, neighbour states, the record.

    Frames and drops are counted on, and the last state stays.
    """
    state = link.state
    state["step"] = state["pending_usec"] = state["applied_usec"] = state["delay"] = NONE
    state["pending_step"] = state["repeated"] = state["deviation"] = state["recorded"] = 0
    reset_formation_link(link.formation)


@compiled
def run(
    plant_fd: int,
    formation_fd: int,
    gcs_fd: int,
    link: AutopilotLink,
    controllers: Controllers,
    until_s: float,
    until_step: int,
) -> Outcome:
    """Work on states until something needs Python.

    Args:
        plant_fd: Socket connected to the plant; its receive timeout bounds how late `until_s`
            is noticed.
        formation_fd: Socket bound to the own formation port, with a short receive timeout.
        gcs_fd: Socket of the ground stations; a datagram there ends the work, except in real time
            and before the plant was heard, where `until_s` is soon enough.
        link: The link.
        controllers: The controllers of one UAV.
        until_s: Wall-clock time, as `monotonic_s` gives it, at which to return [s].
        until_step: Step after which to return.

    Returns:
        SERVICE, TICK (also when the record is full), OVER or RESTARTED; after the last,
        `reset_link` before the next call.
    """
    link, controllers = borrowed(link), borrowed(controllers)
    state, simulator = link.state[0], link.simulator
    look_s = monotonic_s() + _LOOK_S
    while True:
        lockstep = state["flags"] == FTC_SIM_FLAGS_RUNNING | FTC_SIM_FLAGS_LOCKSTEP
        if lockstep:
            length = receive_soon(plant_fd, simulator.received)
        else:
            frozen = state["run"] != NONE and (state["flags"] & FTC_SIM_FLAGS_RUNNING) == 0
            if frozen and not _plant_is_first(plant_fd, gcs_fd, until_s):
                return Outcome.TICK
            length = receive(plant_fd, simulator.received)
        if length >= 0:
            message_id = take(simulator.signer, simulator.received, length, simulator.drops)
            if message_id == NOT_HOT:
                state["received"] = length
                return Outcome.SERVICE
            if message_id != DROPPED:
                problem: int = DropReason.UNEXPECTED
                if message_id == MessageId.SIM_STATE:
                    problem = _check_state(simulator)
                if problem != 0:
                    simulator.drops[-problem] += 1
                elif _is_of_another_run(link):
                    return Outcome.RESTARTED
                else:
                    _work(plant_fd, formation_fd, link, controllers)
                    if state["flags"] & FTC_SIM_FLAGS_ENDED:
                        return Outcome.OVER
        full = 0 < len(link.record) == state["recorded"]
        now_s = monotonic_s()
        if full or state["step"] >= until_step or now_s >= until_s:
            return Outcome.TICK
        if lockstep and now_s >= look_s:
            look_s = now_s + _LOOK_S
            if waits(gcs_fd, simulator.received):
                return Outcome.TICK


@compiled
def _plant_is_first(plant_fd: int, gcs_fd: int, until_s: float) -> bool:
    """Wait for plant or ground station until a time [s]; return whether the plant has sent."""
    links = np.zeros(2, POLLED)
    links[0]["fd"], links[1]["fd"] = plant_fd, gcs_fd
    links[0]["events"] = links[1]["events"] = READABLE
    wait_for_any(links, max(until_s - monotonic_s(), 0.0))
    return bool(links[0]["found"] != 0)


@inlined
def _check_state(link: SimulatorLink) -> int:
    """Return 0 if the received state is valid, otherwise a `DropReason`.

    One NaN would spread through controller and formation. A number whose square is too large for
    a float is refused, too.
    """
    expand(link.received, SIM_STATE_SIZE)
    if system_of(link.received) != link.system:
        return DropReason.STRANGER
    sim_state = link.sim_state[0]
    total = 0.0
    for i in range(3):
        total += sim_state["position"][i] ** 2 + sim_state["velocity"][i] ** 2
        total += sim_state["attitude"][i] ** 2 + sim_state["rates"][i] ** 2
        total += sim_state["specific_force"][i] ** 2 + sim_state["wind"][i] ** 2
    return 0 if np.isfinite(total) else DropReason.OUT_OF_RANGE


@inlined
def _is_of_another_run(link: AutopilotLink) -> bool:
    """Keep the received state; return whether another plant process than before has sent it."""
    state, sim_state = link.state[0], link.simulator.sim_state[0]
    before, run = state["run"], int(sim_state["run"])
    state["flags"] = int(sim_state["flags"])
    state["heard_s"] = monotonic_s()
    state["run"] = run
    copy_record(link.simulator.measured[0], sim_state)
    return bool(before >= 0 and before != run)


@inlined
def _work(plant_fd: int, formation_fd: int, link: AutopilotLink, controllers: Controllers) -> None:
    """Answer one received state; in lockstep nothing is left to send after FTC_STEP_DONE.

    So when the next state comes, every neighbour has been sent the message of this step, if there
    is one; whether there is, the plant hears with FTC_STEP_DONE and passes on with the next state.
    A step that was not flown is never reported done.
    """
    state, sim_state = link.state[0], link.simulator.sim_state[0]
    formation, step, flags = link.formation, int(sim_state["step"]), int(sim_state["flags"])
    running, ended = flags & FTC_SIM_FLAGS_RUNNING, flags & FTC_SIM_FLAGS_ENDED
    lockstep = (flags & FTC_SIM_FLAGS_LOCKSTEP) != 0
    if running and state["step"] < 0:  # the first step needs neighbour states of step 0
        announce(controllers, 0, sim_state)
        send_own_state(formation_fd, formation, controllers)
    fresh = running and step > state["step"]
    if fresh and lockstep and state["away"] > 0:
        state["away"] -= 1
        state["step"] = step
        note_silent_neighbours(formation, sim_state["silent"])
        receive_neighbour_states(formation_fd, formation, controllers, step - 1)
        link.simulator.step_done[0]["silent"] = 1
    elif fresh:
        note_silent_neighbours(formation, sim_state["silent"])
        collect_neighbour_states(formation_fd, formation, controllers, step, lockstep)
        if not lockstep:
            controllers.delays[0]["periods"] = note_delay(state, sim_state)
        mask = controller_step(controllers, 0, sim_state, state["step_us"])
        told = tell_neighbours(controllers, 0, step, state["step_us"])
        state["step"] = step
        row = state["recorded"]
        if row < len(link.record):
            link.record[row]["step"] = step
            copy_record(link.record[row]["signals"], controllers.signals[0])
            state["recorded"] = row + 1
        due = note_events(state, sim_state, controllers, mask, lockstep)
        keep(link.kept)
        if due:
            _send(plant_fd, link, controllers.actuators, MessageId.ACTUATORS)
        if told:
            send_own_state(formation_fd, formation, controllers)
        link.simulator.step_done[0]["silent"] = 0 if told else 1
    elif not running and not ended:  # frozen: neighbours learn of each other
        announce(controllers, 0, sim_state)
        send_own_state(formation_fd, formation, controllers)
        receive_neighbour_states(formation_fd, formation, controllers, 0)
    if ended or (running and lockstep and step == state["step"]):
        link.simulator.step_done[0]["step"] = step
        _send(plant_fd, link, link.simulator.step_done, MessageId.STEP_DONE)


@inlined
def _send(plant_fd: int, link: AutopilotLink, payload: np.ndarray, message_id: int) -> None:
    state, simulator = link.state[0], link.simulator
    length = pack(
        simulator.sent,
        payload,
        message_id,
        simulator.system,
        MAV_COMP_ID_AUTOPILOT1,
        state["sequence"],
    )
    state["sequence"] += 1
    send(plant_fd, simulator.sent, sign_frame(simulator.signer, simulator.sent, length))
