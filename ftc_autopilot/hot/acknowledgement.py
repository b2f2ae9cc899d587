"""Which events have reached the plant, how late they act, and when one is sent again.

FTC_SIM_STATE carries the timestamp of the actuator message being applied. Each message has all four
channels, so a channel's event is acknowledged by the message that carried it first and by
every later one; and from the first state that shows a message follows after how many control
periods it acted: the delay of the link there and back.
"""

import numpy as np

from ftc_autopilot.control.state_predictor import MAX_DELAY_S
from mavlink_defs.constants import N_CHANNELS
from mavlink_defs.runtime.jit import compiled, inlined

NONE = -1

ACKNOWLEDGEMENT: list[tuple[str, str] | tuple[str, str, tuple[int, ...]]] = [
    ("pending_usec", "i8", (N_CHANNELS,)),  # time_usec of the unacknowledged event, -1: none
    ("pending_step", "i8", (N_CHANNELS,)),  # step at which it was sent last
    ("repeated", "i8", (N_CHANNELS,)),  # events sent again
    ("applied_usec", "i8"),  # time_usec of the message in force, -1: none
    ("delay", "f8"),  # mean time until a message acts [control periods], -1: not known
    ("deviation", "f8"),  # mean deviation from it [control periods]
    ("gap_usec", "i8"),  # time of the first state after a long gap [µs]
]
"""Fields of a link's state: real time only, but for `pending_usec` and `repeated`."""


@compiled
def note_delay(state: np.void, sim_state: np.void) -> int:
    """Return the delay of the link [control periods], estimated as RFC 6298 does round trips.

    It follows only from a message that the state before did not show, made after the last long
    gap: one made before may have been sent when this process had time again.

    Args:
        state: Record with the fields `ACKNOWLEDGEMENT` and the last step, updated in place.
        sim_state: FTC_SIM_STATE payload of a later step.
    """
    step, applied_usec = int(sim_state["step"]), _applied_usec(sim_state)
    gap_us = (step - state["step"]) * state["step_us"]
    if gap_us > 1e6 * MAX_DELAY_S:
        state["gap_usec"] = step * state["step_us"]
    fresh = applied_usec > state["applied_usec"] and applied_usec >= state["gap_usec"]
    if fresh and step == state["step"] + 1:
        delay = max(step - 1 - applied_usec / state["step_us"], 0.0)
        if state["delay"] < 0.0:
            state["delay"], state["deviation"] = delay, 0.5 * delay
        else:
            error = delay - state["delay"]
            state["deviation"] += 0.25 * (abs(error) - state["deviation"])
            state["delay"] += 0.125 * error
    state["applied_usec"] = applied_usec
    return int(max(state["delay"], 0.0) + 0.5)


@inlined
def note_events(state: np.void, sim_state: np.void, mask: int, lockstep: bool) -> bool:
    """Note the events to be sent; return whether an actuator message is due.

    One is due if there was an event, or again if one was not acknowledged: in lockstep by the next
    state, in real time when the mean delay and four mean deviations have passed.

    Args:
        state: Record with the fields `ACKNOWLEDGEMENT`, updated in place.
        sim_state: FTC_SIM_STATE payload.
        mask: Channels that had an event.
        lockstep: Whether simulated time waits for the message.
    """
    step, time_usec = int(sim_state["step"]), int(sim_state["time_usec"])
    applied_usec = _applied_usec(sim_state)
    patience = (
        0.0 if lockstep else 1.0 + max(state["delay"], 0.0) + max(4.0 * state["deviation"], 1.0)
    )
    overdue = 0
    for c in range(N_CHANNELS):
        if state["pending_usec"][c] <= applied_usec:
            state["pending_usec"][c] = NONE
        if state["pending_usec"][c] != NONE and step - state["pending_step"][c] > patience:
            overdue |= 1 << c
    if mask | overdue == 0:
        return False
    for c in range(N_CHANNELS):
        if (mask | overdue) & (1 << c):
            state["pending_step"][c] = step
        if mask & (1 << c):
            state["pending_usec"][c] = time_usec
        elif overdue & (1 << c):
            state["repeated"][c] += 1
    return True


@compiled
def _applied_usec(sim_state: np.void) -> int:
    return int(np.int64(sim_state["actuator_time_usec"]))  # -1: none yet
