"""Backstepping on the nominal model: what compared controller 2 of the paper stands for.

The same errors, virtual control and gains as the proposed law, but the surfaces and the thrust
that the nominal aircraft needs, computed by inverting it: no adaptation, no tolerance of
faults, nothing that depends on a trigger.
"""

from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from ftc_autopilot.common.schedule import Schedule, schedule, scheduled
from ftc_autopilot.control.attitude import virtual_control
from ftc_autopilot.control.inversion import (
    acceleration_without_thrust,
    inversion_problem,
    surfaces_for,
)
from ftc_autopilot.control.laws.base import Demand, Instant, LawParameters
from ftc_autopilot.control.laws.gains import TABLE_III_K1, TABLE_III_K2, Gains
from mavlink_defs.config.quantity import quantity
from mavlink_defs.runtime.jit import compiled
from sitl_plant.config import Aircraft
from sitl_plant.rigid_body import R2_inv, angular_acceleration
from sitl_plant.vec3 import add, mat3, mul, mul_t, scale, sub, vec3


class Backstepping(LawParameters):
    """Parameters of nominal backstepping; gains as those of the proposed law."""

    STATE: ClassVar[np.dtype] = np.dtype([("omega_d_filtered", "f8", (3,))])  # rad/s

    kind: Literal["backstepping"] = Field(default="backstepping", description="Name of the law.")

    c_v: float = quantity("1/s", gt=0.0, default=10.0, doc="Gain of the speed error.")
    K1: Schedule[Gains] = schedule(TABLE_III_K1, doc="Gains of the attitude errors (57) [1/s].")
    K2: Schedule[Gains] = schedule(TABLE_III_K2, doc="Gains of the rate errors [1/s].")
    tau_omega_d_s: float = quantity("s", gt=0.0, default=0.015, doc="Filter of omega_d (57).")

    def misfits(self, aircraft: Aircraft) -> Iterator[str]:
        """Yield why the law cannot fly a nominal aircraft: its surfaces cannot be inverted."""
        if (problem := inversion_problem(aircraft)) is not None:
            yield problem


@compiled
def backstepping_law(now: Instant, aircraft: np.void, gains: np.void, state: np.void) -> Demand:
    """Make Ṽ'' = -c_v Ṽ' and ė_ω = -K2 e_ω - λ' R2⁻ᵀ e', if the nominal model were true.

    Args:
        now: The present step.
        aircraft: Nominal aircraft, dtype `sitl_plant.aircraft.AIRCRAFT`.
        gains: Parameters, record made of `Backstepping`.
        state: Record of dtype `Backstepping.STATE`, updated in place.
    """
    motion, errors = now.motion, now.errors
    m, lam = aircraft["m"], errors.lambda_v
    known = acceleration_without_thrust(motion, aircraft)
    r_v = lam * now.reference.V_dot + errors.V_tilde_dot_sum
    zeta_v = motion.v[0] * lam / (m * motion.V)
    T = (r_v - lam * known - gains["c_v"] * errors.V_tilde_prime) / zeta_v

    omega_d = virtual_control(errors, motion, now.reference, scheduled(gains["K1"], now.t))
    filtered = state["omega_d_filtered"]
    if now.first:
        for i in range(3):
            filtered[i] = omega_d[i]
    omega_d_dot = scale(1.0 / gains["tau_omega_d_s"], sub(omega_d, vec3(filtered)))
    e_omega = sub(motion.omega, omega_d)
    K2 = scheduled(gains["K2"], now.t)
    J, J_inv = mat3(aircraft["J"]), mat3(aircraft["J_inv"])
    zeta = (K2[0] * e_omega[0], K2[1] * e_omega[1], K2[2] * e_omega[2])
    zeta = add(zeta, angular_acceleration(motion.omega, motion.air.N, J, J_inv))
    zeta = add(zeta, scale(errors.lambda_omega, mul_t(R2_inv(motion.phi), errors.e_prime)))
    zeta = sub(zeta, omega_d_dot)
    for i in range(3):
        filtered[i] += now.dt * omega_d_dot[i]
    return Demand(surfaces_for(scale(-1.0, mul(J, zeta)), motion.air.C), T)
