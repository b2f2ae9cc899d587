"""Figures taken while a flight is flown equal the whole recording's, to the last bit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from ftc_autopilot.control.diagnosis import LOST
from ftc_autopilot.control.signals import SIGNALS, no_signals
from gcs.results.quantities import integrated_error
from gcs.results.recording import Ending, Recording, Steps
from gcs.results.summary import summary_of
from gcs.results.tally import Tally
from gcs.scenario.bundled import SCENARIOS
from gcs.scenario.changes import with_changes
from gcs.scenario.model import load_scenario

STEP_US, STEPS, N = 10_000, 300, 3


SCENARIO = load_scenario(SCENARIOS / "paper" / "scenario1.yaml")
SCENARIO = SCENARIO.model_copy(update={"step_us": STEP_US})


def random_flight(seed: int, missing: list[tuple[int, int]], disarmed: tuple[int, int]) -> Steps:
    """A flight of 3 s with steps that the first UAV missed, and some that it flew disarmed."""
    rng = np.random.default_rng(seed)
    steps = Steps.room(STEPS, N)
    steps.states[:] = rng.normal(0.0, 2.0, steps.states.shape)
    steps.wind[:] = rng.normal(0.0, 1.0, steps.wind.shape)
    for name in ("V", "command", "reference", "offset"):
        steps.signals[name] = rng.normal(0.0, 2.0, steps.signals[name].shape)
    steps.signals["events"] = rng.integers(0, 16, (STEPS, N)) * (rng.random((STEPS, N)) < 0.3)
    steps.signals["phase"] = rng.integers(0, 4, (STEPS, N, 4))
    begin, end = disarmed
    for name in ("command", "reference"):
        steps.signals[name][begin:end, 0] = np.nan
    for begin, end in missing:
        steps.signals[begin:end, 0] = no_signals(len(range(STEPS)[begin:end]))
    return steps


ranges = st.tuples(st.integers(0, STEPS), st.integers(0, STEPS))


@given(
    st.integers(0, 2**32),
    st.lists(ranges, max_size=3),
    ranges,
    st.lists(st.integers(0, STEPS), max_size=5),
)
def test_it_does_not_matter_how_the_steps_arrive(
    seed: int, missing: list[tuple[int, int]], disarmed: tuple[int, int], cuts: list[int]
) -> None:
    steps = random_flight(seed, missing, disarmed)
    tally = Tally(SCENARIO)
    for begin, end in zip([0, *sorted(cuts)], [*sorted(cuts), STEPS], strict=True):
        tally.add(steps.part(begin, end))
    tally.finish()
    ending = Ending("real_time", STEPS, np.zeros((N, 4), np.int64), 1.0, None)
    flight = Recording.of(steps, ending, (1, 2, 3), STEP_US)
    time_s = flight.time_s
    commands, reference = flight.error("command"), flight.error("reference")
    for i, own in enumerate(tally.uavs):
        assert own["missing"] == np.count_nonzero(flight.missing[:, i])
        assert own["active"] == np.count_nonzero(np.isfinite(flight.signals["command"][:, i, 0]))
        for against, error in enumerate((commands[:, i], reference[:, i])):
            expected = integrated_error(error, STEP_US)
            found = own["sum"][against] * STEP_US / 1e6 if own["counted"][against] else np.nan
            assert_array_equal(np.broadcast_to(found, 4), expected)
        known = np.isfinite(reference[:, i]).all(axis=1)
        settled = np.abs(reference[known & (time_s > 1.0), i])
        assert_array_equal(own["largest"], settled.max(axis=0, initial=0.0))
        final = np.abs(reference[known & (time_s >= 2.0), i])
        found = tally.largest_final_error(i, 2.0)
        assert_array_equal(found, final.max(axis=0) if len(final) else np.full(4, np.nan))
        for name, angles in (("attitude_lost", slice(1, 3)), ("heading_lost", slice(3, 4))):
            beyond = np.flatnonzero((np.abs(reference[:, i, angles]) > np.pi / 2.0).any(axis=1))
            assert own[name] == (beyond[0] if len(beyond) else -1)
        for c in range(4):
            at = np.flatnonzero(flight.signals["events"][:, i] >> c & 1)
            assert own["events"][c] == len(at)
            assert own["min_gap"][c] == (np.diff(at).min() if len(at) > 1 else 0)
        flown = np.isfinite(flight.signals["command"][:, i, 0])
        lost = flight.signals["phase"][:, i] == LOST
        for k in np.flatnonzero(~flown):  # a step without the law says nothing
            lost[k] = lost[k - 1] if k else False
        changes = np.argwhere(np.diff(lost, axis=0, prepend=False))
        assert [decision[:3] for decision in tally.decisions(i)] == [
            (k, c, lost[k, c]) for k, c in changes
        ]


def test_steps_without_the_law_bring_no_lost_actuator_back() -> None:
    """Some were missed, and at the end the vehicle is disarmed."""
    steps = random_flight(0, [], (0, 0))
    steps.signals["phase"][:] = 0
    steps.signals["phase"][100:, 0, 3] = LOST
    steps.signals[110:250:2, 0] = no_signals(70)
    steps.signals[250:, 0] = no_signals(50)
    steps.signals["V"][250:, 0] = 0.0
    tally = Tally(SCENARIO)
    tally.add(steps)
    tally.finish()
    assert [decision[:3] for decision in tally.decisions(0)] == [(100, 3, True)]


def test_the_motion_of_a_foreign_autopilot_has_bands() -> None:
    """Of every step, however they arrive; angles within half a turn."""
    flown = with_changes(SCENARIO, [], {"uavs[1].autopilot.kind": "ardupilot"}, "--set")
    steps = random_flight(0, [], (0, 0))
    steps.signals["V"][40:50, 1] = np.nan
    tally = Tally(flown)
    for cut in (slice(0, 0), slice(0, 45), slice(45, STEPS)):
        tally.add(steps.part(cut.start, cut.stop))
    tally.finish()
    x = steps.states[:, 1]
    roll = np.degrees(np.arctan2(np.sin(x[:, 6]), np.cos(x[:, 6])))
    values = (roll, np.degrees(x[:, 7]), -x[:, 2], steps.signals["V"][:, 1])
    assert [*tally.motion] == [1]
    for k, value in enumerate(values):
        assert tally.motion[1][:, k] == pytest.approx([np.nanmin(value), np.nanmax(value)])


@pytest.mark.parametrize("changes", [{}, {"autopilot.kind": "ardupilot"}])
def test_an_empty_flight_has_no_figures(changes: dict[str, str]) -> None:
    flown = with_changes(SCENARIO, [], changes, "--set")
    tally = Tally(flown)
    tally.add(Steps.room(0, N))
    tally.finish()
    ending = Ending("lockstep", 0, np.zeros((N, 4), np.int64), 0.0, None)
    assert {uav.motion for uav in summary_of(tally, ending, flown).uavs} == {None}
    assert not tally.uavs["counted"].any()
    assert np.isnan(tally.largest_final_error(0, -1.0)).all()
    assert SIGNALS["V"].kind == "f"
