import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ftc_autopilot.controller import SIGNALS
from ftc_autopilot.laws.proposed import Proposed
from ftc_autopilot.trigger import fires, on_wire
from gcs.closed_loop import fly_in_process
from gcs.recording import Recording
from gcs.scenario import Scenario, scenario_of, scenario_tree
from gcs.theory import check_theory, theory_words
from gcs.theory.check import judge
from gcs.theory.dwell import dwell_times, in_force
from gcs.theory.known import Known, known_quantities
from gcs.theory.lyapunov import attitude_subsystem, speed_subsystem
from gcs.theory.residual import residual_sets

SCENARIO_1 = Path(__file__).parents[3] / "scenarios" / "paper" / "scenario1.yaml"
DT = 1e-3
THROTTLE = 3


def scenario_with(**changes: Any) -> Scenario:
    return scenario_of("scenario1 changed", scenario_tree(SCENARIO_1) | changes)


def synthetic(steps: int, uavs: int = 1, loss: str | None = None) -> Recording:
    """A recording of zeros at a safe airspeed."""
    states = np.zeros((steps, uavs, 12))
    states[:, :, 3] = 40.0
    signals = np.zeros((steps, uavs), SIGNALS)
    signals["V"] = 40.0
    return Recording(
        mode="in_process",
        step_us=1000,
        uav_ids=tuple(range(1, uavs + 1)),
        states=states,
        applied=np.zeros((steps, uavs, 4)),
        signals=signals,
        repeats=np.zeros((uavs, 4), np.int64),
        wall_s=0.0,
        loss=loss,
    )


def with_thrust(demand: list[float], events: list[int]) -> Recording:
    recording = synthetic(len(demand))
    recording.signals["demand"][:, 0, THROTTLE] = demand
    recording.signals["events"][events, 0] = 1 << THROTTLE
    return recording


# --- intervals and Zeno bounds


def test_interval_and_bound_of_a_known_command(scenario1: Scenario) -> None:
    recording = with_thrust([0.0, 0.2, 0.4, 0.6, 0.7, 0.9, 1.1], [0, 3, 6])
    throttle = dwell_times(recording, 0, scenario1)["throttle"]
    assert throttle["events"] == 3
    assert throttle["min_interval_s"] == pytest.approx(3 * DT)
    assert throttle["intervals"] == 2
    assert throttle["intervals_of_one_period"] == 0
    assert throttle["mu_n_s"] == pytest.approx(200.0)
    assert throttle["threshold_n"] == 0.5  # a2 up to 14 s
    assert throttle["bound_s"] == pytest.approx(0.5 / 200.0)
    assert throttle["bound_below_period"] is False
    assert throttle["held"] is True


def test_rate_is_that_of_the_saturated_command(scenario1: Scenario) -> None:
    throttle = dwell_times(with_thrust([0.0, -5e3, 1.0], [0]), 0, scenario1)["throttle"]
    assert throttle["mu_n_s"] == pytest.approx(1e3)
    assert throttle["mu_unsaturated_n_s"] == pytest.approx(5001e3)


def test_a_trigger_that_fires_too_early_is_caught(scenario1: Scenario) -> None:
    throttle = dwell_times(with_thrust([0.0, 0.2, 0.4, 0.6], [0, 1, 3]), 0, scenario1)["throttle"]
    assert throttle["intervals_below_bound"] == 2
    assert throttle["held"] is False


def test_each_interval_meets_the_threshold_in_force_at_its_end() -> None:
    scenario = scenario_with(trigger={"a2_n": [{"until_s": 0.003, "value": 0.5}, {"value": 1.0}]})
    ramp = [0.25 * k for k in range(8)]
    throttle = dwell_times(with_thrust(ramp, [0, 2, 6]), 0, scenario)["throttle"]
    assert throttle["held"] is True
    throttle = dwell_times(with_thrust(ramp, [0, 2, 4]), 0, scenario)["throttle"]
    assert throttle["intervals_below_bound"] == 1


def test_joint_surfaces_share_the_fastest_rate() -> None:
    scenario = scenario_with(trigger={"mode": "joint"})
    recording = synthetic(3)
    recording.signals["demand"][:, 0, 0] = np.radians([0.0, 2.0, 4.0])
    recording.signals["events"][:, 0] = 0b111
    dwell = dwell_times(recording, 0, scenario)
    assert dwell["rudder"]["mu_deg_s"] == 0.0
    assert dwell["rudder"]["bound_s"] == pytest.approx(0.5 * DT)
    assert dwell["rudder"]["held"] is True


