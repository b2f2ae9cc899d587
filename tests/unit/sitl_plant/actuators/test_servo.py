"""Servos against independent solutions: scipy's for the lag and its limit, by hand for the rest."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from plain_faults import actuator_fault, add_fault
from scipy import integrate, signal

from gcs.fleet.in_process import fly_in_process
from gcs.scenario.model import Scenario, scenario_of
from mavlink_defs.faults.actuators import ACTUATOR_FAULTS, HARDOVER
from mavlink_defs.faults.table import no_faults
from sitl_plant.actuators.config import ActuatorServos, EngineServo, SurfaceServo
from sitl_plant.actuators.servo import (
    begin_period,
    end_period,
    new_servos,
    positions,
    sent_commands,
)

STEP_US = 1000
DT = STEP_US / 1e6
ELEVATOR, THROTTLE = 1, 3


def moved(servo: SurfaceServo | EngineServo, commands: np.ndarray, channel: int) -> np.ndarray:
    """Positions [deg, N] at the ends of the periods over which commands [deg, N] are held."""
    unit = 1.0 if channel == THROTTLE else math.radians(1.0)
    name = "throttle" if channel == THROTTLE else "elevator"
    servos = new_servos(ActuatorServos.model_validate({name: servo.model_dump()}), STEP_US)
    sent = sent_commands(np.array([servos]))[0]
    controls, flown = np.zeros(4), []
    for step, command in enumerate(commands):
        controls[channel] = command * unit
        begin_period(
            servos, sent, controls, no_faults(ACTUATOR_FAULTS, 1)[0], step, step * DT, True
        )
        end_period(servos, DT)
        flown.append(servos["output"][channel] / unit)
    return np.array(flown)


COMMANDS = np.repeat([2.0, 10.0, -20.0, -19.0, 30.0, 0.0], 80)


@pytest.mark.parametrize("lag_s", [0.0003, 0.02, 0.5])
@pytest.mark.parametrize("channel", [ELEVATOR, THROTTLE])
def test_the_lag_is_scipys(lag_s: float, channel: int) -> None:
    kind = EngineServo if channel == THROTTLE else SurfaceServo
    ours = moved(kind(lag_s=lag_s), COMMANDS, channel)
    t = np.arange(len(COMMANDS) + 1) * DT
    u = np.append(COMMANDS, COMMANDS[-1])
    rest = [COMMANDS[0] * lag_s]  # the state of scipy's realisation of 1 / (lag s + 1)
    _, expected, _ = signal.lsim(([1.0], [lag_s, 1.0]), u, t, X0=rest, interp=False)
    assert ours == pytest.approx(expected[1:], abs=1e-9)


@pytest.mark.parametrize(("lag_s", "limit"), [(0.02, 400.0), (0.02, 50.0), (0.2, 60.0)])
def test_the_lag_with_its_limit_is_the_integral_of_its_equation(lag_s: float, limit: float) -> None:
    ours = moved(SurfaceServo(lag_s=lag_s, rate_limit_deg_s=limit), COMMANDS, ELEVATOR)
    x, expected = COMMANDS[0], []
    for target in COMMANDS:
        flown = integrate.solve_ivp(
            lambda _, y, target=target: np.clip((target - y) / lag_s, -limit, limit),
            (0.0, DT), [x], rtol=1e-10, atol=1e-12,
        )  # fmt: skip
        x = flown.y[0, -1]
        expected.append(x)
    assert ours == pytest.approx(np.array(expected), abs=1e-6)
    assert np.abs(np.diff(ours)).max() == pytest.approx(limit * DT, rel=1e-9)


def test_a_limit_without_lag_ends_at_the_target() -> None:
    ours = moved(SurfaceServo(rate_limit_deg_s=400.0), np.array([0.0, *[1.0] * 5]), ELEVATOR)
    assert ours == pytest.approx([0.0, 0.4, 0.8, 1.0, 1.0, 1.0], abs=1e-12)


def test_dead_time_delays_by_whole_periods() -> None:
    ours = moved(SurfaceServo(dead_time_s=0.003), COMMANDS, ELEVATOR)
    assert ours[3:] == pytest.approx(COMMANDS[:-3], abs=1e-12)
    assert ours[:3] == pytest.approx(COMMANDS[0], abs=1e-12)


def test_resolution_rounds_commands() -> None:
    ours = moved(SurfaceServo(resolution_deg=0.5), np.array([0.2, 0.3, -1.1, 34.9]), ELEVATOR)
    assert ours == pytest.approx([0.0, 0.5, -1.0, 35.0], abs=1e-12)


def test_play_follows_only_beyond_its_half_width() -> None:
    commands = np.array([0.0, 0.4, 2.0, 1.5, 0.6, -1.0])
    ours = moved(SurfaceServo(backlash_deg=2.0), commands, ELEVATOR)
    assert ours == pytest.approx([0.0, 0.0, 1.0, 1.0, 1.0, 0.0], abs=1e-12)


@given(
    lag_s=st.one_of(st.just(0.0), st.floats(1e-5, 1.0)),
    limit=st.one_of(st.none(), st.floats(1.0, 1e4)),
    play=st.floats(0.0, 5.0),
    start=st.floats(-35.0, 35.0),
    target=st.floats(-35.0, 35.0),
)
def test_positions_within_a_period_lead_to_its_end(
    lag_s: float, limit: float | None, play: float, start: float, target: float
) -> None:
    """Of the stages of the integration: monotonic, within the limit, and the end is the end."""
    servo = SurfaceServo(lag_s=lag_s, rate_limit_deg_s=limit, backlash_deg=play)
    servos = new_servos(ActuatorServos(elevator=servo), STEP_US)
    sent = sent_commands(np.array([servos]))[0]
    for step, angle in enumerate((start, target)):
        controls = np.array([0.0, math.radians(angle), 0.0, 0.0])
        begin_period(
            servos, sent, controls, no_faults(ACTUATOR_FAULTS, 1)[0], step, step * DT, True
        )
        path = np.degrees([positions(servos, k * DT / 8.0)[ELEVATOR] for k in range(9)])
        end_period(servos, DT)
        assert math.degrees(servos["output"][ELEVATOR]) == path[-1]
    moves = np.diff(path) * np.sign(target - start)
    assert (moves >= -1e-12).all()
    if limit is not None:
        assert (moves <= limit * DT / 8.0 * (1.0 + 1e-9) + 1e-12).all()


def test_a_stuck_surface_is_there_at_once_and_stays(scenario1: Scenario) -> None:
    """Faults act behind the servo; when one ends, the servo has gone on following."""
    tree = scenario1.model_dump()
    tree |= {
        "duration_s": 0.5,
        "servos": {"surfaces": {"lag_s": 0.02, "rate_limit_deg_s": 400.0}},
        "faults": [
            {"uav": 3, "actuator": "rudder", "stuck_deg": -9.0, "start_s": 0.2, "end_s": 0.4}
        ],
    }
    flown = fly_in_process(scenario_of("stuck", tree))
    rudder = np.degrees(flown.applied[:, 2, 2])
    assert rudder[200:400] == pytest.approx(-9.0, abs=1e-12)
    assert abs(rudder[199] + 9.0) > 1.0
    assert abs(rudder[400] + 9.0) > 1.0
    free = np.delete(rudder, np.s_[199:401])
    assert np.abs(np.diff(free)[np.arange(len(free) - 1) != 198]).max() <= 0.4 + 1e-9


def test_a_hard_over_runs_away_and_comes_back_at_the_rate_of_the_servo() -> None:
    """From 3 ms to 43 ms at 400 deg/s, whatever is commanded meanwhile."""
    servo = SurfaceServo(rate_limit_deg_s=400.0)
    servos = new_servos(ActuatorServos(elevator=servo), STEP_US)
    sent = sent_commands(np.array([servos]))[0]
    faults: np.ndarray = no_faults(ACTUATOR_FAULTS, 1)[0]
    add_fault(
        faults, actuator_fault(ELEVATOR, 0.0, -20.0, 0.0, 0.003, 0.043, HARDOVER.code), now_s=0.0
    )
    flown = []
    for step in range(80):
        begin_period(servos, sent, np.zeros(4), faults, step, step * DT, True)
        end_period(servos, DT)
        flown.append(math.degrees(servos["output"][ELEVATOR]))
    after = np.arange(1, 81)
    expected = np.maximum(np.minimum(-0.4 * (after - 3), 0.0), -0.4 * np.maximum(83 - after, 0))
    assert flown == pytest.approx(expected)


def test_a_hard_over_from_the_start_begins_where_the_first_command_is() -> None:
    servos = new_servos(ActuatorServos(elevator=SurfaceServo(rate_limit_deg_s=400.0)), STEP_US)
    sent = sent_commands(np.array([servos]))[0]
    faults: np.ndarray = no_faults(ACTUATOR_FAULTS, 1)[0]
    add_fault(
        faults, actuator_fault(ELEVATOR, 0.0, -20.0, 0.0, 0.0, math.nan, HARDOVER.code), now_s=0.0
    )
    begin_period(servos, sent, np.zeros(4), faults, 0, 0.0, True)
    end_period(servos, DT)
    assert math.degrees(servos["output"][ELEVATOR]) == pytest.approx(-0.4)
