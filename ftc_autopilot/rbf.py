"""Radial basis functions, eqs. (23) and (24) of the paper.

Every output of the paper's network uses the same basis, so that all that the laws need of it
is the scalar ςᵀς.
"""

import math

import numpy as np

from mavlink_defs.jit import compiled
from sitl_plant.vec3 import Vec3

__all__ = ["basis_norm"]


@compiled
def basis_norm(v: Vec3, phi: Vec3, omega: Vec3, delta_filtered: Vec3, parameters: np.void) -> float:
    """ςᵀς for Θ = [v, ϕ, ω, δ_0 low-pass filtered], with centres on the diagonal of the cube.

    Args:
        v: Velocity, body axes [m/s]; scaled by the parameter `speed_scale`.
        phi: Roll, pitch, yaw [rad].
        omega: Angular velocity, body axes [rad/s].
        delta_filtered: Held surface commands behind the filter τ_δ [rad].
        parameters: Record of dtype `ftc_autopilot.parameters.PARAMETERS`.
    """
    k = parameters["speed_scale"]
    kappa = parameters["rbf_width"]
    total = 0.0
    for index in range(parameters["neurons"]):
        centre = parameters["centres"][index]
        d2 = 0.0
        for j in range(3):
            d2 += (k * v[j] - centre) ** 2
            d2 += (phi[j] - centre) ** 2
            d2 += (omega[j] - centre) ** 2
            d2 += (delta_filtered[j] - centre) ** 2
        activation = math.exp(-d2 / (kappa * kappa))
        total += activation * activation
    return total
