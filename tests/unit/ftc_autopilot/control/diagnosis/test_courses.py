"""The diagnosis along courses, against recorded numbers: one actuator alone, and in flight."""

import math
from typing import NamedTuple

import numpy as np
import pytest
from courses import SERVOS, STEP_US, Course, Pilot, fly_along, plant_of
from plain_faults import actuator_fault, add_fault

from ftc_autopilot.common.motion import motion_of
from ftc_autopilot.common.phases import LOST
from ftc_autopilot.common.records import fill, record_dtype
from ftc_autopilot.control.diagnosis import DIAGNOSIS, DiagnosisParameters
from ftc_autopilot.control.diagnosis.decisions import decide
from ftc_autopilot.control.diagnosis.excitation import dithered, dithered_thrust, probe, probed
from ftc_autopilot.control.diagnosis.parameters import limits_of
from ftc_autopilot.control.diagnosis.suspicions import monitor
from ftc_autopilot.control.laws.surviving import Surviving
from ftc_autopilot.control.triggers.static import PerChannel
from gcs.scenario.model import Scenario
from mavlink_defs.constants import AILERON, ELEVATOR, RUDDER, THROTTLE
from sitl_plant.loop.fleet import fly, observe

DT, STOP = 0.002, math.radians(35.0)
GAINS = np.zeros(1, record_dtype(DiagnosisParameters))[0]
fill(GAINS, DiagnosisParameters().with_servos(SERVOS))


class Case(NamedTuple):
    """What happens to one actuator, its size 1° or 20 N."""

    j: int = AILERON
    rho: float = 1.0  # within the time
    offset: float = 0.0  # the same, in sizes
    swing: float = 0.0  # amplitude of an offset at 1.5 Hz, in sizes
    noise: float = 0.05  # in sizes
    begin_s: float = 0.7
    end_s: float = 1.5
    late: int = 0  # dead time [periods]
    ramp: float = 0.0  # offset that grows from the beginning on, in sizes per s
    seconds: float = 2.2


CASES = {
    "quiet": Case(seconds=1.2),
    "aileron_stuck": Case(rho=0.0, offset=3.0),
    "elevator_stuck": Case(ELEVATOR, rho=0.0, offset=-2.0, noise=0.2),
    "rudder_stuck": Case(RUDDER, rho=0.0, offset=9.0),
    "throttle_stuck": Case(THROTTLE, rho=0.0, offset=25.0, end_s=1.1, seconds=3.2),
    "aileron_weak": Case(rho=0.17),
    "rudder_weak": Case(RUDDER, rho=0.17, offset=1.0),
    "aileron_half": Case(rho=0.5, offset=1.0),
    "throttle_offset": Case(THROTTLE, offset=-10.0),
    "slight_jump": Case(offset=0.9, noise=0.02),
    "noisy_jump": Case(ELEVATOR, offset=-2.5, noise=0.4),
    "jump": Case(offset=8.0, begin_s=0.8, end_s=1.0),
    "drift": Case(ramp=6.0, begin_s=1.0, end_s=2.2, noise=0.3),
    "swinging": Case(swing=4.0),
    "late": Case(late=8, noise=0.02, seconds=1.2),
    "late_rudder": Case(RUDDER, late=12, seconds=1.2),
}


