"""Take-off and landing in flight: the phase that an aircraft is in, and what guidance changes then.

    standing -> rolling -> climbing -> flying -> final -> flare -> roll-out -> stopped
                   |                     ^         |        |
                   rejected -> stopped   +- going around <--+

Without a runway in its path an aircraft that flies is flying, and what is here changes nothing.

Weight on wheels is not measured. An aircraft stands if the air passes it by slower than it has to
for flight, and the ground slower than half of that; it has left the ground when it has risen by a
tenth of its span; it has touched down when the ground pushes it up and ends its sink, or when for
longer than the flare takes from there it neither sinks nor rises.

In the flare the nose begins to turn from the way over the air to the runway one delay of the
reference filter before touchdown, so that half of the turn is made then: who is aligned drifts, and
a gust may keep it up. Wing low would take more bank, of an aircraft
with much side force, than the wing has room for. Bank is limited by the height of the wing tip.

What is left of a faulty aircraft shows on the final, whatever law flies it. One that needs a bank
to fly straight drifts away as soon as it has to level its wings: it flies lower by so much that its
flare ends in a firm touchdown, a few seconds earlier. One that is slower than its command
is commanded to be faster.
"""

import math

import numpy as np

from ftc_autopilot.common.tuples import replaced
from ftc_autopilot.guidance.laws.base import Situation
from ftc_autopilot.guidance.path import NO_LOOP, height_at, point_at
from ftc_autopilot.guidance.runway import STANDS
from ftc_autopilot.guidance.runway_roll import LIFTED, note_line, roll_along
from ftc_autopilot.guidance.runway_state import (
    AIRSPEED,
    AROUND,
    ASKED,
    BANKED,
    CLIMBING,
    FINAL,
    FLARE,
    FLYING,
    NO_REASON,
    OFF_LINE,
    OFF_SLOPE,
    REJECTED,
    ROLL_OUT,
    ROLLING,
    SINKING,
    STANDING,
    STOPPED,
    TOO_LONG,
    enter,
    gravity_of,
    is_glide,
    on_ground,
)
from mavlink_defs.runtime.jit import compiled
from sitl_plant.airframe.aerodynamics import aerodynamics
from sitl_plant.airframe.aircraft import AircraftRecord
from sitl_plant.vec3 import clamp

_UNSTABLE_S = 1.0
"""Time for which an approach is not stable before it is given up [s]."""
_PUSH = 0.25
"""Force upwards beyond the air's and the weight, which the ground makes, relative to the weight."""
_GROUND_EFFECT = 1.2
"""Lift near the ground, relative to free air, at most: JSBSim's table of its c172p."""
_TURNING = 1.0
"""Time before touchdown at which the nose begins to turn, in delays of the reference filter."""
_GUST = 1.0
"""Gust downwards that an approach bears, a little more than light turbulence, MIL-F-8785C [m/s]."""
_GUST_M = 23.0
"""Length of a gust, L_u at 10 ft, the lowest height of MIL-F-8785C [m]."""
_GATE = 3.0
"""Time before the flare from which on an approach has to be stable, in lags."""
_LONG = 3.0
"""Way beyond the place of touchdown at which a flare is given up, in its time constants."""
_LEAST_BANK = math.radians(2.5)
"""Bank that is commanded on the ground; the other half of 5° is for gusts [rad]."""
_BANK_RESERVE = math.radians(10.0)
"""Bank beyond what is commanded with which an approach is not stable [rad]."""
_LEANS = math.radians(5.0), math.radians(10.0)
"""Bank on the final from which on it flies lower, and with which by all of it [rad]."""
_FIRM = 1.0
"""Sink of a firm touchdown [m/s]."""
_TAKES_S = 5.0
"""Time constant with which bank and airspeed of the final count [s]."""
_SLOW = 0.95
"""Airspeed below which it is commanded to be faster, relative to the path's."""
_NEAR_M = 2.0
"""Height below the one to climb to at which the climb ends [m]."""


@compiled
def find_out(through_air: float, over_ground: float, figures: np.void, state: np.void) -> None:
    """Note, once armed, whether the aircraft stands, by airspeed and ground speed [m/s]."""
    state["known"] = 1
    if through_air < figures["stall"] and over_ground < STANDS * figures["stall"]:
        enter(state, STANDING)


@compiled
def note_path(path: np.void, state: np.void) -> None:
    """Note that another path is flown from now on; first a climb is flown to its end."""
    phase = state["phase"]
    if phase == STOPPED:
        enter(state, STANDING)
    elif phase == ROLLING and path["take_off"] == 0.0:
        enter(state, REJECTED)
    elif is_glide(path) and not on_ground(phase):
        enter(state, FLYING)
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
        roll_along(now, path, aircraft, limits, figures, state)
        return math.nan
    s = _in_first_round(path, now.s)
    height = -now.position[2]
    if phase in (CLIMBING, AROUND):
        if s >= state["climb_until"] and height > state["climb_to"] - _NEAR_M:
            enter(state, FLYING)
    elif phase == FLYING:
        if path["landing"] > 0.0 and path["final"] <= s < path["landing"]:
            enter(state, FINAL)
            state["leaning"] = state["faster"] = 0.0
            state["ground"] = height_at(path, path["landing"])
            state["climb_to"], state["climb_until"] = path["around_at"], path["around"]
    else:
        _approach(now, path, s, height, aircraft, limits, figures, state)
    return float(state["climb_to"]) if state["phase"] in (CLIMBING, AROUND) else math.nan


