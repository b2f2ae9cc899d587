"""What laws, triggers and diagnosis remember, over two successive steps, by their equations.

One step from given estimates shows no estimate that stands still, or moves twice as fast.
"""

import math
from typing import Any

import numpy as np
import pytest
from courses import Pilot, motion_at
from steps import COMMANDS, step_of

from ftc_autopilot.common.motion import MeasuredMotion
from ftc_autopilot.control.controller import new_controller, parameter_record
from ftc_autopilot.control.diagnosis.regression import learn, restart
from ftc_autopilot.control.diagnosis.state import ACTUATOR
from ftc_autopilot.control.laws.pid import Pid
from ftc_autopilot.control.laws.proposed import Proposed
from ftc_autopilot.control.laws.surviving import Surviving
from ftc_autopilot.control.laws.tube import Tube
from ftc_autopilot.control.laws.tube.observer import observe
from ftc_autopilot.control.reference import filter_reference
from ftc_autopilot.control.state_predictor import DELAY, note_commands
from ftc_autopilot.control.triggers import TRIGGERS, decide
from ftc_autopilot.control.triggers.base import Candidates
from ftc_autopilot.control.triggers.static import PerChannel
from gcs.scenario.model import Scenario
from mavlink_defs.constants import AILERON, ELEVATOR, RUDDER, THROTTLE
from sitl_plant.actuators.config import ActuatorServos

DT = 1e-3
LONG_S = 0.3
AT_45 = (45.0, 0.0, 0.1, 3.0)


def exactly(expected: Any) -> Any:
    return pytest.approx(expected, rel=1e-10, abs=1e-13)


def flying(law: Any, scenario: Scenario) -> Pilot:
    return Pilot(law.with_servos(ActuatorServos()), PerChannel(), scenario.aircraft, DT)


def alone(pilot: Pilot) -> tuple[MeasuredMotion, MeasuredMotion]:
    """Let a pilot have no neighbours; gives two motions, one after the other."""
    pilot.edges["weight"] = 0.0
    return motion_at(0.2, pilot.nominal), motion_at(0.25, pilot.nominal)


def test_estimates_of_the_proposed_law(scenario1: Scenario) -> None:
    law = Proposed(phi_v0=0.3, g_v0=0.2, phi_omega0=0.1)
    pilot = flying(law, scenario1)
    motions = alone(pilot)
    names = ("Phi_v", "g_v", "beta_v", "Phi_omega", "beta_omega")
    expected = np.array([0.3, 0.2, law.beta_v0, 0.1, law.beta_omega0])
    omega_d, delta = np.zeros(3), np.zeros(3)
    for k, motion in enumerate(motions):
        held = np.array(pilot.state["held"][:3])
        now = pilot.step(motion, AT_45)
        assert [now[name] for name in names] == exactly(expected)
        if k == 0:
            omega_d = now["omega_d"].copy()
        assert now["omega_d_dot"] == exactly((now["omega_d"] - omega_d) / law.tau_omega_d_s)
        omega_d += DT / law.tau_omega_d_s * (now["omega_d"] - omega_d)
        delta += DT / law.tau_delta_s * (held - delta)

        V, v, error, lam = motion.V, np.array(motion.v), now["sync_error"][0], law.lambda1
        approximation = error * now["basis"] * (v @ v) / V**2 / (2.0 * law.h_v1**2)
        e, zeta, basis = now["e_omega"], now["zeta_omega"], now["basis"]
        inputs = (
            lam * law.gamma_v1 * error * approximation,
            law.gamma_v2 * abs(error) * now["zeta_v"],
            law.gamma_v3 * error * (now["alpha_v"] - now["r_v"]),
            law.gamma_omega1 * basis * (e @ e) / (2.0 * law.h_omega1**2),
            law.gamma_omega2 * (e @ zeta),
        )
        leakage = (law.sigma_v1, law.sigma_v2, law.sigma_v3, law.sigma_omega1, law.sigma_omega2)
        expected = expected + DT * (np.array(inputs) - np.array(leakage) * expected)
    estimates = pilot.state["proposed"]
    assert [estimates[name] for name in names] == exactly(expected)
    assert estimates["omega_d_filtered"] == exactly(omega_d)
    assert np.abs(delta).max() > 0.0
    assert estimates["delta_filtered"] == exactly(delta)


