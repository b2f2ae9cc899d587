"""One step of the diagnosis of all actuators."""

import math

import numpy as np

from ftc_autopilot.control.diagnosis.decisions import decide, phase_of
from ftc_autopilot.control.diagnosis.instrument import restart_instrument
from ftc_autopilot.control.diagnosis.measurement import (
    dither_in_force,
    measure,
    moved,
    past_dither,
    restart_command,
)
from ftc_autopilot.control.diagnosis.parameters import Limits, limits_of
from ftc_autopilot.control.diagnosis.regression import long_estimate, restart
from ftc_autopilot.control.diagnosis.suspicions import monitor, watch_stop
from ftc_autopilot.control.step import SignalsRecord, Step
from mavlink_defs.constants import N_CHANNELS, THROTTLE
from mavlink_defs.runtime.jit import compiled, inlined
from sitl_plant.airframe.aircraft import AircraftRecord
from sitl_plant.airframe.stops import range_of
from sitl_plant.airframe.thrust import available_thrust
from sitl_plant.vec3 import clamp, square

_FIRST_SIGMA = 0.2  # standard deviation of the residual at first, relative to the jump threshold
_AT_STOP = 0.98  # of the stop
_MAX_OFFSET = 25.0 / 35.0  # of a surface's stop
_MAX_THRUST_OFFSET = 0.35  # of the thrust limit
_WEAK, _WEAKEST = 0.75, 0.1  # effectiveness taken into account below the first, not below the last
_LARGE_DELAY_S = 0.003
_UNSURE = 0.2  # of what raises a suspicion
_SETTLED = 5.0  # time constants, after which 0.7 % is left


@inlined
def diagnose(
    now: Step, aircraft: AircraftRecord, gains: np.void, state: np.void, signals: SignalsRecord
) -> None:
    """Measure, learn, decide; write the results of every actuator to state and signals.

    After a gap nothing is learnt or decided until the filters of the measurement, and the model of
    the actuators, have forgotten what they began with. Nor is it of an actuator whose command came
    into force while states were lost, nobody knows when, until that is forgotten.

    Args:
        now: The present step; its held commands were in force over the period that ends now.
        aircraft: Nominal aircraft.
        gains: Parameters, record made of `DiagnosisParameters`.
        state: Record of dtype `DIAGNOSIS`, updated in place.
        signals: Written.
    """
    dt, held = now.dt, now.held
    measure(now, aircraft, gains, state)
    settles = _settles(now, gains, state)
    if not settles:
        state["age"] += dt
    actuators = state["actuators"]
    if state["age"] <= 1.5 * dt and abs(now.seen.ahead - state["ahead"]) * dt > _LARGE_DELAY_S:
        for j in range(N_CHANNELS):
            restart_command(j, now, aircraft, gains, state)
    state["ahead"] = now.seen.ahead
    changed = -1
    for j in range(N_CHANNELS):
        actuator, limits = actuators[j], limits_of(gains, j)
        lowest, highest = range_of(aircraft, j)
        if lowest == highest:
            _leave_alone(actuator, j, signals)
            continue
        if settles:
            _begin_again(actuator, limits)
            _report(actuator, j, signals)
            continue
        if _is_unsure(j, limits, now, gains, state):
            _report(actuator, j, signals)
            continue
        before = actuator["lost"]
        if now.first:
            actuator["effectiveness"] = 1.0
            actuator["variance"] = square(_FIRST_SIGMA * limits.jump)
        monitor(actuator, limits, state["age"], dt, gains)
        if j < THROTTLE:
            command = held[j] - dither_in_force(j, state)
            at_stop = command < _AT_STOP * lowest or command > _AT_STOP * highest
            watch_stop(actuator, limits, at_stop, dt, gains)
        dither = past_dither(j, now, gains, state)
        found = decide(actuator, dither, limits, state["age"], dt, gains, j == THROTTLE)
        if found > 0:
            _note_dead_time(j, found, now, aircraft, gains, state)
        if j < THROTTLE and actuator["lost"] != before:
            changed = j
        if actuator["lost"] == 0 and state["age"] > gains["offset_start_s"]:
            _learn_offset(actuator, limits, j, now, aircraft, gains)
        _report(actuator, j, signals)
    if changed >= 0:
        _wait_for_transient(actuators, changed, gains["transient_s"])


@compiled
def _settles(now: Step, gains: np.void, state: np.void) -> bool:
    """Return whether nothing is to be learnt in this step; advance the time that is left."""
    if now.seen.after_gap:
        lag_s = max(gains["servo_lag_s"], gains["throttle"]["lag_s"])
        settling_s = gains["throttle"]["dead_time_s"] + _SETTLED * (gains["filter_s"] + lag_s)
        state["settling_s"] = settling_s
    settles: bool = state["settling_s"] > 0.0
    state["settling_s"] = max(state["settling_s"] - now.dt, 0.0)
    return settles


