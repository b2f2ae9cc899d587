"""Quantities of one UAV's flight that the simulation knows and the controller must not."""

import math
from dataclasses import dataclass

import numpy as np

from ftc_lab.theory.slopes import slopes
from gcs.results.recording import Recording
from gcs.scenario.model import Scenario
from mavlink_defs.faults.actuators import ACTUATOR_FAULTS
from sitl_plant.air.disturbance import disturbance_table
from sitl_plant.airframe.aerodynamics import control_effectiveness
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.config import true_aircraft


@dataclass(frozen=True)
class Neighbours:
    """The neighbours' last reports, as the laws had them at each step; SI, rad.

    Attributes:
        weights: a_ij, (degree,).
        V: (n, degree).
        V_dot: From their accelerometers, (n, degree).
        attitude: (n, degree, 3).
        attitude_dot: R2⁻¹ ω, (n, degree, 3).
    """

    weights: np.ndarray
    V: np.ndarray
    V_dot: np.ndarray
    attitude: np.ndarray
    attitude_dot: np.ndarray


@dataclass(frozen=True)
class Known:
    """Quantities at each step, under the command that is in force from that step on; SI, rad.

    Attributes:
        time_s: Shape (n,).
        period_s: Control period.
        signals: Shape (n,), dtype `ftc_autopilot.control.signals.SIGNALS`.
        present: Steps that the autopilot made and of which every number is finite, (n,).
        reported: Present steps for which `neighbours` is also known, (n,); none in real time,
            where the age of the neighbours' reports is not recorded.
        prompt: Steps at which the plant has received the held command, (n,); none in real time.
        neighbours: Their last reports.
        v: Velocity, body axes, (n, 3).
        attitude: Roll, pitch, yaw, (n, 3).
        omega: Angular velocity, body axes, (n, 3).
        lambda_v: λ = λ1 + λ2 Σ a_ij of the whole neighbourhood.
        lambda_omega: λ' = λ3 + λ4 Σ a_ij, the same.
        applied: Actuator positions and thrust at the start of the period, (n, 4).
        faulty: Whether a fault acts on the actuator, (n, 4).
        rho: Effectiveness of aileron, elevator, rudder, throttle, (n, 4).
        fault: Applied minus ρ times held, (n, 4): f of (13), (19), what the stops cut off, and
            what the plant had not received yet.
        V_dot: True V̇, (n,).
        omega_dot: True ω̇, (n, 3).
        drift_v: Nominal v̇ without thrust, -ω × v + R1ᵀg + F0/m, (n, 3).
        drift_omega: Nominal ω̇ without deflection, J0⁻¹ (S(J0 ω) ω + N0), (n, 3).
        delta_v: Δ_v + d_v of (15), (n, 3): true minus nominal v̇ under the same thrust, so that
            an error of the mass is in it too.
        delta_omega: Δ_ω + d_ω of (21), (n, 3).
        G: J0⁻¹ C0, (n, 3, 3).
        G_error: J⁻¹ C - J0⁻¹ C0 at V = 1 m/s, (3, 3), for Assumption 1.
        G_nominal: J0⁻¹ C0 at V = 1 m/s, (3, 3).
        mass: Nominal m [kg].
        limits: Lowest and highest command by channel, (2, 4).
        R2: Of (6), (n, 3, 3).
        wraps: Between which steps an angle of any UAV's e, or of this UAV's e - e_j, jumps from π
            to -π or back, and with it e' of this UAV or, a period later, of a neighbour; (n - 1,).
    """

    time_s: np.ndarray
    period_s: float
    signals: np.ndarray
    present: np.ndarray
    reported: np.ndarray
    prompt: np.ndarray
    neighbours: Neighbours
    v: np.ndarray
    attitude: np.ndarray
    omega: np.ndarray
    lambda_v: float
    lambda_omega: float
    applied: np.ndarray
    faulty: np.ndarray
    rho: np.ndarray
    fault: np.ndarray
    V_dot: np.ndarray
    omega_dot: np.ndarray
    drift_v: np.ndarray
    drift_omega: np.ndarray
    delta_v: np.ndarray
    delta_omega: np.ndarray
    G: np.ndarray
    G_error: np.ndarray
    G_nominal: np.ndarray
    mass: float
    limits: np.ndarray
    R2: np.ndarray
    wraps: np.ndarray


