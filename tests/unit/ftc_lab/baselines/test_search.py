"""Searches for the slowest equal sender: on a made-up tracking, and against real flights."""

import itertools
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ftc_autopilot.control.laws.tube import Tube
from ftc_autopilot.control.triggers.periodic import Periodic
from ftc_lab.baselines.baseline import Baseline, Search, Uncertain, find_baseline, find_robust
from ftc_lab.baselines.senders import (
    COARSE,
    FINE,
    YARDSTICKS,
    periodic_base,
    senders,
    some_periods,
    transmissions,
    worst_ratio,
)
from ftc_lab.campaigns.model import load_campaign
from ftc_lab.reports.baseline import baseline_report
from gcs.console.errors import BadInput
from gcs.fleet.in_process import fly_in_process
from gcs.results.figures import FlightSummary
from gcs.results.summary import summarise
from gcs.scenario.bundled import find_scenario
from gcs.scenario.model import Scenario, scenario_of, scenario_tree
from mavlink_defs.config.inherit import merged
from mavlink_defs.constants import ACTUATORS

Area = Callable[[dict[str, int], Scenario], float]
CAMPAIGN = "campaigns/uncertainty"


@pytest.fixture(scope="module")
def short(scenario1: Scenario) -> Scenario:
    return Scenario.model_validate(scenario1.model_dump() | {"duration_s": 0.3, "faults": ()})


@pytest.fixture(scope="module")
def base(short: Scenario) -> Scenario:
    return periodic_base(short, Path("scenario"), {})


@pytest.fixture(scope="module")
def flown(short: Scenario) -> FlightSummary:
    return summarise(fly_in_process(short), short)


@pytest.fixture
def pool() -> Iterator[Executor]:
    with ThreadPoolExecutor(2) as pool:
        yield pool


def with_iae(summary: FlightSummary, factor: float, lag: float = 0.0) -> FlightSummary:
    """A flight with so many times the errors against the reference, and the filter's lag."""
    error = 2.0 * factor
    uavs = [
        replace(u, iae=dict.fromkeys(u.iae, lag + error), iae_filtered=dict.fromkeys(u.iae, error))
        for u in summary.uavs
    ]
    return replace(summary, uavs=tuple(uavs))


def periods_of(scenario: Scenario) -> dict[str, int]:
    trigger = scenario.trigger
    assert isinstance(trigger, Periodic)
    return {name: round(s * 1e6 / scenario.step_us) for name, s in trigger.by_channel().items()}


def made_up(base: Scenario, flown: FlightSummary, pool: Executor, area: Area) -> Search:
    """A search among senders whose IAE, divided by the triggered flight's, is `area(periods)`."""

    def fly(scenario: Scenario) -> FlightSummary:
        return with_iae(flown, area(periods_of(scenario), scenario))

    return Search(base, with_iae(flown, 1.0), 1.01, partial(pool.map, fly), lambda: None)


@given(longest=st.integers(1, 3000), ratio=st.floats(1.001, 3.0), shortest=st.integers(1, 50))
def test_neighbours_on_the_list_are_close(longest: int, ratio: float, shortest: int) -> None:
    listed = some_periods(max(longest, shortest), ratio, shortest)
    assert (listed[0], listed[-1]) == (shortest, max(longest, shortest))
    assert all(a < b <= max(a + 1, a * ratio) for a, b in itertools.pairwise(listed))


def test_transmissions_are_counted_in_the_flight(base: Scenario) -> None:
    (slow,) = senders(base, (7, 11, 13, 1))
    counts = summarise(fly_in_process(slow.scenario), slow.scenario).uavs
    assert sum(uav.events for uav in counts) == slow.transmissions
    assert slow.transmissions == transmissions(base, (7, 11, 13, 1))
    of_one = {name: channel.events for name, channel in counts[0].channels.items()}
    assert of_one == {"aileron": 43, "elevator": 28, "rudder": 24, "throttle": 300}


