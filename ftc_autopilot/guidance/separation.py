"""Keeping UAVs apart: a barrier on the velocity that guidance asks for.

With r from neighbour to own aircraft and d = |r|, what is held is::

    d' >= -γ (d - d_min)

so that a distance above d_min is never left for one below it, and one below it grows again. What
the present velocities lack, w = -γ (d - d_min) - d', both aircraft make up for by half. So the
component of the own velocity along r/d is to be at least the present one plus w/2, and the
velocity v that guidance asks for is changed by as little as possible::

    v := v + max(0, (v_now - v)·r/d + w/2) r/d

It is the present velocity that counts, not the one asked for, because aircraft follow late and
neighbours do not tell what they intend. If both follow with a delay T, the distance goes by
d'' = -(d' + γ (d - d_min))/T, which is damped well enough for γ T < 1/2.
"""

import math

import numpy as np

from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import Vec3, add, dot, norm, scale, sub

__all__ = ["kept_apart"]

_SWEEPS = 3
"""Rounds over the neighbours, so that evading one does not approach another."""
_NO_DIRECTION = 1e-6
"""Distance below which two aircraft are in one place [m]."""


@compiled
def kept_apart(
    wanted: Vec3,
    velocity: Vec3,
    positions: np.ndarray,
    velocities: np.ndarray,
    count: int,
    least: float,
    rate: float,
) -> Vec3:
    """Return the velocity to ask for instead of `wanted` so that neighbours keep their distance.

    Args:
        wanted: Velocity over ground that guidance asks for, NED [m/s].
        velocity: The present one [m/s].
        positions: From the UAV to each neighbour, NED, shape (count or more, 3) [m].
        velocities: Those of the neighbours over ground, NED, shape (count or more, 3) [m/s].
        count: Neighbours.
        least: Distance that is held, d_min [m].
        rate: γ [1/s].
    """
    for _ in range(_SWEEPS):
        for j in range(count):
            away = (-positions[j, 0], -positions[j, 1], -positions[j, 2])
            distance = norm(away)
            if not distance > _NO_DIRECTION or math.isinf(distance):
                continue
            away = scale(1.0 / distance, away)
            theirs = (velocities[j, 0], velocities[j, 1], velocities[j, 2])
            approach = dot(sub(velocity, theirs), away)
            lacking = -rate * (distance - least) - approach
            if lacking <= 0.0:
                continue
            short = dot(sub(velocity, wanted), away) + 0.5 * lacking
            if short > 0.0:
                wanted = add(wanted, scale(short, away))
    return wanted