def known_quantities(recording: Recording, i: int, scenario: Scenario) -> Known:
    """Compute `Known` for UAV index i of a recording with at least one step."""
    uav_id, time_s, signals = recording.uav_ids[i], recording.time_s, recording.signals[:, i]
    states = np.ascontiguousarray(recording.states[:, i])
    applied = np.ascontiguousarray(recording.applied[:, i])
    aircraft, law = scenario.aircraft_of(uav_id), scenario.controller
    nominal, true = map(aircraft_record, (aircraft, true_aircraft(aircraft, scenario.uncertainty)))
    table = disturbance_table(scenario.disturbance)
    G_nominal, G_true = control_effectiveness(nominal), control_effectiveness(true)
    rho, faulty = _faults(scenario, uav_id, time_s)
    neighbours, reported = _neighbours(recording, i, scenario)
    present, lockstep = present_steps(recording, i), recording.mode != "real_time"
    a_sum = float(neighbours.weights.sum())
    with np.errstate(all="ignore"):  # a lost flight may end in NaN or inf
        slope = slopes(states, applied, time_s, table, true)
        excess = slope - slopes(states, applied, time_s, np.zeros_like(table), nominal)
        drift = slopes(states, np.zeros_like(applied), time_s, np.zeros_like(table), nominal)
        G = np.square(signals["V"])[:, None, None] * G_nominal
        fault = applied - rho * signals["held"]
        return Known(
            time_s=time_s,
            period_s=recording.step_us / 1e6,
            signals=signals,
            present=present,
            reported=present & reported & lockstep,
            prompt=present & lockstep,
            neighbours=neighbours,
            v=states[:, 3:6],
            attitude=states[:, 6:9],
            omega=states[:, 9:12],
            lambda_v=law.lambda1 + law.lambda2 * a_sum,
            lambda_omega=law.lambda3 + law.lambda4 * a_sum,
            applied=applied,
            faulty=faulty,
            rho=rho,
            fault=fault,
            V_dot=(states[:, 3:6] * slope[:, :3]).sum(axis=1) / signals["V"],
            omega_dot=slope[:, 3:],
            drift_v=drift[:, :3],
            drift_omega=drift[:, 3:],
            delta_v=excess[:, :3],
            delta_omega=excess[:, 3:] + np.einsum("kij,kj->ki", G, fault[:, :3]),
            G=G,
            G_error=G_true - G_nominal,
            G_nominal=G_nominal,
            mass=aircraft.mass_kg,
            limits=np.array([*nominal["stops"], (0.0, aircraft.thrust_limit_n)]).T,
            R2=R2(states[:, 6:9]),
            wraps=_wraps(recording.signals["error"][:, :, 1:], i),
        )


def present_steps(recording: Recording, i: int) -> np.ndarray:
    """Return a mask of the steps of UAV index i in which every recorded number is finite, (n,).

    Predictions and places on a path do not count: the paper's flights have none.
    """
    signals = recording.signals[:, i]
    present: np.ndarray = np.isfinite(recording.states[:, i]).all(axis=1)
    present &= np.isfinite(recording.applied[:, i]).all(axis=1)
    for name in set(signals.dtype.names or ()) - {"predicted_exit", "path_position", "slot"}:
        finite = np.isfinite(signals[name])
        present &= finite if finite.ndim == 1 else finite.all(axis=1)
    return present


