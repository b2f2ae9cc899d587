"""Laws know what thrust there is at an airspeed, and what it turns."""

import math
from typing import Any, TypeAlias

import numpy as np
import pytest
from steps import NOTHING, step_alone, step_of

from ftc_autopilot.common.motion import motion_of
from ftc_autopilot.common.records import fill, record_dtype
from ftc_autopilot.common.tuples import four
from ftc_autopilot.control.controller import new_controller, parameter_record
from ftc_autopilot.control.controllers import new_controllers
from ftc_autopilot.control.diagnosis import DIAGNOSIS, DiagnosisParameters, diagnose
from ftc_autopilot.control.diagnosis.measurement import measure
from ftc_autopilot.control.laws.backstepping import Backstepping
from ftc_autopilot.control.laws.pid import Pid
from ftc_autopilot.control.laws.proposed import Proposed
from ftc_autopilot.control.laws.surviving import Surviving
from ftc_autopilot.control.laws.surviving.lateral import lateral_trim
from ftc_autopilot.control.laws.surviving.longitudinal import (
    PitchTrim,
    pitch_trim,
    thrust_for_pitch,
)
from ftc_autopilot.control.laws.tube import Tube
from ftc_autopilot.control.laws.tube.check import trim
from ftc_autopilot.control.laws.tube.observer import observe as observe_disturbance
from ftc_autopilot.control.reference import Reference
from ftc_autopilot.control.signals import SIGNALS
from ftc_autopilot.control.state_predictor import DELAY, note_commands, thrust_believed
from ftc_autopilot.control.stepping import controller_step
from ftc_autopilot.control.triggers.periodic import Periodic
from ftc_autopilot.control.triggers.static import Consequence, PerChannel
from gcs.scenario.model import Scenario
from mavlink_defs.constants import AILERON, ELEVATOR, RUDDER, THROTTLE
from mavlink_defs.framing.codec import ACTUATORS, SIM_STATE
from sitl_plant.actuators.config import ActuatorServos, EngineServo
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.config import Aircraft
from sitl_plant.airframe.rigid_body import STILL_AIR, gravity_body, state_derivative
from sitl_plant.airframe.thrust import available_thrust
from sitl_plant.loop.fleet import fly, new_plant_state, observe

STEP_US, DT = 1000, 1e-3
LAWS = (Proposed, Backstepping, Pid, Surviving)
Law: TypeAlias = Proposed | Backstepping | Pid | Surviving


def seen(
    aircraft: np.void,
    V: float = 45.0,
    thrust: float = 0.0,
    phi: tuple[float, float, float] = NOTHING,
    omega: tuple[float, float, float] = NOTHING,
    force: tuple[float, ...] = NOTHING,
) -> Any:
    message = np.zeros(1, SIM_STATE)[0]
    message["velocity"] = V * math.cos(0.05), 0.0, V * math.sin(0.05)
    message["attitude"], message["rates"], message["specific_force"] = phi, omega, force
    return motion_of(message, aircraft, thrust)


def record_of(law: Surviving, aircraft: Aircraft) -> np.void:
    law = law.with_servos(ActuatorServos())
    record = parameter_record(law, PerChannel(mode="per_channel"))
    law.derive(aircraft, record[law.kind])
    return record


# commands


@pytest.mark.parametrize("law", LAWS)
def test_no_law_sends_more_than_can_be_made(
    law: type[Law], propelled_aircraft: Aircraft, propelled: np.void
) -> None:
    """Far too slow for its reference, an aircraft gets what its airspeed permits, and the share."""
    model = law().with_servos(ActuatorServos())
    parameters = parameter_record(model, Periodic())
    model.derive(propelled_aircraft, parameters[model.kind])
    state, actuators = new_controller(), np.zeros(1, ACTUATORS)[0]
    motion = seen(propelled, 50.0, force=tuple(-np.array(gravity_body(NOTHING, 9.8))))
    for _ in range(3):
        signals = step_alone(motion, (79.0, 0, 0, 0), propelled, parameters, state, actuators)
        state["reference"][0] = 79.0, 0.0, 0.0
    most = available_thrust(50.0, propelled)
    assert most == 1000.0
    assert signals["demand"][THROTTLE] > 1100.0
    assert state["held"][THROTTLE] == pytest.approx(most, rel=1e-6)
    assert actuators["controls"][THROTTLE] == pytest.approx(most / 2000.0)


