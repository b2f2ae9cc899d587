"""Inversion of the nominal model: deflections for a moment, thrust from an acceleration."""

import numpy as np

from ftc_autopilot.control.motion import Motion
from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import Mat3, Vec3, add, dot, scale

__all__ = ["acceleration_without_thrust", "surfaces_for"]


@compiled
def surfaces_for(moment: Vec3, C: Mat3) -> Vec3:
    """Return deflections [rad] with C δ = moment [N m]; C as (10): the elevator stands alone."""
    determinant = C[0][0] * C[2][2] - C[0][2] * C[2][0]
    return (
        (moment[0] * C[2][2] - moment[2] * C[0][2]) / determinant,
        moment[1] / C[1][1],
        (moment[2] * C[0][0] - moment[0] * C[2][0]) / determinant,
    )


@compiled
def acceleration_without_thrust(motion: Motion, aircraft: np.void) -> float:
    """Return what V̇ would be without thrust: vᵀ(R1ᵀg + F0/m)/V [m/s²]."""
    specific = add(motion.gravity, scale(1.0 / aircraft["m"], motion.air.F))
    return dot(motion.v, specific) / motion.V
