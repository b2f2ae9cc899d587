"""Take-off and landing in flight: the phase that an aircraft is in, and what guidance changes then.

    standing -> rolling -> climbing -> flying -> final -> flare -> roll-out -> stopped
                   |                     ^         |        |
                   rejected -> stopped   +- going around <--+

Without a runway in its path an aircraft that flies is flying, and what is here changes nothing.

Weight on wheels is not measured. An aircraft stands if the air passes it by slower than it has to
for flight, and the ground slower than half of that; it has left the ground when it has risen by a
tenth of its span; it has touched down when it stays low and does not sink any more, as the flare
demands, or is pushed up.

In the flare the nose is turned from the way over the air to the runway as late as the reference
filter permits: most of the turn is made at touchdown. Wing low would take more bank, of an aircraft
with much side force, than the wing has room for. Bank is limited by the height of the wing tip.
"""

import math

import numpy as np

from ftc_autopilot.common.angles import wrap
from ftc_autopilot.guidance.laws.base import Situation
from ftc_autopilot.guidance.path import NO_LOOP, height_at, point_at
from ftc_autopilot.guidance.runway import FROM_LAUNCHER, STANDS
from mavlink_defs.runtime.jit import compiled
from sitl_plant.airframe.aerodynamics import drag
from sitl_plant.airframe.aircraft import AircraftRecord
from sitl_plant.airframe.thrust import available_thrust
from sitl_plant.vec3 import clamp, hypot, square

FLYING, STANDING, ROLLING, REJECTED, CLIMBING, FINAL, FLARE, ROLL_OUT, STOPPED, AROUND = range(10)
"""Phases."""
NO_REASON, NO_THRUST, OFF_LINE, OFF_SLOPE, BANKED, SINKING, AIRSPEED, TOO_LONG, ASKED = range(9)
"""Why a take-off was rejected, or an approach given up."""

RUNWAY_STATE = np.dtype(
    [
        ("phase", "i8"),
        ("known", "i8"),  # 0: whether it stands is not found out yet
        ("time", "f8"),  # in the phase [s]
        ("doubt", "f8"),  # for how long what ends the phase has been seen [s]
        ("ground", "f8"),  # height of the centre of gravity on the runway [m]
        ("climb_to", "f8"),  # height to which a climb leads, and where on the path it may end [m]
        ("climb_until", "f8"),
        ("line", "f8", (3,)),  # on the ground: a place of it, north, east [m], and its course [rad]
        ("rotating", "f8"),  # for how long it has been rotating [s]
        ("acceleration", "f8"),  # behind a low pass [m/s²]
        ("go_arounds", "i8"),  # made
        ("asked", "i8"),  # 1: a go-around is asked for
        ("reason", "i8"),  # of the last rejection or go-around
        ("bank_max", "f8"),  # as the ground permits it [rad]; 0: any
        # what is asked for on the ground
        ("heading", "f8"),  # rad
        ("pitch", "f8"),  # rad
        ("thrust", "f8"),  # N
        ("brake", "f8"),  # share
        ("pitch_integral", "f8"),  # rad s
        ("turn_integral", "f8"),  # of the rudder [rad]
    ]
)

_FILTER_S = 0.5
_REJECTED_S = 0.5
_UNSTABLE_S = 1.0
_CONTACT_S = 0.15
_STOPPED_S = 1.0
_THROWN_S = 0.5
_ROTATION_S = 2.0
"""Times for which something is seen before it counts, and of the rotation [s]."""
_ROTATED_MORE = math.radians(2.0)
"""Pitch beyond the one of level flight to which it rotates [rad]."""
_PUSH = 1.4
"""Specific force upwards that the ground makes, relative to gravity."""
_TURNING = 1.5
"""Time before touchdown at which the nose begins to turn, in delays of the reference filter."""
_GUST = 1.0
"""Gust downwards that an approach bears, a little more than light turbulence, MIL-F-8785C [m/s]."""
_GATE = 3.0
"""Time before the flare from which on an approach has to be stable, in lags."""
_LONG = 3.0
"""Way beyond the place of touchdown at which a flare is given up, in its time constants."""
_LIFTED = 0.1
"""Height by which it has left the ground, in spans."""
_LEAST_BANK = math.radians(5.0)
"""Bank with which a wing tip is clear of the ground [rad]."""
_BANK_RESERVE = math.radians(10.0)
"""Bank beyond what is commanded with which an approach is not stable [rad]."""
_LINE_MAX = math.radians(30.0)
"""Largest angle between nose and runway on the ground [rad]."""
_LINE_S = 2.0
"""Time in which a distance from the centre line is to vanish on the ground [s]."""
_SLOW = 0.2
"""Speed below which it does not turn back faster, relative to V_s."""
_NEAR_M = 2.0
"""Height below the one to climb to at which the climb ends [m]."""
_DECISION = 0.95
"""Airspeed up to which a take-off is rejected, relative to the one of the rotation."""


