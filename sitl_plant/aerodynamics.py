"""Aerodynamic force, moment and control matrix, eqs. (7) to (10) of the paper.

Valid for attached flow: coefficients are linear in the angle of attack and in the angle of
sideslip. Airspeed must be positive.
"""

import math
from typing import NamedTuple

import numpy as np

from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import Mat3, Vec3, mul_t, norm, scale


class Aerodynamics(NamedTuple):
    """Airspeed, aerodynamic force, moment and control matrix."""

    V: float  # airspeed [m/s]
    F: Vec3  # force, body axes [N]
    N: Vec3  # moment without control surfaces, body axes [N m]
    C: Mat3  # moment per aileron, elevator, rudder deflection [N m/rad]


@compiled
def R3(alpha: float, beta: float) -> Mat3:
    """Return the rotation from body to wind axes, eq. (9); angle of attack and sideslip in rad."""
    ca, sa, cb, sb = math.cos(alpha), math.sin(alpha), math.cos(beta), math.sin(beta)
    return (ca * cb, sb, sa * cb), (-ca * sb, cb, -sa * sb), (-sa, 0.0, ca)


@compiled
def aerodynamics(v: Vec3, omega: Vec3, aircraft: np.void) -> Aerodynamics:
    """Evaluate eqs. (7) to (10).

    Args:
        v: Velocity through the air, body axes [m/s].
        omega: Angular velocity, body axes [rad/s].
        aircraft: Record of dtype `sitl_plant.aircraft.AIRCRAFT`.
    """
    V = norm(v)
    alpha = math.atan2(v[2], v[0])
    beta = math.asin(v[1] / V)
    b, c_bar = aircraft["b"], aircraft["c_bar"]
    qS = 0.5 * aircraft["rho"] * V * V * aircraft["S"]

    if aircraft["per_rad_s"]:
        p, q, r = omega
    else:
        p = omega[0] * b / (2.0 * V)
        q = omega[1] * c_bar / (2.0 * V)
        r = omega[2] * b / (2.0 * V)

    C_D = aircraft["cD0"]
    C_Y = aircraft["cY_beta"] * beta
    C_L = aircraft["cL0"] + aircraft["cL_alpha"] * alpha
    C_l = aircraft["cl0"] + aircraft["cl_beta"] * beta + aircraft["cl_p"] * p + aircraft["cl_r"] * r
    C_M = aircraft["cm0"] + aircraft["cm_alpha"] * alpha + aircraft["cm_q"] * q
    C_n = aircraft["cn0"] + aircraft["cn_beta"] * beta + aircraft["cn_p"] * p + aircraft["cn_r"] * r

    F = scale(qS, mul_t(R3(alpha, beta), (-C_D, C_Y, -C_L)))  # (7)
    N = scale(qS, (b * C_l, c_bar * C_M, b * C_n))  # (8)
    qSb, qSc = qS * b, qS * c_bar
    C = (  # (10)
        (qSb * aircraft["cl_da"], 0.0, qSb * aircraft["cl_dr"]),
        (0.0, qSc * aircraft["cm_de"], 0.0),
        (qSb * aircraft["cn_da"], 0.0, qSb * aircraft["cn_dr"]),
    )
    return Aerodynamics(V, F, N, C)
