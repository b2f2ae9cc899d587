"""The chapters of a soak: valid for any seed, and the same for the same one."""

from dataclasses import replace
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from gcs.fleet.in_process import fly_in_process
from gcs.results.summary import summarise
from mavlink_defs.capture.tap_report import ChannelReport, TapReport, UavReport
from mavlink_defs.constants import ACTUATORS
from mavlink_defs.dialect import MAVLink_ftc_events_message
from soak.__main__ import differences
from soak.chapters import chapter


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32), st.integers(1, 1000), st.integers(2, 12))
def test_every_seed_gives_chapters_and_the_same_again(seed: int, number: int, uavs: int) -> None:
    drawn = chapter(seed, number, uavs, 5.0)
    assert drawn == chapter(seed, number, uavs, 5.0)
    assert len(drawn.scenario.uavs) == uavs
    assert all(0 < step <= 2500 for steps in drawn.crashes.values() for step in steps)


def test_another_seed_gives_another_story() -> None:
    assert chapter(1, 1, 3, 5.0).scenario != chapter(2, 1, 3, 5.0).scenario
    assert chapter(1, 1, 3, 5.0).scenario != chapter(1, 2, 3, 5.0).scenario


def test_one_event_more_or_less_anywhere_is_found() -> None:
    drawn = replace(chapter(3, 1, 2, 0.2), crashes={}, lossy=False)
    flight = fly_in_process(drawn.scenario)
    summary = summarise(flight, drawn.scenario)
    reported: dict[int, Any] = {}
    captured = []
    for uav in summary.uavs:
        events = [uav.channels[name].events for name in ACTUATORS]
        reported[uav.id] = MAVLink_ftc_events_message(
            200, uav.active_steps, events, [0] * 4, uav.actuator_messages, [0] * 4, 0
        )
        channels = {
            str(n): ChannelReport(k, None, None) for n, k in zip(ACTUATORS, events, strict=True)
        }
        captured.append(
            UavReport("plant", uav.id, False, 200, None, uav.actuator_messages, 0, channels)
        )
    wire = TapReport(0.2, (), (), tuple(captured), None)
    assert differences(drawn, flight, summary, wire, reported) == []

    reported[1].events[2] += 1
    (difference,) = differences(drawn, flight, summary, wire, reported)
    assert difference.startswith("UAV 1: events of the rudder")
    reported[1].events[2] -= 1
    reported[2].steps -= 1
    assert "steps" in differences(drawn, flight, summary, wire, reported)[0]
    reported[2].steps += 1
    crashed = replace(drawn, crashes={1: [5]})
    assert "restarts" in differences(crashed, flight, summary, wire, reported)[0]
    faulty = {(fault.uav, fault.actuator) for fault in drawn.scenario.actuator_faults}
    c = next(c for c, name in enumerate(ACTUATORS) if (2, name) not in faulty)
    applied = flight.applied.copy()
    applied[100, 1, c] = np.nextafter(applied[100, 1, c], 1.0)
    wrong = replace(flight, applied=applied)
    (difference,) = differences(drawn, wrong, summary, wire, reported)
    assert "step 100" in difference