def test_the_integral_of_pid_does_not_wind_up(propelled: np.void) -> None:
    parameters, state = parameter_record(Pid(), Periodic()), new_controller()
    motion, actuators = seen(propelled, 55.0), np.zeros(1, ACTUATORS)[0]
    for _ in range(2000):
        step_alone(motion, (60.0, 0, 0, 0), propelled, parameters, state, actuators)
        state["reference"][0] = 60.0, 0.0, 0.0
    assert available_thrust(55.0, propelled) == 800.0
    assert state["pid"]["thrust_integral"] == 0.0  # the trim's 900 N are more than there is


def test_the_integral_of_the_pitch_error_waits_for_thrust(
    propelled_aircraft: Aircraft, propelled: np.void
) -> None:
    """It goes on to the side that asks for less."""
    gains = record_of(Surviving(), propelled_aircraft)["surviving"]
    state = np.zeros(1, Surviving.STATE)[0]
    level = PitchTrim(45.0, 0.05, 1900.0)
    gain = gains["thrust_gains"][2, 4]
    for e, waits in ((0.1, gain < 0.0), (-0.1, gain > 0.0)):
        state["pitch_integral"] = 0.0
        now = step_of(seen(propelled, phi=(0.0, e, 0.0)))
        assert thrust_for_pitch(now, level, propelled, gains, state) > 1200.0
        assert (state["pitch_integral"] == 0.0) == waits
        free = propelled.copy()
        free["thrust_rows"] = 0
        thrust_for_pitch(now, level, free, gains, state)
        assert state["pitch_integral"] != 0.0


# the moment of the thrust


def test_the_moment_of_a_motion_has_that_of_the_thrust(propelled: np.void) -> None:
    with_thrust, without = seen(propelled, thrust=1900.0), seen(propelled)
    made = available_thrust(45.0, propelled)
    assert made < 1900.0
    moment = np.subtract(with_thrust.air.N, without.air.N)
    assert moment == pytest.approx(made * np.array([-0.05, 0.1, 0.03]))
    assert with_thrust.by_thrust == pytest.approx(moment)
    assert with_thrust.air.F == without.air.F


def test_the_thrust_that_is_believed_follows_the_commands(propelled: np.void) -> None:
    """By the aircraft's lag; of a UAV of which nothing is noted yet it is the command in force."""
    memory, held = np.zeros(1, DELAY)[0], np.array([0.0, 0.0, 0.0, 500.0])
    assert thrust_believed(memory, 7, 0, held) == 500.0
    note_commands(memory, 7, held, 0.0, STEP_US, 0.3)
    held[THROTTLE] = 900.0
    for step in range(8, 108):
        note_commands(memory, step, held, 0.0, STEP_US, 0.3)
        assert thrust_believed(memory, step + 1, 1, held) == pytest.approx(
            900.0 - 400.0 * math.exp(-(step - 8) * DT / 0.3)
        )
    assert thrust_believed(memory, 108, 0, held) == pytest.approx(900.0 - 400.0 * math.exp(-1 / 3))


def test_a_step_believes_in_the_thrust_in_force(
    scenario1: Scenario, propelled_aircraft: Aircraft
) -> None:
    """Backstepping, which inverts the model, makes the moment that the thrust does not."""
    aircraft = propelled_aircraft.model_copy(
        update={"propulsion": propelled_aircraft.propulsion.model_copy(update={"lag_s": 0.0})}  # type: ignore[union-attr]  # it has one
    )
    tree = scenario1.model_dump() | {
        "aircraft": aircraft.model_dump(), "controller": {"kind": "backstepping"},
        "trigger": {"mode": "periodic"}, "faults": (),
    }  # fmt: skip
    configs = [Scenario.model_validate(tree).autopilot_config(1)]
    record, found = aircraft_record(aircraft), []
    for thrust in (0.0, 800.0):
        controllers, measured = new_controllers(configs), np.zeros(1, SIM_STATE)[0]
        measured["velocity"] = 45.0, 0.0, 2.0
        controllers.uavs[0]["guidance"]["active"] = 1
        controllers.uavs[0]["guidance"]["command"][0] = 45.0
        controllers.uavs[0]["controller"]["held"][THROTTLE] = thrust
        controller_step(*controllers.of(0), measured, STEP_US)
        found.append(controllers.uavs[0]["signals"]["demand"][:3].copy())
    C = np.array(motion_of(measured, record).air.C)
    moment = C @ (found[1] - found[0])
    assert moment == pytest.approx(-800.0 * np.array([-0.05, 0.1, 0.03]), rel=1e-9)


