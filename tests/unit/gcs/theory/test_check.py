import json
import math
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import ftc_autopilot.control.laws as all_laws
from ftc_autopilot.control import controller, controllers
from ftc_autopilot.control.controller import SIGNALS
from ftc_autopilot.control.laws import proposed
from ftc_autopilot.control.laws.proposed import Proposed
from ftc_autopilot.control.trigger import fires, on_wire
from gcs.fleet import in_process
from gcs.fleet.in_process import fly_in_process
from gcs.results.recording import Recording
from gcs.scenario.model import Scenario, load_scenario, scenario_of, scenario_tree
from gcs.theory import Theory, check_theory, theory_words
from gcs.theory.dwell import dwell_times, in_force
from gcs.theory.equality import ROUNDING
from gcs.theory.ground_truth import Known, known_quantities, solve
from gcs.theory.judgement import Verdict
from gcs.theory.lyapunov import attitude_subsystem, speed_subsystem
from gcs.theory.residual import residual_sets

pytestmark = pytest.mark.slow

SCENARIOS = Path(__file__).parents[4] / "scenarios"
SCENARIO_1 = SCENARIOS / "paper" / "scenario1.yaml"
DT = 1e-3
RECORDED = tuple(name for name in SIGNALS.names or () if name != "command")
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
    assert sets[1]["tracking"]["airspeed_m_s"] == 0.0  # of the steps that there are


def test_a_segment_without_any_step_has_no_residual_set(scenario1: Scenario) -> None:
    recording = synthetic(10)
    recording.signals["error"][:] = np.nan
    (only,) = residual_sets(recording, 0, scenario1)
    assert set(only["tracking"].values()) == {None}


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
    rates = solve(known.R2, signals["e_omega"])

    def moved(h: float) -> np.ndarray:
        later = signals.copy()
        for name in estimates:
            later[name] += h * signals[f"{name}_dot"]
        e_prime = signals["sync_error"][:, 1:]
        later["sync_error"][:, 0] += h * (known.lambda_v * known.V_dot - signals["r_v"])
        later["sync_error"][:, 1:] += h * (known.lambda_omega * rates - K1 * e_prime)
        later["e_omega"] += h * (known.omega_dot - signals["omega_d_dot"])
        V_L: np.ndarray = evaluate(replace(known, signals=later), law, trigger).V_L
        return V_L

    V_L_dot = evaluate(replace(known, signals=signals), law, trigger).V_L_dot
    h = 1e-4  # V_L is quadratic: the central difference is exact
    numeric = (moved(h) - moved(-h)) / (2.0 * h)
    np.testing.assert_allclose(V_L_dot, numeric, rtol=1e-6, atol=1e-5 * np.abs(V_L_dot).max())


def test_constants_of_a_calm_flight(calm: tuple[Recording, Scenario]) -> None:
    recording, scenario = calm
    proofs: Any = check_theory(recording, scenario).uavs[0].proofs
    speed, attitude = proofs["speed"].certificate, proofs["attitude"].certificate
    assert speed is not None
    assert attitude is not None
    assert speed.kappa_1_s == 0.06  # sigma_v2
    assert speed.constants["lambda"] == pytest.approx(0.46 + 0.17 * 2)
    assert speed.constants["beta_v"] == 1.0
    # the aircraft is the nominal one: all that is left is the float32 of the wire
    np.testing.assert_allclose(speed.constants["tau_bar_m_s2"], 0.0, atol=1e-9)
    assert speed.constants["g_v"] < 1e-4
    assert speed.chi == pytest.approx(
        0.14 / (2 * 0.052) + 0.8 * 1.5 * 0.93**2 + 0.557 * 0.1, rel=1e-6
    )
    assert attitude.kappa_1_s == 25.0  # sigma_omega
    g = attitude.constants["g_omega"]
    assert attitude.constants["beta_omega"] == pytest.approx(1.0 / g)
    assert attitude.chi == pytest.approx(g + 1.5 * 0.28**2 + 25.0 / (0.02 * g), rel=1e-6)
    assert attitude.ultimate_bound == pytest.approx(attitude.chi / 25.0)


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


