"""The clock of telemetry: simulated time, never faster than the wall clock in lockstep."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from vehicle_bench import Bench, of_type

from ftc_autopilot.config import TelemetryClockKind
from ftc_autopilot.vehicle.telemetry_clock import TelemetryClock
from gcs.scenario.model import Scenario
from mavlink_defs.dialect import FTC_SIM_FLAGS_LOCKSTEP, FTC_SIM_FLAGS_RUNNING

REAL_TIME = FTC_SIM_FLAGS_RUNNING
LOCKSTEP = FTC_SIM_FLAGS_RUNNING | FTC_SIM_FLAGS_LOCKSTEP


def passed_s(bench: Bench, kind: TelemetryClockKind, flags: int, speed: float) -> float:
    """Seconds on the clock in 10 s of wall time, at a ratio of simulated to wall-clock time."""
    clock = TelemetryClock(kind, bench.hot)
    clock.read_us(1000.0)  # frozen
    bench.run(flags)
    bench.hot.measured["time_usec"] = 0
    begin_us = clock.read_us(1000.0)
    for turn in range(1, 501):
        bench.hot.measured["time_usec"] = round(turn * 0.02e6 * speed)
        end_us = clock.read_us(1000.0 + 0.02 * turn)
    return (end_us - begin_us) * 1e-6


@pytest.mark.parametrize(
    ("kind", "flags", "speed", "expected_s"),
    [
        ("wall", LOCKSTEP, 20.0, 10.0),
        ("wall", LOCKSTEP, 0.1, 1.0),
        ("simulated", LOCKSTEP, 20.0, 200.0),
        ("wall", REAL_TIME, 20.0, 200.0),
        ("simulated", REAL_TIME, 0.1, 1.0),
    ],
)
def test_which_time_counts(
    kind: TelemetryClockKind, flags: int, speed: float, expected_s: float, scenario1: Scenario
) -> None:
    assert passed_s(Bench(scenario1), kind, flags, speed) == pytest.approx(expected_s)


@given(
    turns=st.lists(
        st.tuples(st.floats(0.0, 0.1), st.integers(-(10**6), 10**6), st.sampled_from([0, LOCKSTEP]))
    )
)
def test_it_never_goes_faster_than_the_wall_clock_nor_back(
    turns: list[tuple[float, int, int]], scenario1: Scenario
) -> None:
    """Whatever simulated time does: a plant that starts again begins at 0."""
    bench = Bench(scenario1)
    clock = TelemetryClock("wall", bench.hot)
    now, time_us = 1000.0, 0
    readings = [(now, clock.read_us(now))]
    for wall_s, simulated_us, flags in turns:
        now, time_us = now + wall_s, max(time_us + simulated_us, 0)
        bench.run(flags)
        bench.hot.measured["time_usec"] = time_us
        readings.append((now, clock.read_us(now)))
    assert all(after >= before for (_, before), (_, after) in pairwise(readings))
    assert all(reading <= round(at * 1e6) for at, reading in readings)


def test_a_fast_flight_sends_no_more_than_a_slow_one(scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    bench.vehicle.handle_timer(0.0)
    bench.vehicle.gcs_messages()
    bench.run(LOCKSTEP)
    count = 0
    for turn in range(1, 51):  # a second of wall time, twenty of simulated time
        bench.hot.measured["time_usec"] = turn * 400_000
        bench.vehicle.handle_timer(0.02 * turn)
        count += len(of_type(bench.vehicle.gcs_messages(), "ATTITUDE"))
    assert count == 10


@pytest.mark.parametrize(("speed", "expected_s"), [(20.0, 0.1), (1.0, 0.1), (0.25, 0.4)])
def test_it_expects_to_go_on_as_fast_as_it_went(
    speed: float, expected_s: float, scenario1: Scenario
) -> None:
    bench = Bench(scenario1)
    clock = TelemetryClock("wall", bench.hot)
    bench.run(LOCKSTEP)
    bench.hot.measured["time_usec"] = 0
    clock.read_us(1000.0)
    bench.hot.measured["time_usec"] = round(speed * 1e6)
    read_us = clock.read_us(1001.0)
    assert clock.wait_s(read_us + 100_000) == pytest.approx(expected_s)
    assert clock.wait_s(read_us - 1) == 0.0
