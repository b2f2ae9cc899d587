"""The autopilot's hot path, compiled: from a received state to the datagrams it causes.

In lockstep every state is handled. In real time the newest that has come is, and those before it
are passed over: an autopilot that was kept waiting for the processor misses steps, but is not late.

For each running state: take the neighbour states of the step before, make the control step, send
an actuator message if a trigger fired (or if the plant has not acknowledged one), send the own
state to the neighbours if it is due, and in lockstep report the step done.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ftc_autopilot.control.config import Neighbour
from ftc_autopilot.control.controller import SIGNALS
from ftc_autopilot.control.controllers import Controllers, without_plugin
from ftc_autopilot.control.laws import PLUGIN_LAW
from ftc_autopilot.control.stepping import (
    publish_own_state,
)
from ftc_autopilot.hot.acknowledgement import ACKNOWLEDGEMENT, NONE, note_delay, note_events
from ftc_autopilot.hot.checkpoint import Checkpoint, no_checkpoint, save
from ftc_autopilot.hot.formation_link import (
    FormationLink,
    collect_neighbour_states,
    new_formation_link,
    note_plant,
    note_silent_neighbours,
    receive_neighbour_states,
    reset_formation_link,
    send_own_state,
)
from ftc_autopilot.hot.navigation import ESTIMATED, Navigation, write_estimate
from ftc_autopilot.hot.state_age import STATE_AGE, forget_age, note_age
from mavlink_defs.dialect import (
    FTC_SIM_FLAGS_ENDED,
    FTC_SIM_FLAGS_LOCKSTEP,
    FTC_SIM_FLAGS_RUNNING,
    MAV_COMP_ID_AUTOPILOT1,
)
from mavlink_defs.framing import codec
from mavlink_defs.framing.codec import MessageId, pack
from mavlink_defs.framing.hot_signing import LinkSigner, new_link_signer, sign_frame
from mavlink_defs.framing.signing import FORMATION_LINK, PLANT_LINK
from mavlink_defs.runtime.jit import inlined
from mavlink_defs.runtime.memory import copy_record
from mavlink_defs.runtime.native import send

# rows of `AutopilotLink.drops`; the last holds the plant's own counts, as it reports them
GCS, FORMATION, SIMULATOR, PLANT = range(4)

_NO_HISTORY = np.zeros(0)
_EDGE_FADE_S = 0.5
"""Simulated time in which a dropped neighbour's weight goes to 0, and back [s]."""

LINK_STATE = np.dtype(
    [
        ("step", "i8"),  # last running step handled, -1: none
        ("step_us", "i8"),
        ("flags", "i8"),  # FTC_SIM_FLAGS of the last state
        ("heard_s", "f8"),  # wall-clock time of the last state [s], 0: none
        ("run", "i8"),  # the plant's, -1: no state yet
        ("due", "i8"),  # 1: the last state is not handled yet
        *ACKNOWLEDGEMENT,
        *STATE_AGE,
        ("sequence", "i8"),  # frames sent to the plant
        ("received", "i8"),  # length of the datagram in `SimulatorLink.received`
        ("away", "i8"),  # lockstep: steps to let pass before control resumes
        ("recorded", "i8"),  # rows of the record in use
    ]
)


class SimulatorLink(NamedTuple):
    """Buffers of the link to the plant."""

    system: int
    measured: np.ndarray  # (1,), dtype SIM_STATE: the last state, received or estimated
    drops: np.ndarray  # (DROPS_SIZE,), datagrams dropped, by negated `DropReason`
    sent: np.ndarray  # datagram buffer
    received: np.ndarray  # datagram buffer
    sim_state: np.ndarray  # views of `received`
    sim_step: np.ndarray
    sensor: np.ndarray
    gps: np.ndarray
    step_done: np.ndarray  # (1,), payload
    signer: LinkSigner


RECORD = np.dtype([("step", "i8"), ("signals", SIGNALS)])
"""What is recorded of a step."""


