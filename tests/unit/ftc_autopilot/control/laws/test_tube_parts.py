"""The parts of the tube law against independent computations."""

import math
from typing import Any

import numpy as np
import pytest
from courses import Pilot, motion_at
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from steps import COMMANDS, NOTHING, step_of

from ftc_autopilot.common.motion import motion_of
from ftc_autopilot.common.tuples import four, rows_of
from ftc_autopilot.control.controller import parameter_record
from ftc_autopilot.control.laws.tube import Tube
from ftc_autopilot.control.laws.tube.check import check, trim
from ftc_autopilot.control.laws.tube.fallback import (
    coarser,
    fallback_flies,
    least_changes,
    only_rudder_lost,
    triggered,
)
from ftc_autopilot.control.laws.tube.observer import observe
from ftc_autopilot.control.laws.tube.plan import best_change, first_exit
from ftc_autopilot.control.laws.tube.prediction import PredictionStart, ServoModel, predict
from ftc_autopilot.control.laws.tube.tube import build_tube, to_errors
from ftc_autopilot.control.reference import filter_reference
from ftc_autopilot.control.step import ALL, Command, Step
from ftc_autopilot.control.synchronisation_errors import FormationErrors
from ftc_autopilot.control.transmit import saturated
from ftc_autopilot.control.triggers.static import Consequence
from gcs.scenario.model import Scenario
from mavlink_defs.constants import AILERON, THROTTLE
from mavlink_defs.framing.codec import SIM_STATE
from sitl_plant.actuators.config import ActuatorServos
from sitl_plant.actuators.lag import lagged
from sitl_plant.airframe.rigid_body import STILL_AIR, load_state, state_derivative

DT = 1e-3
STATE = (NOTHING, (45.0, 0.5, 2.5), (0.05, 0.1, 0.3), (0.02, -0.03, 0.01))
IDEAL = ServoModel(0.0, math.inf, 0.0)


def gains_of(**parameters: Any) -> np.void:
    law = Tube(**parameters).with_servos(ActuatorServos())
    record: np.void = parameter_record(law, Consequence())["tube"]
    return record


def new_state() -> np.void:
    state: np.void = np.zeros(1, Tube.STATE)[0]
    state["fallback"]["diagnosis"]["actuators"]["effectiveness"] = 1.0
    return state


def measured(
    nominal: np.void,
    v: tuple[float, ...] = STATE[1],
    phi: tuple[float, ...] = STATE[2],
    omega: tuple[float, ...] = STATE[3],
    force: tuple[float, ...] = NOTHING,
) -> Any:
    message = np.zeros(1, SIM_STATE)[0]
    message["velocity"], message["attitude"], message["rates"] = v, phi, omega
    message["specific_force"] = force
    return motion_of(message, nominal)


# the lag


@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(0.005, 0.2), st.floats(0.1, 20.0))
def test_a_lag_with_a_limit_solves_its_equation(
    start: float, target: float, lag: float, limit: float
) -> None:
    x, n = start, 20_000
    for _ in range(n):
        x += 0.1 / n * min(max((target - x) / lag, -limit), limit)
    assert lagged(start, target, lag, limit, 0.1) == pytest.approx(x, abs=2e-4)


def test_a_lag_without_a_limit_is_exponential() -> None:
    assert lagged(1.0, 3.0, 0.5, math.inf, 0.5) == pytest.approx(3.0 - 2.0 / math.e)
    assert lagged(1.0, 3.0, 0.0, math.inf, 0.0) == 3.0


# the prediction


