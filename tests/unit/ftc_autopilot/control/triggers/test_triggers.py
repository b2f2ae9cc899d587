"""Triggers against values worked out by hand, and what each promises."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from ftc_autopilot.common.tuples import Four, four
from ftc_autopilot.control.controller import new_controller, parameter_record, restart_law
from ftc_autopilot.control.laws.proposed import Proposed
from ftc_autopilot.control.triggers import MODES, TRIGGERS, decide
from ftc_autopilot.control.triggers.base import Candidates, TriggerParameters
from ftc_autopilot.control.triggers.periodic import clock
from gcs.scenario.model import Scenario
from mavlink_defs.config.inherit import OF_ANY_MODE
from mavlink_defs.config.models import Problems

ALL = 0b1111
DT = 1e-3
commands = st.lists(st.floats(-10.0, 10.0), min_size=2, max_size=80)


def events(
    trigger: TriggerParameters,
    demand: Sequence[float],
    relative: float,
    absolute: float,
    state: np.void | None = None,
    examined: int = 0,
) -> list[int]:
    """Steps at which a channel with these demands transmits; the others demand nothing."""
    parameters = parameter_record(Proposed(), trigger)
    state = new_controller() if state is None else state
    held, at = np.zeros(4), []
    for k, command in enumerate(demand):
        commanded = (command, 0.0, 0.0, 0.0)
        now = candidates(commanded, four(held), (relative,) * 4, (absolute,) * 4, first=k == 0)
        now = now._replace(examined=examined)
        mask = decide(now, parameters["mode"], parameters["trigger"], state["trigger"])
        if mask & 1:
            held[0] = command
            at.append(k)
    return at


def candidates(
    commanded: Four, held: Four, relative: Four, absolute: Four, first: bool = False
) -> Candidates:
    """All channels, selected by the law."""
    return Candidates(
        dt=DT,
        first=int(first),
        selected=ALL,
        commanded=commanded,
        held=held,
        relative=relative,
        absolute=absolute,
        examined=0,
    )


def made(mode: str, **values: Any) -> TriggerParameters:
    return TRIGGERS[mode](mode=mode, **values)


def test_per_channel_by_hand() -> None:
    # thresholds of 1 + 0.1 |held|: 1 from 0, 1.1 from 1, 1.21 from 2.1
    ramp = [0.0, 0.9, 1.0, 2.0, 2.1, 3.3, 3.31]
    assert events(made("per_channel"), ramp, 0.1, 1.0) == [0, 2, 4, 6]


def test_periodic_by_hand() -> None:
    still = [0.0] * 10
    assert events(made("periodic"), still, 0.0, 1.0) == list(range(10))
    assert events(made("periodic", period_s=0.004), still, 0.0, 1.0) == [0, 4, 8]
    own = made("periodic", period_s=0.004, aileron_period_s=0.003)
    assert events(own, still, 0.0, 1.0) == [0, 3, 6, 9]


def test_without_a_period_the_clock_has_the_control_period() -> None:
    parameters = parameter_record(Proposed(), made("periodic", rudder_period_s=0.004))
    state = new_controller()["trigger"]["periodic"]
    _, period_s = clock(DT, parameters["trigger"]["periodic"], state)
    assert period_s == (DT, DT, 0.004, DT)


def test_each_channel_has_its_own_period() -> None:
    names = ("aileron", "elevator", "rudder", "throttle")
    trigger = made("periodic", **{f"{name}_period_s": (i + 1) * DT for i, name in enumerate(names)})
    parameters, state = parameter_record(Proposed(), trigger), new_controller()
    now = candidates((0.0,) * 4, (0.0,) * 4, (0.0,) * 4, (1.0,) * 4)
    masks = [
        decide(now, parameters["mode"], parameters["trigger"], state["trigger"]) for _ in range(24)
    ]
    assert [sum(mask >> i & 1 for mask in masks) for i in range(4)] == [24, 12, 8, 6]


def test_periodic_event_by_hand() -> None:
    jump = [0.0, 0.0, 5.0, 5.0, 5.0, 5.0, 9.0, 9.0, 9.0, 9.0]
    assert events(made("periodic_event", check_s=0.004), jump, 0.0, 1.0) == [0, 4, 8]
    assert events(made("periodic_event", check_s=0.004), [0.0] * 10, 0.0, 1.0) == [0]


def test_dynamic_by_hand() -> None:
    # λ = 0, θ = 2 ms, threshold 1, command 2 from step 2 on: s = 1, 1, -1, -1 ..., so η is
    # 0, 1e-3, 2e-3 at steps 0, 1, 2. At step 2 η + θ s = 2e-3 - 2e-3 <= 0: an event.
    trigger = made("dynamic", decay_hz=0.0, theta_s=2e-3)
    assert events(trigger, [0.0, 0.0, 2.0, 2.0], 0.0, 1.0) == [0, 2]
    # One step later η is 3e-3, which lasts until 3e-3 - k 1e-3 <= 2e-3: one step
    assert events(trigger, [0.0, 0.0, 0.0, 2.0, 2.0], 0.0, 1.0) == [0, 4]
    # A decay of 500/s halves η before each step's addition: η = 1e-3, 1.5e-3, 1.75e-3 < 2e-3
    trigger = made("dynamic", decay_hz=500.0, theta_s=2e-3)
    assert events(trigger, [0.0, 0.0, 0.0, 2.0, 2.0], 0.0, 1.0) == [0, 3]


def test_self_by_hand() -> None:
    # 0.5 per step, threshold 4, share 0.5. First: the least time, 2 steps. At step 2 the command
    # moved by 1 in 2 steps, so by 2 in 4 (next: 6); then by 2 in 4, so again 4 (next: 10).
    ramp = [0.5 * k for k in range(12)]
    trigger = made("self", share=0.5, shortest_s=0.002, longest_s=0.05)
    assert events(trigger, ramp, 0.0, 4.0) == [0, 2, 6, 10]
    # A command that stands still is sent again after the longest time
    assert events(made("self", shortest_s=0.002, longest_s=0.005), [0.0] * 14, 0.0, 4.0) == [
        *(0, 2, 7, 12)
    ]


def test_scaled_by_hand() -> None:
    # P is 4 steps, P/4 one, threshold 1, share 1/2 in all of these steps. The ramp changes by 1
    # and by 1/4. Medians of steps 4 to 8: 0.05, 0.1, 0.15, 0.225, 0.3375 for both. So the limit at
    # step 4 is the threshold, at step 8 1.4826 3 0.3375 = 1.5, though the command has moved by 1;
    # at step 9 the medians are 0.50625 and 0.16875, and the limit is 1.03, below 1.25
    ramp = [0.25 * k for k in range(10)]
    assert events(made("scaled", within_s=0.004), ramp, 0.0, 1.0) == [0, 4, 9]
    # what stands still is never sent again
    assert events(made("scaled"), [2.0] * 200, 0.0, 1.0) == [0]


def test_scaled_holds_nothing_back_of_an_actuator_under_examination() -> None:
    # white noise, of which a healthy actuator hears the rarest alone
    noise = np.random.default_rng(1).normal(0.0, 3.0, 2000).tolist()
    fixed = events(made("per_channel"), noise, 0.0, 1.0)
    assert events(made("scaled"), noise, 0.0, 1.0, examined=0b0001) == fixed
    others = events(made("scaled"), noise, 0.0, 1.0, examined=0b1110)
    assert others == events(made("scaled"), noise, 0.0, 1.0)
    assert len(others) < len(fixed) / 10


@given(demand=commands, absolute=st.floats(0.01, 3.0), within=st.integers(1, 64))
def test_scaled_never_fires_before_the_threshold(
    demand: list[float], absolute: float, within: int
) -> None:
    at, held = events(made("scaled", within_s=within * DT), demand, 0.0, absolute), demand[0]
    for k in at[1:]:
        assert abs(demand[k] - held) >= absolute
        held = demand[k]


def test_scaled_forgets_at_its_time_constant() -> None:
    """A median moves by a share of itself in each step: up here, where every change is larger."""
    state, growing = new_controller(), [1e-6 * k**3 for k in range(600)]
    trigger = made("scaled", within_s=0.004, memory_s=0.1)
    events(trigger, growing[:-1], 0.0, 1e-9, state)
    before = state["trigger"]["scaled"]["slow"][0]
    parameters = parameter_record(Proposed(), trigger)
    commanded = (growing[-1], 0.0, 0.0, 0.0)
    now = candidates(commanded, (0.0,) * 4, (0.0,) * 4, (1e-9,) * 4)
    decide(now, parameters["mode"], parameters["trigger"], state["trigger"])
    assert state["trigger"]["scaled"]["slow"][0] == pytest.approx(before * (1.0 + DT / 0.1))


def test_self_triggered_waits_as_long_after_a_change_down_as_up() -> None:
    ramp = [0.1 * k for k in range(80)]
    trigger = made("self")
    up, down = events(trigger, ramp, 0.0, 1.0), events(trigger, [-u for u in ramp], 0.0, 1.0)
    assert up == down
    assert np.diff(up).max() < 50


def test_scaled_does_not_count_noise() -> None:
    """White noise of ten thresholds: one sample in 370 and not nine in ten; 100 ms are not."""
    noise = 10.0 * np.random.default_rng(1).standard_normal(20_000)
    every = events(made("per_channel"), noise.tolist(), 0.0, 1.0)
    scaled = events(made("scaled"), noise.tolist(), 0.0, 1.0)
    assert len(every) > 18_000
    assert len([k for k in scaled if k >= 100]) < 20_000 / 370 * 2
    assert len([k for k in scaled if k < 100]) < 50


@pytest.mark.parametrize("size", [0.5, 50.0])
def test_scaled_is_a_third_of_the_clock_whose_error_it_has(size: float) -> None:
    """A random walk, as gusts make it, of any size: every 3 P at the mean square error of P."""
    walk = np.cumsum(size * np.random.default_rng(2).standard_normal(40_000))
    steps = np.arange(len(walk))
    sent = np.isin(steps, events(made("scaled", within_s=64 * DT), walk.tolist(), 0.0, 0.1))
    held, by_clock = walk[np.maximum.accumulate(sent * steps)], walk[steps // 64 * 64]
    late = slice(1000, None)
    assert len(walk[late]) / sent[late].sum() == pytest.approx(3 * 64, rel=0.2)
    error, of_clock = np.mean((walk - held)[late] ** 2), np.mean((walk - by_clock)[late] ** 2)
    assert error == pytest.approx(of_clock, rel=0.2)


def test_scaled_finds_its_threshold_again_after_noise() -> None:
    """Where noise ends, the medians fall by their time constant, until σ rules again."""
    noise = 10.0 * np.random.default_rng(3).standard_normal(5_000)
    calm = np.repeat(np.arange(10.0) * 1.5, 1000)
    at = events(made("scaled"), [*noise.tolist(), *calm.tolist()], 0.0, 1.0)
    assert [k for k in at if k >= 11_000] == [11_000, 12_000, 13_000, 14_000]


@given(demand=commands, absolute=st.floats(0.0, 3.0), relative=st.floats(0.0, 0.5))
def test_per_channel_keeps_the_command_within_its_threshold(
    demand: list[float], absolute: float, relative: float
) -> None:
    at, held = set(events(made("per_channel"), demand, relative, absolute)), 0.0
    for k, command in enumerate(demand):
        if k in at:
            held = command
        else:
            assert abs(command - held) < relative * abs(held) + absolute


@given(demand=commands, absolute=st.floats(0.01, 3.0), decay=st.floats(0.0, 900.0))
def test_dynamic_never_fires_before_the_threshold(
    demand: list[float], absolute: float, decay: float
) -> None:
    """So intervals of its own are at least threshold/µ, as with (25)."""
    trigger = made("dynamic", decay_hz=decay, theta_s=DT / (1.0 - DT * decay))
    at, held = events(trigger, demand, 0.0, absolute), demand[0]
    for k in at[1:]:
        assert abs(demand[k] - held) >= absolute * (1.0 - 1e-9)
        held = demand[k]


@given(demand=commands, absolute=st.floats(0.01, 3.0), decay=st.floats(0.0, 900.0))
def test_dynamic_spends_beyond_the_threshold_what_it_saved_within(
    demand: list[float], absolute: float, decay: float
) -> None:
    """The mean distance to the threshold is not negative: the sum of s is at least η/dt >= 0."""
    trigger = made("dynamic", decay_hz=decay, theta_s=DT / (1.0 - DT * decay))
    at, held, total = set(events(trigger, demand, 0.0, absolute)), 0.0, 0.0
    for k, command in enumerate(demand):
        held = command if k in at else held
        total += absolute - abs(command - held)
        assert total >= -1e-9


@given(demand=commands, check=st.integers(1, 7), absolute=st.floats(0.0, 3.0))
def test_periodic_event_fires_at_checks_only(
    demand: list[float], check: int, absolute: float
) -> None:
    at = events(made("periodic_event", check_s=check * DT), demand, 0.0, absolute)
    assert all(k % check == 0 for k in at)
    if check == 1:
        assert at == events(made("per_channel"), demand, 0.0, absolute)


@given(demand=commands, shortest=st.integers(1, 5), more=st.integers(0, 9))
def test_self_stays_within_its_limits(demand: list[float], shortest: int, more: int) -> None:
    limits = {"shortest_s": shortest * DT, "longest_s": (shortest + more) * DT}
    at = events(made("self", **limits), demand, 0.1, 1.0)
    gaps = np.diff([*at, len(demand)])
    assert all(shortest <= gap <= shortest + more for gap in gaps[:-1])
    assert gaps[-1] <= shortest + more


@given(earlier=commands, demand=commands, mode=st.sampled_from(MODES))
def test_a_trigger_restarts_with_the_law(
    earlier: list[float], demand: list[float], mode: str
) -> None:
    state = new_controller()
    events(made(mode), earlier, 0.0, 1.0, state)
    restart_law(state)
    assert events(made(mode), demand, 0.0, 1.0, state) == events(made(mode), demand, 0.0, 1.0)


@pytest.mark.parametrize(
    ("trigger", "text"),
    [
        ({"mode": "periodic", "period_s": 0.0025}, "trigger.period_s: expected a whole number"),
        ({"mode": "periodic", "rudder_period_s": 0.0105}, "trigger.rudder_period_s: expected a wh"),
        ({"mode": "periodic_event", "check_s": 0.0015}, "trigger.check_s: expected a whole number"),
        ({"mode": "self", "longest_s": 0.002}, "trigger.longest_s: expected >= 0.004 s, shortest"),
        ({"mode": "dynamic", "decay_hz": 1000}, "trigger.decay_hz: expected < 1000 1/s, the"),
        ({"mode": "dynamic", "theta_s": 0.0005}, "trigger.theta_s: expected >= 0.0010101 s, so th"),
        ({"mode": "consequence"}, "trigger.mode: 'consequence' needs a law that chooses what"),
    ],
)
def test_what_makes_no_sense_is_refused(
    scenario1: Scenario, trigger: dict[str, Any], text: str
) -> None:
    with pytest.raises(ValidationError) as refusal:
        Scenario.model_validate(scenario1.model_dump() | {"trigger": trigger})
    (error,) = refusal.value.errors()
    problems = error["ctx"]["error"]
    assert isinstance(problems, Problems)
    assert str(problems).startswith(text)


def test_what_another_mode_inherits_is_what_every_trigger_has() -> None:
    assert TriggerParameters.model_fields.keys() - {"mode"} == OF_ANY_MODE
