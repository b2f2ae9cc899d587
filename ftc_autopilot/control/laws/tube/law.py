"""One step of the tube law: diagnosis, observer, and whose turn it is to fly."""

import math

import numpy as np

from ftc_autopilot.control.laws.base import Demand, Instant
from ftc_autopilot.control.laws.surviving import surviving_law
from ftc_autopilot.control.laws.tube.adaptation import adapt
from ftc_autopilot.control.laws.tube.check import check
from ftc_autopilot.control.laws.tube.observer import observe
from ftc_autopilot.control.laws.tube.takeover import (
    only_rudder_lost,
    take_over,
    triggered,
    with_coarser_thresholds,
)
from ftc_autopilot.control.triggers.base import in_steps
from mavlink_defs.constants import AILERON, ELEVATOR, N_CHANNELS, RUDDER, THROTTLE
from mavlink_defs.runtime.jit import inlined


@inlined
def tube_law(
    now: Instant,
    aircraft: np.void,
    gains: np.void,
    state: np.void,
    reference: np.ndarray,
    bandwidth: float,
    signals: np.void,
) -> tuple[Demand, int]:
    """Return the commands, and the mask of those that are to be sent.

    Args:
        now: The present step.
        aircraft: Nominal aircraft, dtype `sitl_plant.aircraft.AIRCRAFT`.
        gains: Parameters, record made of `Tube`.
        state: Record of dtype `Tube.STATE`, updated in place.
        reference: Filtered reference and its two derivatives, shape (4, 3).
        bandwidth: Of the reference filter [rad/s].
        signals: Record of dtype `ftc_autopilot.control.controller.SIGNALS`; the diagnosis and
            the predicted exits are written.
    """
    now = with_coarser_thresholds(now, gains["takeover_threshold"])
    surviving = surviving_law(now, aircraft, gains, state, signals)
    no_rudder = only_rudder_lost(gains, state)
    positions, commands = state["positions"], state["commands"]
    for j in range(N_CHANNELS):
        positions[j], commands[j] = state["diagnosis"]["actuators"][j]["position"], now.held[j]
    if no_rudder:
        positions[RUDDER] = state["diagnosis"]["actuators"][RUDDER]["stuck"]
    checked = state["step"] % in_steps(gains["check_s"], now.dt) == 0
    if checked:
        adapt(now, aircraft, gains, state)
    model = state["model"]
    observe(now, positions, model, gains, state)
    mask = 0
    if take_over(now, gains, state):
        for j in range(N_CHANNELS):
            if triggered(now, j, surviving, aircraft, commands):
                mask |= 1 << j
            state["exit"][j] = math.nan
    else:
        if no_rudder and triggered(now, RUDDER, surviving, aircraft, commands):
            mask |= 1 << RUDDER
        if checked if now.clock_s[0] == 0.0 else now.due != 0:
            rudder = commands[RUDDER]
            if no_rudder:
                commands[RUDDER] = positions[RUDDER]
            mask |= check(
                now, positions, no_rudder, model, gains, state, reference, bandwidth, commands
            )
            if no_rudder:
                commands[RUDDER] = rudder
    for j in range(N_CHANNELS):
        if mask & (1 << j):
            state["sent"][j] = state["step"]
        signals["predicted_exit"][j] = state["exit"][j]
    state["step"] += 1
    delta = commands[AILERON], commands[ELEVATOR], commands[RUDDER]
    return Demand(delta, commands[THROTTLE]), mask
