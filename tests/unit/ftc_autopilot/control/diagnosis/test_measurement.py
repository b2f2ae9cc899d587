"""What the diagnosis measures is what the plant's actuators do."""

import itertools
from typing import Any

import numpy as np
import pytest
from plain_faults import actuator_fault, add_fault
from scipy import signal
from steps import step_of

from ftc_autopilot.common.motion import motion_of
from ftc_autopilot.common.records import fill, record_dtype
from ftc_autopilot.common.tuples import four
from ftc_autopilot.control.diagnosis import DIAGNOSIS, DiagnosisParameters
from ftc_autopilot.control.diagnosis.diagnose import _note_dead_time
from ftc_autopilot.control.diagnosis.measurement import measure, servo_step, steps_back
from gcs.scenario.model import Scenario
from mavlink_defs.constants import RUDDER, THROTTLE
from mavlink_defs.faults.fault import Fault
from sitl_plant.actuators.config import ActuatorServos
from sitl_plant.loop.fleet import fly, new_plant_state, observe

STEP_US, DT, STEPS = 1000, 1e-3, 800
TRIM = np.array([0.07, -0.02, 0.36, 900.0])


def flown(scenario: Scenario, commands: np.ndarray, fault: Fault | None = None) -> tuple[Any, Any]:
    """`commanded` and `measured` of each step, while a plant flies these commands."""
    tree = scenario.model_dump() | {"disturbance": {}, "faults": ()}
    plant = new_plant_state(Scenario.model_validate(tree).plant_config())
    if fault is not None:
        add_fault(plant.uavs[0]["faults"], fault, now_s=0.0)
    gains = np.zeros(1, record_dtype(DiagnosisParameters))[0]
    fill(gains, DiagnosisParameters().with_servos(ActuatorServos()))
    state = np.zeros(1, DIAGNOSIS)[0]
    commanded, measured = np.zeros((2, len(commands), 4))
    for step, command in enumerate(commands):
        observe(plant, 0, step, STEP_US)
        motion = motion_of(plant.uavs[0]["message"], plant.uavs[0]["aircraft"])
        now = step_of(motion, step == 0, held=four(plant.uavs[0]["controls"]))
        measure(now, plant.uavs[0]["aircraft"], gains, state)
        commanded[step] = state["actuators"]["commanded"]
        measured[step] = state["actuators"]["measured"]
        plant.uavs[0]["controls"] = command
        assert fly(plant, step, STEP_US) < 0
    return commanded, measured


def staircase() -> np.ndarray:
    """Commands about trim that change every 20 to 80 ms."""
    rng = np.random.default_rng(3)
    commands = np.tile(TRIM, (STEPS, 1))
    for c, size in enumerate((0.03, 0.03, 0.05, 100.0)):
        ends = np.cumsum(rng.integers(20, 80, 40))
        for begin, end in itertools.pairwise(ends):
            commands[begin:end, c] += rng.uniform(-size, size)
    return commands


def test_measured_is_commanded_while_all_is_well(scenario1: Scenario) -> None:
    commands = staircase()
    commanded, measured = flown(scenario1, commands)
    share = DT / DiagnosisParameters().filter_s
    held = np.vstack([np.zeros(4), commands[:-1]])  # in force before each step
    held = signal.lfilter([share], [1.0, share - 1.0], held, axis=0)
    assert np.allclose(commanded[1:], held[1:], atol=1e-9)
    assert np.abs(np.degrees(measured - commanded)[50:, :3]).max() < 0.1
    assert np.abs(measured - commanded)[50:, 3].max() < 1.0


@pytest.mark.parametrize("channel", range(4))
def test_measured_shows_a_fault_of_its_own_actuator_alone(
    scenario1: Scenario, channel: int
) -> None:
    stuck = (0.0, 0.0, 10.0, 700.0)[channel]
    fault = actuator_fault(channel, 0.0, stuck, 0.0, 0.3, float("inf"))
    commanded, measured = flown(scenario1, staircase(), fault)
    difference = np.abs(measured - commanded)[100:] / (*np.radians([1.0, 1.0, 1.0]), 10.0)
    others = [c for c in range(4) if c != channel]
    assert difference[:, others].max() < 0.1
    expected = np.radians(stuck) if channel < 3 else stuck
    late = measured[400:, channel]  # ten times the filter after the fault
    assert np.allclose(late, expected, atol=0.002 if channel < 3 else 1.0)


