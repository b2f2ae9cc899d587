"""Adaptive fault-tolerant attitude controller, eqs. (37) to (39) and (57) of the paper."""

import math
from typing import NamedTuple

import numpy as np

from ftc_autopilot.common.schedule import scheduled
from ftc_autopilot.control.step import Step
from mavlink_defs.runtime.jit import inlined
from sitl_plant.airframe.aircraft import AircraftRecord
from sitl_plant.airframe.rigid_body import R2, R2_inv, angular_acceleration
from sitl_plant.vec3 import Vec3, add, dot, mat3, mul, mul_t, scale, square, sub, vec3


class AttitudeLaw(NamedTuple):
    """The attitude controller's command and the rates of its estimates."""

    delta_hat: Vec3  # aileron, elevator, rudder asked for, before saturation [rad]
    Phi_omega_dot: float
    beta_omega_dot: float
    zeta_omega: Vec3  # [rad/s²]


@inlined
def virtual_control(now: Step, K1: Vec3) -> Vec3:
    """Return the virtual control ω_d, eq. (57) [rad/s]; K1 by its diagonal."""
    lam, e_prime = now.errors.lambda_omega, now.errors.e_prime
    rates = add(
        (-K1[0] * e_prime[0], -K1[1] * e_prime[1], -K1[2] * e_prime[2]),
        add(scale(lam, now.reference.phi_dot), now.errors.e_dot_sum),
    )
    return scale(1.0 / lam, mul(R2(now.motion.phi), rates))


@inlined
def filtered_derivative(now: Step, omega_d: Vec3, tau_s: float, filtered: np.ndarray) -> Vec3:
    """Return the derivative of ω_d behind its filter of (57) [rad/s²], and advance the filter.

    Args:
        now: The present step; in the first one the filter starts at ω_d.
        omega_d: Virtual control [rad/s].
        tau_s: Time constant of the filter [s].
        filtered: ω_d behind the filter [rad/s], shape (3,), updated in place.
    """
    if now.first:
        for i in range(3):
            filtered[i] = omega_d[i]
    slope = scale(1.0 / tau_s, sub(omega_d, vec3(filtered)))
    for i in range(3):
        filtered[i] += now.dt * slope[i]
    return slope


@inlined
def zeta(
    now: Step,
    e_omega: Vec3,
    omega_d_dot: Vec3,
    K2: Vec3,
    network: Vec3,
    robust: Vec3,
    aircraft: AircraftRecord,
) -> Vec3:
    """Return ζ_ω of (37) [rad/s²]: minus the angular acceleration that the surfaces must make.

    Args:
        now: The present step.
        e_omega: ω - ω_d [rad/s].
        omega_d_dot: Filtered derivative of ω_d [rad/s²].
        K2: Diagonal of K2.
        network: Term of the network; 0 without one.
        robust: Robust term; 0 without one.
        aircraft: Nominal aircraft.
    """
    motion, errors = now.motion, now.errors
    J, J_inv = mat3(aircraft["J"]), mat3(aircraft["J_inv"])
    total = (K2[0] * e_omega[0], K2[1] * e_omega[1], K2[2] * e_omega[2])
    total = add(total, angular_acceleration(motion.omega, motion.air.N, J, J_inv))
    total = add(add(total, network), robust)
    total = add(total, scale(errors.lambda_omega, mul_t(R2_inv(motion.phi), errors.e_prime)))
    return sub(total, omega_d_dot)


@inlined
def attitude_law(
    now: Step,
    e_omega: Vec3,
    omega_d_dot: Vec3,
    basis: float,
    aircraft: AircraftRecord,
    gains: np.void,
    estimates: np.void,
) -> AttitudeLaw:
    """Evaluate eqs. (37), (38) and (39).

    Args:
        now: The present step, with the nominal moment N0 and control matrix C0.
        e_omega: ω - ω_d [rad/s].
        omega_d_dot: Filtered derivative of ω_d [rad/s²].
        basis: ςᵀς.
        aircraft: Nominal aircraft.
        gains: Parameters, record made of `ftc_autopilot.control.laws.proposed.Proposed`.
        estimates: Φ̂_ω, β̂_ω, record of dtype `Proposed.STATE`; read only.
    """
    Phi_omega, beta_omega = estimates["Phi_omega"], estimates["beta_omega"]
    h1_sq = square(gains["h_omega1"])
    h2_sq = square(gains["h_omega2"])

    Xi = scale(basis, e_omega)
    network = scale(Phi_omega / (2.0 * h1_sq), Xi)
    robust = scale(1.0 / (2.0 * h2_sq), e_omega)
    K2 = scheduled(gains["K2"], now.t)
    zeta_omega = zeta(now, e_omega, omega_d_dot, K2, network, robust, aircraft)

    b2_z2 = beta_omega * beta_omega * dot(zeta_omega, zeta_omega)
    b2_z2 = max(b2_z2, gains["gain_floor"])  # 0: the paper's law
    gain = -b2_z2 / math.sqrt(b2_z2 * dot(e_omega, e_omega) + gains["eps_omega"])
    Gt_e = mul_t(now.motion.air.C, mul_t(mat3(aircraft["J_inv"]), e_omega))  # Gᵀe_ω, G = J0⁻¹C0
    return AttitudeLaw(
        scale(gain, Gt_e),  # (37)
        gains["gamma_omega1"] * dot(e_omega, Xi) / (2.0 * h1_sq)
        - gains["sigma_omega1"] * Phi_omega,  # (38)
        gains["gamma_omega2"] * dot(e_omega, zeta_omega)
        - gains["sigma_omega2"] * beta_omega,  # (39)
        zeta_omega,
    )
