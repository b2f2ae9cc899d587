"""What an autopilot receives of the plant: states, or sensors with the steps that they are of."""

import numpy as np

from ftc_autopilot.hot.link import AutopilotLink, SimulatorLink
from ftc_autopilot.hot.navigation import (
    check_step,
    is_complete,
    is_estimated,
    navigate,
    note_gps,
    note_sensor,
)
from mavlink_defs.dialect import FTC_SIM_FLAGS_ENDED, FTC_SIM_FLAGS_LOCKSTEP
from mavlink_defs.framing.codec import (
    HIL_GPS_SIZE,
    HIL_SENSOR_SIZE,
    SIM_STATE_SIZE,
    SIM_STEP_SIZE,
    MessageId,
    copy_step,
    expand,
    system_of,
)
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.hot_link import DROPPED, NOT_HOT, Outcome, take
from mavlink_defs.runtime.jit import inlined
from mavlink_defs.runtime.memory import copy_record
from mavlink_defs.runtime.native import monotonic_s, receive_now, waits


@inlined
def receive_states(length: int, plant_fd: int, link: AutopilotLink) -> Outcome:
    """Take a datagram of the plant, which lies in `SimulatorLink.received`; a state is due then.

    In real time the newest state of all datagrams that wait in the socket; of sensors, until the
    step that is sent last.

    Args:
        length: Its length [bytes].
        plant_fd: Socket connected to the plant.
        link: The link.

    Returns:
        NONE; SERVICE or RESTARTED if Python is needed.
    """
    outcome = _receive(length, link)
    while outcome == Outcome.NONE and _more_may_wait(link):
        length = receive_now(plant_fd, link.simulator.received)
        if length < 0:
            break
        outcome = _receive(length, link)
    return outcome


@inlined
def is_due(outcome: Outcome, plant_fd: int, link: AutopilotLink) -> bool:
    """Return whether a state is due to be answered after `receive_states`."""
    if outcome == Outcome.RESTARTED or link.state[0]["due"] == 0:
        return False  # else there may be a newer state behind what Python is needed for
    return not (outcome == Outcome.SERVICE and waits(plant_fd, link.simulator.sent))


@inlined
def _more_may_wait(link: AutopilotLink) -> bool:
    """Return whether the next datagram belongs to what was received last, or replaces it."""
    state = link.state[0]
    return _is_real_time(state) or (is_estimated(link.navigation) and state["due"] == 0)


@inlined
def _is_real_time(state: np.void) -> bool:
    """Return whether states pass without waiting for this autopilot, and another may follow."""
    waiting_or_over = FTC_SIM_FLAGS_LOCKSTEP | FTC_SIM_FLAGS_ENDED
    return bool(state["run"] >= 0 and state["flags"] & waiting_or_over == 0)


@inlined
def _receive(length: int, link: AutopilotLink) -> Outcome:
    """Take the state that lies in `SimulatorLink.received`, if it is one; it is due then.

    Args:
        length: Length of the datagram [bytes].
        link: The link.

    Returns:
        NONE, SERVICE or RESTARTED.
    """
    state, simulator = link.state[0], link.simulator
    message_id = take(simulator.signer, simulator.received, length, simulator.drops)
    if message_id == DROPPED:
        return Outcome.NONE
    if message_id == NOT_HOT:
        state["received"] = length
        return Outcome.SERVICE
    if is_estimated(link.navigation):
        return _receive_sensors(message_id, link)
    problem: int = DropReason.UNEXPECTED
    if message_id == MessageId.SIM_STATE:
        problem = _check_state(simulator)
    if problem != 0:
        simulator.drops[-problem] += 1
        return Outcome.NONE
    before, sim_state = state["run"], simulator.sim_state[0]
    if _is_news(state, simulator.measured[0], sim_state):
        copy_record(simulator.measured[0], sim_state)
    return Outcome.RESTARTED if before >= 0 and before != state["run"] else Outcome.NONE


@inlined
def _receive_sensors(message_id: int, link: AutopilotLink) -> Outcome:
    """Note sensors, and with their step bring the estimate up to it; it is due then.

    Args:
        message_id: Of the message in `SimulatorLink.received`, which is intact.
        link: The link.

    Returns:
        NONE or RESTARTED.
    """
    state, simulator, navigation = link.state[0], link.simulator, link.navigation
    received = simulator.received
    problem: int = DropReason.UNEXPECTED
    is_step = message_id == MessageId.SIM_STEP
    if system_of(received) != simulator.system:
        problem = DropReason.STRANGER
    elif message_id == MessageId.SENSOR:
        expand(received, HIL_SENSOR_SIZE)
        problem = note_sensor(navigation, simulator.sensor[0], simulator.measured[0])
    elif message_id == MessageId.GPS:
        expand(received, HIL_GPS_SIZE)
        problem = note_gps(navigation, simulator.gps[0])
    elif is_step:
        expand(received, SIM_STEP_SIZE)
        problem = check_step(navigation, simulator.sim_step[0])
    if problem != 0:
        simulator.drops[-problem] += 1
        return Outcome.NONE
    before, sim_step, measured = state["run"], simulator.sim_step[0], simulator.measured[0]
    if not is_step:
        return Outcome.NONE
    restarted = before >= 0 and before != np.int64(sim_step["run"])
    if not restarted and not is_complete(navigation, sim_step):
        state["heard_s"] = monotonic_s()
        return Outcome.NONE
    if _is_news(state, measured, sim_step):
        if restarted:
            copy_step(sim_step, measured)
            return Outcome.RESTARTED
        navigate(navigation, sim_step, measured)
        state["flags"] = int(measured["flags"])
    return Outcome.NONE


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