@pytest.mark.parametrize("ahead", [0, 1, 5, 127, 128, 500])
def test_the_commands_are_as_old_as_the_measurement(ahead: int, scenario1: Scenario) -> None:
    """Up to 127 periods, over which they are remembered; older ones count as that old."""
    gains, state = servo(0.0), np.zeros(1, DIAGNOSIS)[0]
    plant = new_plant_state(scenario1.plant_config())
    observe(plant, 0, 0, STEP_US)
    motion = motion_of(plant.uavs[0]["message"], plant.uavs[0]["aircraft"])
    found, steps = [], 300
    for step in range(steps):
        now = step_of(motion, step == 0, held=four(1e-3 * step * np.array([1.0, 2.0, 3.0, 4.0])))
        now = now._replace(seen=now.seen._replace(ahead=ahead, links=max(ahead - 2, 0)))
        measure(now, plant.uavs[0]["aircraft"], gains, state)
        state["age"] += DT
        found.append(state["actuators"]["position"].copy())
    sent = steps - 1 - min(ahead, 127)
    assert found[-1][:3] == pytest.approx(1e-3 * sent * np.array([1.0, 2.0, 3.0]))
    assert found[-1][THROTTLE] == pytest.approx(4e-3 * (steps - 1 - min(max(ahead - 2, 0), 127)))
    state["actuators"]["dead_steps"] = 3
    measure(now, plant.uavs[0]["aircraft"], gains, state)
    sent = steps - min(ahead + 3, 127)
    assert state["actuators"]["position"][RUDDER] == pytest.approx(3e-3 * min(sent, steps - 1))


def test_the_throttle_s_dead_time_comes_on_top_of_the_links(scenario1: Scenario) -> None:
    gains, state = servo(0.0), np.zeros(1, DIAGNOSIS)[0]
    gains["throttle"]["dead_time_s"] = 0.05
    plant = new_plant_state(scenario1.plant_config())
    observe(plant, 0, 0, STEP_US)
    now = step_of(motion_of(plant.uavs[0]["message"], plant.uavs[0]["aircraft"]))
    now = now._replace(seen=now.seen._replace(ahead=9, links=2))
    assert [steps_back(j, now, gains, state) for j in (RUDDER, THROTTLE)] == [9, 52]


def servo(lag_s: float, rate_limit_deg_s: float = 1e6) -> np.void:
    """Parameters of the diagnosis with this model of the surfaces' servos."""
    gains: np.void = np.zeros(1, record_dtype(DiagnosisParameters))[0]
    given = DiagnosisParameters(servo_lag_s=lag_s, servo_rate_limit_deg_s=rate_limit_deg_s)
    fill(gains, given.with_servos(ActuatorServos()))
    return gains


@pytest.mark.parametrize("lag", [0.005, 0.02, 0.1])
def test_a_servo_has_its_lag(lag: float) -> None:
    time = np.arange(0.0, 0.2, DT)
    command = np.where((time // 0.04) % 2 == 0, 1.0, -0.5)
    position = [0.0]
    for u in command[:-1]:
        position.append(servo_step(position[-1], u, RUDDER, servo(lag), DT))
    continuous = signal.TransferFunction([1.0], [lag, 1.0]).to_ss()
    sampled = signal.cont2discrete(
        (continuous.A, continuous.B, continuous.C, continuous.D), DT, "zoh"
    )
    _, expected, _ = signal.dlsim(sampled, command)
    assert np.allclose(position, expected[:, 0], atol=1e-12)


def test_a_servo_is_no_faster_than_its_limit() -> None:
    position, limited = 0.0, servo(0.0, 400.0)
    for _ in range(10):
        position = servo_step(position, 1.0, RUDDER, limited, DT)
    assert position == pytest.approx(np.radians(4.0))
    assert servo_step(0.0, 1.0, RUDDER, servo(0.0), DT) == 1.0
    assert servo_step(0.0, 900.0, THROTTLE, limited, DT) == 900.0  # which has none


@pytest.mark.parametrize("shown_by", [RUDDER, THROTTLE])
def test_surfaces_share_a_dead_time_and_the_throttle_has_its_own(
    shown_by: int, scenario1: Scenario
) -> None:
    state = np.zeros(1, DIAGNOSIS)[0]
    plant = new_plant_state(scenario1.plant_config())
    observe(plant, 0, 0, STEP_US)
    now = step_of(motion_of(plant.uavs[0]["message"], plant.uavs[0]["aircraft"]))
    _note_dead_time(shown_by, 12, now, plant.uavs[0]["aircraft"], servo(0.0), state)
    surfaces, throttle = (12, 0) if shown_by == RUDDER else (0, 12)
    assert state["actuators"]["dead_steps"].tolist() == [surfaces] * 3 + [throttle]