def test_integrals_of_the_pid_law(scenario1: Scenario) -> None:
    law = Pid(
        rate_ff=(0.0,) * 3, rate_p=(0.3,) * 3, speed_p_n_s_m=0.0, integral_limit_deg=(90.0,) * 3
    )
    pilot = flying(law, scenario1)
    integral, thrust, stop = np.zeros(3), 0.0, float(pilot.nominal["stops"][0, 1])
    for motion in alone(pilot):
        now = pilot.step(motion, (45.0, *motion.phi))
        scaling = (law.trim_airspeed_m_s / motion.V) ** 2
        error = -(now["demand"][:3] / scaling + integral) / np.array(law.rate_p)
        assert np.abs(now["demand"][:3]).max() < stop
        assert now["demand"][THROTTLE] == exactly(law.thrust_trim_n + thrust)
        integral += DT * np.array(law.rate_i) * error
        thrust -= DT * law.speed_i_n_m * now["error"][0]
    assert pilot.state["pid"]["integral"] == exactly(integral)
    assert pilot.state["pid"]["thrust_integral"] == exactly(thrust)


def test_the_reference_filter() -> None:
    """From rest, (ω/(s+ω))³ by explicit Euler: jerk, acceleration, rate, one step after another."""
    x, w = np.zeros((4, 3)), 2.5
    for _ in range(3):
        filter_reference(np.ones(4), x, w, DT)
    bends = [DT * w**3]
    bends.append(bends[0] + DT * (w**3 - 3.0 * w * bends[0]))
    slope = DT * (bends[0] + bends[1])
    value = DT * (DT * bends[0])
    bends.append(bends[1] + DT * (w**3 - 3.0 * w**2 * DT * bends[0] - 3.0 * w * bends[1]))
    for row in x:
        assert list(row) == exactly([value, slope, bends[2]])


def test_the_variable_of_the_dynamic_trigger() -> None:
    trigger = TRIGGERS["dynamic"](mode="dynamic")
    parameters = parameter_record(Proposed(), trigger)
    states = new_controller()["trigger"]
    moved, decay = (0.2, 0.4, 0.0, 0.6), parameters["trigger"]["dynamic"]
    now = Candidates(
        dt=DT,
        first=0,
        selected=15,
        commanded=moved,
        held=(0.0,) * 4,
        relative=(0.1,) * 4,
        absolute=(1.0,) * 4,
        examined=0,
    )
    eta = np.zeros(4)
    for _ in range(2):
        assert decide(now, parameters["mode"], parameters["trigger"], states) == 0
        eta = eta + DT * (1.0 - np.array(moved) - decay["decay_hz"] * eta)
        assert states["dynamic"]["eta"] == exactly(eta)


def test_memory_of_the_surviving_law(scenario1: Scenario) -> None:
    """With the aileron and the elevator lost, the rudder at its stop, the nose too high."""
    law = Surviving(alpha_limit_deg=1.0, pitch_error_limit_deg=0.0)
    pilot = flying(law, scenario1)
    state, motions = pilot.state["surviving"], alone(pilot)
    actuators, stop = state["diagnosis"]["actuators"], float(pilot.nominal["stops"][0, 1])
    for c in (AILERON, ELEVATOR):
        actuators[c]["lost"] = 1
    mean = state["rudder_mean"] = 0.99 * stop
    integral = lowered = driven = 0.0
    for motion in motions:
        now = pilot.step(motion, AT_45)
        rudder = float(np.clip(now["demand"][RUDDER], -stop, stop))
        mean += DT / 0.7 * (rudder - mean)
        integral += DT * now["error"][2]
        over = math.atan2(motion.v[2], motion.v[0]) - math.radians(1.0)
        lowered -= DT * 2.0 * over
        driven += DT * math.radians(40.0)
        assert over > 0.0
        assert state["rudder_mean"] == exactly(mean)
        assert state["pitch_integral"] == exactly(integral)
        assert state["pitch_lowered"] == exactly(lowered)
        assert state["aileron_driven"] == exactly(driven)


def test_effectiveness_and_offset_that_the_diagnosis_uses(scenario1: Scenario) -> None:
    """Effectiveness follows the regression within 0.2 s, where that is well below 1."""
    pilot = flying(Surviving(), scenario1)
    diagnosis = pilot.state["surviving"]["diagnosis"]
    weak, prior = diagnosis["actuators"][AILERON], math.radians(0.3)
    first, second = alone(pilot)
    pilot.step(first, AT_45)
    diagnosis["age"] = 5.0  # all filters have settled
    weak["long_var_u"], weak["long_cov"] = 0.01, 0.004
    rho, offsets = 1.0, np.array(diagnosis["actuators"]["offset"])
    for motion in (second, first):
        for actuator in diagnosis["actuators"]:
            actuator["holdoff_s"] = 1.0  # no jump counts
        pilot.step(motion, AT_45)
        p0 = 3.0 * prior**2
        found = (weak["long_cov"] + p0) / (weak["long_var_u"] + p0)
        assert found < 0.5
        rho += DT / 0.2 * (found - rho)
        assert weak["effectiveness"] == exactly(rho)
        actuators = diagnosis["actuators"]
        used = np.array([rho, 1.0, 1.0, 1.0])
        assert actuators["effectiveness"] == exactly(used)
        difference = actuators["measured"] - used * actuators["commanded"]
        memory = np.array([0.06, 0.06, 0.06, 0.3])
        offsets += DT / memory * (difference - offsets)
        largest = np.array([25.0 / 35.0 * pilot.nominal["stops"][0, 1]] * 3 + [1e9])
        offsets = np.clip(offsets, -largest, largest)
        assert actuators["offset"][:3] == exactly(offsets[:3])


