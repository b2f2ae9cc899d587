"""The autopilot's hot path, compiled: from a received state to the datagrams it causes.

In lockstep every state is handled. In real time the newest that has come is, and those before it
are passed over: an autopilot that was kept waiting for the processor misses steps, but is not late.

For each running state: take the neighbour states of the step before, make the control step, send
an actuator message if a trigger fired (or if the plant has not acknowledged one), send the own
state to the neighbours if it is due, and in lockstep report the step done.
"""

import numpy as np

from ftc_autopilot.control.signals import SIGNALS
from ftc_autopilot.control.stepping import publish_own_state
from ftc_autopilot.hot.acknowledgement import ACKNOWLEDGEMENT, note_delay, note_events
from ftc_autopilot.hot.formation_link import (
    collect_neighbour_states,
    note_plant,
    note_silent_neighbours,
    receive_neighbour_states,
    send_own_state,
)
from ftc_autopilot.hot.navigation import write_estimate
from ftc_autopilot.hot.state_age import STATE_AGE, note_age
from mavlink_defs.dialect import (
    FTC_SIM_FLAGS_ENDED,
    FTC_SIM_FLAGS_LOCKSTEP,
    FTC_SIM_FLAGS_RUNNING,
    MAV_COMP_ID_AUTOPILOT1,
)
from mavlink_defs.framing.codec import MessageId, pack_bytes
from mavlink_defs.framing.hot_signing import LinkSigner, sign_frame
from mavlink_defs.runtime.jit import inlined
from mavlink_defs.runtime.memory import bytes_of, copy_record
from mavlink_defs.runtime.native import send

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
        ("received", "i8"),  # length of the datagram in `AUTOPILOT.received`
        ("away", "i8"),  # lockstep: steps to let pass before control resumes
        ("recorded", "i8"),  # rows of the record in use
    ]
)

RECORD = np.dtype([("step", "i8"), ("signals", SIGNALS)])
"""What is recorded of a step."""