def test_without_a_trigger_there_is_no_bound() -> None:
    scenario = scenario_with(trigger={"mode": "periodic"})
    throttle = dwell_times(with_thrust([0.0, 1.0], [0, 1]), 0, scenario)["throttle"]
    assert throttle["min_interval_s"] == pytest.approx(DT)
    assert throttle["bound_s"] is throttle["held"] is None


@given(st.lists(st.floats(-50.0, 3000.0), min_size=1, max_size=60))
def test_no_working_trigger_beats_its_bound(scenario1: Scenario, demand: list[float]) -> None:
    limit = scenario1.aircraft.thrust_limit_n
    held, events = 0.0, []
    for k, wanted in enumerate(demand):
        if k == 0 or fires(min(max(wanted, 0.0), limit), held, 0.01, 0.5):
            held = float(on_wire(wanted, 0.0, limit)) * limit
            events.append(k)
    throttle = dwell_times(with_thrust(demand, events), 0, scenario1)["throttle"]
    assert throttle["held"] in {True, None}


def test_schedule_windows_include_their_last_instant(scenario1: Scenario) -> None:
    times = np.array([0.0, 14.0, 14.001, 24.0])
    assert in_force(scenario1.trigger.a2_n, times).tolist() == [0.5, 0.5, 1.0, 1.0]


# --- residual sets


def test_residual_set_is_the_largest_error_of_the_last_seconds(scenario1: Scenario) -> None:
    recording = synthetic(24_000)
    error = recording.signals["error"]
    error[1000, 0, 0] = 9.0  # at 1 s, not within (1, 4] s
    error[4000, 0, 0] = -2.0  # at 4 s: still the first segment
    error[13_000, 0, 1] = np.radians(3.0)
    recording.signals["sync_error"][23_999, 0, 3] = np.radians(-4.0)
    first, second, third = residual_sets(recording, 0, scenario1)
    assert (first["from_s"], first["end_s"]) == (1.0, 4.0)
    assert first["tracking"]["airspeed_m_s"] == 2.0
    assert second["tracking"]["airspeed_m_s"] == 0.0
    assert second["tracking"]["roll_deg"] == pytest.approx(3.0)
    assert third["synchronisation"]["yaw_deg"] == pytest.approx(4.0)


def test_a_lost_flight_has_the_segments_that_it_reached(scenario1: Scenario) -> None:
    recording = synthetic(4500, loss="UAV 1 was lost")
    recording.signals["error"][4499, 0, 0] = np.nan
    sets = residual_sets(recording, 0, scenario1)
    assert [(s["from_s"], s["end_s"]) for s in sets] == [(1.0, 4.0), (4.0, 4.5)]
    assert sets[1]["tracking"]["airspeed_m_s"] is None


# --- Lyapunov functions

CALM = {"duration_s": 2.0, "disturbance": {}, "faults": [], "trigger": {"mode": "periodic"}}


@pytest.fixture(scope="module")
def calm() -> tuple[Recording, Scenario]:
    """No fault, no disturbance, no trigger, nominal aircraft: 2 s."""
    scenario = scenario_with(**CALM)
    return fly_in_process(scenario), scenario


@pytest.fixture(scope="module")
def rough() -> tuple[Recording, Scenario]:
    """Triggers, disturbance, uncertainty, a switch of K1 at 1.5 s, two faults: 3 s."""
    tree = scenario_tree(SCENARIO_1)
    gains = [{"until_s": 1.5, "value": [50.0, 50.0, 51.0]}, {"value": [45.0, 45.0, 45.0]}]
    scenario = scenario_with(
        duration_s=3.0,
        uncertainty={"mass": 1.1, "inertia": 1.2, "coefficients": 0.9},
        controller=tree["controller"] | {"K1": gains},
        faults=[
            {"uav": 1, "actuator": "throttle", "effectiveness": 0.9, "start_s": 2.0, "end_s": 2.5},
            {"uav": 2, "actuator": "rudder", "stuck_deg": 0.0, "start_s": 2.0, "end_s": 2.1},
        ],
    )
    return fly_in_process(scenario), scenario


@pytest.fixture(scope="module")
def known(calm: tuple[Recording, Scenario]) -> Known:
    return known_quantities(calm[0], 1, calm[1])


def test_speed_function_changes_as_the_chain_rule_says(
    calm: tuple[Recording, Scenario], known: Known
) -> None:
    law = calm[1].controller
    assert isinstance(law, Proposed)
    speed = speed_subsystem(known, law, calm[1].trigger)
    assert speed is not None
    settled = slice(200, None)  # the command leaves its stops within the first 20 ms
    mean = 0.5 * (speed.V_L_dot[1:] + speed.V_L_dot[:-1])[settled]
    np.testing.assert_allclose((np.diff(speed.V_L) / DT)[settled], mean, atol=2e-4)
    assert np.abs(mean).max() > 0.02


