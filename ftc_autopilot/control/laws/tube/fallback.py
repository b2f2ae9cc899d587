"""Fallback: the surviving law flies after the loss of an actuator, with a large error, or events.

That is, after the loss of more than the rudder, with a large error of roll or pitch, while aileron
or elevator is weaker than the adaptation can believe or a turn has to be slow, while an actuator
swings or is suspect at its stop, or a channel has more events than the tube law should need.
"""

import math

import numpy as np

from ftc_autopilot.common.tuples import Four
from ftc_autopilot.control.diagnosis.parameters import limits_of
from ftc_autopilot.control.diagnosis.suspicions import stop_suspected
from ftc_autopilot.control.laws.tube.adaptation import MAX_ERROR
from ftc_autopilot.control.step import Step, Thresholds
from ftc_autopilot.control.triggers.scaled import noise_threshold
from mavlink_defs.constants import AILERON, ELEVATOR, N_CHANNELS, RUDDER, THROTTLE
from mavlink_defs.runtime.jit import compiled, inlined
from sitl_plant.airframe.aircraft import AircraftRecord
from sitl_plant.airframe.stops import has_actuator

_MAX_DOUBLINGS = 4
_CHANGES_OF_SIDE = 2.6  # changes to the other side: four within two seconds, or three within less
_SWING_SIGMA = 0.3  # standard deviation of a smoothed residual, relative to a jump


@inlined
def flies_without_rudder(aircraft: AircraftRecord, gains: np.void, state: np.void) -> bool:
    """Return whether the tube law leaves yaw alone: no rudder, or only the rudder is lost."""
    return not has_actuator(aircraft, RUDDER) or only_rudder_lost(gains, state)


@inlined
def only_rudder_lost(gains: np.void, state: np.void) -> bool:
    """Return whether the rudder alone is lost: the tube law flies on without yaw."""
    if gains["survive"] == 0:
        return False
    actuators = state["fallback"]["diagnosis"]["actuators"]
    others = actuators[AILERON]["lost"] + actuators[ELEVATOR]["lost"] + actuators[THROTTLE]["lost"]
    return bool(actuators[RUDDER]["lost"] != 0 and others == 0)


@inlined
def fallback_flies(now: Step, gains: np.void, state: np.void) -> bool:
    """Return whether the surviving law flies in this step; advance the time that it has left."""
    if gains["survive"] == 0:
        return False
    state["fallback_left"] = max(state["fallback_left"] - now.dt, 0.0)
    lost, actuators = False, state["fallback"]["diagnosis"]["actuators"]
    diagnosis = gains["fallback"]["diagnosis"]
    for j in range(N_CHANNELS):
        lost = lost or actuators[j]["lost"] != 0
        limits = limits_of(diagnosis, j)
        noise = math.sqrt(max(actuators[j]["variance"] - actuators[j]["smooth_variance"], 0.0))
        swings = math.sqrt(actuators[j]["smooth_variance"]) > max(_SWING_SIGMA * limits.jump, noise)
        swings = swings or actuators[j]["swings"] > _CHANGES_OF_SIDE
        if swings and j != THROTTLE:  # thrust swings with each command that lags, and turns nothing
            state["fallback_left"] = max(state["fallback_left"], now.dt)
        if actuators[j]["suspect_s"] > 0.0 and stop_suspected(actuators[j], diagnosis):
            state["fallback_left"] = max(state["fallback_left"], actuators[j]["suspect_s"])
    large = max(abs(now.errors.e[0]), abs(now.errors.e[1])) > gains["fallback_error_rad"]
    weakest = min(actuators[AILERON]["effectiveness"], actuators[ELEVATOR]["effectiveness"])
    weak = weakest < 1.0 - MAX_ERROR or state["fallback"]["slows_turn"] != 0
    if large or weak or (lost and not only_rudder_lost(gains, state)):
        state["fallback_left"] = max(state["fallback_left"], gains["fallback_s"])
    rate = state["event_rate"]
    for j in range(N_CHANNELS):
        rate[j] *= 1.0 - now.dt
        if rate[j] > gains["event_rate_limit"]:
            longer = gains["event_rate_cooldown_s"] * 2.0 ** min(
                state["rate_exceeded"], _MAX_DOUBLINGS
            )
            state["fallback_left"] = max(state["fallback_left"], longer)
            state["rate_exceeded"] += 1
            for i in range(N_CHANNELS):
                rate[i] = 0.0
    return bool(state["fallback_left"] > 0.0 and not now.first)


@compiled
def least_changes(thresholds: Thresholds, commands: np.ndarray) -> Four:
    """Return by how much a command differs at (25) and (29) from those in force, shape (4,)."""
    a, b = thresholds.a, thresholds.b
    return (
        b[0] * abs(commands[0]) + b[1],
        b[0] * abs(commands[1]) + b[1],
        b[0] * abs(commands[2]) + b[1],
        a[0] * abs(commands[3]) + a[1],
    )


@inlined
def triggered(
    now: Step, j: int, commanded: Four, least: Four, noise: np.void, commands: np.ndarray
) -> bool:
    """Return whether the surviving law's command of channel j is sent, which is in force then.

    The clock decides that if the trigger has one; else (25) or (29), with thresholds that grow with
    the noise and the gusts in the commands, as in the trigger `scaled`.

    Args:
        now: The present step.
        j: The channel, number as FTC_ACTUATOR.
        commanded: Commands of the surviving law, saturated [rad, rad, rad, N].
        least: Thresholds of (25) and (29) [rad, rad, rad, N].
        noise: Record of dtype `Scaled.STATE`.
        commands: In force [rad, rad, rad, N], shape (4,), updated.
    """
    fired = bool(abs(commanded[j] - commands[j]) >= max(least[j], noise_threshold(j, noise)))
    if now.clock_s[j] > 0.0:
        fired = bool(now.due & (1 << j))
    if fired:
        commands[j] = commanded[j]
    return fired


@compiled
def coarser(thresholds: Thresholds, factor: float) -> Thresholds:
    """Return the thresholds of (25) and (29) multiplied by a factor."""
    a, b = thresholds.a, thresholds.b
    return Thresholds((factor * a[0], factor * a[1]), (factor * b[0], factor * b[1]))
