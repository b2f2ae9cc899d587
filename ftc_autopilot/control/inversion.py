"""Inversion of the nominal model: deflections for a moment, thrust from an acceleration."""

import numpy as np

from ftc_autopilot.common.motion import Motion
from mavlink_defs.constants import ACTUATORS, THROTTLE
from mavlink_defs.runtime.jit import compiled
from sitl_plant.aircraft import aircraft_record
from sitl_plant.config import Aircraft
from sitl_plant.vec3 import Mat3, Vec3, add, dot, scale

_LEAST_EFFECT = 1e-3
"""Least effect of the weakest combination of the surfaces, by that of the strongest one.

Below it, what a degree of the one does takes more than 1000° of the other.
"""
_CONCERNED = 0.3  # share of a surface in that combination from which on it is named


def inversion_problem(aircraft: Aircraft) -> str | None:
    """Return why deflections for a moment cannot be computed for an aircraft; None if they can.

    The matrix J⁻¹C0 of the angular accelerations per deflection is judged by its singular values.
    Its shape is the same in the whole flight envelope: (10) has no angle of attack or sideslip, and
    airspeed and air density scale it as a whole.
    """
    a = aircraft_record(aircraft)
    b, c = a["b"], a["c_bar"]
    with np.errstate(all="ignore"):
        effect = a["J_inv"] @ np.array(
            [
                [b * a["cl_da"], 0.0, b * a["cl_dr"]],
                [0.0, c * a["cm_de"], 0.0],
                [b * a["cn_da"], 0.0, b * a["cn_dr"]],
            ]
        )
    if not np.isfinite(effect).all():
        return "the effect of its surfaces is too large for a float"
    _, sizes, combinations = np.linalg.svd(effect)
    if sizes[-1] >= _LEAST_EFFECT * sizes[0] > 0.0:
        return None
    names = zip(ACTUATORS[:THROTTLE], np.abs(combinations[-1]), strict=True)
    weak = " and ".join(name for name, part in names if part > _CONCERNED)
    ratio = sizes[-1] / sizes[0] if sizes[0] > 0.0 else 0.0
    return (
        f"no moment can be made by its {weak}: least by largest effect of the surfaces is "
        f"{ratio:.3g}, expected >= {_LEAST_EFFECT:g}"
    )


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
