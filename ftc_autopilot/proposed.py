"""The paper's controller: adaptive, fault-tolerant, for speed and attitude."""

import numpy as np

from ftc_autopilot.attitude import attitude_law, virtual_control
from ftc_autopilot.formation import FormationErrors
from ftc_autopilot.motion import Motion
from ftc_autopilot.parameters import scheduled
from ftc_autopilot.rbf import basis_norm
from ftc_autopilot.reference import Reference
from ftc_autopilot.speed import speed_law
from mavlink_defs.jit import compiled
from sitl_plant.vec3 import scale, sub, vec3

__all__ = ["proposed_law"]


@compiled
def proposed_law(
    t: float,
    dt: float,
    motion: Motion,
    reference: Reference,
    errors: FormationErrors,
    aircraft: np.void,
    parameters: np.void,
    state: np.void,
    signals: np.void,
) -> None:
    """Evaluate eqs. (33) to (39) and (57), then advance the estimates by explicit Euler.

    Args:
        t: Time that the gain schedules run on [s].
        dt: Control period [s].
        motion: Own motion.
        reference: Filtered reference.
        errors: Formation errors.
        aircraft: Nominal aircraft, dtype `sitl_plant.aircraft.AIRCRAFT`.
        parameters: Record of dtype `ftc_autopilot.parameters.PARAMETERS`.
        state: Record of dtype `ftc_autopilot.controller.CONTROLLER`, updated in place.
        signals: Record of dtype `ftc_autopilot.controller.SIGNALS`; `demand` and the law's
            inner quantities are written.
    """
    delta_filtered, held = state["delta_filtered"], state["held"]
    for i in range(3):  # δ_0 was held over the period that ends here
        delta_filtered[i] += dt / parameters["tau_delta"] * (held[i] - delta_filtered[i])
    basis = basis_norm(motion.v, motion.phi, motion.omega, vec3(delta_filtered), parameters)

    speed = speed_law(
        errors,
        motion,
        reference,
        basis,
        state["Phi_v"],
        state["g_v"],
        state["beta_v"],
        scheduled(parameters["a1"], t)[0],
        aircraft["m"],
        parameters,
    )

    omega_d = virtual_control(errors, motion, reference, scheduled(parameters["K1"], t), parameters)
    if state["steps"] == 0:
        for i in range(3):
            state["omega_d_filtered"][i] = omega_d[i]
    omega_d_dot = scale(
        1.0 / parameters["tau_omega_d"], sub(omega_d, vec3(state["omega_d_filtered"]))
    )
    e_omega = sub(motion.omega, omega_d)
    attitude = attitude_law(
        errors,
        motion,
        e_omega,
        omega_d_dot,
        basis,
        state["Phi_omega"],
        state["beta_omega"],
        scheduled(parameters["K2"], t),
        aircraft,
        parameters,
    )

    signals["Phi_v"], signals["g_v"], signals["beta_v"] = (
        state["Phi_v"], state["g_v"], state["beta_v"],
    )  # fmt: skip
    signals["Phi_omega"], signals["beta_omega"] = state["Phi_omega"], state["beta_omega"]
    signals["Phi_v_dot"], signals["g_v_dot"] = speed.Phi_v_dot, speed.g_v_dot
    signals["beta_v_dot"] = speed.beta_v_dot
    signals["Phi_omega_dot"] = attitude.Phi_omega_dot
    signals["beta_omega_dot"] = attitude.beta_omega_dot
    signals["basis"] = basis
    signals["alpha_v"], signals["r_v"] = speed.alpha_v, speed.r_v
    signals["zeta_v"], signals["B_v"] = speed.zeta_v, speed.B_v
    for i in range(3):
        signals["omega_d"][i] = omega_d[i]
        signals["omega_d_dot"][i] = omega_d_dot[i]
        signals["e_omega"][i] = e_omega[i]
        signals["zeta_omega"][i] = attitude.zeta_omega[i]
        signals["demand"][i] = attitude.delta_hat[i]
        state["omega_d_filtered"][i] += dt * omega_d_dot[i]
    signals["demand"][3] = speed.T_hat

    state["Phi_v"] += dt * speed.Phi_v_dot
    state["g_v"] += dt * speed.g_v_dot
    state["beta_v"] += dt * speed.beta_v_dot
    state["Phi_omega"] += dt * attitude.Phi_omega_dot
    state["beta_omega"] += dt * attitude.beta_omega_dot