def R2(attitude: np.ndarray) -> np.ndarray:
    """Return the matrices (6) from Euler angle rates to body rates; attitudes (n, 3) [rad]."""
    roll, pitch = attitude[:, 0], attitude[:, 1]
    zero, one = np.zeros_like(roll), np.ones_like(roll)
    rows = (
        (one, zero, -np.sin(pitch)),
        (zero, np.cos(roll), np.sin(roll) * np.cos(pitch)),
        (zero, -np.sin(roll), np.cos(roll) * np.cos(pitch)),
    )
    return np.moveaxis(np.array(rows), -1, 0)


def short_way(angle: np.ndarray) -> np.ndarray:
    """Wrap angle differences of any shape to (-π, π] [rad]."""
    turned: np.ndarray = angle - 2.0 * np.pi * np.ceil((angle - np.pi) / (2.0 * np.pi))
    return turned


def solve(matrices: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Solve a linear system per step, matrices (n, 3, 3) and vectors (n, 3); (n, 3)."""
    solution: np.ndarray = np.linalg.solve(matrices, vectors[..., None])[..., 0]
    return solution


def _neighbours(recording: Recording, i: int, scenario: Scenario) -> tuple[Neighbours, np.ndarray]:
    """Return the reports that UAV index i had, and a mask of the steps that had them, (n,).

    Step k uses what they derived from the state of step k - 1; step 0 uses its own state. With a
    trigger on the formation links it is extrapolated, and no step has such reports.
    """
    config = scenario.autopilot_config(recording.uav_ids[i]).neighbours
    others = [recording.uav_ids.index(neighbour.id) for neighbour in config]
    before = np.maximum(np.arange(len(recording.states)) - 1, 0)
    reported = np.full(len(before), scenario.links.formation.trigger is None)
    attitude = _heard(recording.signals["attitude"], before, others)
    rates = np.empty_like(attitude)
    for d, j in enumerate(others):
        reported &= present_steps(recording, j)[before]
        with np.errstate(all="ignore"):
            rates[:, d] = solve(R2(attitude[:, d]), recording.states[before, j, 9:12])
    neighbours = Neighbours(
        weights=np.array([neighbour.weight for neighbour in config]),
        V=_heard(recording.signals["V"], before, others),
        V_dot=_heard(recording.signals["V_dot"], before, others),
        attitude=attitude,
        attitude_dot=rates,
    )
    return neighbours, reported


def _heard(values: np.ndarray, before: np.ndarray, others: list[int]) -> np.ndarray:
    """Return values of other UAVs at earlier steps, from (n, uavs, ...) to (n, degree, ...)."""
    heard: np.ndarray = values[before[:, None], others]
    return heard


def _faults(scenario: Scenario, uav_id: int, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """ρ of (13), (19), and whether a fault acts, by step and actuator; shapes (n, 4)."""
    rho, faulty = np.ones((len(time_s), 4)), np.zeros((len(time_s), 4), bool)
    for target, fault in scenario.fault_commands():
        # of a sensor, this theory knows nothing
        if target == uav_id and fault.family is ACTUATOR_FAULTS:
            end_s = math.inf if math.isnan(fault.end_s) else fault.end_s
            acts = (fault.start_s <= time_s) & (time_s < end_s)  # as `apply_faults`
            rho[acts, fault.number] = fault.effectiveness
            faulty[acts, fault.number] = True
    return rho, faulty


def _wraps(e: np.ndarray, i: int) -> np.ndarray:
    """Steps within one of which an angle of e, (n, uavs, 3), or of e_i - e_j wraps; (n - 1,)."""
    angles = np.concatenate([e, short_way(e[:, [i]] - e)], axis=1)
    wraps: np.ndarray = np.any(np.abs(np.diff(angles, axis=0)) > np.pi, axis=(1, 2))
    near = wraps.copy()
    near[1:] |= wraps[:-1]
    near[:-1] |= wraps[1:]
    return near
