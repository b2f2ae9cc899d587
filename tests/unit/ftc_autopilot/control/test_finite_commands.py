"""No value that is not finite ever leaves a law; what cannot be inverted is refused."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from steps import step_alone, step_of

from ftc_autopilot.common.motion import motion_of
from ftc_autopilot.control.controller import new_controller, parameter_record
from ftc_autopilot.control.controllers import new_controllers
from ftc_autopilot.control.inversion import inversion_problem, surfaces_for
from ftc_autopilot.control.laws import LAWS
from ftc_autopilot.control.laws.proposed import Proposed
from ftc_autopilot.control.step import ALL, Command, Thresholds
from ftc_autopilot.control.transmit import transmit
from ftc_autopilot.control.triggers import MODES, TRIGGERS
from gcs.scenario.model import Scenario
from mavlink_defs.constants import ACTUATORS, N_CHANNELS
from mavlink_defs.framing.codec import SIM_STATE
from sitl_plant.airframe.aerodynamics import aerodynamics, control_effectiveness
from sitl_plant.airframe.aircraft import COEFFICIENTS, aircraft_record
from sitl_plant.airframe.config import Aircraft

NO_RUDDER = {"cl_dr": 0.0, "cn_dr": 0.0}
INVERTING = {"backstepping", "surviving", "tube"}

anything = st.floats() | st.floats(-1.0, 1.0) | st.sampled_from([math.nan, math.inf, -math.inf])
factor = st.sampled_from([0.0, 1.0, 1.0, -1.0, 1e-9, 1e3]) | st.floats(-3.0, 3.0)
angle, rate = st.floats(-math.pi, math.pi), st.floats(-100.0, 100.0)


_FLYING = np.zeros(1, SIM_STATE)[0]
_FLYING["velocity"] = (45.0, 0.0, 0.0)


def law_tree(scenario: Scenario, kind: str, factors: dict[str, float]) -> dict[str, Any]:
    """The scenario with another law, and an aircraft with some coefficients multiplied."""
    tree: dict[str, Any] = scenario.model_dump()
    for name, by in factors.items():
        tree["aircraft"]["coefficients"][name] *= abs(by) if name == "cD0" else by
    mode = "consequence" if LAWS[kind].SELECTS_CHANNELS else "per_channel"
    return tree | {"controller": {"kind": kind}, "trigger": {"mode": mode}}


@given(
    demands=st.lists(
        st.tuples(st.tuples(anything, anything, anything, anything), st.integers(0, ALL)),
        min_size=1,
        max_size=4,
    ),
    mode=st.sampled_from(MODES),
)
def test_a_demand_that_is_not_finite_is_not_sent_and_the_last_command_is_held(
    demands: list[tuple[tuple[float, float, float, float], int]], mode: str, nominal: np.void
) -> None:
    state, controls = new_controller(), np.zeros(16, np.float32)
    parameters = parameter_record(Proposed(), TRIGGERS[mode](mode=mode))
    failures = np.zeros(N_CHANNELS, int)
    for k, (asked, selected) in enumerate(demands):
        before = controls.copy(), state["held"].copy()
        command = Command(asked[:3], asked[3], selected)
        thresholds = Thresholds((0.01, 0.5), (0.01, 0.02))
        now = step_of(motion_of(_FLYING, nominal), k == 0, thresholds=thresholds)
        mask = transmit(command, now, nominal, parameters, state, controls, 0)
        failed = ~np.isfinite(asked)
        failures += failed
        assert not any(mask & (1 << c) for c in np.flatnonzero(failed))
        assert np.isfinite(controls).all()
        assert (np.abs(controls) <= 1.0).all()
        for c in np.flatnonzero(failed):
            assert controls[c] == before[0][c]
            assert state["held"][c] == before[1][c]
        if k == 0:
            assert mask == ALL & ~sum(1 << int(c) for c in np.flatnonzero(failed))
    assert state["not_finite"].tolist() == failures.tolist()


motion = st.fixed_dictionaries(
    {
        "velocity": st.tuples(st.floats(-300.0, 300.0), *[st.floats(-90.0, 90.0)] * 2),
        "attitude": st.tuples(angle, st.floats(-1.6, 1.6), angle),
        "rates": st.tuples(rate, rate, rate),
        "specific_force": st.tuples(rate, rate, rate),
    }
)


@pytest.mark.parametrize("kind", LAWS)
@settings(max_examples=25)
@given(
    factors=st.dictionaries(st.sampled_from(COEFFICIENTS), factor, max_size=8),
    motions=st.lists(motion, min_size=1, max_size=3),
)
def test_no_law_sends_what_is_not_finite(
    kind: str, factors: dict[str, float], motions: list[dict[str, Any]], scenario1: Scenario
) -> None:
    tree = law_tree(scenario1, kind, factors)
    if any(LAWS[kind](kind=kind).misfits(Aircraft.model_validate(tree["aircraft"]))):
        assert kind in INVERTING
        with pytest.raises(ValidationError, match=kind):
            Scenario.model_validate(tree)
        return
    scenario = Scenario.model_validate(tree)
    controllers = new_controllers([scenario.autopilot_config(1)])
    aircraft, parameters = controllers.uavs[0]["aircraft"], controllers.uavs[0]["parameters"]
    state, actuators = controllers.uavs[0]["controller"], controllers.uavs[0]["actuators"]
    for measured in motions:
        message = np.zeros(1, SIM_STATE)[0]
        for name, value in measured.items():
            message[name] = value
        if np.linalg.norm(message["velocity"]) < 3.0:  # where the plant ends
            message["velocity"] = (3.0, 0.0, 0.0)
        command = (45.0, 0.3, -0.1, 1.0)
        motion_now = motion_of(message, aircraft)
        signals = step_alone(motion_now, command, aircraft, parameters, state, actuators)
        controls = actuators["controls"]
        assert np.isfinite(controls).all()
        assert (np.abs(controls) <= 1.0).all()
        assert np.isfinite(state["held"]).all()
        sent = [bool(signals["events"] & (1 << c)) for c in range(N_CHANNELS)]
        lacking = ~np.isfinite(signals["demand"])
        assert signals["not_finite"] == sum(1 << int(c) for c in np.flatnonzero(lacking))
        assert not (lacking & sent).any()


surfaces = ("cl_da", "cl_dr", "cm_de", "cn_da", "cn_dr")


@given(
    factors=st.fixed_dictionaries(dict.fromkeys(surfaces, factor)),
    v=st.tuples(st.floats(3.0, 300.0), st.floats(-60.0, 60.0), st.floats(-60.0, 60.0)),
)
def test_what_is_not_refused_can_be_inverted_everywhere(
    factors: dict[str, float], v: tuple[float, float, float], scenario1: Scenario
) -> None:
    aircraft = Aircraft.model_validate(law_tree(scenario1, "pid", factors)["aircraft"])
    C = aerodynamics(v, (0.0, 0.0, 0.0), aircraft_record(aircraft)).C
    if inversion_problem(aircraft) is None:
        moment = (10.0, -20.0, 30.0)
        found = np.array(C) @ surfaces_for(moment, C)
        assert np.allclose(found, moment, atol=1e-6)
    else:  # an axis or a surface is some thousand times weaker than the strongest
        assert np.linalg.cond(np.linalg.inv(aircraft_record(aircraft)["J"]) @ C) > 100.0


@pytest.mark.parametrize("kind", LAWS)
def test_an_aircraft_without_a_rudder_is_refused_with_the_reason(
    kind: str, scenario1: Scenario
) -> None:
    tree = law_tree(scenario1, kind, NO_RUDDER)
    if kind not in INVERTING:
        Scenario.model_validate(tree)
        return
    with pytest.raises(ValidationError) as caught:
        Scenario.model_validate(tree)
    text = str(caught.value)
    for part in ("by its rudder", "is 0, expected >= 0.001", "one of proposed, pid,", repr(kind)):
        assert part in text


@pytest.mark.parametrize(
    ("factors", "weak"),
    [
        ({"cm_de": 0.0}, "by its elevator"),
        ({"cl_da": 0.0, "cn_da": 1e-9}, "by its aileron"),
        (dict.fromkeys(surfaces, 0.0), "of the surfaces is 0,"),
    ],
)
def test_the_weak_surface_is_named(
    factors: dict[str, float], weak: str, scenario1: Scenario
) -> None:
    aircraft = Aircraft.model_validate(law_tree(scenario1, "pid", factors)["aircraft"])
    problem = inversion_problem(aircraft)
    assert problem is not None
    assert weak in problem


def test_surfaces_that_do_the_same_are_named_together(scenario1: Scenario) -> None:
    tree = scenario1.model_dump()["aircraft"]
    tree["coefficients"] |= {"cl_dr": tree["coefficients"]["cl_da"]}
    tree["coefficients"] |= {"cn_dr": tree["coefficients"]["cn_da"]}
    problem = inversion_problem(Aircraft.model_validate(tree))
    assert problem is not None
    assert "aileron and rudder" in problem
    assert ACTUATORS[1] not in problem


def with_rudder_like_aileron(scenario: Scenario, times: float) -> Aircraft:
    """An aircraft whose rudder does what its aileron does, so many times as strongly."""
    tree = scenario.model_dump()["aircraft"]
    for axis in "ln":
        tree["coefficients"][f"c{axis}_dr"] = times * tree["coefficients"][f"c{axis}_da"]
    return Aircraft.model_validate(tree)


@pytest.mark.parametrize(
    ("times", "names"),
    [(0.1, "by its rudder:"), (0.5, "by its aileron and rudder:"), (10.0, "by its aileron:")],
)
def test_a_surface_is_named_if_it_has_a_share_in_what_is_weak(
    times: float, names: str, scenario1: Scenario
) -> None:
    problem = inversion_problem(with_rudder_like_aileron(scenario1, times))
    assert problem is not None
    assert names in problem


@pytest.mark.parametrize("size", [1.0, 1e-3, 1e4])
def test_an_effect_is_judged_relative_to_the_largest_one(size: float, scenario1: Scenario) -> None:
    """Of an aircraft of any size, even if no surface makes 1 rad/s² at 1 m/s."""
    tree = scenario1.model_dump()["aircraft"]
    tree["wing_area_m2"] *= size
    effect = control_effectiveness(aircraft_record(Aircraft.model_validate(tree)))
    elevator = tree["coefficients"]["cm_de"] / effect[1, 1]
    largest = float(np.linalg.norm(effect[np.ix_([0, 2], [0, 2])], 2))
    for ratio in (1.01e-3, 0.9e-3, 0.2e-3):
        tree["coefficients"]["cm_de"] = elevator * ratio * largest
        problem = inversion_problem(Aircraft.model_validate(tree))
        if ratio > 1e-3:
            assert problem is None
        else:
            assert problem is not None
            assert "by its elevator: ratio of least to largest effect" in problem
            assert f"of the surfaces is {ratio:.3g}," in problem


def test_a_law_whose_gains_do_not_exist_says_so(scenario1: Scenario) -> None:
    tree = law_tree(scenario1, "surviving", {"cm_alpha": 0.0})
    with pytest.raises(ValidationError, match="cannot hold it"):
        Scenario.model_validate(tree)
