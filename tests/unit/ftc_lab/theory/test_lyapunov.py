import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from theory_flights import DT, SCENARIOS, scenario_with

from ftc_autopilot.control.laws.proposed import Proposed
from ftc_autopilot.control.signals import SIGNALS
from ftc_lab.theory import check_theory, theory_sentences
from ftc_lab.theory.equality import ROUNDING
from ftc_lab.theory.ground_truth import Known, known_quantities, solve
from ftc_lab.theory.judgement import TheoremVerdict
from ftc_lab.theory.lyapunov import attitude_subsystem, speed_subsystem
from gcs.fleet.in_process import fly_in_process
from gcs.results.recording import Recording
from gcs.scenario.model import Scenario, load_scenario
from mavlink_defs.constants import THROTTLE

pytestmark = pytest.mark.slow

NOT_OF_THE_LAW = {
    *("command", "effectiveness", "offset", "confidence", "phase", "dead_steps"),
    *("neighbour_message", "predicted_exit", "path_position", "slot", "report_size"),
    "not_finite",  # of the trigger, and 0 in every flight that has a proof
}
RECORDED = tuple(name for name in SIGNALS.names or () if name not in NOT_OF_THE_LAW)


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
    # along the velocity, where lift and side force do not act; of 6 m/s², 0.11 differ by u < V
    along = (recording.states[:, 2, 3:6] * truth.delta_v).sum(axis=1) / truth.signals["V"]
    expected = (thrust - 0.9 * drag) / (1.1 * a.mass_kg) - (thrust - drag) / a.mass_kg
    np.testing.assert_allclose(along, expected, atol=0.15)
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
    assert follower["attitude"].verdict is TheoremVerdict.LEFT
    assert follower["attitude"].hypotheses.no_effectiveness == {"rudder": 100}
    assert follower["attitude"].hypotheses.assumption_2 == 0.0
    assert follower["speed"].verdict is TheoremVerdict.HELD
    assert leader["speed"].verdict is TheoremVerdict.HELD  # effectiveness 0.9 is within them


@pytest.mark.parametrize("fault", ["loe_aileron_severe", "stuck_at_aileron"])
def test_a_departed_flight_leaves_the_hypotheses(fault: str) -> None:
    scenario = load_scenario(SCENARIOS / "faults" / f"{fault}.yaml")
    scenario = scenario.model_copy(update={"duration_s": 20.3})  # roll passes 90° at 19.3 s
    theory = check_theory(fly_in_process(scenario), scenario)
    part = theory.uavs[2].proofs["attitude"]
    assert part.verdict is TheoremVerdict.LEFT
    assert theory.uavs[1].proofs["attitude"].verdict is TheoremVerdict.HELD
    hypotheses = part.hypotheses
    if fault == "stuck_at_aileron":
        assert hypotheses.no_effectiveness["aileron"] == 1300
    else:
        assert hypotheses.at_stop > 1000
        assert hypotheses.beyond_bound > 1000
    text = "\n".join(theory_sentences(theory))
    assert "UAV 3 left the hypotheses of (69)" in text
    assert "not contradicted" not in text


def test_a_wrong_control_effectiveness_violates_assumption_1() -> None:
    scenario = scenario_with(duration_s=0.1, uncertainty={"coefficients": 2.5})
    part = check_theory(fly_in_process(scenario), scenario).uavs[0].proofs["attitude"]
    assert part.hypotheses.assumption_1 == pytest.approx(1.5)
    assert part.verdict is TheoremVerdict.LEFT


@pytest.mark.parametrize(("subsystem", "channel"), [("speed", 0), ("attitude", 2)])
def test_an_error_that_runs_away_is_caught(
    calm: tuple[Recording, Scenario], subsystem: str, channel: int
) -> None:
    recording, scenario = calm
    signals = recording.signals.copy()
    signals["sync_error"][:, 0, channel] += 100.0 * recording.time_s**2
    part = check_theory(replace(recording, signals=signals), scenario).uavs[0].proofs[subsystem]
    assert part.verdict is TheoremVerdict.VIOLATED
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
    recording = replace(
        recording,
        states=recording.states[first],
        applied=recording.applied[first],
        wind=recording.wind[first],
    )
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
        assert TheoremVerdict.VIOLATED in {part.verdict for part in judged}, component