@inlined
def prepare_step(
    formation_fd: int, plant_fd: int, own: np.void, edges: np.ndarray, signer: LinkSigner
) -> bool:
    """Exchange states with the neighbours for the state that is due.

    Args:
        formation_fd: Socket bound to the own formation port, with a short receive timeout.
        plant_fd: Socket connected to the plant.
        own: Record of dtype `ftc_autopilot.hot.state.AUTOPILOT`.
        edges: Of its neighbours, dtype `EDGE`.
        signer: Of the formation link.

    Returns:
        Whether a control step has to be made before `report_done`.
    """
    state, sim_state, uav = own["link"], own["measured"], own["uav"]
    step, flags = int(sim_state["step"]), int(sim_state["flags"])
    running, ended = flags & FTC_SIM_FLAGS_RUNNING, flags & FTC_SIM_FLAGS_ENDED
    lockstep = (flags & FTC_SIM_FLAGS_LOCKSTEP) != 0
    state["due"] = 0
    frozen = not running and not ended
    if frozen or (running and state["step"] < 0):  # the first step needs states of step 0
        publish_own_state(uav, sim_state)
        send_own_state(formation_fd, own, edges, signer)
    fresh = running != 0 and step > state["step"]
    away = fresh and lockstep and state["away"] > 0
    ahead = passed_over = 0
    if fresh and not lockstep:
        datagrams = own["navigation"]["count"] + 1
        ahead = note_age(state, plant_fd, step, 1_000_000 // state["step_us"], datagrams)
        passed_over = step - state["step"] - 1 if state["step"] >= 0 else 0
    note_plant(own["formation"], lockstep, passed_over, step + ahead, state["heard_s"])
    if fresh:
        note_silent_neighbours(edges, sim_state["silent"])
    if frozen or away:
        receive_neighbour_states(formation_fd, own, edges, signer, step - 1 if away else 0)
    if away:
        state["away"] -= 1
        state["step"] = step
        own["step_done"]["silent"] = 1
    elif fresh:
        collect_neighbour_states(formation_fd, own, edges, signer, step, lockstep)
        if not lockstep:
            uav["delay"]["periods"] = note_delay(state, sim_state)
    return fresh and not away


@inlined
def note_step(own: np.void, record: np.ndarray, estimates: np.ndarray, mask: int) -> bool:
    """Record what a control step has made; return whether an actuator message is due.

    Args:
        own: Record of dtype `AUTOPILOT`.
        record: Its room for steps, dtype `RECORD`, shape (rows,).
        estimates: Room for the estimates by which they are flown, shape (rows or 0, ESTIMATED).
        mask: Channels that had an event, as `controller_step` returns it.
    """
    state, sim_state, uav = own["link"], own["measured"], own["uav"]
    lockstep = (int(sim_state["flags"]) & FTC_SIM_FLAGS_LOCKSTEP) != 0
    state["step"] = sim_state["step"]
    row = state["recorded"]
    if row < len(record):
        record[row]["step"] = state["step"]
        copy_record(record[row]["signals"], uav["signals"])
        if row < len(estimates):
            write_estimate(sim_state, estimates[row])
        state["recorded"] = row + 1
    due = note_events(state, sim_state, mask, lockstep)
    if due:
        uav["actuators"]["time_usec"] = sim_state["time_usec"]
    return due


@inlined
def send_step(
    plant_fd: int,
    formation_fd: int,
    due: bool,
    broadcasts: bool,
    own: np.void,
    edges: np.ndarray,
    plant_signer: LinkSigner,
    formation_signer: LinkSigner,
) -> None:
    """Send what a control step has made, if it has made anything to send.

    Args:
        plant_fd: Socket connected to the plant.
        formation_fd: Socket bound to the own formation port.
        due: Whether the actuator message is sent.
        broadcasts: Whether the own state is sent to the neighbours.
        own: Record of dtype `AUTOPILOT`.
        edges: Of the neighbours, dtype `EDGE`.
        plant_signer: Of the simulator link.
        formation_signer: Of the formation link.
    """
    if due:
        payload = bytes_of(own["uav"]["actuators"])
        _send(plant_fd, own, payload, MessageId.ACTUATORS, plant_signer)
    if broadcasts:
        send_own_state(formation_fd, own, edges, formation_signer)
    own["step_done"]["silent"] = 0 if broadcasts else 1


@inlined
def report_done(plant_fd: int, own: np.void, signer: LinkSigner) -> bool:
    """Tell a plant in lockstep that its state was answered; return whether the flight is over.

    Nothing is left to send after FTC_STEP_DONE: when the next state comes, every neighbour has
    been sent the message of this step, if there is one; whether there is, the plant hears with
    FTC_STEP_DONE and passes on with the next state. A step that was not flown is never reported.

    Args:
        plant_fd: Socket connected to the plant.
        own: Record of dtype `AUTOPILOT`.
        signer: Of the simulator link.
    """
    sim_state, both = own["measured"], FTC_SIM_FLAGS_RUNNING | FTC_SIM_FLAGS_LOCKSTEP
    step, flags = int(sim_state["step"]), int(sim_state["flags"])
    ended = (flags & FTC_SIM_FLAGS_ENDED) != 0
    if ended or (flags & both == both and step == own["link"]["step"]):
        own["step_done"]["step"] = step
        _send(plant_fd, own, bytes_of(own["step_done"]), MessageId.STEP_DONE, signer)
    return ended


@inlined
def _send(
    plant_fd: int, own: np.void, payload: np.ndarray, message_id: int, signer: LinkSigner
) -> None:
    state, datagram = own["link"], bytes_of(own["sent"])
    length = pack_bytes(
        datagram, payload, message_id, own["system"], MAV_COMP_ID_AUTOPILOT1, state["sequence"]
    )
    state["sequence"] += 1
    send(plant_fd, datagram, sign_frame(signer, datagram, length))