@compiled
def nose_for(now: Situation, path: np.void, figures: np.void, state: np.void) -> float:
    """Return the heading of the runway when the nose is to turn to it [rad]; NaN before.

    A belly slides as well with the crab, by which it stays on the line in gusts.
    """
    if state["phase"] != FLARE or figures["wheels"] == 0.0:
        return math.nan
    bias = figures["touchdown"] * figures["flare"]
    above = -now.position[2] - state["ground"]
    left = figures["flare"] * math.log(max(above + bias, bias) / bias)
    left = max(left, above / max(now.velocity[2], figures["touchdown"]))  # a gust keeps it up
    if left > _TURNING * 3.0 / now.bandwidth:
        return math.nan
    return float(point_at(path, path["landing"]).course)


@compiled
def on_final(now: Situation, path: np.void, figures: np.void, state: np.void) -> Situation:
    """Note what the final and the flare take; return the situation on the path that is flown.

    The lower path is flown as much later as brings its touchdown to the same place.
    """
    if state["phase"] == FINAL:
        state["leaning"] += (now.motion.phi[0] - state["leaning"]) * now.dt / _TAKES_S
    slow = _SLOW * now.here.airspeed - now.motion.V
    most = figures["approach"] - figures["stall"]
    state["faster"] = clamp(state["faster"] + slow * now.dt / _TAKES_S, 0.0, most)
    least, all_of_it = _LEANS
    share = clamp((abs(state["leaning"]) - least) / (all_of_it - least), 0.0, 1.0)
    firm = min(_FIRM, figures["approach"] * figures["slope"])
    sink = figures["touchdown"] + share * max(firm - figures["touchdown"], 0.0)
    lower = (sink - figures["touchdown"]) * figures["flare"]
    later = figures["approach"] * figures["flare"] * math.log(sink / figures["touchdown"])
    slot = replaced(now.coordination, "slot", (0.0, 0.0, -lower))
    now = replaced(replaced(now, "coordination", slot), "s", max(now.s - later, path["final"]))
    return replaced(now, "here", point_at(path, now.s))


@compiled
def bank_near_ground(
    roll: float, now: Situation, path: np.void, limits: np.void, figures: np.void, state: np.void
) -> float:
    """Return a bank [rad] within what the height of the wing tip permits."""
    phase = state["phase"]
    state["bank_max"] = 0.0
    if phase not in (CLIMBING, FINAL, FLARE, AROUND):
        return roll
    # when the command comes into force: the flare ends the sink, and gusts add as they come
    delay, flare = 3.0 / now.bandwidth, figures["flare"]
    lower = max(now.velocity[2], 0.0) * flare * (1.0 - math.exp(-delay / flare))
    lower += _GUST * math.sqrt(delay * min(delay, _GUST_M / figures["approach"]))
    most = _bank_max(-now.position[2] - lower - state["ground"], limits, figures)
    state["bank_max"] = most
    return clamp(roll, -most, most)


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
    aircraft: AircraftRecord,
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
            enter(state, FLARE)
            return
        normal = figures["approach"] * max(-now.here.climb, figures["slope"]) + _GUST
        gate = path["flare"] + _GATE * figures["lag"] * normal
        reason = NO_REASON
        may = state["go_arounds"] < figures["go_arounds"] and not is_glide(path)
        if height < gate and may:
            reason = _unstable(now, path, above, normal, limits, figures)
        state["doubt"] = state["doubt"] + now.dt if reason != NO_REASON else 0.0
        if state["doubt"] > _UNSTABLE_S:
            _give_up(state, reason)
        return
    g, by_air = gravity_of(now), aerodynamics(now.motion.v, now.motion.omega, aircraft).F
    carried = max(-_GROUND_EFFECT * by_air[2] / aircraft["m"], g)
    pushed = -now.motion.specific_force[2] - carried > _PUSH * g
    lowest = max(LIFTED * figures["span"], 0.3)
    low = above < lowest
    longest = path["landing"] + _LONG * figures["flare"] * figures["approach"]
    stays = low and abs(sink) < 0.5 * figures["touchdown"]
    state["doubt"] = state["doubt"] + now.dt if stays else 0.0
    arrested = low and pushed and sink < figures["touchdown"]
    if arrested or state["doubt"] > lowest / figures["touchdown"]:
        enter(state, ROLL_OUT)
        note_line(now, state)
        state["pitch"] = now.motion.phi[1]
    elif s > longest and not (low or is_glide(path)):
        _give_up(state, TOO_LONG)


@compiled
def _give_up(state: np.void, reason: int) -> None:
    enter(state, AROUND)
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
