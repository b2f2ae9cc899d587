import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from theory_flights import SHORT, python_loop, scenario_with

from ftc_autopilot.common import angles
from ftc_autopilot.control import controller
from ftc_autopilot.control.laws import proposed
from ftc_lab.theory import check_theory, theory_sentences
from ftc_lab.theory.judgement import TheoremVerdict
from gcs.fleet.in_process import fly_in_process
from gcs.results.recording import Recording

pytestmark = pytest.mark.slow

Law = Callable[..., Any]


def flown_by(monkeypatch: pytest.MonkeyPatch, **laws: Callable[[Law], Law]) -> Recording:
    """Fly scenario 1 for a moment with `speed_law` or `attitude_law` wrapped."""
    python_loop(monkeypatch)
    for name, wrap in laws.items():
        monkeypatch.setattr(proposed, name, wrap(getattr(proposed, name)))
    return fly_in_process(scenario_with(**SHORT))


def given_step(now: Any, changes: dict[str, Callable[..., Any]]) -> Any:
    """A step with some fields changed; each change is given the field."""
    return now._replace(**{name: change(getattr(now, name)) for name, change in changes.items()})


def attitude_given(**changes: Callable[..., Any]) -> Callable[[Law], Law]:
    """An attitude law that is given errors, motion or ω̇_d changed."""
    filtered = changes.pop("omega_d_dot", lambda omega_d_dot: omega_d_dot)

    def wrap(law: Law) -> Law:
        def mutant(now: Any, e_omega: Any, omega_d_dot: Any, *rest: Any) -> Any:
            return law(given_step(now, changes), e_omega, filtered(omega_d_dot), *rest)

        return mutant

    return wrap


def with_gain(factor: Callable[[Any, Any, Any], float]) -> Callable[[Law], Law]:
    """An attitude law with its command multiplied; the factor is given ζ, e_ω and β̂."""

    def wrap(law: Law) -> Law:
        def mutant(*given: Any) -> Any:
            done = law(*given)
            share = factor(np.array(done.zeta_omega), np.array(given[1]), given[6]["beta_omega"])
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
        done, gains, estimates = law(*given), given[5], given[6]
        leakage = gains["sigma_omega2"] * estimates["beta_omega"]
        zeta = tuple(-z for z in done.zeta_omega)
        rate = -(done.beta_omega_dot + leakage) - leakage
        return done._replace(zeta_omega=zeta, beta_omega_dot=rate)

    return mutant


def speed_given(**changes: Callable[..., Any]) -> Callable[[Law], Law]:
    def wrap(law: Law) -> Law:
        def mutant(now: Any, *rest: Any) -> Any:
            return law(given_step(now, changes), *rest)

        return mutant

    return wrap


def weaker_drive(law: Law) -> Law:
    """0.9 (α_v - r_v) β̂_v in B_v, and nowhere else."""

    def mutant(*given: Any) -> Any:
        estimates = given[4].copy()
        estimates["beta_v"] *= 0.9
        return law(*given[:4], estimates)._replace(beta_v_dot=law(*given).beta_v_dot)

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
                assert part.verdict is TheoremVerdict.VIOLATED
                assert expected <= caught
            else:
                assert caught == set()
    assert any("VIOLATED. UAV 1" in sentence for sentence in theory_sentences(theory))


def filter_with(order: str, poles: float = 1.0) -> Callable[..., None]:
    """A reference filter that updates value, rate and acceleration in some order.

    "012" with poles as they are is explicit Euler, the filter as it is; a derivative that is
    updated before what it changes makes the step semi-implicit.
    """

    def mutant(command: Any, x: Any, bandwidth: float, dt: float) -> None:
        w = bandwidth * poles
        for c in range(4):
            error = command[c] - x[c, 0]
            error = angles.wrap(error) if c == 3 else error
            jerk = w**3 * error - 3.0 * w**2 * x[c, 1] - 3.0 * w * x[c, 2]
            for k in map(int, order):
                x[c, k] += dt * (jerk if k == 2 else x[c, k + 1])

    return mutant


STEPPING = {
    "duration_s": 0.2,
    "profile": [
        {"start_s": 0.0, "airspeed_m_s": 40.0, "roll_deg": 0.0, "pitch_deg": 0.0, "yaw_deg": 170.0},
        {"start_s": 0.1, "airspeed_m_s": 42.0, "roll_deg": 5.0, "pitch_deg": 4.0, "yaw_deg": -170},
    ],
}
"""A step of every command, of yaw the short way round; before it the reference is at rest."""


@pytest.mark.parametrize(
    ("order", "poles"),
    [("012", 1.0), ("210", 1.0), ("201", 1.0), ("021", 1.0), ("102", 1.0), ("012", 1.001)],
)
def test_a_reference_that_is_filtered_otherwise_is_caught(
    order: str, poles: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    python_loop(monkeypatch)
    monkeypatch.setattr(controller, "filter_reference", filter_with(order, poles))
    scenario = scenario_with(**STEPPING)
    flown, is_right = fly_in_process(scenario), (order, poles) == ("012", 1.0)
    assert np.abs(flown.signals["reference_dot"][-1]).min() > 1e-3
    for uav in check_theory(flown, scenario).uavs:
        for part in uav.proofs.values():
            caught = {f"{e.equation} {e.quantity}" for e in part.equalities if e.violated}
            assert any("from the commands" in one for one in caught) != is_right
            assert (part.verdict is TheoremVerdict.VIOLATED) != is_right


def test_the_laws_as_they_are_pass_the_same_flight(monkeypatch: pytest.MonkeyPatch) -> None:
    """The flight of the wrong laws differs from others in nothing but the wrong law."""
    compiled = fly_in_process(scenario_with(**SHORT))
    flown = flown_by(monkeypatch, attitude_law=attitude_given(), speed_law=speed_given())
    assert flown.signals.tobytes() == compiled.signals.tobytes()
    assert flown.states.tobytes() == compiled.states.tobytes()
    for uav in check_theory(flown, scenario_with(**SHORT)).uavs:
        for part in uav.proofs.values():
            assert part.verdict is TheoremVerdict.HELD
            assert all(e.steps >= 399 for e in part.equalities)