class AutopilotLink(NamedTuple):
    """Both hot links of one autopilot, and what is recorded of its steps."""

    state: np.ndarray  # (1,), dtype LINK_STATE
    simulator: SimulatorLink
    navigation: Navigation
    formation: FormationLink
    drops: np.ndarray  # (4, DROPS_SIZE), datagrams dropped, by link and negated `DropReason`
    record: np.ndarray  # dtype RECORD; empty if nothing is recorded. Python empties it
    estimates: np.ndarray  # (rows of `record`, ESTIMATED): the state by which each step was flown
    checkpoint: Checkpoint


def new_link(
    system: int,
    neighbours: Sequence[Neighbour],
    step_us: int,
    neighbour_timeout_s: float,
    record_rows: int,
    navigation: Navigation,
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
        navigation: What it makes of sensors.
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
        sim_step=codec.payload_view(received, codec.SIM_STEP),
        sensor=codec.payload_view(received, codec.HIL_SENSOR),
        gps=codec.payload_view(received, codec.HIL_GPS),
        step_done=np.zeros(1, codec.STEP_DONE),
        signer=plant_signer or new_link_signer(b"", PLANT_LINK),
    )
    formation = new_formation_link(
        system,
        neighbours,
        timeout_steps=round(neighbour_timeout_s * 1e6 / step_us),
        fade_steps=max(round(_EDGE_FADE_S * 1e6 / step_us), 1),
        steps_per_s=1e6 / step_us,
        drops=drops[FORMATION],
        signer=formation_signer or new_link_signer(b"", FORMATION_LINK),
    )
    link = AutopilotLink(
        state=state,
        simulator=simulator,
        navigation=navigation,
        formation=formation,
        drops=drops,
        record=np.zeros(record_rows, RECORD),
        estimates=np.zeros((record_rows if len(navigation.imus) else 0, ESTIMATED)),
        checkpoint=no_checkpoint(),
    )
    reset_link(link)
    return link