@pytest.mark.parametrize("name", CASES)
def test_one_actuator_alone(name: str) -> None:
    case, course = CASES[name], Course(f"actuator_{name}")
    j, is_throttle = case.j, case.j == THROTTLE
    size = 20.0 if is_throttle else math.radians(1.0)
    state = np.zeros(1, DIAGNOSIS)[0]
    actuator, limits = state["actuators"][j], limits_of(GAINS, j)
    actuator["effectiveness"], actuator["variance"] = 1.0, (0.2 * limits.jump) ** 2
    random = np.random.default_rng(7)
    share, sent, steps = DT / float(GAINS["filter_s"]), [(0.0, 0.0)] * 40, round(case.seconds / DT)
    for k in range(steps):
        t = k * DT
        base = size * (2.0 * math.sin(9.0 * t) + (t % 0.2 > 0.1)) + (900.0 if is_throttle else 0.0)
        state["age"] = t + DT
        if actuator["lost"] == 0 and is_throttle:
            command = dithered_thrust(base, 1800.0, GAINS, state)
        elif is_throttle:
            command = base + probe(j, GAINS, state)
        elif actuator["lost"] == 0:
            command = dithered(base, j, (-STOP, STOP), GAINS, state)
        else:
            command = probed(j, float(actuator["stuck"]), GAINS, state)
        sent.append((command, float(actuator["dither"])))
        received, _ = sent[-1 - case.late]
        fails = case.begin_s <= t < case.end_s
        does = received
        if fails:
            swung = case.swing * math.sin(2.0 * math.pi * 1.5 * t)
            does = case.rho * received + size * (case.offset + swung)
            does += size * case.ramp * (t - case.begin_s)
        noise = case.noise * size * random.standard_normal()
        actuator["commanded"] += share * (command - actuator["commanded"])
        actuator["measured"] += share * (does - actuator["measured"]) + noise
        monitor(actuator, limits, float(state["age"]), DT, GAINS)
        dither = sent[-1][1]
        dead = decide(actuator, dither, limits, float(state["age"]), DT, GAINS, is_throttle)
        actuator["dead_steps"] = max(dead, actuator["dead_steps"])
        if (k + 1) % (steps // 12) == 0 or actuator["decided_s"] == 0.0 or dead > 0:
            course.note(actuator)
    course.check()


FAULTS = {
    "aileron": actuator_fault(AILERON, 0.0, 2.0, 0.0, 0.4, 0.8),
    "elevator": actuator_fault(ELEVATOR, 0.5, 1.0, 0.0, 0.3, math.inf),
    "rudder": actuator_fault(RUDDER, 0.0, 25.0, 0.0, 0.4, math.inf),
    "throttle": actuator_fault(THROTTLE, 0.0, 300.0, 0.0, 0.4, math.inf),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_in_flight(name: str, scenario1: Scenario) -> None:
    """One measurement comes after a gap."""
    plant = plant_of(scenario1)
    add_fault(plant.uavs[0]["faults"], FAULTS[name], now_s=0.0)
    pilot = Pilot(Surviving().with_servos(SERVOS), PerChannel(), scenario1.aircraft, 0.004)
    gap_s = 0.9 if name == "aileron" else 0.6
    fly_along(Course(f"flight_{name}"), pilot, plant, 1.2, gap_s, delay=int(name == "rudder"))


@pytest.mark.parametrize("rho", [0.6, 1.0])
def test_the_effectiveness_is_found_while_the_command_moves(
    rho: float, scenario1: Scenario
) -> None:
    """Without an alarm: of 40 % of the aileron's power lost, no test for a loss says anything."""
    plant = plant_of(scenario1, disturbance={})
    add_fault(
        plant.uavs[0]["faults"], actuator_fault(AILERON, rho, 0.0, 0.0, 0.2, math.inf), now_s=0.0
    )
    pilot = Pilot(Surviving().with_servos(SERVOS), PerChannel(), scenario1.aircraft, 0.004)
    random, course = np.random.default_rng(3), []
    command = trim = np.array([0.07, -0.02, 0.36, 900.0])
    for k in range(400):
        observe(plant, 0, k, STEP_US)
        pilot.state["held"] = command
        signals = pilot.step(
            motion_of(plant.uavs[0]["message"], plant.uavs[0]["aircraft"]), (45.0, 0.0, 0.1, 0.0)
        )
        course.append(float(signals["effectiveness"][AILERON]))
        assert signals["phase"][AILERON] != LOST
        if k % 15 == 0:
            command = trim + np.array([random.uniform(-0.08, 0.08), 0.0, 0.0, 0.0])
        plant.uavs[0]["controls"] = command
        assert fly(plant, k, STEP_US) < 0
    assert course[45] == pytest.approx(1.0, abs=0.02)
    assert course[-1] == pytest.approx(rho, abs=0.1)  # a prior pulls it to 1
