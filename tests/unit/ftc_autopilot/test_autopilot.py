"""When an autopilot turns to its services: by the clock of telemetry in lockstep."""

import time
from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from ftc_autopilot.autopilot import Autopilot
from ftc_autopilot.hot.state import new_autopilots
from gcs.scenario.model import Scenario
from mavlink_defs.dialect import FTC_SIM_FLAGS_LOCKSTEP, FTC_SIM_FLAGS_RUNNING
from mavlink_defs.endpoint import UdpAddress, bind_udp, connect_udp

ANY_PORT = UdpAddress("127.0.0.1", 0)


@pytest.fixture
def autopilot(scenario1: Scenario) -> Iterator[Autopilot]:
    """One in a lockstep flight, whose plant sends nothing."""
    with ExitStack() as stack:
        plant, formation, gcs = (
            stack.enter_context(bind_udp(ANY_PORT, "test")) for _ in ("plant", "formation", "gcs")
        )
        to_plant = stack.enter_context(connect_udp(UdpAddress(*plant.getsockname())))
        config = scenario1.autopilot_config(scenario1.uavs[0].id)
        autopilot = Autopilot(
            config, new_autopilots([config]), to_plant, formation, gcs, None, None
        )
        autopilot._hot.flags = FTC_SIM_FLAGS_RUNNING | FTC_SIM_FLAGS_LOCKSTEP
        autopilot._hot.heard_s = time.monotonic()
        yield autopilot


def wait_s(autopilot: Autopilot, simulated_s: float) -> float:
    """Let simulated time pass between two turns; return the time until the next one [s]."""
    autopilot._handle_messages()
    autopilot._hot.measured["time_usec"] += round(simulated_s * 1e6)
    autopilot._handle_messages()
    before_s = time.monotonic()
    return autopilot.until_s() - before_s


def test_a_flight_as_fast_as_the_clock_turns_when_telemetry_is_due(autopilot: Autopilot) -> None:
    assert wait_s(autopilot, simulated_s=100.0) <= 0.201  # the next but one tenth of a second


def test_a_slow_flight_does_not_look_before_telemetry_is_due(autopilot: Autopilot) -> None:
    assert wait_s(autopilot, simulated_s=0.0) >= 0.499
