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
from sitl_plant.vec3 import clamp


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
    for j in range(N_CHANNELS):
        commands[j] -= state["dither"][j]
    if fallback_flies(now, gains, state):
        for j in range(N_CHANNELS):
            commands[j] += state["dither"][j]
        for j in range(N_CHANNELS):
            if triggered(now, j, surviving, thresholds, aircraft, commands):
                mask |= 1 << j
                state["dither"][j] = actuators[j]["dither"]
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
        mask |= _dither(actuators, aircraft, state, commands)
    for j in range(N_CHANNELS):
        if mask & (1 << j):
            state["sent"][j] = state["step"]
        signals["predicted_exit"][j] = state["exit"][j]
    state["step"] += 1
    delta = commands[AILERON], commands[ELEVATOR], commands[RUDDER]
    return Command(delta, commands[THROTTLE], mask)


@inlined
def _dither(
    actuators: np.ndarray, aircraft: AircraftRecord, state: np.void, commands: np.ndarray
) -> int:
    """Add the dithers of suspect actuators to what was planned, as far as the stops allow.

    Args:
        actuators: Of the diagnosis, which chose the dithers.
        aircraft: Nominal aircraft, with its stops.
        state: Record of dtype `Tube.STATE`, updated in place.
        commands: Without dither [rad, rad, rad, N], shape (4,), updated.

    Returns:
        Bit mask of the channels whose dither has changed.
    """
    mask = 0
    for j in range(N_CHANNELS):
        highest = aircraft["thrust_limit"] if j == THROTTLE else aircraft["surface_limit"]
        lowest = 0.0 if j == THROTTLE else -highest
        within = clamp(actuators[j]["dither"], lowest - commands[j], highest - commands[j])
        if within != state["dither"][j]:
            mask |= 1 << j
        state["dither"][j] = within
        commands[j] += within
    return mask
