"""Take-off and landing on the ground: rolling, rotation, lift-off, standstill."""

import math

import numpy as np

from ftc_autopilot.common.angles import wrap
from ftc_autopilot.guidance.laws.base import Situation
from ftc_autopilot.guidance.runway import FROM_LAUNCHER, STANDS
from ftc_autopilot.guidance.runway_state import (
    CLIMBING,
    NO_REASON,
    NO_THRUST,
    OFF_LINE,
    REJECTED,
    ROLL_OUT,
    ROLLING,
    STANDING,
    STOPPED,
    enter,
    gravity_of,
)
from mavlink_defs.runtime.jit import compiled
from sitl_plant.airframe.aerodynamics import drag
from sitl_plant.airframe.aircraft import AircraftRecord
from sitl_plant.airframe.thrust import available_thrust
from sitl_plant.vec3 import clamp, hypot, square

_FILTER_S = 0.5
_REJECTED_S = 0.5
_STOPPED_S = 1.0
_THROWN_S = 0.5
_ROTATION_S = 2.0
"""Times for which something is seen before it counts, and of the rotation [s]."""
_ROTATED_MORE = math.radians(2.0)
"""Pitch beyond the one of level flight to which it rotates [rad]."""
_LINE_MAX = math.radians(30.0)
"""Largest angle between nose and runway on the ground [rad]."""
_LINE_S = 2.0
"""Time in which a distance from the centre line is to vanish on the ground [s]."""
_SLOW = 0.2
"""Speed below which it does not turn back faster, relative to V_s."""
_DECISION = 0.95
"""Airspeed up to which a take-off is rejected, relative to the one of the rotation."""
_ROLLING_ON = 0.4
"""Speed at which it rolls on, clear of those behind it, relative to V_s."""
LIFTED = 0.1
"""Height by which it has left the ground, in spans."""


@compiled
def roll_along(
    now: Situation,
    path: np.void,
    aircraft: AircraftRecord,
    limits: np.void,
    figures: np.void,
    state: np.void,
) -> None:
    """Advance the phases on the ground, and say what is asked for there.

    The line is the runway's to the end: another path leads elsewhere, which is for the air.
    """
    phase, speed = state["phase"], hypot(now.velocity[0], now.velocity[1])
    if phase == STANDING and state["waits"] == 0 and now.s < path["take_off"] > 0.0:
        enter(state, ROLLING)
        note_line(now, state)
        state["ground"], state["acceleration"] = -now.position[2], 0.0
        state["climb_to"], state["climb_until"] = path["climb_to"], path["take_off"]
    north, east, course = state["line"]
    across = math.cos(course) * (now.position[1] - east)
    off = across - math.sin(course) * (now.position[0] - north)
    away = math.atan(off / (_LINE_S * max(speed, _SLOW * figures["stall"])))
    state["heading"] = wrap(course - clamp(away, -_LINE_MAX, _LINE_MAX))
    if state["phase"] == ROLLING:
        _take_off(now, off, aircraft, limits, figures, state)
        return
    if phase in (STANDING, STOPPED):
        state["heading"] = now.motion.phi[2]
    lowered = min(state["time"] / _ROTATION_S, 1.0) if phase == ROLL_OUT else 1.0
    state["thrust"], state["brake"] = 0.0, lowered
    if phase == ROLL_OUT and now.s < state["brake_from"]:
        faster = (_ROLLING_ON * figures["stall"] - speed) / _FILTER_S
        needed = aircraft["m"] * faster + _resistance(now, aircraft, figures)
        most = limits["thrust_share_max"] * available_thrust(now.motion.V, aircraft)
        state["thrust"], state["brake"] = clamp(needed, 0.0, most), 0.0
    state["pitch"] += (figures["pitch"] - state["pitch"]) * lowered
    if phase in (REJECTED, ROLL_OUT):
        state["doubt"] = state["doubt"] + now.dt if speed < 0.05 * figures["stall"] else 0.0
        if state["doubt"] > _STOPPED_S:
            enter(state, STOPPED)


@compiled
def note_line(now: Situation, state: np.void) -> None:
    """Note the line of the runway that is rolled on."""
    state["line"][0], state["line"][1] = now.here.north, now.here.east
    state["line"][2] = now.here.course


@compiled
def _take_off(
    now: Situation,
    off: float,
    aircraft: AircraftRecord,
    limits: np.void,
    figures: np.void,
    state: np.void,
) -> None:
    """Accelerate along the runway, rotate, and notice the lift-off, or that it is not coming."""
    V, motion = now.motion.V, now.motion
    resistance = _resistance(now, aircraft, figures)
    most = limits["thrust_share_max"] * available_thrust(V, aircraft)
    needed = aircraft["m"] * figures["acceleration"] + resistance
    state["thrust"], state["brake"] = min(needed, most), 0.0
    if figures["starts"] == FROM_LAUNCHER:
        state["thrust"], state["pitch"] = available_thrust(V, aircraft), motion.phi[1]
        moves = hypot(now.velocity[0], now.velocity[1]) > STANDS * figures["stall"]
        state["doubt"] = state["doubt"] + now.dt if moves else 0.0
        let_go = motion.specific_force[0] < gravity_of(now) or state["doubt"] > _THROWN_S
        if moves and let_go:
            enter(state, CLIMBING)
        return
    if figures["rotate"] < V:
        state["rotating"] += now.dt
    highest = min(figures["rotation"] + _ROTATED_MORE, figures["highest"])
    share = min(state["rotating"] / _ROTATION_S, 1.0)
    state["pitch"] = figures["pitch"] + share * (highest - figures["pitch"])
    if _DECISION * figures["rotate"] < V:
        risen = -now.position[2] - state["ground"]
        if risen > LIFTED * figures["span"]:
            enter(state, CLIMBING)
        return
    expected = (state["thrust"] - resistance) / aircraft["m"]
    measured = motion.specific_force[0] + motion.gravity[0]
    state["acceleration"] += (measured - state["acceleration"]) * min(now.dt / _FILTER_S, 1.0)
    settled = state["time"] > 2.0 * _FILTER_S + 3.0 * aircraft["thrust_lag"]
    reason = NO_REASON
    if settled and state["acceleration"] < figures["reject_share"] * expected:
        reason = NO_THRUST
    elif abs(off) > 0.5 * figures["width"]:
        reason = OFF_LINE
    state["doubt"] = state["doubt"] + now.dt if reason != NO_REASON else 0.0
    if state["doubt"] > _REJECTED_S:
        enter(state, REJECTED)
        state["reason"], state["thrust"], state["brake"] = reason, 0.0, 1.0


@compiled
def _resistance(now: Situation, aircraft: AircraftRecord, figures: np.void) -> float:
    """Return drag and friction of an aircraft that rolls [N]."""
    x, _, z = now.motion.v
    pressure = 0.5 * aircraft["rho"] * square(now.motion.V) * aircraft["S"]
    friction = aircraft["m"] * aircraft["g"] * figures["rolling"]
    return float(drag(pressure, math.atan2(z, max(x, 1.0)), aircraft) + friction)
