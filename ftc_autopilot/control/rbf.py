"""Radial basis functions, eqs. (23) and (24) of the paper.

Every output of the paper's network uses the same basis, so that all that the laws need of it
is the scalar ςᵀς.
"""

import math

import numpy as np

from mavlink_defs.config.models import Model
from mavlink_defs.config.quantity import quantity, whole
from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import Vec3, square


class Rbf(Model):
    """Radial basis functions (23), (24): centres on a diagonal, one width for all.

    Attributes:
        neurons: Number M of neurons.
        span: Centres span -span to span.
        width: Width kappa.
        speed_scale: Factor of the velocity in the network's input.
    """

    neurons: int = whole("", default=15, ge=1, le=64)
    span: float = quantity("", default=1.5, gt=0.0)
    width: float = quantity("", default=2.0, gt=0.0)
    speed_scale: float = quantity("s/m", default=0.025, gt=0.0)


@compiled
def basis_norm(v: Vec3, phi: Vec3, omega: Vec3, delta_filtered: Vec3, rbf: np.void) -> float:
    """Return ςᵀς for Θ = [v, ϕ, ω, δ_0 low-pass filtered], centres on the cube's diagonal.

    Args:
        v: Velocity, body axes [m/s]; scaled by the parameter `speed_scale`.
        phi: Roll, pitch, yaw [rad].
        omega: Angular velocity, body axes [rad/s].
        delta_filtered: Held surface commands behind the filter τ_δ [rad].
        rbf: Record made of `Rbf`.
    """
    k, kappa, span, M = rbf["speed_scale"], rbf["width"], rbf["span"], rbf["neurons"]
    spacing = 2.0 * span / max(M - 1, 1)
    total = 0.0
    for index in range(M):
        centre = index * spacing - span
        d2 = 0.0
        for j in range(3):
            d2 += square(k * v[j] - centre)
            d2 += square(phi[j] - centre)
            d2 += square(omega[j] - centre)
            d2 += square(delta_filtered[j] - centre)
        activation = math.exp(-d2 / (kappa * kappa))
        total += activation * activation
    return total