def test_attitude_function_changes_as_the_chain_rule_says(
    calm: tuple[Recording, Scenario], known: Known
) -> None:
    law = calm[1].controller
    assert isinstance(law, Proposed)
    attitude = attitude_subsystem(known, law, calm[1].trigger)
    assert attitude is not None
    s = known.signals
    true = np.gradient(s["omega_d"], DT, axis=0)  # the chain rule has the filtered one
    V_L_dot = attitude.V_L_dot + (s["e_omega"] * (s["omega_d_dot"] - true)).sum(axis=1)
    settled = slice(500, None)
    mean = 0.5 * (V_L_dot[1:] + V_L_dot[:-1])[settled]
    np.testing.assert_allclose((np.diff(attitude.V_L) / DT)[settled], mean, atol=5e-5)
    assert np.abs(mean).max() > 0.01


@pytest.mark.parametrize("evaluate", [speed_subsystem, attitude_subsystem])
def test_chain_rule_is_the_derivative_along_any_rates(
    calm: tuple[Recording, Scenario], known: Known, evaluate: Any
) -> None:
    """With estimates and errors of a size that no flight has, so that every term counts."""
    law, trigger = calm[1].controller, calm[1].trigger
    assert isinstance(law, Proposed)
    rng = np.random.default_rng(1)
    signals = known.signals.copy()
    estimates = ("Phi_v", "g_v", "beta_v", "Phi_omega", "beta_omega")
    for name in (*estimates, *(f"{name}_dot" for name in estimates), "sync_error", "e_omega"):
        signals[name] = rng.normal(size=signals[name].shape)
    K1 = np.array([50.0, 50.0, 51.0])

    def moved(h: float) -> np.ndarray:
        later = signals.copy()
        for name in estimates:
            later[name] += h * signals[f"{name}_dot"]
        e_prime = signals["sync_error"][:, 1:]
        later["sync_error"][:, 0] += h * (known.lambda_v * known.V_dot - signals["r_v"])
        later["sync_error"][:, 1:] += h * (known.lambda_omega * known.e_omega_rates - K1 * e_prime)
        later["e_omega"] += h * (known.omega_dot - signals["omega_d_dot"])
        V_L: np.ndarray = evaluate(replace(known, signals=later), law, trigger).V_L
        return V_L

    V_L_dot = evaluate(replace(known, signals=signals), law, trigger).V_L_dot
    h = 1e-4  # V_L is quadratic: the central difference is exact
    numeric = (moved(h) - moved(-h)) / (2.0 * h)
    np.testing.assert_allclose(V_L_dot, numeric, rtol=1e-6, atol=1e-5 * np.abs(V_L_dot).max())


def test_constants_of_a_calm_flight(calm: tuple[Recording, Scenario]) -> None:
    recording, scenario = calm
    uav = check_theory(recording, scenario)["uavs"][0]
    speed, attitude = uav["lyapunov"]["speed"], uav["lyapunov"]["attitude"]
    assert speed["kappa_1_s"] == 0.06  # sigma_v2
    assert speed["constants"]["lambda"] == pytest.approx(0.46 + 0.17 * 2)
    assert speed["constants"]["beta_v"] == 1.0
    # the aircraft is the nominal one: all that is left is the float32 of the wire
    np.testing.assert_allclose(speed["constants"]["tau_bar_m_s2"], 0.0, atol=1e-9)
    assert speed["constants"]["g_v"] < 1e-4
    assert speed["chi"] == pytest.approx(
        0.14 / (2 * 0.052) + 0.8 * 1.5 * 0.93**2 + 0.557 * 0.1, rel=1e-6
    )
    assert attitude["kappa_1_s"] == 25.0  # sigma_omega
    g = attitude["constants"]["g_omega"]
    assert attitude["constants"]["beta_omega"] == pytest.approx(1.0 / g)
    assert attitude["chi"] == pytest.approx(g + 1.5 * 0.28**2 + 25.0 / (0.02 * g), rel=1e-6)
    assert attitude["ultimate_bound"] == pytest.approx(attitude["chi"] / 25.0)


