"""One step of the tube law: diagnosis, observer, and whether the fallback flies."""

import math

import numpy as np

from ftc_autopilot.control.laws.surviving.law import reaching_stops, reconfigured
from ftc_autopilot.control.laws.tube.adaptation import adapt
from ftc_autopilot.control.laws.tube.check import check
from ftc_autopilot.control.laws.tube.fallback import (
    coarser,
    fallback_flies,
    only_rudder_lost,
    triggered,
)
from ftc_autopilot.control.laws.tube.observer import observe
from ftc_autopilot.control.step import Command, SignalsRecord, Step
from ftc_autopilot.control.triggers.base import in_steps
from mavlink_defs.constants import AILERON, ELEVATOR, N_CHANNELS, RUDDER, THROTTLE
from mavlink_defs.runtime.jit import inlined
from sitl_plant.aircraft import AircraftRecord


@inlined
def tube_law(
    now: Step, aircraft: AircraftRecord, gains: np.void, state: np.void, signals: SignalsRecord
) -> Command:
    """Return the commands, and select those that are to be sent.

    Args:
        now: The present step.
        aircraft: Nominal aircraft.
        gains: Parameters, record made of `Tube`.
        state: Record of dtype `Tube.STATE`, updated in place.
        signals: The diagnosis and the predicted exits are written.
    """
    thresholds = coarser(now.thresholds, gains["takeover_threshold"])
    surviving = reconfigured(now, aircraft, gains["fallback"], state["fallback"], signals)
    surviving = reaching_stops(surviving, thresholds, aircraft)
    no_rudder = only_rudder_lost(gains, state)
    positions, commands = state["positions"], state["commands"]
    actuators = state["fallback"]["diagnosis"]["actuators"]
    for j in range(N_CHANNELS):
        positions[j], commands[j] = actuators[j]["position"], now.held[j]
    if no_rudder:
        positions[RUDDER] = actuators[RUDDER]["stuck"]
    checked = state["step"] % in_steps(gains["check_s"], now.dt) == 0
    if checked:
        adapt(now, aircraft, gains, state)
    model = state["model"]
    observe(now, positions, model, gains, state)
    mask = 0
    if fallback_flies(now, gains, state):
        for j in range(N_CHANNELS):
            if triggered(now, j, surviving, thresholds, aircraft, commands):
                mask |= 1 << j
            state["exit"][j] = math.nan
    else:
        if no_rudder and triggered(now, RUDDER, surviving, thresholds, aircraft, commands):
            mask |= 1 << RUDDER
        if checked if now.clock_s[0] == 0.0 else now.due != 0:
            rudder = commands[RUDDER]
            if no_rudder:
                commands[RUDDER] = positions[RUDDER]
            mask |= check(now, positions, no_rudder, model, gains, state, commands)
            if no_rudder:
                commands[RUDDER] = rudder
    for j in range(N_CHANNELS):
        if mask & (1 << j):
            state["sent"][j] = state["step"]
        signals["predicted_exit"][j] = state["exit"][j]
    state["step"] += 1
    delta = commands[AILERON], commands[ELEVATOR], commands[RUDDER]
    return Command(delta, commands[THROTTLE], mask)
