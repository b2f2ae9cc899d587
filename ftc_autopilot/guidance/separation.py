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
most 3 m/s: who is higher evades upwards, or the one with the lower system id if they are equally
high.

It is the present velocities that count, as aircraft follow late and neighbours do not tell what
they intend. If both follow with a delay T, the distance goes by d'' = -(d' + γ (d - d_min))/T,
which is damped well enough for γ T < 1/2.
"""

import math

import numpy as np

from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import Vec3, add, dot, norm, scale, sub, vec3

__all__ = ["kept_apart", "nearest"]

_SWEEPS = 3
"""Rounds over the neighbours, so that evading one does not approach another."""
_ONE_PLACE_M = 1e-6
"""Distance below which there is no way out [m]."""
_LEVEL_M = 2.0
"""Difference in height below which two UAVs are equally high [m]."""
_VERTICAL_MAX_M_S = 3.0
"""Fastest evasion up or down [m/s]."""


@compiled
def kept_apart(
    wanted: Vec3,
    position: Vec3,
    velocity: Vec3,
    neighbours: np.ndarray,
    weights: np.ndarray,
    upwards: np.ndarray,
    now_s: float,
    dt: float,
    least: float,
    rate: float,
) -> Vec3:
    """Return the velocity to ask for instead of `wanted` so that neighbours keep their distance.

    Args:
        wanted: Velocity over ground that guidance asks for, NED [m/s].
        position: The own one, NED [m].
        velocity: The present one over ground, NED [m/s].
        neighbours: Last message of each neighbour, dtype `mavlink_defs.framing.codec.NEIGHBOUR`,
            shape (degree,).
        weights: a_ij of each neighbour, 0 while it is silent, shape (degree,).
        upwards: 1 if this UAV evades a neighbour that is equally high upwards, -1 if downwards,
            shape (degree or more,).
        now_s: Present step times the control period [s].
        dt: Control period [s].
        least: Distance that is held, d_min [m].
        rate: γ [1/s].
    """
    climb = 0.0
    if least <= 0.0:
        return wanted
    for _ in range(_SWEEPS):
        for d in range(len(weights)):
            if not _tells_place(neighbours[d], weights[d]):
                continue
            away = sub(position, _place(neighbours[d], now_s, dt))
            distance = norm(away)
            if distance < _ONE_PLACE_M:
                continue
            height = -away[2]
            away = scale(1.0 / distance, away)
            mean = scale(0.5, add(velocity, vec3(neighbours[d]["ground_velocity"])))
            short = dot(sub(mean, wanted), away) - 0.5 * rate * (distance - least)
            if short > 0.0:
                wanted = add(wanted, scale(short, away))
                side = math.copysign(1.0, height) if abs(height) > _LEVEL_M else upwards[d]
                level = max(1.0 - abs(height) / least, 0.0) * math.hypot(away[0], away[1])
                climb += side * level * short
    climb = min(max(climb, -_VERTICAL_MAX_M_S), _VERTICAL_MAX_M_S)
    return add(wanted, (0.0, 0.0, -climb))


@compiled
def nearest(
    position: Vec3, neighbours: np.ndarray, weights: np.ndarray, now_s: float, dt: float
) -> tuple[int, float]:
    """Return index and distance [m] of the nearest neighbour; -1 and NaN if none tells its place.

    Arguments are those of `kept_apart`.
    """
    found, least = -1, math.nan
    for d in range(len(weights)):
        if _tells_place(neighbours[d], weights[d]):
            distance = norm(sub(position, _place(neighbours[d], now_s, dt)))
            if found < 0 or distance < least:
                found, least = d, distance
    return found, least


@compiled
def _tells_place(neighbour: np.void, weight: float) -> bool:
    return bool(weight > 0.0 and np.int64(neighbour["path_id"]) != 0)


@compiled
def _place(neighbour: np.void, now_s: float, dt: float) -> Vec3:
    """Return where a neighbour is now, if it has gone on as it told."""
    age = now_s - np.int64(neighbour["step"]) * dt
    velocity = vec3(neighbour["ground_velocity"])
    return add(vec3(neighbour["position"]), scale(age, velocity))