def test_mass_and_coefficients_make_the_uncertainty(rough: tuple[Recording, Scenario]) -> None:
    recording, scenario = rough
    truth = known_quantities(recording, 2, scenario)
    a = scenario.aircraft
    V2, thrust = truth.signals["V"] ** 2, recording.applied[:, 2, THROTTLE]
    drag = 0.5 * a.air_density_kg_m3 * V2 * a.wing_area_m2 * a.coefficients.cD0
    # along the velocity, where lift and side force do not act; u = V nearly
    along = (recording.states[:, 2, 3:6] * truth.delta_v).sum(axis=1) / truth.signals["V"]
    expected = (thrust - 0.9 * drag) / (1.1 * a.mass_kg) - (thrust - drag) / a.mass_kg
    np.testing.assert_allclose(along, expected, atol=0.3)
    assert np.abs(expected).max() > 1.0


def test_a_rough_flight_does_not_contradict_the_theorems(
    rough: tuple[Recording, Scenario],
) -> None:
    result = check_theory(*rough)
    for uav in result["uavs"]:
        for part in uav["lyapunov"].values():
            assert not part["contradicted"]
            assert part["finite_difference"]["satisfied"] == 1.0
            assert part["finite_difference"]["largest_use"] < 1.0


def test_jumps_and_stuck_actuators_are_left_out_and_counted(
    rough: tuple[Recording, Scenario],
) -> None:
    leader, follower, last = (uav["lyapunov"] for uav in check_theory(*rough)["uavs"])
    assert leader["speed"]["excluded"]["jump_of_V_L"] == 2  # the fault comes and goes
    assert last["speed"]["excluded"]["jump_of_V_L"] == 0
    assert last["attitude"]["excluded"]["jump_of_V_L"] == 1  # K1 switches
    assert last["attitude"]["excluded"]["no_effectiveness"] == 0
    assert follower["attitude"]["excluded"]["no_effectiveness"] == 100
    assert follower["speed"]["excluded"]["no_effectiveness"] == 0


@pytest.mark.parametrize(("subsystem", "channel"), [("speed", 0), ("attitude", 2)])
def test_an_error_that_runs_away_contradicts(
    calm: tuple[Recording, Scenario], subsystem: str, channel: int
) -> None:
    recording, scenario = calm
    flown = recording.signals["sync_error"].copy()
    try:
        recording.signals["sync_error"][:, 0, channel] += 100.0 * recording.time_s**2
        result = check_theory(recording, scenario)
    finally:
        recording.signals["sync_error"][:] = flown
    part = result["uavs"][0]["lyapunov"][subsystem]
    assert part["contradicted"]
    assert part["finite_difference"]["satisfied"] < 1.0
    assert part["finite_difference"]["largest_excess"] > 0.0
    assert part["ultimate_bound_held"] is False
    assert any("CONTRADICTED by UAV 1" in words for words in theory_words(result))


def test_nothing_to_compare_is_said() -> None:
    assert set(judge(None, np.zeros(2), np.zeros(2), "deg")) == {"absent"}


# --- the whole


@pytest.mark.parametrize("steps", [0, 1, 2, 3])
def test_a_very_short_flight_is_no_problem(steps: int, scenario1: Scenario) -> None:
    result = check_theory(synthetic(steps, 3, loss="UAV 1 was lost"), scenario1)
    json.dumps(result, allow_nan=False)
    assert theory_words(result)


def test_a_flight_that_ends_in_no_numbers_is_no_problem(
    rough: tuple[Recording, Scenario],
) -> None:
    flown, scenario = rough
    states, signals = flown.states.copy(), flown.signals.copy()
    states[-2:] = np.nan
    for name in ("V", "error", "sync_error", "demand", "e_omega", "omega_d"):
        signals[name][-2:] = np.nan
    broken = Recording(**{**vars(flown), "states": states, "signals": signals, "loss": "lost"})
    result = check_theory(broken, scenario)
    json.dumps(result, allow_nan=False)
    assert not result["uavs"][2]["lyapunov"]["attitude"]["contradicted"]
    assert theory_words(result)


def test_other_laws_have_no_lyapunov_check() -> None:
    scenario = scenario_with(controller={"kind": "backstepping"})
    result = check_theory(synthetic(5000, 3), scenario)
    assert result["uavs"][0]["lyapunov"] is None
    assert "backstepping" in result["uavs"][0]["lyapunov_absent"]
    assert result["uavs"][0]["residual"]
    assert any("not checked" in words for words in theory_words(result))


def test_words_say_what_was_not_checked(rough: tuple[Recording, Scenario]) -> None:
    result = check_theory(*rough)
    json.dumps(result, allow_nan=False)
    words = "\n".join(theory_words(result))
    assert "below the control period" in words
    assert "(53)" in words
    assert "(69)" in words
    assert "W* are taken as 0" in words
    assert "Not checked" in words
    assert "100 with an actuator at ρ = 0" in words