# trims


@pytest.mark.parametrize("stuck", [-0.02, 0.03])
@pytest.mark.parametrize("pitch", [-0.1, 0.2])
def test_a_trim_of_pitch_is_a_steady_flight(
    stuck: float, pitch: float, propelled_aircraft: Aircraft
) -> None:
    """With the moment of its own thrust; the general aircraft's lift and drag by surfaces are 0."""
    tree = propelled_aircraft.model_dump()
    tree["coefficients"] |= {"cL_de": 0.0, "cD_de": 0.0, "cD_de2": 0.0}
    tree["propulsion"]["thrust"] = None
    aircraft = Aircraft.model_validate(tree)
    record = aircraft_record(aircraft)
    gains = record_of(Surviving(), aircraft)["surviving"].copy()
    gains["airspeeds"][[0, -1]] = 1.0, 500.0
    diagnosis = np.zeros(1, Surviving.STATE)[0]["diagnosis"]
    diagnosis["actuators"][ELEVATOR]["stuck"] = stuck
    V = 45.0
    for _ in range(2):
        reference = Reference(45.0, 0.0, (0.0, pitch, 0.0), NOTHING)
        found = pitch_trim(step_of(seen(record, V), reference=reference), record, gains, diagnosis)
        V = found.V
    v = (V * math.cos(found.alpha), 0.0, V * math.sin(found.alpha))
    steady = (NOTHING, v, (0.0, pitch, 0.0), NOTHING)
    _, v_dot, _, omega_dot = state_derivative(
        steady, found.thrust, (0.0, stuck, 0.0), NOTHING, NOTHING, STILL_AIR, record
    )
    assert [v_dot[0], v_dot[2]] == pytest.approx([0.0] * 2, abs=1e-9)
    by_thrust = 0.1 * found.thrust / record["J"][1, 1]
    assert by_thrust > 5.0
    assert abs(omega_dot[1]) < 0.02 * by_thrust


@pytest.mark.parametrize("lost", [AILERON, RUDDER])
def test_a_lateral_trim_leaves_no_moment(lost: int, propelled: np.void) -> None:
    other, diagnosis = RUDDER if lost == AILERON else AILERON, np.zeros(1, DIAGNOSIS)[0]
    reference = Reference(45.0, 0.0, (0.3, 0.0, 0.0), NOTHING)
    now = step_of(seen(propelled, thrust=800.0, phi=(0.0, 0.1, 0.0)), reference=reference)
    found = lateral_trim(now, lost, 0.03, propelled, diagnosis)
    delta = [0.0, 0.0, 0.0]
    delta[lost], delta[other] = 0.03, found.delta
    v = (45.0 * math.cos(found.beta), 45.0 * math.sin(found.beta), 0.0)
    _, _, _, omega_dot = state_derivative(
        (NOTHING, v, (0.3, 0.1, 0.0), (0.0, 0.0, found.r)),
        800.0, (delta[0], delta[1], delta[2]), NOTHING, NOTHING, STILL_AIR, propelled,
    )  # fmt: skip
    assert [omega_dot[0], omega_dot[2]] == pytest.approx([0.0, 0.0], abs=1e-9)


@pytest.mark.parametrize("believed", [0.0, 700.0])
def test_the_trim_of_tube_turns_nothing(believed: float, propelled: np.void) -> None:
    commands, motion = np.zeros(4), seen(propelled, thrust=believed, omega=(0.02, -0.03, 0.01))
    trim(step_of(motion, first=True), propelled, commands)
    assert 100.0 < commands[THROTTLE] < available_thrust(45.0, propelled)
    _, _, _, omega_dot = state_derivative(
        (NOTHING, motion.v, motion.phi, motion.omega), commands[THROTTLE],
        (commands[0], commands[1], commands[2]), NOTHING, NOTHING, STILL_AIR, propelled,
    )  # fmt: skip
    assert omega_dot == pytest.approx(NOTHING, abs=0.5)  # the thrust moves by the last deflections