def test_the_slowest_equal_sender_is_found_where_tracking_is_not_monotone(
    short: Scenario, base: Scenario, flown: FlightSummary, pool: Executor
) -> None:
    good = {1, 2, 3, 17}
    search = made_up(base, flown, pool, lambda p, _: 1.0 if p["rudder"] in good else 1.02)
    found = find_baseline(short, search, 40, each_channel=False)
    assert found.slowest_uniform is not None
    assert found.slowest_uniform.sender.periods == (17,) * 4
    assert [one.sender.periods[0] for one in found.uniform] == some_periods(40, FINE)
    report = baseline_report(found)
    assert "| slowest equal: every 17 ms | 216 |" in report
    assert "Of the 16 faster than the one in the table 13 are not equal" in report


def test_each_channel_gets_the_longest_period_that_it_stands(
    short: Scenario, base: Scenario, flown: FlightSummary, pool: Executor
) -> None:
    limits = {"aileron": 4, "elevator": 11, "rudder": 40, "throttle": 200}

    def area(periods: Mapping[str, int], _: Scenario) -> float:
        return 1.0 if all(periods[name] <= limits[name] for name in ACTUATORS) else 3.0

    search = made_up(base, flown, pool, area)
    own = find_baseline(short, search, 300, each_channel=True).per_channel
    assert own is not None
    for name, n in zip(ACTUATORS, own.sender.periods, strict=True):
        longer = next(m for m in some_periods(10**6, COARSE, n) if m > n)
        assert n <= limits[name] < longer


def test_no_equal_sender_is_a_result(
    short: Scenario, base: Scenario, flown: FlightSummary, pool: Executor
) -> None:
    found = find_baseline(short, made_up(base, flown, pool, lambda *_: 1.5), 9, each_channel=True)
    assert found.slowest_uniform is found.per_channel is None
    assert found.to_json()["saved"]["uniform"] is None
    assert "none of 9 periods up to 9 ms" in baseline_report(found)


def test_a_sender_that_saves_nothing_has_a_negative_saving(flown: FlightSummary) -> None:
    baseline = Baseline("one", "pid", "pid", "self", 1000, 1.01, 300, 200, uniform=())
    assert baseline.to_json()["saved"]["every_period"] == -0.5


def test_a_flight_that_ends_badly_is_no_equal(flown: FlightSummary) -> None:
    assert worst_ratio(flown, flown) == 1.0
    assert worst_ratio(replace(flown, completed=False), flown) is None
    first, *others = flown.uavs
    for lost in (replace(first, attitude_lost_at_s=0.1), replace(first, heading_lost_at_s=0.1)):
        assert worst_ratio(replace(flown, uavs=(lost, *others)), flown) is None


def test_one_uav_that_tracks_worse_is_enough(flown: FlightSummary) -> None:
    last = flown.uavs[-1]
    doubled = {
        name: {**iae, "yaw": 2.0 * (iae["yaw"] or 0.0)}
        for name, iae in (("reference", last.iae_filtered), ("commands", last.iae))
    }
    by_reference = replace(last, iae_filtered=doubled["reference"])
    by_commands = replace(last, iae=doubled["commands"])
    for worse, ratios in ((by_reference, (2.0, 1.0)), (by_commands, (1.0, 2.0))):
        flight = replace(flown, uavs=(*flown.uavs[:-1], worse))
        found = [worst_ratio(flight, flown, yardstick) for yardstick in YARDSTICKS]
        assert found == pytest.approx(ratios)


