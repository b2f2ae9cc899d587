import itertools
import json
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import pytest
from theory_flights import SHORT, python_loop, scenario_with, synthetic

from ftc_autopilot.control.signals import SIGNALS
from ftc_lab.theory import Theory, check_theory, theory_sentences
from ftc_lab.theory.judgement import TheoremVerdict
from gcs.fleet import in_process
from gcs.fleet.in_process import fly_in_process
from gcs.results.recording import Recording
from gcs.scenario.model import Scenario

pytestmark = pytest.mark.slow


def checked(theory: Theory) -> Theory:
    """The theory, if it can be written as JSON and as sentences."""
    json.dumps(asdict(theory), allow_nan=False)
    assert theory_sentences(theory)
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
    missed, calls = range(100, 110), itertools.count()

    def step(*arguments: Any) -> int:
        is_third, measured = next(calls) % 3 == 2, arguments[3]
        return 0 if is_third and measured["step"] in missed else made(*arguments)

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
            assert part.verdict is TheoremVerdict.HELD
        speed = uav.proofs["speed"].equalities
        steps.append({f"{e.equation} {e.quantity}": e.steps for e in speed})
    assert steps[2]["(33) T̂"] == 390
    assert steps[2]["(36) step of β̂_v"] == 389  # nor the step from the last missing one
    assert steps[0]["(33) T̂"] == 400
    assert steps[0]["(31) Ṽ'"] == 390  # it may have had older reports
    assert theory.uavs[2].residual[0]["tracking"]["airspeed_m_s"] is not None
    assert any("10 of UAV 3" in sentence for sentence in theory_sentences(theory))


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
    assert theory.uavs[2].proofs["attitude"].verdict is TheoremVerdict.HELD
    assert theory.uavs[2].missing_steps == 2


def test_a_flight_without_any_number_is_no_problem(scenario1: Scenario) -> None:
    recording = synthetic(50, 3)
    recording.signals["V"][:] = np.nan
    theory = checked(check_theory(recording, scenario1))
    assert theory.uavs[0].proofs["speed"].verdict is TheoremVerdict.LEFT
    assert theory.uavs[0].proofs["speed"].certificate is None


def test_in_real_time_what_needs_the_age_of_data_is_not_compared(
    rough: tuple[Recording, Scenario],
) -> None:
    flown, scenario = rough
    theory = checked(check_theory(replace(flown, mode="real_time"), scenario))
    part = theory.uavs[0].proofs["attitude"]
    skipped = {e.equation for e in part.equalities if e.steps == 0}
    assert skipped == {"(32)", "(57)", "(58)", "(19)"}
    assert part.verdict is TheoremVerdict.HELD
    assert any("Not compared: (19)" in sentence for sentence in theory_sentences(theory))


def test_other_laws_have_no_proof() -> None:
    scenario = scenario_with(controller={"kind": "backstepping"})
    theory = checked(check_theory(synthetic(5000, 3), scenario))
    assert theory.uavs[0].proofs == {}
    assert "backstepping" in str(theory.proofs_absent)
    assert theory.uavs[0].residual
    assert any("not checked" in sentence for sentence in theory_sentences(theory))


def test_sentences_say_what_was_not_checked(rough: tuple[Recording, Scenario]) -> None:
    text = "\n".join(theory_sentences(checked(check_theory(*rough))))
    assert "below the control period" in text
    assert "(53), V̇_L ≤ -κ V_L + χ of the speed subsystem: held for UAV 1, 2, 3" in text
    assert "(69), V̇_L ≤ -κ V_L + χ of the attitude subsystem: left the hypotheses for UAV 2" in text
    assert "rudder at ρ = 0 in 3.33% of steps" in text
    assert "Of χ each inequality gives away" in text
    assert "W* are taken as 0" in text
    assert "Not checked" in text


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"servos": {"rudder": {"lag_s": 0.02}}}, "servos"),
        ({"sensors": {"gyro_deg_s": {"bias": 0.1}}}, "errors of sensors"),
        ({"wind": {"turbulence": "light"}}, "motions of the air"),
        ({"trigger": {"mode": "dynamic"}}, "other triggers than (25), (29)"),
        ({"trigger": {"mode": "periodic", "rudder_period_s": 0.002}}, "other triggers than"),
    ],
)
def test_proofs_are_left_out_of_flights_that_the_theorems_do_not_know(
    change: dict[str, Any], named: str
) -> None:
    scenario = scenario_with(**SHORT | change)
    theory = checked(check_theory(fly_in_process(scenario), scenario))
    assert named in str(theory.proofs_absent)
    assert not any(uav.proofs for uav in theory.uavs)