@compiled
def on_ground(phase: int) -> bool:
    """Return whether an aircraft is on the ground in a phase."""
    return bool(phase in (STANDING, ROLLING, REJECTED, ROLL_OUT, STOPPED))


@compiled
def find_out(through_air: float, over_ground: float, figures: np.void, state: np.void) -> None:
    """Note, once armed, whether the aircraft stands, by airspeed and ground speed [m/s]."""
    state["known"] = 1
    if through_air < figures["stall"] and over_ground < STANDS * figures["stall"]:
        _enter(state, STANDING)


@compiled
def note_path(path: np.void, state: np.void) -> None:
    """Note that another path is flown from now on; first a climb is flown to its end."""
    phase = state["phase"]
    if phase == STOPPED:
        _enter(state, STANDING)
    elif phase == ROLLING and path["take_off"] == 0.0:
        _enter(state, REJECTED)
    elif phase in (FINAL, FLARE):
        _give_up(state, ASKED)
    state["climb_until"] = 0.0
    state["go_arounds"] = state["asked"] = 0


@compiled
def uses_runway(path: np.void, state: np.void) -> bool:
    """Return whether any of this is of concern."""
    return bool(state["phase"] != FLYING or path["landing"] > 0.0 or path["take_off"] > 0.0)


@compiled
def advance(
    now: Situation,
    path: np.void,
    aircraft: AircraftRecord,
    limits: np.void,
    figures: np.void,
    state: np.void,
) -> float:
    """Advance the phase by an update of guidance.

    Args:
        now: The situation.
        path: Record of dtype `ftc_autopilot.guidance.path.PATH`.
        aircraft: Nominal aircraft.
        limits: Record made of `GuidanceParameters`.
        figures: Record of dtype `ftc_autopilot.guidance.runway.RUNWAY_FIGURES`.
        state: Record of dtype `RUNWAY_STATE`, updated in place.

    Returns:
        Height to climb to in place of the path's [m]; NaN: the path's.
    """
    state["time"] += now.dt
    phase = state["phase"]
    if on_ground(phase):
        _roll(now, path, aircraft, limits, figures, state)
        return math.nan
    s = _in_first_round(path, now.s)
    height = -now.position[2]
    if phase in (CLIMBING, AROUND):
        if s >= state["climb_until"] and height > state["climb_to"] - _NEAR_M:
            _enter(state, FLYING)
    elif phase == FLYING:
        if path["landing"] > 0.0 and path["final"] <= s < path["landing"]:
            _enter(state, FINAL)
            state["ground"] = height_at(path, path["landing"])
            state["climb_to"], state["climb_until"] = path["around_at"], path["around"]
    else:
        _approach(now, path, s, height, limits, figures, state)
    return float(state["climb_to"]) if state["phase"] in (CLIMBING, AROUND) else math.nan


@compiled
def nose_for(now: Situation, path: np.void, figures: np.void, state: np.void) -> float:
    """Return the heading of the runway when the nose is to turn to it [rad]; NaN before."""
    if state["phase"] != FLARE:
        return math.nan
    bias = figures["touchdown"] * figures["flare"]
    above = -now.position[2] - state["ground"]
    left = figures["flare"] * math.log(max(above + bias, bias) / bias)
    if left > _TURNING * 3.0 / now.bandwidth:
        return math.nan
    return float(point_at(path, path["landing"]).course)


@compiled
def bank_near_ground(
    roll: float, now: Situation, path: np.void, limits: np.void, figures: np.void, state: np.void
) -> float:
    """Return a bank [rad] within what the height of the wing tip permits."""
    phase = state["phase"]
    state["bank_max"] = 0.0
    if phase not in (CLIMBING, FINAL, FLARE, AROUND):
        return roll
    lower = 3.0 / now.bandwidth * max(now.velocity[2], 0.0)  # when the command comes into force
    most = _bank_max(-now.position[2] - lower - state["ground"], limits, figures)
    state["bank_max"] = most
    return clamp(roll, -most, most)


@compiled
def _enter(state: np.void, phase: int) -> None:
    state["phase"] = phase
    state["time"] = state["doubt"] = state["rotating"] = 0.0
    state["pitch_integral"] = state["turn_integral"] = 0.0


@compiled
def _in_first_round(path: np.void, s: float) -> float:
    """Return the path parameter within the first round of a path that returns [m]."""
    end = path["start"][path["count"]]
    if path["loop"] == NO_LOOP or s < end:
        return s
    again = path["start"][path["loop"]]
    return float(again + (s - again) % (end - again))


@compiled
def _bank_max(above: float, limits: np.void, figures: np.void) -> float:
    """Return the bank with which a wing tip is clear of the ground [rad]."""
    clear = _LEAST_BANK + math.atan(2.0 * max(above, 0.0) / figures["span"])
    return min(clear, float(limits["bank_max_rad"]))


# in the air