@given(factor=st.floats(1.02, 50.0), lag=st.floats(0.0, 1e4))
def test_no_lag_of_the_reference_hides_an_error_that_the_sender_makes(
    factor: float, lag: float, short: Scenario, base: Scenario, flown: FlightSummary
) -> None:
    """Every sender has the same lag; it is no part of what equal means."""

    def fly(scenario: Scenario) -> FlightSummary:
        return with_iae(flown, 1.0 if periods_of(scenario)["rudder"] <= 2 else factor, lag)

    search = Search(
        base, with_iae(flown, 1.0, lag), 1.01, lambda listed: map(fly, listed), lambda: None
    )
    found = find_baseline(short, search, 4, each_channel=True)
    assert found.slowest_uniform is not None
    assert found.slowest_uniform.sender.periods == (2,) * 4
    assert found.per_channel is not None
    assert found.per_channel.sender.periods[2] == 2
    hidden = (lag + 2.0 * factor) / (lag + 2.0) <= 1.01
    assert found.slowest_by_commands is not None
    assert found.slowest_by_commands.sender.periods == ((4,) * 4 if hidden else (2,) * 4)
    told = found.to_json()
    assert told["uniform"][-1]["worst"] == pytest.approx(factor)
    assert told["uniform"][-1]["equal"] is False
    assert told["by_commands"][-1]["equal"] is hidden
    assert f"slowest equal against the commands: every {4 if hidden else 2} ms" in baseline_report(
        found
    )


def test_the_slowest_sender_that_keeps_enough_aircraft(
    short: Scenario, base: Scenario, flown: FlightSummary, pool: Executor
) -> None:
    """Heavier aircraft stand shorter periods: with 20 of them 5 % is one."""
    heaviest: list[float] = []  # of a latin hypercube: one in each twentieth of [0.8, 1.2]

    def area(periods: Mapping[str, int], scenario: Scenario) -> float:
        return 1.0 if periods["rudder"] * scenario.uncertainty.mass <= 12.0 else 9.0

    search = made_up(base, flown, pool, area)
    campaign = load_campaign(find_scenario(CAMPAIGN), draws=20)

    def fly(scenario: Scenario) -> FlightSummary:
        if scenario.trigger != short.trigger:
            return next(search.fly([scenario]))
        heaviest.append(scenario.uncertainty.mass)
        return with_iae(flown, 1.0)

    searched = replace(search, fly=lambda scenarios: map(fly, scenarios))
    found = find_robust(short, searched, Uncertain(campaign, Path("x"), 1.5, 0.95), 60)
    heaviest.sort()
    assert len(heaviest) == 20
    assert found.triggered == (20, True)
    assert found.to_json()["triggered"]["flown"] == 20
    longest = max(n for n in some_periods(60, COARSE) if n * heaviest[-2] <= 12.0)
    assert found.slowest is not None
    assert found.slowest.sender.periods == (longest,) * 4
    assert found.slowest.kept == sum(longest * mass <= 12.0 for mass in heaviest)
    assert all(one.flown < 20 or not one.good for one in found.checked[:-1])


def test_a_law_is_sent_by_the_clock_with_the_parameters_that_suit_the_clock(
    short: Scenario, flown: FlightSummary, pool: Executor
) -> None:
    """Of the widths of the tube the best one counts, and is named."""
    tree = merged(short.model_dump(), scenario_tree("tube"))
    tube = scenario_of("tube", tree)
    base = periodic_base(tube, Path("scenario"), {})
    assert isinstance(base.controller, Tube)

    def area(periods: Mapping[str, int], scenario: Scenario) -> float:
        scale = scenario.controller.model_dump()["tube_scale"]
        return 1.0 if scale == 0.5 and periods["rudder"] <= 7 else 2.0

    found = find_baseline(tube, made_up(base, flown, pool, area), 40, each_channel=False)
    assert found.slowest_uniform is not None
    assert found.slowest_uniform.sender.periods == (7,) * 4
    assert found.slowest_uniform.sender.parameters == {"tube_scale": 0.5}
    assert "| slowest equal: every 7 ms, tube_scale 0.5 |" in baseline_report(found)


def test_the_sender_may_have_another_law(short: Scenario) -> None:
    other = periodic_base(short, Path("x"), {"controller.kind": "pid"})
    assert (other.controller.kind, other.trigger.mode) == ("pid", "periodic")
    assert other.trigger.a2_n == short.trigger.a2_n
    with pytest.raises(BadInput, match=r"--against controller\[0\]: expected a list"):
        periodic_base(short, Path("x"), {"controller[0]": 1})