def test_a_rough_flight_holds_every_equality_and_inequality(
    rough: tuple[Recording, Scenario],
) -> None:
    for uav in check_theory(*rough).uavs:
        for part in uav.proofs.values():
            assert [e for e in part.equalities if e.violated or e.steps < 2900] == []
            assert part.contradicted == []
            assert part.certificate is not None
            assert part.certificate.finite_difference.satisfied == 1.0
            assert part.certificate.finite_difference.largest_use < 1.0  # type: ignore[operator]  # not None


def test_what_the_inequalities_give_away_makes_all_of_chi(
    rough: tuple[Recording, Scenario],
) -> None:
    for uav in check_theory(*rough).uavs:
        for part in uav.proofs.values():
            found = part.certificate
            assert found is not None
            given = sum(slack.mean for slack in found.slack.values())
            assert given + found.used == pytest.approx(1.0, rel=1e-9)
            assert min(slack.smallest for slack in found.slack.values()) > -ROUNDING


def test_jumps_are_left_out_and_counted(rough: tuple[Recording, Scenario]) -> None:
    leader, follower, last = (uav.proofs for uav in check_theory(*rough).uavs)
    jumps = [
        (proofs["speed"].certificate.jumps, proofs["attitude"].certificate.jumps)  # type: ignore[union-attr]  # not None
        for proofs in (leader, follower, last)
    ]
    assert jumps[0] == (2, 1)  # the fault comes and goes; K1 switches
    assert jumps[2] == (0, 1)


def test_a_stuck_actuator_leaves_the_hypotheses(rough: tuple[Recording, Scenario]) -> None:
    leader, follower, _ = (uav.proofs for uav in check_theory(*rough).uavs)
    assert follower["attitude"].verdict is Verdict.LEFT
    assert follower["attitude"].hypotheses.no_effectiveness == {"rudder": 100}
    assert follower["attitude"].hypotheses.assumption_2 == 0.0
    assert follower["speed"].verdict is Verdict.HELD
    assert leader["speed"].verdict is Verdict.HELD  # effectiveness 0.9 is within them


@pytest.mark.parametrize("fault", ["loe_aileron_severe", "stuck_at_aileron"])
def test_a_departed_flight_leaves_the_hypotheses(fault: str) -> None:
    scenario = load_scenario(SCENARIOS / "faults" / f"{fault}.yaml")
    scenario = scenario.model_copy(update={"duration_s": 20.3})  # roll passes 90° at 19.3 s
    theory = check_theory(fly_in_process(scenario), scenario)
    part = theory.uavs[2].proofs["attitude"]
    assert part.verdict is Verdict.LEFT
    assert theory.uavs[1].proofs["attitude"].verdict is Verdict.HELD
    hypotheses = part.hypotheses
    if fault == "stuck_at_aileron":
        assert hypotheses.no_effectiveness["aileron"] == 1300
    else:
        assert hypotheses.at_stop > 1000
        assert hypotheses.beyond_bound > 1000
    words = "\n".join(theory_words(theory))
    assert "UAV 3 left the hypotheses of (69)" in words
    assert "not contradicted" not in words


def test_a_wrong_control_effectiveness_violates_assumption_1() -> None:
    scenario = scenario_with(duration_s=0.1, uncertainty={"coefficients": 2.5})
    part = check_theory(fly_in_process(scenario), scenario).uavs[0].proofs["attitude"]
    assert part.hypotheses.assumption_1 == pytest.approx(1.5)
    assert part.verdict is Verdict.LEFT


@pytest.mark.parametrize(("subsystem", "channel"), [("speed", 0), ("attitude", 2)])
def test_an_error_that_runs_away_is_caught(
    calm: tuple[Recording, Scenario], subsystem: str, channel: int
) -> None:
    recording, scenario = calm
    signals = recording.signals.copy()
    signals["sync_error"][:, 0, channel] += 100.0 * recording.time_s**2
    part = check_theory(replace(recording, signals=signals), scenario).uavs[0].proofs[subsystem]
    assert part.verdict is Verdict.VIOLATED
    assert "V̇_L ≤ -κ V_L + χ by finite differences" in part.contradicted
    assert part.certificate is not None
    assert part.certificate.finite_difference.largest_excess > 0.0  # type: ignore[operator]  # not None


