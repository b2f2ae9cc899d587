"""The paper's controller: adaptive, fault-tolerant, for speed and attitude."""

from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np

from ftc_autopilot.common.schedule import Schedule, schedule, scheduled
from ftc_autopilot.control.attitude import (
    AttitudeLaw,
    attitude_law,
    filtered_derivative,
    virtual_control,
)
from ftc_autopilot.control.laws.base import TABLE_III_K1, TABLE_III_K2, Gains, LawParameters
from ftc_autopilot.control.rbf import Rbf, basis_norm
from ftc_autopilot.control.signals import SIGNALS
from ftc_autopilot.control.speed import SpeedLaw, speed_law
from ftc_autopilot.control.step import ALL, Command, SignalsRecord, Step
from mavlink_defs.config.quantity import quantity
from mavlink_defs.runtime.jit import apart, compiled
from sitl_plant.airframe.aircraft import AIRCRAFT, AircraftRecord
from sitl_plant.airframe.config import Aircraft
from sitl_plant.vec3 import clamp_each, sub, vec3


class Proposed(LawParameters):
    """The paper's law, which learns the forces and moments that its model lacks, faults included.

    Choose it to reproduce the paper, or where an actuator gets weak but does not fail. Its
    equations are (31) to (39) and (57).

    Attributes:
        kind: Name of the law.
        c_v: Gain of the speed law (33).
        eps_v: Smoothing of the speed law (33).
        gamma_v1: Rate of Phi_v (34).
        gamma_v2: Rate of g_v (35).
        gamma_v3: Rate of beta_v (36).
        sigma_v1: Leakage of Phi_v (34).
        sigma_v2: Leakage of g_v (35).
        sigma_v3: Leakage of beta_v (36).
        h_v1: Weight of the network (33), (34).
        h_v2: Weight of the robust term (33).
        K1: Gains of the attitude errors (57) [1/s].
        K2: Gains of the rate errors [1/s].
        eps_omega: Smoothing of the attitude law (37).
        gamma_omega1: Rate of Phi_omega (38).
        gamma_omega2: Rate of beta_omega (39).
        sigma_omega1: Leakage of Phi_omega (38).
        sigma_omega2: Leakage of beta_omega (39).
        h_omega1: Weight of the network (37), (38).
        h_omega2: Weight of the robust term (37).
        gain_floor: Least beta_omega^2 |zeta_omega|^2 in (37); 0: the paper's law.
        tau_omega_d_s: Filter of omega_d (57).
        omega_d_limit_deg_s: Limit of each component of omega_d (57); 0: none.
        tau_delta_s: Filter of delta_0 (23).
        phi_v0: Phi_v at t = 0.
        g_v0: g_v at t = 0.
        beta_v0: beta_v at t = 0.
        phi_omega0: Phi_omega at t = 0.
        beta_omega0: beta_omega at t = 0.
        rbf: The network's radial basis functions.
    """

    PAGE: ClassVar[str] = "explanation/method.md"
    STATE: ClassVar[np.dtype] = np.dtype(
        [
            ("Phi_v", "f8"),
            ("g_v", "f8"),
            ("beta_v", "f8"),
            ("Phi_omega", "f8"),
            ("beta_omega", "f8"),
            ("omega_d_filtered", "f8", (3,)),  # rad/s
            ("delta_filtered", "f8", (3,)),  # rad
        ]
    )

    kind: Literal["proposed"] = "proposed"

    c_v: float = quantity("1/s", default=10.0, gt=0.0)
    eps_v: float = quantity("", default=0.1, gt=0.0)
    gamma_v1: float = quantity("", default=0.0037, gt=0.0)
    gamma_v2: float = quantity("", default=0.0094, gt=0.0)
    gamma_v3: float = quantity("", default=0.052, gt=0.0)
    sigma_v1: float = quantity("1/s", default=0.11, ge=0.0)
    sigma_v2: float = quantity("1/s", default=0.06, ge=0.0)
    sigma_v3: float = quantity("1/s", default=0.14, ge=0.0)
    h_v1: float = quantity("", default=0.93, gt=0.0)
    h_v2: float = quantity("", default=9.2, gt=0.0)

    K1: Schedule[Gains] = schedule(TABLE_III_K1)
    K2: Schedule[Gains] = schedule(TABLE_III_K2)
    eps_omega: float = quantity("", default=1.0, gt=0.0)
    gamma_omega1: float = quantity("", default=0.01, gt=0.0)
    gamma_omega2: float = quantity("", default=0.01, gt=0.0)
    sigma_omega1: float = quantity("1/s", default=25.0, ge=0.0)
    sigma_omega2: float = quantity("1/s", default=25.0, ge=0.0)
    h_omega1: float = quantity("", default=0.28, gt=0.0)
    h_omega2: float = quantity("", default=3.4, gt=0.0)
    gain_floor: float = quantity("", default=0.0, ge=0.0, le=100.0)
    tau_omega_d_s: float = quantity("s", default=0.015, gt=0.0)
    omega_d_limit_deg_s: float = quantity("deg/s", default=0.0, ge=0.0, le=3600.0)
    tau_delta_s: float = quantity("s", default=0.01, gt=0.0)

    phi_v0: float = quantity("", default=0.0, ge=0.0, le=100.0)
    g_v0: float = quantity("", default=0.0, ge=0.0, le=100.0)
    beta_v0: float = quantity("", default=1.0, ge=0.0)
    phi_omega0: float = quantity("", default=0.0, ge=0.0, le=100.0)
    beta_omega0: float = quantity("", default=0.011, ge=0.0)

    rbf: Rbf = Rbf()

    def misfits(self, aircraft: Aircraft) -> Iterator[str]:
        """Yield why the law cannot fly a nominal aircraft: it holds the heading by a rudder."""
        if not aircraft.has("rudder"):
            yield "the aircraft has no rudder to hold the heading"


