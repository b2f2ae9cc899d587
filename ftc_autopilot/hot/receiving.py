"""What an autopilot receives of the plant: states, or sensors with the steps that they are of."""

import numpy as np

from ftc_autopilot.hot.drops import SIMULATOR
from ftc_autopilot.hot.navigation import (
    check_step,
    is_complete,
    is_estimated,
    navigate,
    note_gps,
    note_sensor,
)
from mavlink_defs.dialect import FTC_SIM_FLAGS_ENDED, FTC_SIM_FLAGS_LOCKSTEP
from mavlink_defs.framing.codec import MessageId, copy_step, system_of, unpack
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.hot_link import DROPPED, NOT_HOT, ReturnReason, take
from mavlink_defs.framing.hot_signing import LinkSigner
from mavlink_defs.runtime.jit import inlined
from mavlink_defs.runtime.memory import bytes_of, copy_record
from mavlink_defs.runtime.native import monotonic_s, receive_now, waits
from sitl_plant.vec3 import square


@inlined
def receive_states(
    length: int, plant_fd: int, own: np.void, history: np.ndarray, signer: LinkSigner
) -> ReturnReason:
    """Take a datagram of the plant, which lies in `AUTOPILOT.received`; a state is due then.

    In real time the newest state of all datagrams that wait in the socket; of sensors, until the
    step that is sent last.

    Args:
        length: Its length [bytes].
        plant_fd: Socket connected to the plant.
        own: Record of dtype `ftc_autopilot.hot.state.AUTOPILOT`.
        history: The estimator's memory.
        signer: Of the simulator link.

    Returns:
        NONE; SERVICE or RESTARTED if Python is needed.
    """
    outcome = _receive(length, own, history, signer)
    while outcome == ReturnReason.NONE and _more_may_wait(own):
        length = receive_now(plant_fd, bytes_of(own["received"]))
        if length < 0:
            break
        outcome = _receive(length, own, history, signer)
    return outcome


@inlined
def is_due(outcome: ReturnReason, plant_fd: int, own: np.void) -> bool:
    """Return whether a state is due to be answered after `receive_states`."""
    if outcome == ReturnReason.RESTARTED or own["link"]["due"] == 0:
        return False  # else there may be a newer state behind what Python is needed for
    return not (outcome == ReturnReason.SERVICE and waits(plant_fd, bytes_of(own["sent"])))


@inlined
def _more_may_wait(own: np.void) -> bool:
    """Return whether the next datagram belongs to what was received last, or replaces it."""
    state = own["link"]
    return _is_real_time(state) or (is_estimated(own["navigation"]) and state["due"] == 0)


@inlined
def _is_real_time(state: np.void) -> bool:
    """Return whether states pass without waiting for this autopilot, and another may follow."""
    waiting_or_over = FTC_SIM_FLAGS_LOCKSTEP | FTC_SIM_FLAGS_ENDED
    return bool(state["run"] >= 0 and state["flags"] & waiting_or_over == 0)


@inlined
def _receive(length: int, own: np.void, history: np.ndarray, signer: LinkSigner) -> ReturnReason:
    """Take the state that lies in `AUTOPILOT.received`, if it is one; it is due then.

    Args:
        length: Length of the datagram [bytes].
        own: Record of dtype `AUTOPILOT`.
        history: The estimator's memory.
        signer: Of the simulator link.

    Returns:
        NONE, SERVICE or RESTARTED.
    """
    state, datagram, drops = own["link"], bytes_of(own["received"]), own["drops"][SIMULATOR]
    message_id = take(signer, datagram, length, drops)
    if message_id == DROPPED:
        return ReturnReason.NONE
    if message_id == NOT_HOT:
        state["received"] = length
        return ReturnReason.SERVICE
    if is_estimated(own["navigation"]):
        return _receive_sensors(message_id, own, history)
    problem: int = DropReason.UNEXPECTED
    if message_id == MessageId.SIM_STATE:
        problem = _check_state(own)
    if problem != 0:
        drops[-problem] += 1
        return ReturnReason.NONE
    before, sim_state = state["run"], own["sim_state"]
    if _is_news(state, own["measured"], sim_state):
        copy_record(own["measured"], sim_state)
    return ReturnReason.RESTARTED if before >= 0 and before != state["run"] else ReturnReason.NONE


@inlined
def _receive_sensors(message_id: int, own: np.void, history: np.ndarray) -> ReturnReason:
    """Note sensors, and with their step bring the estimate up to it; it is due then.

    Args:
        message_id: Of the message in `AUTOPILOT.received`, which is intact.
        own: Record of dtype `AUTOPILOT`.
        history: The estimator's memory.

    Returns:
        NONE or RESTARTED.
    """
    state, navigation, measured = own["link"], own["navigation"], own["measured"]
    received, sim_step = bytes_of(own["received"]), own["sim_step"]
    problem: int = DropReason.UNEXPECTED
    is_step = message_id == MessageId.SIM_STEP
    if system_of(received) != own["system"]:
        problem = DropReason.STRANGER
    elif message_id == MessageId.SENSOR:
        unpack(received, bytes_of(own["sensor"]))
        problem = note_sensor(navigation, history, own["sensor"], measured)
    elif message_id == MessageId.GPS:
        unpack(received, bytes_of(own["gps"]))
        problem = note_gps(navigation, own["gps"])
    elif is_step:
        unpack(received, bytes_of(sim_step))
        problem = check_step(navigation, sim_step)
    if problem != 0:
        own["drops"][SIMULATOR][-problem] += 1
        return ReturnReason.NONE
    before = state["run"]
    if not is_step:
        return ReturnReason.NONE
    restarted = before >= 0 and before != np.int64(sim_step["run"])
    if not restarted and not is_complete(navigation, sim_step):
        state["heard_s"] = monotonic_s()
        return ReturnReason.NONE
    if _is_news(state, measured, sim_step):
        if restarted:
            copy_step(sim_step, measured)
            return ReturnReason.RESTARTED
        navigate(navigation, history, sim_step, measured)
        state["flags"] = int(measured["flags"])
    return ReturnReason.NONE


@inlined
def _check_state(own: np.void) -> int:
    """Return 0 if the received state is valid, otherwise a `DropReason`.

    One NaN would spread through controller and formation. A number whose square is too large for
    a float is refused, too.
    """
    received, sim_state = bytes_of(own["received"]), own["sim_state"]
    unpack(received, bytes_of(sim_state))
    if system_of(received) != own["system"]:
        return DropReason.STRANGER
    total = 0.0
    for i in range(3):
        total += square(sim_state["position"][i]) + square(sim_state["velocity"][i])
        total += square(sim_state["attitude"][i]) + square(sim_state["rates"][i])
        total += square(sim_state["specific_force"][i]) + square(sim_state["wind"][i])
    return 0 if np.isfinite(total) else DropReason.OUT_OF_RANGE


@inlined
def _is_news(state: np.void, measured: np.void, received: np.void) -> bool:
    """Note that a state has come; return whether it is to be handled.

    In real time one that was overtaken on its way is not.

    Args:
        state: Of the link.
        measured: The last state.
        received: The one that has come, or its FTC_SIM_STEP.
    """
    run, step, flags = int(received["run"]), int(received["step"]), int(received["flags"])
    state["heard_s"] = monotonic_s()
    overtaken = state["run"] == run and step < int(measured["step"])
    if overtaken and not flags & FTC_SIM_FLAGS_LOCKSTEP:
        return False
    state["flags"], state["run"], state["due"] = flags, run, 1
    return True