@pytest.mark.parametrize("name", RECORDED)
def test_a_changed_number_anywhere_in_the_record_is_caught(
    calm: tuple[Recording, Scenario], name: str
) -> None:
    """Whatever number of a law's record is off by a millionth, an equality says so."""
    recording, scenario = calm
    first = slice(0, 60)
    recording = replace(recording, states=recording.states[first], applied=recording.applied[first])
    for component in range(math.prod(SIGNALS[name].shape)):
        signals = recording.signals[first].copy()
        values = signals[name].reshape(*signals.shape, -1)[..., component]
        if name == "events":
            values[40, 1] ^= 1
        else:
            values[40, 1] += 1e-6 * np.abs(values).max() + 1e-9
        changed = replace(recording, signals=signals)
        judged = [
            part for uav in check_theory(changed, scenario).uavs for part in uav.proofs.values()
        ]
        assert Verdict.VIOLATED in {part.verdict for part in judged}, component


# --- deliberately wrong laws: each must be caught by the equation that it breaks

Law = Callable[..., Any]


SHORT = {"duration_s": 0.4}


def python_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the loop and what calls the laws run as plain Python, and all else as compiled."""
    chain = (
        (in_process, "_run"),
        (in_process, "controller_step"),
        (controllers, "_control"),
        (controllers, "control_step"),
        (controller, "evaluate"),
        (all_laws, "proposed_law"),
    )
    for module, name in chain:
        compiled = getattr(module, name)
        monkeypatch.setattr(module, name, getattr(compiled, "py_func", compiled))


def flown_by(monkeypatch: pytest.MonkeyPatch, **laws: Callable[[Law], Law]) -> Recording:
    """Fly scenario 1 for a moment with `speed_law` or `attitude_law` wrapped."""
    python_loop(monkeypatch)
    for name, wrap in laws.items():
        monkeypatch.setattr(proposed, name, wrap(getattr(proposed, name)))
    return fly_in_process(scenario_with(**SHORT))


def attitude_given(**changes: Callable[..., Any]) -> Callable[[Law], Law]:
    """An attitude law with some arguments changed; each change is given errors and motion."""

    def wrap(law: Law) -> Law:
        def mutant(errors: Any, motion: Any, e_omega: Any, omega_d_dot: Any, *rest: Any) -> Any:
            given = {"errors": errors, "motion": motion, "omega_d_dot": omega_d_dot}
            given |= {name: change(given[name]) for name, change in changes.items()}
            return law(given["errors"], given["motion"], e_omega, given["omega_d_dot"], *rest)

        return mutant

    return wrap


def with_gain(factor: Callable[[Any, Any, Any], float]) -> Callable[[Law], Law]:
    """An attitude law with its command multiplied; the factor is given ζ, e_ω and β̂."""

    def wrap(law: Law) -> Law:
        def mutant(*given: Any) -> Any:
            done = law(*given)
            share = factor(np.array(done.zeta_omega), np.array(given[2]), given[6])
            return done._replace(delta_hat=tuple(share * d for d in done.delta_hat))

        return mutant

    return wrap


def proportional(zeta: np.ndarray, e_omega: np.ndarray, beta: float) -> float:
    """-0.03 Gᵀ e_ω, without β̂ and ζ, as a share of (37) with ε_ω = 1."""
    strength = beta**2 * (zeta @ zeta)
    return 0.03 * math.sqrt(strength * (e_omega @ e_omega) + 1.0) / strength


def negated(law: Law) -> Law:
    """ζ_ω negated wherever it enters: (37) does not change, (39) does."""

    def mutant(*given: Any) -> Any:
        done, gains = law(*given), given[9]
        leakage = gains["sigma_omega2"] * given[6]
        zeta = tuple(-z for z in done.zeta_omega)
        rate = -(done.beta_omega_dot + leakage) - leakage
        return done._replace(zeta_omega=zeta, beta_omega_dot=rate)

    return mutant


def speed_given(**changes: Callable[..., Any]) -> Callable[[Law], Law]:
    def wrap(law: Law) -> Law:
        def mutant(errors: Any, motion: Any, *rest: Any) -> Any:
            given = {"errors": errors, "motion": motion}
            given |= {name: change(given[name]) for name, change in changes.items()}
            return law(given["errors"], given["motion"], *rest)

        return mutant

    return wrap


def weaker_drive(law: Law) -> Law:
    """0.9 (α_v - r_v) β̂_v in B_v, and nowhere else."""

    def mutant(*given: Any) -> Any:
        weak = law(*given[:6], 0.9 * given[6], *given[7:])
        return weak._replace(beta_v_dot=law(*given).beta_v_dot)

    return mutant


def without_drag(motion: Any) -> Any:
    v, force = np.array(motion.v), np.array(motion.air.F)
    sideways = force - (force @ v) / (v @ v) * v
    return motion._replace(air=motion.air._replace(F=tuple(sideways.tolist())))


def scaled(field: str, factor: float) -> Callable[[Any], Any]:
    return lambda errors: errors._replace(
        **{field: tuple(factor * x for x in getattr(errors, field))}
    )


MUTANTS: dict[str, tuple[dict[str, Any], set[str]]] = {
    "N0 dropped": (
        {
            "attitude_law": attitude_given(
                motion=lambda m: m._replace(air=m.air._replace(N=(0.0, 0.0, 0.0)))
            )
        },
        {"(37) ζ_ω", "(65) rate of V_L before the inequalities"},
    ),
    "sign of the R2^-T e' term": (
        {"attitude_law": attitude_given(errors=scaled("e_prime", -1.0))},
        {"(37) ζ_ω", "(65) rate of V_L before the inequalities"},
    ),
    "R2^-T e' dropped": (
        {"attitude_law": attitude_given(errors=scaled("e_prime", 0.0))},
        {"(37) ζ_ω", "(65) rate of V_L before the inequalities"},
    ),
    "omega_d_dot dropped": (
        {"attitude_law": attitude_given(omega_d_dot=lambda _: (0.0, 0.0, 0.0))},
        {"(37) ζ_ω", "(65) rate of V_L before the inequalities"},
    ),
    "gain / 4": ({"attitude_law": with_gain(lambda *_: 0.25)}, {"(37) δ̂"}),
    "gain x 9": ({"attitude_law": with_gain(lambda *_: 9.0)}, {"(37) δ̂"}),
    "constant gain": ({"attitude_law": with_gain(proportional)}, {"(37) δ̂"}),
    "zeta negated": (
        {"attitude_law": negated},
        {"(37) ζ_ω", "(65) rate of V_L before the inequalities"},
    ),
    "drag removed": (
        {"speed_law": speed_given(motion=without_drag)},
        {"(33) α_v", "(49) rate of V_L before the inequalities"},
    ),
    "sign of the neighbours' r_v term": (
        {"speed_law": speed_given(errors=lambda e: e._replace(V_tilde_dot_sum=-e.V_tilde_dot_sum))},
        {"(33) r_v", "(41) Ṽ' · rate of Ṽ'"},
    ),
    "drive x 0.9": ({"speed_law": weaker_drive}, {"(33) B_v"}),
}


@pytest.mark.parametrize("name", MUTANTS)
def test_a_wrong_law_is_caught_by_its_equation(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    laws, expected = MUTANTS[name]
    theory = check_theory(flown_by(monkeypatch, **laws), scenario_with(**SHORT))
    wrong = "attitude" if "attitude_law" in laws else "speed"
    for uav in theory.uavs:
        for subsystem, part in uav.proofs.items():
            caught = {f"{e.equation} {e.quantity}" for e in part.equalities if e.violated}
            if subsystem == wrong:
                assert part.verdict is Verdict.VIOLATED
                assert expected <= caught
            else:
                assert caught == set()
    assert any("VIOLATED. UAV 1" in words for words in theory_words(theory))


def test_the_laws_as_they_are_pass_the_same_flight(monkeypatch: pytest.MonkeyPatch) -> None:
    """The flight of the wrong laws differs from others in nothing but the wrong law."""
    compiled = fly_in_process(scenario_with(**SHORT))
    flown = flown_by(monkeypatch, attitude_law=attitude_given(), speed_law=speed_given())
    assert flown.signals.tobytes() == compiled.signals.tobytes()
    assert flown.states.tobytes() == compiled.states.tobytes()
    for uav in check_theory(flown, scenario_with(**SHORT)).uavs:
        for part in uav.proofs.values():
            assert part.verdict is Verdict.HELD
            assert all(e.steps >= 399 for e in part.equalities)


# --- the whole


def checked(theory: Theory) -> Theory:
    """The theory, if it can be written as JSON and put into words."""
    json.dumps(asdict(theory), allow_nan=False)
    assert theory_words(theory)
    return theory


@pytest.mark.parametrize("steps", [0, 1, 2, 3])
def test_a_very_short_flight_is_no_problem(steps: int, scenario1: Scenario) -> None:
    checked(check_theory(synthetic(steps, 3, loss="UAV 1 was lost"), scenario1))


def test_steps_that_an_autopilot_did_not_make_are_left_out_and_counted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """UAV 3 misses steps 100 to 109; its neighbours keep what it had reported before."""
    python_loop(monkeypatch)
    made: Any = vars(in_process)["controller_step"]
    missed = range(100, 110)

    def step(controllers: Any, i: int, measured: Any, step_us: int) -> int:
        return (
            0 if i == 2 and measured["step"] in missed else made(controllers, i, measured, step_us)
        )

    monkeypatch.setattr(in_process, "controller_step", step)
    flown, scenario = fly_in_process(scenario_with(**SHORT)), scenario_with(**SHORT)
    for name in SIGNALS.names or ():
        if SIGNALS[name].base.kind == "f":
            flown.signals[name][missed, 2] = np.nan
    theory = checked(check_theory(flown, scenario))
    assert [uav.missing_steps for uav in theory.uavs] == [0, 0, 10]
    steps = []
    for uav in theory.uavs:
        for part in uav.proofs.values():
            assert part.verdict is Verdict.HELD
        speed = uav.proofs["speed"].equalities
        steps.append({f"{e.equation} {e.quantity}": e.steps for e in speed})
    assert steps[2]["(33) T̂"] == 390
    assert steps[2]["(36) step of β̂_v"] == 389  # nor the step from the last missing one
    assert steps[0]["(33) T̂"] == 400
    assert steps[0]["(31) Ṽ'"] == 390  # it may have had older reports
    assert theory.uavs[2].residual[0]["tracking"]["airspeed_m_s"] is not None
    assert any("10 of UAV 3" in words for words in theory_words(theory))


def test_a_flight_that_ends_in_no_numbers_is_no_problem(
    rough: tuple[Recording, Scenario],
) -> None:
    flown, scenario = rough
    states, signals = flown.states.copy(), flown.signals.copy()
    states[-2:] = np.nan
    for name in ("V", "error", "sync_error", "demand", "e_omega", "omega_d"):
        signals[name][-2:] = np.nan
    broken = replace(flown, states=states, signals=signals, loss="lost")
    theory = checked(check_theory(broken, scenario))
    assert theory.uavs[2].proofs["attitude"].verdict is Verdict.HELD
    assert theory.uavs[2].missing_steps == 2


def test_a_flight_without_any_number_is_no_problem(scenario1: Scenario) -> None:
    recording = synthetic(50, 3)
    recording.signals["V"][:] = np.nan
    theory = checked(check_theory(recording, scenario1))
    assert theory.uavs[0].proofs["speed"].verdict is Verdict.LEFT
    assert theory.uavs[0].proofs["speed"].certificate is None


def test_in_real_time_what_needs_the_age_of_data_is_not_compared(
    rough: tuple[Recording, Scenario],
) -> None:
    flown, scenario = rough
    theory = checked(check_theory(replace(flown, mode="real_time"), scenario))
    part = theory.uavs[0].proofs["attitude"]
    skipped = {e.equation for e in part.equalities if e.steps == 0}
    assert skipped == {"(32)", "(57)", "(58)", "(19)"}
    assert part.verdict is Verdict.HELD
    assert any("Not compared: (19)" in words for words in theory_words(theory))


def test_other_laws_have_no_proof() -> None:
    scenario = scenario_with(controller={"kind": "backstepping"})
    theory = checked(check_theory(synthetic(5000, 3), scenario))
    assert theory.uavs[0].proofs == {}
    assert "backstepping" in str(theory.proofs_absent)
    assert theory.uavs[0].residual
    assert any("not checked" in words for words in theory_words(theory))


def test_words_say_what_was_not_checked(rough: tuple[Recording, Scenario]) -> None:
    words = "\n".join(theory_words(checked(check_theory(*rough))))
    assert "below the control period" in words
    assert "(53), V̇_L ≤ -κ V_L + χ of the speed subsystem: held for UAV 1, 2, 3" in words
    assert (
        "(69), V̇_L ≤ -κ V_L + χ of the attitude subsystem: left the hypotheses for UAV 2" in words
    )
    assert "rudder at ρ = 0 in 3.33% of steps" in words
    assert "Of χ each inequality gives away" in words
    assert "W* are taken as 0" in words
    assert "Not checked" in words