@apart(aircraft=AIRCRAFT, gains=Proposed.record(), state=Proposed.STATE, signals=SIGNALS)
def proposed_law(
    now: Step, aircraft: AircraftRecord, gains: np.void, state: np.void, signals: SignalsRecord
) -> Command:
    """Evaluate eqs. (33) to (39) and (57), then advance the estimates by explicit Euler.

    Args:
        now: The present step.
        aircraft: Nominal aircraft.
        gains: Parameters, record made of `Proposed`.
        state: Record of dtype `Proposed.STATE`, updated in place.
        signals: Inner quantities are written.
    """
    motion = now.motion
    if now.first:
        state["Phi_v"], state["g_v"] = gains["phi_v0"], gains["g_v0"]
        state["beta_v"] = gains["beta_v0"]
        state["Phi_omega"], state["beta_omega"] = gains["phi_omega0"], gains["beta_omega0"]
    delta_filtered = state["delta_filtered"]
    for i in range(3):  # δ_0 was held over the period that ends here
        delta_filtered[i] += now.dt / gains["tau_delta_s"] * (now.held[i] - delta_filtered[i])
    basis = basis_norm(motion.v, motion.phi, motion.omega, vec3(delta_filtered), gains["rbf"])

    speed = speed_law(now, basis, aircraft, gains, state)

    omega_d = virtual_control(now, scheduled(gains["K1"], now.t))
    if gains["omega_d_limit_rad_s"] > 0.0:
        omega_d = clamp_each(omega_d, gains["omega_d_limit_rad_s"])
    omega_d_dot = filtered_derivative(
        now, omega_d, gains["tau_omega_d_s"], state["omega_d_filtered"]
    )
    e_omega = sub(motion.omega, omega_d)
    attitude = attitude_law(now, e_omega, omega_d_dot, basis, aircraft, gains, state)

    _record(signals, state, basis, speed, attitude)
    for i in range(3):
        signals["omega_d"][i] = omega_d[i]
        signals["omega_d_dot"][i] = omega_d_dot[i]
        signals["e_omega"][i] = e_omega[i]

    state["Phi_v"] += now.dt * speed.Phi_v_dot
    state["g_v"] += now.dt * speed.g_v_dot
    state["beta_v"] += now.dt * speed.beta_v_dot
    state["Phi_omega"] += now.dt * attitude.Phi_omega_dot
    state["beta_omega"] += now.dt * attitude.beta_omega_dot
    return Command(attitude.delta_hat, speed.T_hat, ALL)


@compiled
def _record(
    signals: SignalsRecord, estimates: np.void, basis: float, speed: SpeedLaw, attitude: AttitudeLaw
) -> None:
    """Write the laws' inner quantities, the estimates as they were used."""
    signals["Phi_v"], signals["g_v"] = estimates["Phi_v"], estimates["g_v"]
    signals["beta_v"] = estimates["beta_v"]
    signals["Phi_omega"] = estimates["Phi_omega"]
    signals["beta_omega"] = estimates["beta_omega"]
    signals["Phi_v_dot"], signals["g_v_dot"] = speed.Phi_v_dot, speed.g_v_dot
    signals["beta_v_dot"] = speed.beta_v_dot
    signals["Phi_omega_dot"] = attitude.Phi_omega_dot
    signals["beta_omega_dot"] = attitude.beta_omega_dot
    signals["basis"] = basis
    signals["alpha_v"], signals["r_v"] = speed.alpha_v, speed.r_v
    signals["zeta_v"], signals["B_v"] = speed.zeta_v, speed.B_v
    for i in range(3):
        signals["zeta_omega"][i] = attitude.zeta_omega[i]
