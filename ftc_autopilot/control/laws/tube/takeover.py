"""When the surviving law flies instead: an actuator is lost, an error large, or events crowd."""

import numpy as np

from ftc_autopilot.control.laws.base import Demand, Instant
from mavlink_defs.constants import AILERON, ELEVATOR, N_CHANNELS, RUDDER, THROTTLE
from mavlink_defs.runtime.jit import compiled, inlined

_MOST_DOUBLINGS = 4


@inlined
def only_rudder_lost(gains: np.void, state: np.void) -> bool:
    """Return whether the rudder alone is lost: the tube law flies on without yaw."""
    if gains["survive"] == 0:
        return False
    actuators = state["diagnosis"]["actuators"]
    others = actuators[AILERON]["lost"] + actuators[ELEVATOR]["lost"] + actuators[THROTTLE]["lost"]
    return bool(actuators[RUDDER]["lost"] != 0 and others == 0)


@inlined
def take_over(now: Instant, gains: np.void, state: np.void) -> bool:
    """Return whether the surviving law flies this step; advance the time that it has left."""
    if gains["survive"] == 0:
        return False
    state["taken_over"] = max(state["taken_over"] - now.dt, 0.0)
    lost = False
    for j in range(N_CHANNELS):
        lost = lost or state["diagnosis"]["actuators"][j]["lost"] != 0
    large = max(abs(now.errors.e[0]), abs(now.errors.e[1])) > gains["rescue_rad"]
    if large or (lost and not only_rudder_lost(gains, state)):
        state["taken_over"] = max(state["taken_over"], gains["takeover_s"])
    recent = state["recent"]
    for j in range(N_CHANNELS):
        recent[j] *= 1.0 - now.dt
        if recent[j] > gains["storm_events"]:
            longer = gains["storm_s"] * 2.0 ** min(state["storms"], _MOST_DOUBLINGS)
            state["taken_over"] = max(state["taken_over"], longer)
            state["storms"] += 1
            for i in range(N_CHANNELS):
                recent[i] = 0.0
    return bool(state["taken_over"] > 0.0 and not now.first)


@inlined
def triggered(
    now: Instant, j: int, demand: Demand, aircraft: np.void, commands: np.ndarray
) -> bool:
    """Return whether the surviving law's command of channel j is sent, and take it.

    The clock decides that if the trigger has one, else (25) or (29).

    Args:
        now: The present step, with the thresholds.
        j: The channel, number as FTC_ACTUATOR.
        demand: Commands of the surviving law.
        aircraft: Nominal aircraft, whose limits saturate the command.
        commands: In force [rad, rad, rad, N], shape (4,), updated.
    """
    if j == THROTTLE:
        wanted = min(max(demand.T_hat, 0.0), aircraft["thrust_limit"])
        least = now.a[0] * abs(commands[j]) + now.a[1]
    else:
        stop = aircraft["surface_limit"]
        wanted = min(max(demand.delta_hat[j], -stop), stop)
        least = now.b[0] * abs(commands[j]) + now.b[1]
    fired = bool(abs(wanted - commands[j]) >= least)
    if now.clock_s[j] > 0.0:
        fired = bool(now.due & (1 << j))
    if fired:
        commands[j] = wanted
    return fired


@compiled
def with_coarser_thresholds(now: Instant, factor: float) -> Instant:
    """Return the present step with the thresholds of (25) and (29) multiplied by a factor."""
    return Instant(
        now.t,
        now.dt,
        now.first,
        now.motion,
        now.command,
        now.reference,
        now.errors,
        now.held,
        (factor * now.a[0], factor * now.a[1]),
        (factor * now.b[0], factor * now.b[1]),
        now.due,
        now.clock_s,
    )