def test_filters_of_the_diagnosis(scenario1: Scenario) -> None:
    law = Surviving()
    pilot = flying(law, scenario1)
    diagnosis, motions = pilot.state["surviving"]["diagnosis"], alone(pilot)
    pilot.step(motions[0], AT_45)
    omega, share = np.array(motions[0].omega), DT / law.diagnosis.filter_s
    commanded, moment = np.zeros(4), np.zeros(3)
    for k, motion in enumerate((motions[1], motions[0])):
        held = np.array(pilot.state["held"])
        pilot.step(motion, AT_45)
        J, w = np.array(pilot.nominal["J"]), np.array(motion.omega)
        omega += share * (w - omega)
        moment += share * (np.cross(w, J @ w) - np.array(motion.air.N) - moment)
        commanded += share * (held - commanded)
        assert diagnosis["omega_filtered"] == exactly(omega)
        assert diagnosis["moment_filtered"] == exactly(moment)
        assert diagnosis["actuators"]["commanded"] == exactly(commanded)
        assert diagnosis["age"] == exactly((k + 2) * DT)


def test_moments_of_the_regression() -> None:
    """Means of two pairs are plain means; the longer memory takes a third of a second."""
    actuator = np.zeros(1, ACTUATOR)[0]
    restart(actuator)
    long = 0.0
    for u, y in ((0.2, 0.1), (0.6, 0.3), (0.4, 0.5)):
        actuator["commanded"], actuator["measured"] = u, y
        learn(actuator, 10.0, LONG_S, DT)
        long += DT / 0.3 * (float(actuator["cov"]) - long)
    pairs = np.array([(0.2, 0.1), (0.6, 0.3), (0.4, 0.5)])
    cov = np.cov(pairs.T, ddof=0)
    assert (actuator["var_u"], actuator["cov"], actuator["var_y"]) == exactly(
        (cov[0, 0], cov[0, 1], cov[1, 1])
    )
    assert actuator["long_cov"] == exactly(long)


def test_the_observer_of_the_tube_law(scenario1: Scenario) -> None:
    law = Tube()
    pilot = flying(law, scenario1)
    motions, nominal = alone(pilot), pilot.nominal
    gains, state = pilot.parameters["tube"], np.zeros(1, Tube.STATE)[0]
    observe(step_of(motions[0], True), COMMANDS, nominal, gains, state)
    d, slope, tau = np.zeros(3), np.zeros(3), law.force_observer_s
    rates_d, rates_slope, pole = np.zeros(3), np.zeros(3), 1.0 / law.rates_observer_s
    for motion in (motions[1], motions[0]):
        before = np.array(state["omega"])
        air_v = np.array(state["v"])
        observe(step_of(motion), COMMANDS, nominal, gains, state)
        force = np.array(motion.air.F) + np.array([COMMANDS[THROTTLE], 0.0, 0.0])
        innovation = np.array(motion.specific_force) - force / nominal["m"] - d
        slope += DT * innovation / (4.0 * tau**2)
        d += DT * slope + DT / tau * innovation
        assert state["disturbance"][:3] == exactly(d)
        assert state["disturbance_slope"][:3] == exactly(slope)
        innovation = (np.array(state["omega"]) - motion.omega) / (3.0 * pole * DT - 1.0)
        rates_d += DT * (rates_slope + 3.0 * pole**2 * innovation)
        rates_slope += DT * pole**3 * innovation
        assert np.abs(innovation).max() > 1e-4
        assert np.allclose(state["disturbance"][3:], rates_d, rtol=1e-7, atol=0.0)
        assert np.allclose(state["disturbance_slope"][3:], rates_slope, rtol=1e-7, atol=0.0)
        assert not np.array_equal(before, state["omega"])
        assert not np.array_equal(air_v, state["v"])


def test_the_servo_of_the_predictor() -> None:
    delay, lag_s = np.zeros(1, DELAY)[0], 0.02
    note_commands(delay, 0, np.zeros(4), lag_s, 1000)
    for step in (1, 2):
        note_commands(delay, step, np.array([1.0, -0.5, 0.2, 700.0]), lag_s, 1000)
        share = 1.0 - math.exp(-step * DT / lag_s)
        expected = [share, -0.5 * share, 0.2 * share, 700.0]
        assert delay["positions"][step] == exactly(expected)
