"""States predicted over a delay, and states in place of lost ones."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from steps import NOTHING

from ftc_autopilot.control.controllers import Controllers, ReferenceSource, new_controllers
from ftc_autopilot.control.reference import profile_record
from ftc_autopilot.control.state_predictor import (
    DELAY,
    interpolate,
    lost_states,
    note_commands,
    note_state,
    predicted,
    smoothed,
)
from ftc_autopilot.control.stepping import controller_step
from gcs.fleet.in_process import fly_in_process
from gcs.scenario.model import Scenario, scenario_of, scenario_tree
from mavlink_defs.framing.codec import SIM_STATE
from sitl_plant.airframe.aerodynamics import aerodynamics
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.rigid_body import STILL_AIR, load_state, specific_force, state_derivative
from sitl_plant.vec3 import vec3

STEP_US = 1000
DELAY_S = 0.02


@pytest.fixture(scope="module")
def calm() -> Scenario:
    """A flight that the nominal model explains: no disturbance, no uncertainty, no fault."""
    tree = scenario_tree(Path("paper/scenario1"))
    for name in ("disturbance", "faults", "uncertainty"):
        tree.pop(name, None)
    return scenario_of("calm", tree | {"duration_s": 3.0})


def state_of(flight_states: np.ndarray, step: int, force: np.ndarray) -> np.void:
    measured: np.void = np.zeros(1, SIM_STATE)[0]
    measured["step"] = step
    measured["position"], measured["velocity"] = flight_states[0:3], flight_states[3:6]
    measured["attitude"], measured["rates"] = flight_states[6:9], flight_states[9:12]
    measured["specific_force"] = force
    return measured


@pytest.mark.parametrize("delay", [1, 5, 20])
def test_the_prediction_is_what_the_aircraft_then_does(calm: Scenario, delay: int) -> None:
    """The commands are those that were on their way, not those in force when they were sent."""
    flight = fly_in_process(calm)
    aircraft = aircraft_record(calm.aircraft)
    for now in (500, 1500, 2500):
        memory = np.zeros(1, DELAY)[0]
        memory["periods"] = delay
        for step in range(now - 100, now):  # a command acts `delay` periods after its step
            note_commands(memory, step, flight.applied[step + delay, 1], 0.0, STEP_US)
        x = flight.states[now, 1]
        v_dot = np.gradient(flight.states[now - 1 : now + 1, 1, 3:6], axis=0)[0] * 1e6 / STEP_US
        gravity = calm.aircraft.gravity_m_s2 * down_in_body_axes(x[6:9])
        measured = state_of(x, now, v_dot + np.cross(x[9:12], x[3:6]) - gravity)
        result = predicted(memory, measured, 0.0, STEP_US, aircraft)
        assert result["step"] == now
        then = flight.states[now + delay, 1]
        moved = np.abs(then - x)
        for name, part, least in (("velocity", slice(3, 6), 1e-2), ("attitude", slice(6, 9), 1e-5)):
            wrong = np.abs(result[name] - then[part])
            assert (wrong < 0.05 * moved[part].max() + least).all(), name
        assert np.allclose(result["rates"], then[9:12], atol=1e-3)


@given(
    rates=st.lists(st.floats(-5.0, 5.0), min_size=2, max_size=30),
    filter_s=st.floats(1e-4, 0.5),
)
def test_the_low_pass_is_a_first_order_lag_of_each_rate(
    rates: list[float], filter_s: float
) -> None:
    """Its response to a staircase is the sum of the responses to the steps."""
    memory, x = np.zeros(1, DELAY)[0], np.zeros(12)
    for step, rate in enumerate(rates):
        x[9:12] = rate, -2.0 * rate, 0.5
        result = smoothed(memory, state_of(x, step, np.zeros(3)), filter_s, STEP_US)
        note_commands(memory, step, np.zeros(4), 0.0, STEP_US)
        expected = rates[0] + sum(
            (rates[k] - rates[k - 1]) * -math.expm1(-(step - k + 1) * STEP_US / 1e6 / filter_s)
            for k in range(1, step + 1)
        )
        assert result["rates"] == pytest.approx([expected, -2.0 * expected, 0.5], abs=1e-9)
        assert (result["velocity"] == x[3:6]).all()
        assert result["step"] == step


def test_the_low_pass_begins_anew_after_a_gap_and_leaves_the_measured_state_alone() -> None:
    memory, x = np.zeros(1, DELAY)[0], np.zeros(12)
    for step, rate in ((0, 1.0), (500, -3.0)):  # 0.5 s without a state
        x[9:12] = rate
        measured = state_of(x, step, np.zeros(3))
        assert (smoothed(memory, measured, 0.05, STEP_US)["rates"] == rate).all()
        assert (measured["rates"] == rate).all()
        assert smoothed(memory, measured, 0.0, STEP_US) == measured
        note_commands(memory, step, np.zeros(4), 0.0, STEP_US)
        note_state(memory, measured)


def down_in_body_axes(attitude: np.ndarray) -> np.ndarray:
    roll, pitch, _ = attitude
    return np.array([-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)])


def test_the_prediction_solves_the_equations(any_aircraft: np.void) -> None:
    """In wind, under a force that the model does not explain, which is taken to stay.

    Surfaces and gyro are 4 ms later than the links' 3 ms: the thrust acts earlier.
    """
    memory, wind, now, links, ahead = np.zeros(1, DELAY)[0], np.array([2.0, -1.0, 0.5]), 200, 3, 7
    sent = {}
    for step in range(now - 20, now):
        sent[step] = np.array([0.01 * (step % 7), 0.05 * math.sin(step), 0.2, 100.0 * (step % 5)])
        note_commands(memory, step, sent[step], 0.0, STEP_US)
    memory["periods"] = links
    x = np.array([0.0, 0.0, -90.0, 44.0, 2.0, 3.0, 0.2, 0.1, 3.0, 0.5, -0.4, 0.2])
    force_0 = (0.7, -0.4, 1.2)
    unexplained = np.array(force_0)

    def force(x: np.ndarray, sent_at: int, thrust: float) -> np.ndarray:
        air = aerodynamics(vec3(x[3:6] - wind), vec3(x[9:12]), any_aircraft)
        by_air = specific_force(air, vec3(sent[sent_at]), thrust, any_aircraft)
        return np.array(by_air) + unexplained

    thrusts = [float(sent[min(now - links + k, now - 1)][3]) for k in range(-1, ahead)]
    measured = state_of(x, now, force(x, now - ahead - 1, thrusts[0]))
    measured["wind"] = wind
    result = predicted(memory, measured, 0.004, STEP_US, any_aircraft)
    for k in range(ahead):
        da, de, dr, _ = sent[now - ahead + k].tolist()

        def slope(
            _: float, y: np.ndarray, d: tuple[float, ...] = (da, de, dr), T: float = thrusts[k + 1]
        ) -> np.ndarray:
            y = np.concatenate([y[:3], y[3:6] - wind, y[6:]])
            parts = state_derivative(
                load_state(y), T, (d[0], d[1], d[2]), force_0, NOTHING, STILL_AIR, any_aircraft
            )
            return np.concatenate([*parts])

        x = solve_ivp(slope, (0.0, STEP_US / 1e6), x, rtol=1e-9, atol=1e-12).y[:, -1]
    assert result["velocity"] == pytest.approx(x[3:6], abs=1e-5)
    assert result["attitude"] == pytest.approx(x[6:9], abs=1e-6)
    assert result["rates"] == pytest.approx(x[9:12], abs=1e-5)
    assert result["specific_force"] == pytest.approx(force(x, now - 1, thrusts[-1]), abs=1e-5)
    assert result["wind"] == pytest.approx(wind)
    assert result["position"] == pytest.approx(measured["position"])


def test_without_a_delay_the_state_is_the_measured_one(calm: Scenario) -> None:
    memory, measured = np.zeros(1, DELAY)[0], np.zeros(1, SIM_STATE)[0]
    measured["velocity"] = 40.0, 0.0, 1.0
    found = predicted(memory, measured, 0.0, STEP_US, aircraft_record(calm.aircraft))
    assert found.tobytes() == measured.tobytes()


def test_no_delay_is_longer_than_what_is_remembered(calm: Scenario) -> None:
    """A delay of the links and a dead time that was found add up to more periods than are noted."""
    aircraft, results = aircraft_record(calm.aircraft), []
    for dead in (27, 40):
        memory, measured = np.zeros(1, DELAY)[0], np.zeros(1, SIM_STATE)[0]
        measured["velocity"], measured["step"] = (40.0, 0.0, 1.0), 300
        for step in range(300):
            command = np.array([1e-4 * step, 0.0, 0.0, 900.0])
            note_commands(memory, step, command, 0.0, STEP_US)
        memory["periods"], memory["found"] = 100, dead
        results.append(predicted(memory, measured, 0.0, STEP_US, aircraft).tobytes())
    assert results[0] == results[1]


def test_a_law_without_diagnosis_predicts_over_no_dead_time_of_another(calm: Scenario) -> None:
    controllers, measured = new_controller_of(calm), np.zeros(1, SIM_STATE)[0]
    measured["velocity"] = 40.0, 0.0, 1.0
    controllers.uavs[0]["signals"]["dead_steps"] = 16  # as the law before has left it
    controller_step(*controllers.of(0), measured, STEP_US)
    assert controllers.uavs[0]["delay"]["found"] == 0


@given(
    gap=st.integers(1, 100),
    begin=st.integers(0, 10**6),
    before=st.floats(-10.0, 10.0),
    after=st.floats(-10.0, 10.0),
)
def test_lost_states_lie_on_the_line_between_their_neighbours(
    gap: int, begin: int, before: float, after: float
) -> None:
    memory, first, last = (np.zeros(1, kind)[0] for kind in (DELAY, SIM_STATE, SIM_STATE))
    first["step"], last["step"] = begin, begin + gap + 1
    names = ("velocity", "attitude", "rates", "specific_force", "wind")
    for name in names:
        first[name], last[name] = before, after
    note_state(memory, first)
    note_commands(memory, begin, np.zeros(4), 0.0, STEP_US)
    assert lost_states(memory, last, STEP_US) == gap
    for k in range(1, gap + 1):
        between = interpolate(memory, last)
        assert between["step"] == begin + k
        for name in names:
            assert between[name] == pytest.approx(before + k / (gap + 1) * (after - before))
        note_commands(memory, begin + k, np.zeros(4), 0.0, STEP_US)


@pytest.mark.parametrize(("step", "lost"), [(1, 0), (101, 100), (102, 0), (0, 0)])
def test_a_long_gap_is_not_compensated(step: int, lost: int) -> None:
    memory, measured = np.zeros(1, DELAY)[0], np.zeros(1, SIM_STATE)[0]
    note_commands(memory, 0, np.zeros(4), 0.0, STEP_US)
    measured["step"] = step
    assert max(lost_states(memory, measured, STEP_US), 0) == lost


@given(
    steps=st.lists(st.integers(1, 40), min_size=1, max_size=12),
    values=st.lists(st.floats(-1.0, 1.0), min_size=12, max_size=12),
)
def test_commands_stay_in_force_until_the_next_ones(steps: list[int], values: list[float]) -> None:
    memory, step, said = np.zeros(1, DELAY)[0], 0, {}
    for after, value in zip(steps, values, strict=False):
        step += after
        note_commands(memory, step, np.full(4, value), 0.0, STEP_US)
        said[step] = value
    rows = len(memory["positions"])
    for earlier in range(max(step - rows + 1, 0), step + 1):
        known = [value for at, value in said.items() if at <= earlier]
        assert memory["positions"][earlier % rows] == pytest.approx(
            known[-1] if known else values[0]
        )


def test_a_servo_with_a_lag_comes_later() -> None:
    memory, command = np.zeros(1, DELAY)[0], np.array([0.1, -0.2, 0.3, 900.0])
    note_commands(memory, 0, np.zeros(4), 0.02, STEP_US)
    for step in range(1, 21):  # a time constant
        note_commands(memory, step, command, 0.02, STEP_US)
    reached = memory["positions"][20] / command
    assert reached == pytest.approx([*np.full(3, 1.0 - np.exp(-1.0)), 1.0])


def new_controller_of(scenario: Scenario) -> Controllers:
    controllers = new_controllers([scenario.autopilot_config(2)])
    controllers.uavs[0]["profile"] = profile_record(scenario.segments())
    for key, value in (("active", 1), ("follows", ReferenceSource.PROFILE), ("start_step", 0)):
        controllers.uavs[0]["guidance"][key] = value
    return controllers


def test_the_reference_does_not_stand_still_over_lost_states(calm: Scenario) -> None:
    whole, lossy = new_controller_of(calm), new_controller_of(calm)
    measured = np.zeros(1, SIM_STATE)[0]
    measured["velocity"] = 40.0, 0.0, 1.0
    for step in range(1200):
        measured["step"], measured["time_usec"] = step, step * STEP_US
        controller_step(*whole.of(0), measured, STEP_US)
        if step % 7 not in {2, 3, 4}:
            controller_step(*lossy.of(0), measured, STEP_US)
    assert (
        lossy.uavs["controller"]["reference"].tobytes()
        == whole.uavs["controller"]["reference"].tobytes()
    )
    assert lossy.uavs["controller"]["steps"][0] < whole.uavs["controller"]["steps"][0] == 1200
    counted = lossy.uavs[0]["controller"]
    assert counted["messages"] <= counted["steps"]


def test_a_known_dead_time_of_the_servos_is_predicted_over() -> None:
    tree = scenario_tree(Path("paper/scenario1")) | {"duration_s": 6.0}
    dead = {"dead_time_s": DELAY_S}
    slow = tree | {"servos": {"surfaces": dead, "throttle": dead}}
    known = slow | {"controller": slow["controller"] | {"delay_s": DELAY_S}}
    ideal, unaware, aware = (roll_error(scenario_of("delay", one)) for one in (tree, slow, known))
    assert aware < 1.05 * ideal
    assert unaware > 1.5 * ideal


def roll_error(scenario: Scenario) -> float:
    """Return the IAE of the roll angle [deg s]."""
    error = fly_in_process(scenario).error("command")[..., 1]
    return float(np.degrees(np.abs(error)).sum() * scenario.step_us / 1e6)
