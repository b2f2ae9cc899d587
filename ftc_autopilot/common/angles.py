"""Angles."""

import math

from mavlink_defs.runtime.jit import compiled


@compiled
def wrap(angle: float) -> float:
    """Return the angle in (-π, π] that is congruent to `angle` [rad]; exact if in range."""
    if -math.pi < angle <= math.pi:
        return angle
    return -((math.pi - angle) % (2.0 * math.pi) - math.pi)
