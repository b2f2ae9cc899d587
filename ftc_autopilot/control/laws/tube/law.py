"""One step of the tube law: diagnosis, observer, and whether the fallback flies."""

import math

import numpy as np

from ftc_autopilot.control.diagnosis.measurement import servo_step
from ftc_autopilot.control.diagnosis.parameters import limits_of
from ftc_autopilot.control.laws.surviving.law import reaching_stops, reconfigured
from ftc_autopilot.control.laws.tube.adaptation import adapt
from ftc_autopilot.control.laws.tube.check import check
from ftc_autopilot.control.laws.tube.fallback import (
    coarser,
    fallback_flies,
    flies_without_rudder,
    least_changes,
    triggered,
)
from ftc_autopilot.control.laws.tube.observer import observe
from ftc_autopilot.control.laws.tube.parameters import Tube
from ftc_autopilot.control.signals import SIGNALS
from ftc_autopilot.control.step import Command, SignalsRecord, Step
from ftc_autopilot.control.transmit import saturated
from ftc_autopilot.control.triggers.base import in_steps
from ftc_autopilot.control.triggers.scaled import watch
from mavlink_defs.constants import AILERON, ELEVATOR, N_CHANNELS, RUDDER, THROTTLE
from mavlink_defs.runtime.jit import apart, compiled, inlined
from sitl_plant.airframe.aircraft import AIRCRAFT, AircraftRecord
from sitl_plant.airframe.stops import has_actuator, range_of
from sitl_plant.vec3 import clamp

_MAX_PERIOD_S = 0.03
"""Of a clock that can send a dither."""
_NOISE_SHARE, _NOISE_MEMORY_S = 0.5, 1.0
"""Of the time 1/K2 of its fastest loop, within which changes of its commands are watched."""


@apart(aircraft=AIRCRAFT, gains=Tube.record(), state=Tube.STATE, signals=SIGNALS)
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
    thresholds = coarser(now.thresholds, gains["fallback_threshold"])
    surviving = reconfigured(now, aircraft, gains["fallback"], state["fallback"], signals)
    surviving = reaching_stops(surviving, thresholds, aircraft)
    no_rudder = flies_without_rudder(aircraft, gains, state)
    positions, commands = state["positions"], state["commands"]
    actuators = state["fallback"]["diagnosis"]["actuators"]
    for j in range(N_CHANNELS):
        positions[j] = _position(now, j, gains["fallback"]["diagnosis"], state)
        commands[j] = now.held[j]
    if no_rudder:
        positions[RUDDER] = actuators[RUDDER]["stuck"]
    checked = state["step"] % in_steps(gains["check_s"], now.dt) == 0
    if checked:
        adapt(now, aircraft, gains, state)
    model = state["model"]
    observe(now, positions, model, gains, state)
    commanded = saturated(surviving, now, aircraft)
    least = least_changes(thresholds, commands)
    K2 = gains["fallback"]["K2"]
    within_s = _NOISE_SHARE / max(K2[0], K2[1], K2[2])
    watch(commanded, least, within_s, _NOISE_MEMORY_S, now.dt, state["noise"])
    mask = 0
    for j in range(N_CHANNELS):
        commands[j] -= state["dither"][j]
    if fallback_flies(now, gains, state):
        for j in range(N_CHANNELS):
            commands[j] += state["dither"][j]
        for j in range(N_CHANNELS):
            if triggered(now, j, commanded, least, state["noise"], commands):
                mask |= 1 << j
                state["dither"][j] = actuators[j]["dither"]
            state["exit"][j] = math.nan
    else:
        if (
            no_rudder
            and has_actuator(aircraft, RUDDER)
            and triggered(now, RUDDER, commanded, least, state["noise"], commands)
        ):
            mask |= 1 << RUDDER
        if checked if now.clock_s[0] == 0.0 else now.due != 0:
            rudder = commands[RUDDER]
            if no_rudder:
                commands[RUDDER] = positions[RUDDER]
            mask |= check(now, positions, no_rudder, model, gains, state, commands)
            if no_rudder:
                commands[RUDDER] = rudder
        mask |= _dither(now, gains["fallback"]["diagnosis"], aircraft, state, commands)
    for j in range(N_CHANNELS):
        if mask & (1 << j):
            state["sent"][j] = state["step"]
        signals["predicted_exit"][j] = state["exit"][j]
    state["step"] += 1
    delta = commands[AILERON], commands[ELEVATOR], commands[RUDDER]
    return Command(delta, commands[THROTTLE], mask)


@compiled
def _position(now: Step, j: int, diagnosis: np.void, state: np.void) -> float:
    """Return where the model of servo j is when the present state is: after a known delay."""
    if state["step"] <= 1:
        return float(now.held[j])
    return servo_step(state["positions"][j], now.held[j], j, diagnosis, now.dt)


@inlined
def _dither(
    now: Step, gains: np.void, aircraft: AircraftRecord, state: np.void, commands: np.ndarray
) -> int:
    """Add the dithers of the control check to what was planned, as far as the stops allow.

    A clock that is too slow for a dither would hold it, and sends none. Later suspicions are left
    to the movements of the plans: a dither would leave the tube.

    Args:
        now: The present step.
        gains: Of the diagnosis, record made of `DiagnosisParameters`.
        aircraft: Nominal aircraft, with its stops.
        state: Record of dtype `Tube.STATE`, updated in place.
        commands: Without dither [rad, rad, rad, N], shape (4,), updated.

    Returns:
        Bit mask of the channels whose dither has changed.
    """
    mask, diagnosis = 0, state["fallback"]["diagnosis"]
    for j in range(N_CHANNELS):
        actuator, limits = diagnosis["actuators"][j], limits_of(gains, j)
        lowest, highest = range_of(aircraft, j)
        is_check = diagnosis["age"] < limits.check + limits.suspicion
        moves = (is_check or actuator["lost"] != 0) and now.clock_s[j] < _MAX_PERIOD_S
        dither = actuator["dither"] if moves else 0.0
        within = clamp(dither, lowest - commands[j], highest - commands[j])
        if now.clock_s[j] > 0.0 and not now.due & (1 << j):
            within = state["dither"][j]
        if within != state["dither"][j]:
            mask |= 1 << j
        state["dither"][j] = actuator["dither"] = within
        commands[j] += within
    return mask
