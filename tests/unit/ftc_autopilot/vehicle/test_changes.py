"""What a vehicle announces when sensors and actuators come and go in any order: true, and bounded.

Every property holds for what stations receive, not for what a service yields.
"""

import re
from collections import defaultdict
from collections.abc import Iterator
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from vehicle_bench import Bench, of_type

from ftc_autopilot.estimation.health import INCONSISTENT, NOISY, REASONS, SILENT, STUCK, WELL
from gcs.scenario.model import Scenario, load_scenario
from mavlink_defs.constants import ACTUATORS, BAROMETER, GNSS, MAGNETOMETER, PITOT

SENSORS = {MAGNETOMETER: "magnetometer", BAROMETER: "barometer", PITOT: "pitot", GNSS: "GNSS"}
SECOND = 1_000_000
reasons = st.sampled_from([WELL, WELL, SILENT, STUCK, INCONSISTENT, NOISY])
moments = st.tuples(
    st.integers(0, 3).map(lambda tenths: tenths * 100_000 + 10_000),  # time that passes [µs]
    st.tuples(reasons, reasons),
    st.sampled_from(sorted(SENSORS)),
    reasons,
    st.integers(0, len(ACTUATORS) - 1),
    st.booleans(),
)
Moment = tuple[int, tuple[int, int], int, int, int, bool]


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    laws = {"kind": "surviving"}
    tree = load_scenario("paper/scenario1").model_dump()
    return Scenario.model_validate({**tree, "controller": laws, "navigation": "estimated"})


def texts_of(bench: Bench) -> list[str]:
    texts: list[str] = []
    for chunk in of_type(bench.vehicle.gcs_messages(), "STATUSTEXT"):
        if chunk.chunk_seq == 0:
            texts.append("")
        texts[-1] += chunk.text
    return texts


class Trembling:
    """A vehicle whose sensors and actuators are excluded and taken back, as a test says."""

    def __init__(self, scenario: Scenario) -> None:
        self.bench = Bench(scenario)
        self.time_us = 20 * SECOND
        self.report = self.bench.hot.navigation["estimator"]["report"]
        self.diagnosis = self.bench.controllers.uavs[0]["controller"]["surviving"]["diagnosis"]
        self.diagnosis["age"], self.report["aligned"] = 20.0, 1
        self.bench.run()
        self.heard()

    def heard(self) -> list[str]:
        self.bench.hot.measured["time_usec"] = self.time_us
        self.bench.now += 0.01
        self.bench.vehicle.handle_timer(self.bench.now)
        return texts_of(self.bench)

    def note(self, moment: Moment) -> None:
        passed_us, imus, sensor, reason, actuator, lost = moment
        self.time_us += passed_us
        self.report["imu_reasons"][:2] = imus
        if WELL in imus and imus[int(self.report["imu"])] != WELL:
            self.report["imu"] = imus.index(WELL)
        self.report["reasons"][sensor] = reason
        self.diagnosis["actuators"][actuator]["lost"] = lost

    def fly(self, flown: list[Moment]) -> Iterator[str]:
        """Yield each text when it comes; at the end, those of the next second of quiet."""
        for moment in flown:
            self.note(moment)
            yield from self.heard()
        self.time_us += SECOND
        yield from self.heard()


def subject_of(text: str) -> str:
    found = re.match(r"(IMU \d|\w+)", text)
    assert found, text
    return found[1]


@settings(max_examples=40, deadline=None)
@given(flown=st.lists(moments, max_size=25))
def test_a_subject_has_one_text_a_second_and_the_last_one_is_how_it_is(
    scenario: Scenario, flown: list[Moment]
) -> None:
    vehicle = Trembling(scenario)
    last: dict[str, str] = {}
    told: dict[str, list[int]] = defaultdict(list)
    for text in vehicle.fly(flown):
        last[subject_of(text)] = text
        told[subject_of(text)].append(vehicle.time_us)
    for subject, times in told.items():
        gaps = [after - before for before, after in pairwise(times)]
        assert all(gap >= SECOND for gap in gaps), (subject, times)
    states = {f"IMU {k + 1}": int(vehicle.report["imu_reasons"][k]) for k in range(2)}
    for subject, reason in states.items():
        if subject in last:
            assert ("back in use" in last[subject]) == (reason == WELL)
            assert reason == WELL or f": {REASONS[reason]}, " in last[subject]
    for sensor, name in SENSORS.items():
        if name in last:
            well = vehicle.report["reasons"][sensor] == WELL
            assert ("back in use" in last[name]) == well
    for actuator, name in enumerate(ACTUATORS):
        if name in last:
            lost = bool(vehicle.diagnosis["actuators"][actuator]["lost"])
            assert (f"{name} lost" in last[name]) == lost


@settings(max_examples=30, deadline=None)
@given(flown=st.lists(moments, max_size=25))
def test_no_text_says_that_an_excluded_imu_is_flown_by(
    scenario: Scenario, flown: list[Moment]
) -> None:
    for text in Trembling(scenario).fly(flown):
        found = re.match(r"IMU (\d) excluded .*flying by IMU (\d)", text)
        assert found is None or found[1] != found[2], text


def test_when_no_imu_is_left_the_text_says_so(scenario: Scenario) -> None:
    vehicle = Trembling(scenario)
    vehicle.note((0, (NOISY, WELL), GNSS, WELL, 0, False))
    assert vehicle.heard() == ["IMU 1 excluded at 20.00 s: noisy, flying by IMU 2"]
    vehicle.note((0, (NOISY, STUCK), GNSS, WELL, 0, False))
    assert vehicle.heard() == [
        "IMU 2 excluded at 20.00 s: stuck, no IMU passes its test, IMU 2 is the best"
    ]


def test_what_alternates_is_counted_and_a_flight_that_ends_leaves_nothing_out(
    scenario: Scenario,
) -> None:
    vehicle = Trembling(scenario)
    heard = []
    for tenth in range(25):
        vehicle.note((100_000, (WELL, WELL), GNSS, SILENT if tenth % 2 == 0 else WELL, 0, False))
        heard += vehicle.heard()
    assert heard == [
        "GNSS excluded at 20.10 s: silent, dead reckoning",
        "GNSS excluded at 21.10 s: silent, dead reckoning (10 changes since the last text)",
        "GNSS excluded at 22.10 s: silent, dead reckoning (10 changes since the last text)",
    ]
    vehicle.bench.vehicle.farewell("the end")
    assert texts_of(vehicle.bench) == [
        "GNSS excluded at 22.50 s: silent, dead reckoning (4 changes since the last text)",
        "the end",
    ]