def checkpoint_records(
    link: AutopilotLink, controllers: Controllers, vehicle: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Return what a checkpoint saves of an autopilot, the record of its vehicle last.

    The area of a plug-in's law, a third of all, is left out if there is none.
    """
    is_plugin = int(controllers.parameters[0]["law"]) == PLUGIN_LAW
    return (
        link.state,
        link.formation.state,
        controllers.parameters if is_plugin else without_plugin(controllers.parameters),
        controllers.states if is_plugin else without_plugin(controllers.states),
        controllers.guidance,
        controllers.formations,
        controllers.profiles,
        controllers.actuators,
        controllers.neighbour_states,
        controllers.weights,
        controllers.last_broadcast,
        *_estimated_records(link),
        vehicle,
    )


def _estimated_records(link: AutopilotLink) -> tuple[np.ndarray, ...]:
    """Return what a checkpoint saves of an estimated state; of a true one nothing."""
    navigation = link.navigation
    estimator = navigation.estimator._replace(history=_NO_HISTORY)  # it has a file of its own
    records = link.simulator.measured, navigation.arrivals, *estimator
    return records if len(navigation.imus) else tuple(record[:0] for record in records)


def reset_link(link: AutopilotLink) -> None:
    """Forget the flight: steps, unacknowledged events, neighbour states, the record.

    Frames and drops are counted on, and the last state stays.
    """
    state = link.state
    state["step"] = state["pending_usec"] = state["applied_usec"] = state["delay"] = NONE
    state["pending_step"] = state["repeated"] = state["deviation"] = state["recorded"] = 0
    state["gap_usec"] = state["due"] = 0
    forget_age(state)
    reset_formation_link(link.formation)


@inlined
def prepare_step(
    formation_fd: int, plant_fd: int, link: AutopilotLink, controllers: Controllers
) -> bool:
    """Exchange states with the neighbours for the state that is due.

    Args:
        formation_fd: Socket bound to the own formation port, with a short receive timeout.
        plant_fd: Socket connected to the plant.
        link: The link.
        controllers: The controllers of one UAV.

    Returns:
        Whether a control step has to be made before `report_done`.
    """
    state, sim_state = link.state[0], link.simulator.measured[0]
    formation, step, flags = link.formation, int(sim_state["step"]), int(sim_state["flags"])
    running, ended = flags & FTC_SIM_FLAGS_RUNNING, flags & FTC_SIM_FLAGS_ENDED
    lockstep = (flags & FTC_SIM_FLAGS_LOCKSTEP) != 0
    state["due"] = 0
    frozen = not running and not ended
    if frozen or (running and state["step"] < 0):  # the first step needs states of step 0
        publish_own_state(controllers, 0, sim_state)
        send_own_state(formation_fd, formation, controllers.own_states)
    fresh = running != 0 and step > state["step"]
    away = fresh and lockstep and state["away"] > 0
    ahead = passed_over = 0
    if fresh and not lockstep:
        datagrams = len(link.navigation.imus) + 1
        ahead = note_age(state, plant_fd, step, 1_000_000 // state["step_us"], datagrams)
        passed_over = step - state["step"] - 1 if state["step"] >= 0 else 0
    note_plant(formation, lockstep, passed_over, step + ahead, state["heard_s"])
    if fresh:
        note_silent_neighbours(formation, sim_state["silent"])
    if frozen or away:
        receive_neighbour_states(formation_fd, formation, controllers, step - 1 if away else 0)
    if away:
        state["away"] -= 1
        state["step"] = step
        link.simulator.step_done[0]["silent"] = 1
    elif fresh:
        collect_neighbour_states(formation_fd, formation, controllers, step, lockstep)
        if not lockstep:
            controllers.delays[0]["periods"] = note_delay(state, sim_state)
    return fresh and not away


@inlined
def send_step(
    formation_fd: int,
    plant_fd: int,
    mask: int,
    broadcasts: bool,
    link: AutopilotLink,
    controllers: Controllers,
) -> None:
    """Record and send what a control step has made, if it has made anything to send.

    Args:
        formation_fd: Socket bound to the own formation port.
        plant_fd: Socket connected to the plant.
        mask: Channels that had an event, as `controller_step` returns it.
        broadcasts: Whether the own state is sent to the neighbours.
        link: The link.
        controllers: The controllers of one UAV.
    """
    state, sim_state = link.state[0], link.simulator.measured[0]
    lockstep = (int(sim_state["flags"]) & FTC_SIM_FLAGS_LOCKSTEP) != 0
    state["step"] = sim_state["step"]
    row = state["recorded"]
    if row < len(link.record):
        link.record[row]["step"] = state["step"]
        copy_record(link.record[row]["signals"], controllers.signals[0])
        if row < len(link.estimates):
            write_estimate(sim_state, link.estimates[row])
        state["recorded"] = row + 1
    due = note_events(state, sim_state, controllers, mask, lockstep)
    save(link.checkpoint)
    if due:
        _send(plant_fd, link, controllers.actuators, MessageId.ACTUATORS)
    if broadcasts:
        send_own_state(formation_fd, link.formation, controllers.own_states)
    link.simulator.step_done[0]["silent"] = 0 if broadcasts else 1


@inlined
def report_done(plant_fd: int, link: AutopilotLink) -> bool:
    """Tell a plant in lockstep that its state was answered; return whether the flight is over.

    Nothing is left to send after FTC_STEP_DONE: when the next state comes, every neighbour has
    been sent the message of this step, if there is one; whether there is, the plant hears with
    FTC_STEP_DONE and passes on with the next state. A step that was not flown is never reported.

    Args:
        plant_fd: Socket connected to the plant.
        link: The link.
    """
    sim_state, both = link.simulator.measured[0], FTC_SIM_FLAGS_RUNNING | FTC_SIM_FLAGS_LOCKSTEP
    step, flags = int(sim_state["step"]), int(sim_state["flags"])
    ended = (flags & FTC_SIM_FLAGS_ENDED) != 0
    if ended or (flags & both == both and step == link.state[0]["step"]):
        link.simulator.step_done[0]["step"] = step
        _send(plant_fd, link, link.simulator.step_done, MessageId.STEP_DONE)
    return ended


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
