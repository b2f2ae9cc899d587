"""Adaptive fault-tolerant attitude controller, eqs. (37) to (39) and (57) of the paper."""

import math
from typing import NamedTuple

import numpy as np

from ftc_autopilot.common.motion import Motion
from ftc_autopilot.control.reference import Reference
from ftc_autopilot.control.synchronisation_errors import FormationErrors
from mavlink_defs.runtime.jit import compiled
from sitl_plant.rigid_body import R2, R2_inv, angular_acceleration
from sitl_plant.vec3 import Vec3, add, dot, mat3, mul, mul_t, scale, sub


class AttitudeLaw(NamedTuple):
    """The attitude controller's command and the rates of its estimates."""

    delta_hat: Vec3  # aileron, elevator, rudder asked for, before saturation [rad]
    Phi_omega_dot: float
    beta_omega_dot: float
    zeta_omega: Vec3  # [rad/s²]


@compiled
def virtual_control(
    errors: FormationErrors, motion: Motion, reference: Reference, K1: Vec3
) -> Vec3:
    """Return the virtual control ω_d, eq. (57) [rad/s].

    Args:
        errors: Formation errors.
        motion: Own motion.
        reference: Filtered reference.
        K1: Diagonal of K1.
    """
    lam = errors.lambda_omega
    e_prime = errors.e_prime
    rates = add(
        (-K1[0] * e_prime[0], -K1[1] * e_prime[1], -K1[2] * e_prime[2]),
        add(scale(lam, reference.phi_dot), errors.e_dot_sum),
    )
    return scale(1.0 / lam, mul(R2(motion.phi), rates))


@compiled
def limited(rates: Vec3, limit: float) -> Vec3:
    """Return rates with each component limited to ±limit [rad/s]; a limit of 0 is none."""
    if limit == 0.0:
        return rates
    p, q, r = rates
    return (
        min(max(p, -limit), limit),
        min(max(q, -limit), limit),
        min(max(r, -limit), limit),
    )


@compiled
def attitude_law(
    errors: FormationErrors,
    motion: Motion,
    e_omega: Vec3,
    omega_d_dot: Vec3,
    basis: float,
    Phi_omega: float,
    beta_omega: float,
    K2: Vec3,
    aircraft: np.void,
    gains: np.void,
) -> AttitudeLaw:
    """Evaluate eqs. (37), (38) and (39).

    Args:
        errors: Formation errors.
        motion: Own motion, with the nominal moment N0 and control matrix C0.
        e_omega: ω - ω_d [rad/s].
        omega_d_dot: Filtered derivative of ω_d [rad/s²].
        basis: ςᵀς.
        Phi_omega: Estimate Φ̂_ω.
        beta_omega: Estimate β̂_ω.
        K2: Diagonal of K2.
        aircraft: Nominal aircraft, dtype `sitl_plant.aircraft.AIRCRAFT`.
        gains: Parameters, record made of `ftc_autopilot.control.laws.proposed.Proposed`.
    """
    J_inv = mat3(aircraft["J_inv"])
    h1_sq = gains["h_omega1"] ** 2
    h2_sq = gains["h_omega2"] ** 2

    Xi = scale(basis, e_omega)
    zeta = (K2[0] * e_omega[0], K2[1] * e_omega[1], K2[2] * e_omega[2])
    zeta = add(zeta, angular_acceleration(motion.omega, motion.air.N, mat3(aircraft["J"]), J_inv))
    zeta = add(zeta, scale(Phi_omega / (2.0 * h1_sq), Xi))
    zeta = add(zeta, scale(1.0 / (2.0 * h2_sq), e_omega))
    zeta = add(zeta, scale(errors.lambda_omega, mul_t(R2_inv(motion.phi), errors.e_prime)))
    zeta = sub(zeta, omega_d_dot)

    b2_z2 = beta_omega * beta_omega * dot(zeta, zeta)
    gain = -b2_z2 / math.sqrt(b2_z2 * dot(e_omega, e_omega) + gains["eps_omega"])
    Gt_e = mul_t(motion.air.C, mul_t(J_inv, e_omega))  # Gᵀ e_ω with G = J0⁻¹ C0
    return AttitudeLaw(
        scale(gain, Gt_e),  # (37)
        gains["gamma_omega1"] * dot(e_omega, Xi) / (2.0 * h1_sq)
        - gains["sigma_omega1"] * Phi_omega,  # (38)
        gains["gamma_omega2"] * dot(e_omega, zeta) - gains["sigma_omega2"] * beta_omega,  # (39)
        zeta,
    )