def integrated(nominal: np.void, servo: ServoModel, d: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """Airspeed and attitude every 15 ms over 0.6 s, by an integrator with a small tolerance."""

    def derivative(s: float, x: np.ndarray) -> np.ndarray:
        u = x[12:] if servo.lag > 0.0 else COMMANDS
        rates = np.clip((COMMANDS - u) / max(servo.lag, 1e-9), -servo.limit, servo.limit)
        rates[3] = (COMMANDS[3] - u[3]) / max(servo.throttle_lag, 1e-9)
        now = d + slope * 0.135 * (1.0 - math.exp(-s / 0.135))
        parts = state_derivative(
            load_state(x[:12]),
            u[3],
            tuple(u[:3]),
            tuple(now[:3]),
            tuple(now[3:]),
            STILL_AIR,
            nominal,
        )
        return np.concatenate([*parts, rates if servo.lag > 0.0 else np.zeros(4)])

    begin = np.concatenate([*STATE, np.zeros(3), [700.0]])
    at = 0.015 * np.arange(1, 41)
    x = solve_ivp(derivative, (0.0, 0.6), begin, t_eval=at, rtol=1e-9, atol=1e-10, max_step=0.01).y
    return np.array([np.linalg.norm(x[3:6], axis=0), *x[6:9]])


@pytest.mark.parametrize("servo", [IDEAL, ServoModel(0.02, 7.0, 0.05)])
def test_the_prediction_is_the_plants_motion(nominal: np.void, servo: ServoModel) -> None:
    """Of the nominal aircraft; halving the step quarters the error, as a midpoint rule's."""
    d = np.array([0.1, -0.2, 0.3, 0.2, -0.1, 0.1])
    slope = np.array([0.5, 0.0, -0.5, 1.0, 0.5, -0.5])
    start = PredictionStart(STATE, np.array([0.0, 0.0, 0.0, 700.0]), servo, d, slope, 0.135)
    exact = integrated(nominal, servo, d, slope)
    errors = []
    for halves in (1, 2):
        outputs = np.empty((4, 40 * halves))
        predict(start, COMMANDS, 0.015 / halves, 40 * halves, nominal, outputs)
        errors.append(np.abs(outputs[:, halves - 1 :: halves] - exact).max(axis=1))
    assert errors[0][0] < 0.01  # m/s
    assert np.degrees(errors[0][1:]).max() < 0.1
    assert np.all(errors[1] < 0.4 * errors[0])


# the tube


def errors_with(V_tilde: float, yaw: float, weighted_yaw: float) -> FormationErrors:
    """λ' = 5, of which the error (32) holds `weighted_yaw`."""
    return FormationErrors(
        V_tilde,
        (0.0, 0.0, yaw),
        V_tilde * 0.8,
        (0.0, 0.0, 5.0 * weighted_yaw),
        0.8,
        5.0,
        0.0,
        NOTHING,
    )


def on_the_way(errors: FormationErrors, command: np.ndarray, filtered: np.ndarray) -> Step:
    """A step with these errors, a command, and the filtered reference on its way to it."""
    return step_of(None, errors=errors, command=four(command), filtered=rows_of(filtered))


def test_the_path_is_the_reference_that_will_be() -> None:
    gains = gains_of()
    command = np.array([50.0, 0.1, -0.05, 3.1])
    reference = np.array([[40.0, 3.0, 1.0], [0.0, 0.1, 0.0], [0.1, 0.0, -0.1], [-3.1, 0.2, 0.1]])
    path, width = np.empty((4, 40)), np.empty((4, 40))
    build_tube(on_the_way(errors_with(0.0, 0.0, 0.0), command, reference), 40, gains, path, width)
    fine = 1e-5
    filtered, rows = reference.copy(), []
    for _ in range(40):
        for _ in range(1500):
            filter_reference(command, filtered, 2.5, fine)
        rows.append(filtered[:, 0].copy())
    off = path - np.array(rows).T
    off[1:] = (off[1:] + math.pi) % (2.0 * math.pi) - math.pi
    assert np.abs(off).max() < 2e-3


def test_the_width_of_the_tube_by_hand() -> None:
    """At rest it is d; outside there is a funnel; on the way it is wider by k |z|."""
    gains = gains_of(tube_scale=0.5, funnel_s=0.34)
    command = np.array([45.0, 0.0, 0.0, 0.0])
    reference = np.zeros((4, 3))
    reference[:, 0] = (45.0, 0.0, 0.2, 0.0)
    path, width = np.empty((4, 40)), np.empty((4, 40))
    build_tube(on_the_way(errors_with(1.0, 0.0, 0.0), command, reference), 40, gains, path, width)
    s = 0.015 * np.arange(1, 41)
    assert width[0] == pytest.approx(0.11 + (1.0 - 0.11) * np.exp(-s / 0.34))
    assert width[1] == pytest.approx(np.full(40, math.radians(0.15)))
    way = 0.2 * np.exp(-2.5 * s) * (1.0 + 2.5 * s + (2.5 * s) ** 2 / 2.0)
    assert path[2] == pytest.approx(way)
    assert width[2] == pytest.approx(math.radians(0.07) + 0.03 * way)


def test_a_large_error_returns_no_faster_than_it_may() -> None:
    """Yaw is 0.6 rad off; 12 deg/s bring it back, of which 12·0.34 deg are the funnel's."""
    reference, command = np.zeros((4, 3)), np.zeros(4)
    path, width = np.empty((4, 40)), np.empty((4, 40))
    gains = gains_of(funnel_s=0.34, width_deg=(0.4, 0.13, 1.2))
    build_tube(on_the_way(errors_with(0.0, 0.6, 0.6), command, reference), 40, gains, path, width)
    rate = math.radians(12.0)
    s = 0.015 * np.arange(1, 41)
    assert path[3] == pytest.approx(0.6 - rate * 0.34 - rate * s)
    assert width[3, 0] == pytest.approx(
        math.radians(1.2) + (rate * 0.34 - math.radians(1.2)) * math.exp(-0.015 / 0.34)
    )


def test_what_the_neighbours_ask_for_moves_the_path() -> None:
    """The present output is off its path by e'/λ', not by the error against the reference."""
    path, width = np.empty((4, 40)), np.empty((4, 40))
    errors = errors_with(0.0, 0.05, 0.02)
    now = on_the_way(errors, np.zeros(4), np.zeros((4, 3)))
    build_tube(now, 40, gains_of(), path, width)
    outputs = np.full((4, 40), 0.05)
    to_errors(outputs, path, 40)
    assert outputs[3] == pytest.approx(np.full(40, 0.02))


# the plan


def test_the_first_exit_is_the_first_row_outside() -> None:
    width = np.array([1.0, 1.0, 1.0])
    assert first_exit(np.array([1.0, -1.0, 1.01]), width) == 2
    assert first_exit(np.array([0.0, -1.0, 1.0]), width) == 3
    assert first_exit(np.array([0.0, math.nan, 0.0]), width) == 1  # nobody knows: outside


rows = st.lists(st.floats(-3.0, 3.0), min_size=8, max_size=8)


@given(rows, rows, st.lists(st.floats(0.1, 1.0), min_size=8, max_size=8))
def test_no_other_change_stays_in_for_longer(
    errors: list[float], slopes: list[float], widths: list[float]
) -> None:
    error, width, share, low, high = np.array(errors), np.array(widths), 0.8, -2.0, 1.5
    influence = np.array(slopes)
    influence[np.abs(influence) < 0.01] = 0.0
    plan = best_change(error, influence, width, 2, share, low, high)
    assert low <= plan.change <= high

    def stays(change: float, slack: float) -> int:
        """Rows that a change influences, in which it is inside, until the first outside."""
        for k in range(2, 8):
            off = abs(error[k] + influence[k] * change)
            if influence[k] != 0.0 and off > share * width[k] + slack:
                return k
        return 8

    assert stays(plan.change, 1e-9) >= plan.leaves
    assert max(stays(change, 0.0) for change in np.linspace(low, high, 701)) <= plan.leaves


def test_of_the_changes_that_stay_in_the_least_squares_one_is_taken() -> None:
    error, influence, width = np.array([0.2, 0.4]), np.array([1.0, 2.0]), np.array([1.0, 2.0])
    plan = best_change(error, influence, width, 0, 1.0, -9.0, 9.0)
    # minimum of (0.2 + u)² + (0.4 + 2u)²/4 is at u = -0.2
    assert plan.change == pytest.approx(-0.2)
    assert plan.leaves == 2
    at_the_stop = best_change(error, influence, width, 0, 1.0, -0.1, 9.0)
    assert at_the_stop.change == pytest.approx(-0.1)


@pytest.mark.parametrize(("settle_s", "row"), [(0.3, 20), (0.585, 39), (9.0, 39)])
def test_a_plan_without_room_meets_the_path_when_it_has_settled(
    settle_s: float, row: int, nominal: np.void
) -> None:
    """At the end of what is predicted if that is sooner; pitch is planned last."""
    gains, state = gains_of(settle_s=(settle_s,) * 4, plan_share=(0.0,) * 4), new_state()
    state["omega"] = STATE[3]
    errors = FormationErrors(0.0, (0.0, 0.001, 0.0), 0.0, (0.0, 0.005, 0.0), 1.0, 5.0, 0.0, NOTHING)
    motion, commands = measured(nominal), COMMANDS.copy()
    command, filtered = np.array([motion.V, 0.05, 0.099, 0.3]), np.zeros((4, 3))
    filtered[:, 0] = command
    now = on_the_way(errors, command, filtered)._replace(motion=motion, first=True)
    assert check(now, commands.copy(), False, nominal, gains, state, commands) == ALL
    path, width, outputs = (np.empty((4, 40)) for _ in range(3))
    start = PredictionStart(STATE, commands, IDEAL, np.zeros(6), np.zeros(6), 0.13)
    predict(start, commands, 0.015, 40, nominal, outputs)
    build_tube(now, 40, gains, path, width)
    to_errors(outputs, path, 40)
    assert int(np.abs(outputs[2, 10:]).argmin()) + 10 == row
    assert abs(outputs[2, row]) < 0.05 * np.abs(np.diff(outputs[2]))[row - 1]


# the observer and the trim


def test_the_observer_finds_a_disturbance_and_its_slope(nominal: np.void) -> None:
    """Of the angular acceleration a ramp, of the specific force a constant."""
    gains, state = gains_of(), new_state()
    omega, v = np.array([0.02, -0.03, 0.01]), STATE[1]
    d, slope = np.array([0.5, -0.2, 0.1]), np.array([0.4, 0.0, -0.3])
    for k in range(1000):
        t = k * DT
        x = (NOTHING, v, STATE[2], tuple(omega))
        derivative = state_derivative(
            x, 900.0, tuple(COMMANDS[:3]), NOTHING, NOTHING, STILL_AIR, nominal
        )
        air = measured(nominal, omega=tuple(omega)).air
        force = np.add(air.F, (900.0, 0.0, 0.0)) / nominal["m"] + (0.3, 0.0, -0.1)
        motion = measured(nominal, omega=tuple(omega), force=tuple(force))
        observe(step_of(motion, first=k == 0), COMMANDS, nominal, gains, state)
        omega = omega + DT * (np.array(derivative[3]) + d + slope * t)
    assert state["disturbance"][:3] == pytest.approx([0.3, 0.0, -0.1], abs=1e-6)
    assert state["disturbance"][3:] == pytest.approx(d + slope * 0.998, abs=2e-3)
    assert state["disturbance_slope"][3:] == pytest.approx(slope, abs=5e-3)
    assert state["omega"] == pytest.approx(omega, abs=2e-3)


def test_the_trim_turns_and_accelerates_nothing(nominal: np.void) -> None:
    commands = np.zeros(4)
    trim(step_of(measured(nominal), first=True), nominal, commands)
    derivative = state_derivative(
        STATE, commands[3], tuple(commands[:3]), NOTHING, NOTHING, STILL_AIR, nominal
    )
    assert derivative[3] == pytest.approx(NOTHING, abs=1e-9)
    v = np.array(STATE[1])
    assert v @ np.array(derivative[1]) / np.linalg.norm(v) == pytest.approx(0.0, abs=1e-9)


# whose turn it is


def test_the_surviving_law_takes_over_for_as_long_as_needed(nominal: np.void) -> None:
    gains, state, now = gains_of(), new_state(), step_of(measured(nominal))
    actuators = state["fallback"]["diagnosis"]["actuators"]
    assert not fallback_flies(now, gains, state)
    actuators[1]["lost"] = 1
    assert fallback_flies(now, gains, state)
    assert state["fallback_left"] == 0.5
    actuators[1]["lost"] = 0
    assert sum(fallback_flies(now, gains, state) for _ in range(1000)) in {499, 500}
    assert not fallback_flies(now, gains_of(survive=False), state)


@pytest.mark.parametrize("actuator", [0, 1])
def test_the_surviving_law_takes_over_from_what_cannot_believe_in_a_weak_surface(
    nominal: np.void, actuator: int
) -> None:
    gains, state, now = gains_of(), new_state(), step_of(measured(nominal))
    weak = state["fallback"]["diagnosis"]["actuators"][actuator]
    weak["effectiveness"] = 0.61
    assert not fallback_flies(now, gains, state)
    weak["effectiveness"] = 0.59
    assert fallback_flies(now, gains, state)


@pytest.mark.parametrize(("actuator", "flies"), [(AILERON, True), (THROTTLE, False)])
def test_a_surface_that_swings_is_a_reason_and_a_thrust_that_lags_is_none(
    nominal: np.void, actuator: int, flies: bool
) -> None:
    gains, state, now = gains_of(), new_state(), step_of(measured(nominal))
    one = state["fallback"]["diagnosis"]["actuators"][actuator]
    one["variance"] = one["smooth_variance"] = 1e4 if actuator == THROTTLE else 0.01
    one["swings"] = 3.0
    assert fallback_flies(now, gains, state) == flies


def test_the_surviving_law_flies_while_a_turn_has_to_be_slow(nominal: np.void) -> None:
    gains, state, now = gains_of(), new_state(), step_of(measured(nominal))
    state["fallback"]["slows_turn"] = 1
    assert fallback_flies(now, gains, state)


def test_without_rudder_the_tube_law_flies_on(nominal: np.void) -> None:
    gains, state, now = gains_of(), new_state(), step_of(measured(nominal))
    actuators = state["fallback"]["diagnosis"]["actuators"]
    actuators[2]["lost"] = 1
    assert only_rudder_lost(gains, state)
    assert not fallback_flies(now, gains, state)
    actuators[0]["lost"] = 1
    assert not only_rudder_lost(gains, state)
    assert fallback_flies(now, gains, state)


def test_a_large_error_and_a_high_event_rate_are_reasons_too(nominal: np.void) -> None:
    gains, motion = gains_of(), measured(nominal)
    off = FormationErrors(0.0, (0.0, math.radians(15.1), 0.0), 0.0, NOTHING, 1.0, 1.0, 0.0, NOTHING)
    assert fallback_flies(step_of(motion, errors=off), gains, new_state())
    state = new_state()
    for longer in (5.0, 10.0, 20.0):
        state["event_rate"][2], state["fallback_left"] = 17.1, 0.0
        assert fallback_flies(step_of(motion), gains, state)
        assert state["fallback_left"] == longer


@given(rudder=st.floats(-0.7, 0.7), thrust=st.floats(-100.0, 2200.0), factor=st.floats(0.5, 4.0))
def test_its_commands_are_sent_by_the_papers_triggers(
    rudder: float, thrust: float, factor: float, nominal: np.void
) -> None:
    now, commands, noise = step_of(measured(nominal)), COMMANDS.copy(), new_state()["noise"]
    sent = saturated(Command((0.0, 0.0, rudder), thrust, ALL), now, nominal)
    least = least_changes(coarser(now.thresholds, factor), commands)
    stop = nominal["stops"][0, 1]
    commanded = min(max(rudder, -stop), stop)
    due = abs(commanded - 0.3) >= factor * (0.01 * 0.3 + math.radians(1.0))
    assert triggered(now, 2, sent, least, noise, commands) == due
    assert commands[2] == (commanded if due else 0.3)
    commanded = min(max(thrust, 0.0), nominal["thrust_limit"])
    due = abs(commanded - 900.0) >= factor * (0.01 * 900.0 + 1.0)
    assert triggered(now, 3, sent, least, noise, commands) == due
    assert commands[3] == (commanded if due else 900.0)


def test_a_command_that_gusts_move_is_sent_less_often(nominal: np.void) -> None:
    now, commands, state = step_of(measured(nominal)), COMMANDS.copy(), new_state()
    least = least_changes(now.thresholds, commands)
    state["noise"]["slow"][3] = 2.0 * least[3]
    beside = 0.0, 0.0, 0.3, 900.0 + 2.0 * least[3]
    assert not triggered(now, 3, beside, least, state["noise"], commands)
    assert triggered(
        now, 3, (0.0, 0.0, 0.3, 900.0 + 3.0 * least[3]), least, state["noise"], commands
    )


def test_predictions_are_checked_as_often_as_configured(scenario1: Scenario) -> None:
    """In between they stand as they are."""
    pilot = Pilot(
        Tube(check_s=0.004).with_servos(ActuatorServos()), Consequence(), scenario1.aircraft
    )
    exits = []
    for step in range(20):
        motion = motion_at(step * pilot.dt, pilot.nominal)
        signals = pilot.step(motion, (45.0, 0.0, 0.0, 3.0))
        exits.append(signals["predicted_exit"].copy())
    changed = 1 + np.flatnonzero(np.any(np.diff(exits, axis=0) != 0.0, axis=1))
    assert changed.tolist() == list(range(4, 20, 4))