@compiled
def _is_unsure(j: int, limits: Limits, now: Step, gains: np.void, state: np.void) -> bool:
    """Return whether too little is known of what actuator j is to show; let doubt fade.

    Of a command that came into force while states were lost nobody knows since when; what it moved
    fades with the lag of the actuator and the filter of the measurement.
    """
    unresolved, actuator = now.seen.unresolved, state["actuators"][j]
    lag_s = gains["throttle"]["lag_s"] if j == THROTTLE else gains["servo_lag_s"]
    actuator["unsure"] *= max(1.0 - now.dt / (gains["filter_s"] + lag_s), 0.0)
    if unresolved > 0:
        actuator["unsure"] += moved(j, unresolved, now, gains, state)
    least = min(limits.prior, _UNSURE * min(limits.jump, limits.smooth_jump))
    return bool(unresolved != 0 or actuator["unsure"] > least)


@compiled
def _begin_again(actuator: np.void, limits: Limits) -> None:
    """Let all that was seen of an actuator count for nothing; a suspicion is tested again.

    The slow mean of the drift test stays: it shows what has failed in a gap.
    """
    u = actuator["commanded"]
    r = actuator["measured"] - actuator["effectiveness"] * u
    actuator["mean"] = actuator["smooth"] = r
    actuator["command_mean"] = actuator["smooth_u"] = u
    restart(actuator)
    restart_instrument(actuator, False)
    actuator["dither_s"] = actuator["confidence"] = 0.0
    actuator["confirmed_s"] = actuator["followed_s"] = actuator["quiet_s"] = 0.0
    if actuator["suspect_s"] > 0.0:
        actuator["suspect_s"] = limits.suspicion


@compiled
def _report(actuator: np.void, j: int, signals: SignalsRecord) -> None:
    """Write the results of actuator j."""
    signals["effectiveness"][j] = actuator["effectiveness"]
    signals["offset"][j] = actuator["stuck"] if actuator["lost"] != 0 else actuator["offset"]
    signals["confidence"][j] = actuator["confidence"]
    signals["phase"][j] = phase_of(actuator)
    if j < THROTTLE:
        signals["dead_steps"] = max(signals["dead_steps"], actuator["dead_steps"])


@compiled
def _leave_alone(actuator: np.void, j: int, signals: SignalsRecord) -> None:
    """Write of a surface that the aircraft has not that nothing is wrong with it."""
    actuator["effectiveness"] = actuator["confidence"] = 1.0
    signals["effectiveness"][j] = signals["confidence"][j] = 1.0
    signals["offset"][j], signals["phase"][j] = 0.0, phase_of(actuator)


@compiled
def _note_dead_time(
    j: int, steps: int, now: Step, aircraft: AircraftRecord, gains: np.void, state: np.void
) -> None:
    """Note the dead time that actuator j has shown; all surfaces have the first that one shows."""
    actuators = state["actuators"]
    for k in range(N_CHANNELS):
        one = k == j or (k < THROTTLE and j < THROTTLE)
        if one and actuators[k]["dead_steps"] == 0:
            actuators[k]["dead_steps"] = steps
            restart_command(k, now, aircraft, gains, state)
            restart_instrument(actuators[k], False)


@compiled
def _wait_for_transient(actuators: np.ndarray, changed: int, time_s: float) -> None:
    """Learn nothing of the other surfaces while the aircraft answers to a reconfiguration.

    An uncertain aircraft's true C is not C0: part of what one surface does, or fails to do, is
    measured as another's.
    """
    for j in range(THROTTLE):
        if j != changed:
            actuators[j]["blanking_s"] = max(actuators[j]["blanking_s"], time_s)


@compiled
def _learn_offset(
    actuator: np.void, limits: Limits, j: int, now: Step, aircraft: AircraftRecord, gains: np.void
) -> None:
    """Follow the offset f = y - ρ u of actuator j within its bounds; the thrust's between stops."""
    lowest, highest = range_of(aircraft, j)
    if j < THROTTLE:
        _weigh(actuator, limits.prior, limits.excitation, gains["effectiveness_s"], now.dt)
        least, largest = _MAX_OFFSET * lowest, _MAX_OFFSET * highest
    else:
        largest = _MAX_THRUST_OFFSET * highest
        least = -largest
        most = available_thrust(now.seen.motion.V, aircraft)
        if not 1.0 < now.held[THROTTLE] < most - 1.0:
            return
    f = actuator["measured"] - actuator["effectiveness"] * actuator["commanded"]
    offset = actuator["offset"] + now.dt / limits.offset * (f - actuator["offset"])
    actuator["offset"] = clamp(offset, least, largest)


@compiled
def _weigh(actuator: np.void, prior: float, excitation: float, memory_s: float, dt: float) -> None:
    """Follow the effectiveness, but only where it is clearly off: it is 1 otherwise.

    An effectiveness once found weak stays so while the command moves too little to show otherwise.
    """
    found = long_estimate(actuator, prior)
    enough = max(excitation, 2.1 * math.sqrt(actuator["variance"]))
    target = 1.0
    if found < _WEAK:
        target = max(found, _WEAKEST)
    elif actuator["effectiveness"] < 0.9 and actuator["long_var_u"] < square(0.7 * enough):
        target = actuator["effectiveness"]
    actuator["effectiveness"] += dt / memory_s * (target - actuator["effectiveness"])
