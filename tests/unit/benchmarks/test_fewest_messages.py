"""The search for a schedule with few messages: it flies the plant, and keeps to the budget."""

import numpy as np
import pytest

from benchmarks.fewest_messages import BUDGET, Schedule, Sky, first_guess, improve, search, without
from gcs.fleet.in_process import fly_in_process
from gcs.results.quantities import in_degrees
from gcs.scenario.model import Scenario

STOP, THRUST = np.radians(35.0), 2000.0


@pytest.fixture(scope="module")
def short(scenario1: Scenario) -> Scenario:
    return Scenario.model_validate(scenario1.model_dump() | {"duration_s": 0.4, "faults": ()})


def test_commands_by_hand() -> None:
    times = (np.array([0.0, 0.015]), np.array([0.0]), np.array([0.0, 0.01]), np.array([0.0]))
    values = (np.array([0.2, 0.6]), np.array([0.1]), np.array([-1.0, 1.0]), np.array([0.5]))
    schedule = Schedule(times, values)
    assert schedule.messages == 6
    assert schedule.commands(3, 10_000) == pytest.approx(
        np.array([[0.2, 0.1, -1.0, 0.5], [0.4, 0.1, 1.0, 0.5], [0.6, 0.1, 1.0, 0.5]])
    )


def test_a_vector_is_the_schedule(short: Scenario) -> None:
    schedule = first_guess(short, 4)
    again = schedule.with_vector(schedule.vector(), 0.4)
    for mine, other in zip(
        schedule.times + schedule.values, again.times + again.values, strict=True
    ):
        assert mine == pytest.approx(other)


def test_open_loop_is_the_flight_that_was_recorded(short: Scenario) -> None:
    """The commands of a flight with feedback, sent again without it, make the same flight."""
    flight = fly_in_process(short)
    shares = flight.signals["held"][:, 2] / np.array([STOP, STOP, STOP, THRUST])
    schedule = Schedule((flight.time_s,) * 4, tuple(shares.T))
    error = Sky(short, short.step_us).error(schedule)
    assert error == pytest.approx(in_degrees(flight.error("command")[:, 2]), abs=1e-6)


def test_improving_reduces_the_largest_error(short: Scenario) -> None:
    sky = Sky(short, 4000)
    poor = Schedule((np.zeros(1),) * 4, tuple(np.array([v]) for v in (0.2, 0.1, 0.4, 0.2)))
    error = sky.error(poor)
    assert error is not None
    sky.budget = 0.05 * BUDGET
    before = sky.ratios(error).max()
    better, ratios = improve(sky, poor, 3)
    assert ratios.max() < 0.7 * before
    again = sky.error(better)
    assert again is not None
    assert sky.ratios(again) == pytest.approx(ratios)


def test_no_message_stays_that_the_budget_does_not_need(short: Scenario) -> None:
    sky = Sky(short, 4000)
    found = search(sky, first_guess(short, 3), 2, lambda *_: None)
    assert found is not None
    assert found.messages == 4


def test_what_is_found_is_within_the_budget_and_cannot_lose_a_message_as_it_is(
    short: Scenario,
) -> None:
    sky = Sky(short, 4000)
    start = first_guess(short, 3)
    error = sky.error(start)
    assert error is not None
    sky.budget = 1.1 * sky.ratios(error) * BUDGET
    found = search(sky, start, 1, lambda *_: None)
    assert found is not None
    assert 4 < found.messages <= start.messages
    error = sky.error(found)
    assert error is not None
    assert sky.ratios(error).max() <= 1.0
    for c, times in enumerate(found.times):
        for i in range(1, len(times)):
            fewer = sky.error(without(found, {(c, i)}))
            assert fewer is None or sky.ratios(fewer).max() > 0.995
