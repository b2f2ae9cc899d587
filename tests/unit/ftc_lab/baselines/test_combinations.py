"""Laws and triggers: what there is, who is on the front, and what the report says of the lost."""

import csv
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ftc_autopilot.control.laws import LAWS
from ftc_autopilot.control.triggers import MODES
from ftc_lab.baselines.combinations import (
    AIRCRAFT,
    Combination,
    combinations,
    fault_files,
    fly_faults,
    message_bytes,
    on_the_front,
    rivals,
    with_slowest_equal,
)
from ftc_lab.baselines.senders import Sender
from ftc_lab.reports.combinations import combinations_csv, combinations_section
from gcs.fleet.in_process import fly_in_process
from gcs.results.figures import FlightSummary
from gcs.results.quantities import QUANTITIES
from gcs.results.summary import summarise
from gcs.scenario.model import Scenario
from mavlink_defs.faults.actuators import STUCK

UNIT = dict.fromkeys(QUANTITIES, 1.0)
number = st.floats(0.0, 5.0)


@pytest.fixture(scope="module")
def flown(scenario1: Scenario) -> FlightSummary:
    short = Scenario.model_validate(scenario1.model_dump() | {"duration_s": 0.05, "faults": ()})
    return summarise(fly_in_process(short), short)


@pytest.fixture
def pool() -> Iterator[Executor]:
    with ThreadPoolExecutor(2) as pool:
        yield pool


def with_iae(summary: FlightSummary, iae: float) -> FlightSummary:
    errors = dict.fromkeys(QUANTITIES, iae)
    uavs = [replace(uav, iae=errors, iae_filtered=errors) for uav in summary.uavs]
    return replace(summary, uavs=tuple(uavs))


def test_every_law_has_every_trigger_that_goes_with_it(scenario1: Scenario) -> None:
    listed = combinations(scenario1)
    pairs = {(one.aircraft, one.law, one.trigger) for one in listed}
    assert len(pairs) == len(listed)
    for law, model in LAWS.items():
        selects = model.SELECTS_CHANNELS
        own = {"consequence", "periodic"} if selects else set(MODES) - {"consequence"}
        for aircraft in AIRCRAFT:
            assert {mode for a, kind, mode in pairs if (a, kind) == (aircraft, law)} == own
    for one in listed:
        assert (one.scenario.controller.kind, one.scenario.trigger.mode) == (one.law, one.trigger)
        assert one.scenario.trigger.a2_n == scenario1.trigger.a2_n
        servo = one.scenario.servos.surfaces
        assert (servo is not None and servo.lag_s > 0.0) == (one.aircraft == "realistic")
    paper = next(one for one in listed if one.law == "proposed")
    assert paper.scenario.controller == scenario1.controller


@given(st.dictionaries(st.text("abc", min_size=1), st.tuples(number, number)))
def test_nothing_beats_the_front_and_the_front_beats_the_rest(
    points: dict[str, tuple[float, float]],
) -> None:
    front = on_the_front(points)
    for name, (x, y) in points.items():
        better = [b for a, b in points.items() if a != name and b[0] <= x and b[1] <= y]
        beaten = any(b != (x, y) for b in better)
        assert (name in front) != beaten
        assert not beaten or any(points[f][0] <= x and points[f][1] <= y for f in front)


def section(listed: list[Combination]) -> list[str]:
    text = combinations_section(listed, 3, UNIT, "caption")
    return [line for line in text.splitlines() if line.startswith("| ")]


def test_a_flight_without_control_is_no_result(scenario1: Scenario, flown: FlightSummary) -> None:
    one = Combination("ideal", "pid", "joint", scenario1, with_iae(flown, 2.0))
    first, *others = flown.uavs
    spoiled: list[Callable[[FlightSummary], FlightSummary]] = [
        lambda s: replace(s, completed=False),
        lambda s: replace(s, uavs=(replace(first, attitude_lost_at_s=0.01), *others)),
        lambda s: replace(s, uavs=(replace(first, heading_lost_at_s=0.01), *others)),
    ]
    assert one.uav(3) is not None
    assert "| **pid, joint** |" in section([one])[2]
    for spoil in spoiled:
        assert one.summary is not None
        lost = replace(one, summary=spoil(one.summary))
        assert lost.uav(3) is None
        assert section([lost])[2].startswith("| pid, joint | lost | - |")


