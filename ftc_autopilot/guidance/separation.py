"""Keeping UAVs apart: a barrier on the velocity that guidance asks for.

With r from neighbour to own aircraft and d = |r|, what is held is::

    d' >= -γ (d - d_min)

so that a distance above d_min is never left for one below it, and one below it grows again. Both
aircraft have an equal share in it: along r/d, each asks for at least the mean of both present
velocities less γ (d - d_min)/2. The velocity v that guidance asks for is changed by as little as
possible::

    v := v + max(0, ((v_now + v_j)/2 - v)·r/d - γ (d - d_min)/2) r/d

Two that meet head on would only stop each other. So what changes the velocity horizontally also
changes it vertically, by as much at first, less the more of d_min they differ in height, and by at
most 3 m/s: the higher one evades upwards, or the one with the lower system id if they are equally
high.

A degraded member may not be able to evade. So the others take its share, too, and count on the
distance that is left after the time T by which they respond late::

    v := v + max(0, (v_j - v)·r/d - γ (d + T min(d', 0) - d_min)) r/d

A degraded member slower than an aircraft may fly cannot be followed, only passed: above it, as it
sinks, by a change of height that may be faster.

It is the present velocities that count, as aircraft respond late and neighbours do not report what
they intend. If both follow with a delay T, the distance goes by d'' = -(d' + γ (d - d_min))/T,
which is damped well enough for γ T < 1/2.
"""

import math

import numpy as np

from ftc_autopilot.guidance.members import NOMINAL, cause_of
from ftc_autopilot.guidance.places import is_known, place_now
from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import Vec3, add, dot, hypot, norm, scale, sub, vec3

_SWEEPS = 3
"""Rounds over the members, so that evading one does not approach another."""
_ONE_PLACE_M = 1e-6
"""Distance below which there is no way out [m]."""
_AHEAD_S = 1.2
"""Time ahead for which a distance to a degraded member counts: aircraft respond so late [s]."""
_LEVEL_M = 2.0
"""Difference in height below which two UAVs are equally high [m]."""
_VERTICAL_MAX_M_S = 3.0
"""Fastest evasion up or down [m/s]."""
_PASSING_MAX_M_S = 8.0
"""The same where a degraded member is passed [m/s]."""


@compiled
def keep_apart(
    desired: Vec3,
    position: Vec3,
    velocity: Vec3,
    wind: Vec3,
    slowest: float,
    places: np.ndarray,
    layout: np.void,
    table: np.ndarray,
    step: int,
    dt: float,
    least: float,
    rate: float,
) -> Vec3:
    """Return the velocity to ask for instead of `desired` so that members keep their distance.

    Args:
        desired: Velocity over ground that guidance asks for, NED [m/s].
        position: The own one, NED [m].
        velocity: The present one over ground, NED [m/s].
        wind: At the own aircraft, NED [m/s].
        slowest: Least airspeed that guidance asks for [m/s].
        places: Of the other members, dtype `ftc_autopilot.guidance.places.PLACE`.
        layout: Record of dtype `ftc_autopilot.guidance.formation.LAYOUT`.
        table: States of the members, see `ftc_autopilot.guidance.members`.
        step: Present step.
        dt: Control period [s].
        least: Distance that is held, d_min [m].
        rate: γ [1/s].
    """
    climb, passing, count = 0.0, 0.0, layout["count"]
    if least <= 0.0:
        return desired
    first, _ = nearest(position, places, layout, step, dt)
    for k in range(_SWEEPS * count + 1):
        m = k % count if k < _SWEEPS * count else first
        if m < 0 or m == layout["own"] or not is_known(places[m], step, dt):
            continue
        away = sub(position, place_now(places[m], step * dt, dt))
        distance = norm(away)
        if distance < _ONE_PLACE_M:
            continue
        height = -away[2]
        away = scale(1.0 / distance, away)
        theirs, room = vec3(places[m]["velocity"]), distance - least
        if cause_of(table[m]) == NOMINAL:
            theirs = scale(0.5, add(velocity, theirs))
            room *= 0.5
        else:
            room += _AHEAD_S * min(dot(sub(velocity, theirs), away), 0.0)
        short = dot(sub(theirs, desired), away) - rate * room
        if short > 0.0:
            desired = add(desired, scale(short, away))
            passed = cause_of(table[m]) != NOMINAL and _airspeed(places[m], wind) < slowest
            side = 1.0 if passed or layout["own"] < m else -1.0
            if abs(height) > _LEVEL_M:
                side = math.copysign(1.0, height)
            level = max(1.0 - abs(height) / least, 0.0) * hypot(away[0], away[1])
            if passed:
                passing += side * level * short
            else:
                climb += side * level * short
    climb = min(max(climb, -_VERTICAL_MAX_M_S), _VERTICAL_MAX_M_S)
    climb += min(max(passing, -_PASSING_MAX_M_S), _PASSING_MAX_M_S)
    return add(desired, (0.0, 0.0, -climb))


@compiled
def _airspeed(place: np.void, wind: Vec3) -> float:
    return norm(sub(vec3(place["velocity"]), wind))


@compiled
def nearest(
    position: Vec3, places: np.ndarray, layout: np.void, step: int, dt: float
) -> tuple[int, float]:
    """Return the nearest member and its distance [m]; -1 and NaN if no place is known.

    Arguments as of `keep_apart`.
    """
    found, least = -1, math.nan
    for m in range(layout["count"]):
        if m != layout["own"] and is_known(places[m], step, dt):
            distance = norm(sub(position, place_now(places[m], step * dt, dt)))
            if found < 0 or distance < least:
                found, least = m, distance
    return found, least
