"""What a simulation knows of one UAV's flight and a controller must not know."""

import math
from dataclasses import dataclass

import numpy as np

from gcs.recording import Recording
from gcs.scenario import Scenario
from gcs.theory.slopes import euler_rates, slopes
from sitl_plant.aerodynamics import aerodynamics
from sitl_plant.aircraft import aircraft_record
from sitl_plant.config import true_aircraft
from sitl_plant.disturbance import disturbance_table

__all__ = ["Known", "known_quantities"]


@dataclass(frozen=True)
class Known:
    """Quantities at each step, under the command that is in force from that step on; SI, rad.

    Attributes:
        time_s: Shape (n,).
        signals: Shape (n,), dtype `ftc_autopilot.controller.SIGNALS`.
        lambda_v: λ = λ1 + λ2 Σ a_ij of the whole neighbourhood.
        lambda_omega: λ' = λ3 + λ4 Σ a_ij, likewise.
        rho: Effectiveness of aileron, elevator, rudder, throttle, (n, 4).
        fault: Applied minus ρ times held, (n, 4): f of (13), (19), what the stops cut off, and
            what the plant had not received yet.
        V_dot: True V̇, (n,).
        omega_dot: True ω̇, (n, 3).
        delta_v: Δ_v + d_v of (15), (n, 3): true minus nominal v̇ under the same thrust, so that
            an error of the mass is in it too.
        delta_omega: Δ_ω + d_ω of (21), (n, 3).
        G: J0⁻¹ C0, (n, 3, 3).
        e_omega_rates: R2⁻¹ e_ω, (n, 3).
        yaw_wraps: Between which steps the yaw error of any UAV jumps from π to -π or back, and
            with it e' of this UAV or, a period later, of a neighbour; (n - 1,).
    """

    time_s: np.ndarray
    signals: np.ndarray
    lambda_v: float
    lambda_omega: float
    rho: np.ndarray
    fault: np.ndarray
    V_dot: np.ndarray
    omega_dot: np.ndarray
    delta_v: np.ndarray
    delta_omega: np.ndarray
    G: np.ndarray
    e_omega_rates: np.ndarray
    yaw_wraps: np.ndarray


def known_quantities(recording: Recording, i: int, scenario: Scenario) -> Known:
    """Compute them for UAV index i of a recording with at least one step."""
    uav_id, time_s = recording.uav_ids[i], recording.time_s
    states = np.ascontiguousarray(recording.states[:, i])
    applied = np.ascontiguousarray(recording.applied[:, i])
    signals = recording.signals[:, i]
    nominal = aircraft_record(scenario.aircraft)
    true = aircraft_record(true_aircraft(scenario.aircraft, scenario.uncertainty))
    table = disturbance_table(scenario.disturbance)
    with np.errstate(all="ignore"):  # a lost flight may end in numbers that are none
        slope = slopes(states, applied, time_s, table, true)
        excess = slope - slopes(states, applied, time_s, np.zeros_like(table), nominal)
        C_by_V2 = aerodynamics((1.0, 0.0, 0.0), (0.0, 0.0, 0.0), nominal).C  # (10): C0 ~ V²
        G = np.square(signals["V"])[:, None, None] * (nominal["J_inv"] @ np.array(C_by_V2))
        rho = _effectiveness(scenario, uav_id, time_s)
        fault = applied - rho * signals["held"]
        v = states[:, 3:6]
        law = scenario.controller
        a_sum = sum(n.weight for n in scenario.autopilot_config(uav_id).neighbours)
        return Known(
            time_s=time_s,
            signals=signals,
            lambda_v=law.lambda1 + law.lambda2 * a_sum,
            lambda_omega=law.lambda3 + law.lambda4 * a_sum,
            rho=rho,
            fault=fault,
            V_dot=(v * slope[:, :3]).sum(axis=1) / signals["V"],
            omega_dot=slope[:, 3:],
            delta_v=excess[:, :3],
            delta_omega=excess[:, 3:] + np.einsum("kij,kj->ki", G, fault[:, :3]),
            G=G,
            e_omega_rates=euler_rates(
                np.ascontiguousarray(states[:, 6:9]), np.ascontiguousarray(signals["e_omega"])
            ),
            yaw_wraps=_yaw_wraps(recording.signals["error"][:, :, 3]),
        )


def _effectiveness(scenario: Scenario, uav_id: int, time_s: np.ndarray) -> np.ndarray:
    """ρ of (13), (19) by step and actuator, shape (n, 4)."""
    rho = np.ones((len(time_s), 4))
    for faulty, fault in scenario.fault_commands():
        if faulty == uav_id:
            end_s = math.inf if math.isnan(fault.end_s) else fault.end_s
            acts = (fault.start_s <= time_s) & (time_s < end_s)  # as `apply_faults`
            rho[acts, fault.actuator] = fault.effectiveness
    return rho


def _yaw_wraps(yaw_errors: np.ndarray) -> np.ndarray:
    """Steps within one of which any of the yaw errors, (n, uavs), wraps; (n - 1,)."""
    wraps: np.ndarray = np.any(np.abs(np.diff(yaw_errors, axis=0)) > np.pi, axis=1)
    near = wraps.copy()
    near[1:] |= wraps[:-1]
    near[:-1] |= wraps[1:]
    return near