def test_fault_files_that_lose_the_aircraft_are_counted(
    scenario1: Scenario, flown: FlightSummary, pool: Executor
) -> None:
    first, *others = flown.uavs
    rolled = replace(flown, uavs=(replace(first, attitude_lost_at_s=0.01), *others))
    turned = replace(flown, uavs=(replace(first, heading_lost_at_s=0.01), *others))

    def fly(scenario: Scenario) -> FlightSummary:
        assert (scenario.controller.kind, scenario.trigger.mode) == ("pid", "joint")
        stuck = [fault.command().kind is STUCK for fault in scenario.faults]
        return rolled if all(stuck) else turned

    one = Combination("ideal", "pid", "joint", scenario1, with_iae(flown, 2.0))
    degraded = fly_faults(one, partial(pool.map, fly))
    lost = degraded.faults_lost
    assert lost is not None
    assert len(fault_files()) == 30
    assert {"stuck_zero_aileron", "thrust_loss"} <= set(lost)
    assert not {"loe_aileron", "bias_rudder"} & set(lost)
    assert section([degraded])[2].endswith(f"| {len(lost)} of 30 |")


def test_the_table_has_a_line_for_each_uav(scenario1: Scenario) -> None:
    brief = Scenario.model_validate(scenario1.model_dump() | {"duration_s": 0.05, "faults": ()})
    listed = combinations(brief)[:2]
    flights = (summarise(fly_in_process(one.scenario), one.scenario) for one in listed)
    done = [replace(one, summary=flight) for one, flight in zip(listed, flights, strict=True)]
    rows = list(csv.DictReader(combinations_csv(done).splitlines()))
    assert [row["uav"] for row in rows] == ["1", "2", "3"] * 2
    for row in rows:
        assert int(row["bytes"]) == int(row["messages"]) * message_bytes()


def test_a_message_is_as_long_as_on_the_wire() -> None:
    """Header 10, time and flags 16, four commands 16, checksum 2; zeros at the end are cut."""
    assert message_bytes() == 10 + 16 + 16 + 2


def test_every_law_is_a_rival_by_the_clock(scenario1: Scenario) -> None:
    found = rivals(combinations(scenario1))
    for aircraft in AIRCRAFT:
        own = [sender for flown, sender in found if flown == aircraft]
        assert {one.law for one in own} == set(LAWS)
        for law in LAWS:
            periods = [one.period_s for one in own if one.law == law]
            assert periods == sorted(periods)
            assert (periods[0], periods[-1]) == (0.005, 0.5)
    assert all(sender.scenario.trigger.mode == "periodic" for _, sender in found)


def test_the_slowest_equal_sender_is_as_good_and_sends_least(
    scenario1: Scenario, flown: FlightSummary
) -> None:
    found = {sender.law: sender for _, sender in rivals(combinations(scenario1))}

    def by_clock(law: str) -> Sender:
        return replace(found[law], periods=(10,) * 4)

    def rival(
        law: str, events: int, iae: float, aircraft: str = "ideal"
    ) -> tuple[str, Sender, FlightSummary]:
        summary = with_iae(flown, iae)
        uavs = [
            replace(
                uav,
                channels={
                    name: replace(channel, events=events // 4)
                    for name, channel in uav.channels.items()
                },
            )
            for uav in summary.uavs
        ]
        sent = replace(summary, uavs=tuple(uavs))
        return aircraft, by_clock(law), sent

    one = Combination("ideal", "tube", "consequence", scenario1, with_iae(flown, 2.0))
    as_good = [rival("pid", 400, 2.015), rival("surviving", 800, 1.0)]
    worse = [rival("proposed", 40, 2.03), rival("pid", 80, 1.0, "realistic")]
    lost = rival("backstepping", 40, 1.0)
    lost = (*lost[:2], replace(lost[2], completed=False))
    compared = with_slowest_equal(one, [*worse, *as_good, lost], 3)
    assert compared.slowest_equal is not None
    assert compared.slowest_equal.sender == by_clock("pid")
    assert compared.slowest_equal.transmissions == 400
    assert "| pid, every 10 ms: 400 |" in section([compared])[2]
    alone = with_slowest_equal(one, [*worse, lost], 3)
    assert alone.slowest_equal is None
    assert "| none | - |" in section([alone])[2]


def test_a_sender_by_the_clock_is_its_own_equal(scenario1: Scenario, flown: FlightSummary) -> None:
    one = Combination("ideal", "pid", "periodic", scenario1, flown)
    own = flown.uav(3)
    assert own is not None
    equal = with_slowest_equal(one, [], 3).slowest_equal
    assert equal is not None
    assert (equal.sender.period_s, equal.transmissions) == (0.001, own.events)