@compiled
def _approach(
    now: Situation,
    path: np.void,
    s: float,
    height: float,
    limits: np.void,
    figures: np.void,
    state: np.void,
) -> None:
    """Advance the final approach and the flare."""
    above, sink = height - state["ground"], now.velocity[2]
    if state["asked"] != 0:
        _give_up(state, ASKED)
        return
    if state["phase"] == FINAL:
        if height < path["flare"]:
            _enter(state, FLARE)
            return
        normal = figures["approach"] * max(-now.here.climb, figures["slope"]) + _GUST
        gate = path["flare"] + _GATE * figures["lag"] * normal
        reason = NO_REASON
        if height < gate and state["go_arounds"] < figures["go_arounds"]:
            reason = _unstable(now, path, above, normal, limits, figures)
        state["doubt"] = state["doubt"] + now.dt if reason != NO_REASON else 0.0
        if state["doubt"] > _UNSTABLE_S:
            _give_up(state, reason)
        return
    pushed = -now.motion.specific_force[2] > _PUSH * gravity_of(now)
    low = above < max(_LIFTED * figures["span"], 0.3)
    touches = low and (sink < 0.5 * figures["touchdown"] or pushed)
    state["doubt"] = state["doubt"] + now.dt if touches else 0.0
    if state["doubt"] > _CONTACT_S or (low and pushed):
        _enter(state, ROLL_OUT)
        _note_line(now, state)
        state["pitch"] = now.motion.phi[1]
    elif s > path["landing"] + _LONG * figures["flare"] * figures["approach"] and not low:
        _give_up(state, TOO_LONG)


@compiled
def gravity_of(now: Situation) -> float:
    """Return the acceleration of gravity [m/s²]."""
    x, y, z = now.motion.gravity
    return math.sqrt(x * x + y * y + z * z)


@compiled
def _give_up(state: np.void, reason: int) -> None:
    _enter(state, AROUND)
    state["reason"], state["asked"] = reason, 0
    state["go_arounds"] += 1


@compiled
def _unstable(
    now: Situation, path: np.void, above: float, normal: float, limits: np.void, figures: np.void
) -> int:
    """Return why an approach is not stable; `normal` is its usual sink, in a gust [m/s]."""
    V, slowest = now.motion.V, 0.5 * (figures["stall"] + figures["approach"])
    beside = height_at(path, now.s) + now.position[2]
    if abs(now.off) > 0.5 * figures["width"]:
        return OFF_LINE
    if abs(beside) > normal * figures["lag"]:
        return OFF_SLOPE
    if abs(now.motion.phi[0]) > _bank_max(above, limits, figures) + _BANK_RESERVE:
        return BANKED
    if now.velocity[2] > 2.0 * normal:
        return SINKING
    if not slowest < V < 3.0 * figures["approach"] - 2.0 * slowest:  # twice as much faster
        return AIRSPEED
    return NO_REASON


# on the ground


@compiled
def _roll(
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
    if phase == STANDING and path["take_off"] > 0.0 and now.s < path["take_off"]:
        _enter(state, ROLLING)
        _note_line(now, state)
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
    state["pitch"] += (figures["pitch"] - state["pitch"]) * lowered
    if phase in (REJECTED, ROLL_OUT):
        state["doubt"] = state["doubt"] + now.dt if speed < 0.05 * figures["stall"] else 0.0
        if state["doubt"] > _STOPPED_S:
            _enter(state, STOPPED)


@compiled
def _note_line(now: Situation, state: np.void) -> None:
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
    pressure = 0.5 * aircraft["rho"] * square(V) * aircraft["S"]
    resistance = drag(pressure, math.atan2(motion.v[2], max(motion.v[0], 1.0)), aircraft)
    resistance += aircraft["m"] * aircraft["g"] * figures["rolling"]
    most = limits["thrust_share_max"] * available_thrust(V, aircraft)
    needed = aircraft["m"] * figures["acceleration"] + resistance
    state["thrust"], state["brake"] = min(needed, most), 0.0
    if figures["starts"] == FROM_LAUNCHER:
        state["thrust"], state["pitch"] = available_thrust(V, aircraft), motion.phi[1]
        moves = hypot(now.velocity[0], now.velocity[1]) > STANDS * figures["stall"]
        state["doubt"] = state["doubt"] + now.dt if moves else 0.0
        let_go = motion.specific_force[0] < gravity_of(now) or state["doubt"] > _THROWN_S
        if moves and let_go:
            _enter(state, CLIMBING)
        return
    if figures["rotate"] < V:
        state["rotating"] += now.dt
    highest = min(figures["rotation"] + _ROTATED_MORE, figures["highest"])
    share = min(state["rotating"] / _ROTATION_S, 1.0)
    state["pitch"] = figures["pitch"] + share * (highest - figures["pitch"])
    if _DECISION * figures["rotate"] < V:
        risen = -now.position[2] - state["ground"]
        if risen > _LIFTED * figures["span"]:
            _enter(state, CLIMBING)
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
        _enter(state, REJECTED)
        state["reason"], state["thrust"], state["brake"] = reason, 0.0, 1.0