def test_the_observer_knows_what_full_throttle_makes(propelled: np.void) -> None:
    """Something holds the aircraft: a disturbance against what there is of thrust and moments."""
    record: np.void = parameter_record(Tube().with_servos(ActuatorServos()), Consequence())["tube"]
    state, omega = np.zeros(1, Tube.STATE)[0], (0.02, -0.03, 0.01)
    commands, full = np.array([0.01, 0.02, 0.03, 1990.0]), available_thrust(45.0, propelled)
    still = seen(propelled, omega=omega)
    force = np.array(still.air.F) + np.array(still.air.B) @ commands[:3]
    force += np.array(still.air.D) * commands[1] ** 2 + [full, 0.0, 0.0]
    motion = seen(propelled, omega=omega, force=tuple(force / propelled["m"]))
    for k in range(2000):
        observe_disturbance(step_of(motion, first=k == 0), commands, propelled, record, state)
    slope = state_derivative(
        (NOTHING, motion.v, NOTHING, omega), full, (0.01, 0.02, 0.03),
        NOTHING, NOTHING, STILL_AIR, propelled,
    )[3]  # fmt: skip
    assert state["disturbance"][:3] == pytest.approx(NOTHING, abs=1e-6)
    assert state["disturbance"][3:] == pytest.approx(-np.array(slope), abs=1e-3)


# the diagnosis


def test_what_cannot_be_made_is_not_missed(
    scenario1: Scenario, propelled_aircraft: Aircraft
) -> None:
    """Full throttle at an airspeed that permits half of it: measured is what is commanded."""
    tree = scenario1.model_dump() | {
        "aircraft": propelled_aircraft.model_dump(),
        "disturbance": {}, "uncertainty": {}, "faults": (),
    }  # fmt: skip
    plant = new_plant_state(Scenario.model_validate(tree).plant_config())
    gains, state = np.zeros(1, record_dtype(DiagnosisParameters))[0], np.zeros(1, DIAGNOSIS)[0]
    fill(gains, DiagnosisParameters().with_servos(ActuatorServos(throttle=EngineServo(lag_s=0.3))))
    aircraft, most = plant.uavs[0]["aircraft"], []
    for step in range(800):
        observe(plant, 0, step, STEP_US)
        motion = motion_of(
            plant.uavs[0]["message"], aircraft, float(plant.uavs[0]["applied"][THROTTLE])
        )
        now = step_of(motion, step == 0, held=four(plant.uavs[0]["controls"]))
        measure(now, aircraft, gains, state)
        plant.uavs[0]["controls"] = 0.02, 0.03, 0.1, 1990.0
        plant.uavs["message"]["actuator_time_usec"] = 0
        assert fly(plant, step, STEP_US) < 0
        most.append(available_thrust(motion.V, aircraft))
    actuators = state["actuators"]
    assert actuators["position"][THROTTLE] > 1.3 * most[-1]
    assert actuators["commanded"][THROTTLE] == pytest.approx(most[-1], rel=0.02)
    away = np.abs(actuators["measured"] - actuators["commanded"])
    assert np.degrees(away[:THROTTLE]).max() < 0.05
    assert away[THROTTLE] < 5.0


@pytest.mark.parametrize(("short_of_full", "learns"), [(0.5, False), (60.0, True)])
def test_no_offset_is_learnt_at_full_throttle(
    short_of_full: float, learns: bool, propelled: np.void
) -> None:
    """Of a thrust that is 100 N less than it should be; full is what the airspeed permits."""
    law = Surviving().with_servos(ActuatorServos())
    gains = parameter_record(law, PerChannel(mode="per_channel"))["surviving"]["diagnosis"]
    state, signals = np.zeros(1, DIAGNOSIS)[0], np.zeros(1, SIGNALS)[0]
    held = np.array([0.0, 0.0, 0.0, available_thrust(45.0, propelled) - short_of_full])
    still = seen(propelled, thrust=float(held[THROTTLE]))
    less = np.array([held[THROTTLE] - 100.0, 0.0, 0.0])
    force = (np.array(still.air.F) + less) / propelled["m"]
    motion = seen(propelled, thrust=float(held[THROTTLE]), force=tuple(force))
    for k in range(1500):
        diagnose(step_of(motion, first=k == 0, held=four(held)), propelled, gains, state, signals)
    throttle = state["actuators"][THROTTLE]
    assert throttle["measured"] - throttle["commanded"] == pytest.approx(-100.0, abs=1.0)
    assert (throttle["offset"] < -20.0) == learns
    assert (throttle["offset"] == 0.0) != learns
