"""Flights of both laws that diagnose: what nobody has said, and what only a dither shows."""

from typing import Any

import numpy as np
import pytest

from benchmarks import bad_links
from benchmarks.fault_families import HARDWARE, UAV, scenario_with
from ftc_autopilot.common.phases import LOST
from gcs.fleet.in_process import fly_in_process
from gcs.results.recording import Recording
from mavlink_defs.capture.impairment import Impairment
from mavlink_defs.constants import ACTUATORS

pytestmark = pytest.mark.slow

LAWS = ("surviving", "tube")


def declared(flight: Recording) -> list[tuple[int, str]]:
    """UAV and name of each actuator that was ever declared lost."""
    lost = (flight.signals["phase"] == LOST).any(axis=0)
    return [
        (uav, name)
        for i, uav in enumerate(flight.uav_ids)
        for c, name in enumerate(ACTUATORS)
        if lost[i, c]
    ]


def attitude_errors(flight: Recording, after_s: float = 1.0) -> np.ndarray:
    """Largest errors of roll, pitch and yaw after a time [deg], shape (n, 3)."""
    errors = np.abs(flight.error("reference")[flight.time_s > after_s][..., 1:])
    return np.asarray(np.degrees(errors).max(axis=0))


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(
    "stuck",
    [
        {"actuator": "aileron", "stuck_deg": 0.0},
        {"actuator": "elevator", "stuck_deg": 0.0},
        {"actuator": "rudder", "stuck_deg": 12.0},
        {"actuator": "throttle", "stuck_n": 800.0},
    ],
    ids=lambda stuck: stuck["actuator"],
)
@pytest.mark.parametrize("start_s", [0.0, 0.1])
def test_what_is_stuck_from_the_start_is_found_within_a_second(
    law: str, stuck: dict[str, Any], start_s: float
) -> None:
    fault = {"uav": UAV, "start_s": start_s} | stuck
    flight = fly_in_process(scenario_with(law, "realistic", [fault], {"duration_s": 3.0}))
    i, c = flight.uav_ids.index(UAV), ACTUATORS.index(stuck["actuator"])
    found = flight.time_s[flight.signals["phase"][:, i, c] == LOST]
    assert found[0] - start_s < 1.0
    assert declared(flight) == [(UAV, stuck["actuator"])]
    assert attitude_errors(flight, 0.0).max() < 45.0


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("surface", ["aileron", "elevator", "rudder"])
@pytest.mark.parametrize("frequency_hz", [0.8, 2.5])
def test_a_surface_that_works_and_swings_is_not_given_up(
    law: str, surface: str, frequency_hz: float
) -> None:
    """The loop counteracts the swing, so that the surface hardly moves while its command does."""
    fault = {"uav": UAV, "actuator": surface, "bias_deg": 4.0, "start_s": 3.0}
    fault["frequency_hz"] = frequency_hz
    flight = fly_in_process(scenario_with(law, "ideal", [fault], {"duration_s": 10.0}))
    assert declared(flight) == []
    assert attitude_errors(flight).max() < 5.0


@pytest.mark.parametrize(
    ("law", "surface", "frequency_hz"),
    [("surviving", "aileron", 3.456), ("tube", "aileron", 6.715), ("tube", "elevator", 5.084)],
)
def test_what_is_stuck_and_swings_is_found_before_it_overturns_the_aircraft(
    law: str, surface: str, frequency_hz: float
) -> None:
    """It may pass for a surface that works; then the law's command ends at its stop."""
    fault = {"uav": UAV, "actuator": surface, "stuck_deg": 5.0, "start_s": 3.0}
    fault["frequency_hz"] = frequency_hz
    flight = fly_in_process(scenario_with(law, "ideal", [fault], {"duration_s": 10.0}))
    assert flight.loss is None
    assert declared(flight) == [(UAV, surface)]
    assert attitude_errors(flight)[:, :2].max() < 90.0


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("hardware", HARDWARE)
@pytest.mark.parametrize(
    "late",
    [
        {"servos": {"surfaces": {"dead_time_s": 0.02}}},
        {"sensors": {"gyro_deg_s": {"latency_s": 0.02}}},
        {"servos": {"surfaces": {"dead_time_s": 0.04}}, "controller": {"delay_s": 0.04}},
        {"servos": {"throttle": {"dead_time_s": 0.1}}},
    ],
    ids=["servos, nobody says", "gyro, nobody says", "servos, as known", "throttle"],
)
def test_what_comes_late_is_no_fault(law: str, hardware: str, late: dict[str, Any]) -> None:
    flight = fly_in_process(scenario_with(law, hardware, [], late | {"duration_s": 12.0}))
    assert flight.loss is None
    assert declared(flight) == []
    errors = attitude_errors(flight)
    assert errors[:, 0].max() < 5.0  # roll
    assert errors.max() < 10.0  # what is left after a second of what was late at first


@pytest.mark.parametrize("law", LAWS)
def test_an_autopilot_that_stood_still_blames_nobody(
    law: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In real time its states are lost meanwhile, and it goes on from the newest."""
    stopped = ((2.0, 2.15), (2.6, 3.2))

    class Direction(bad_links._Direction):
        def __init__(self, impairment: Impairment, name: str) -> None:
            super().__init__(impairment, name)
            self._name = name

        def send(self, payload: np.void, now_s: float) -> None:
            still = any(begin <= now_s < end for begin, end in stopped)
            if not (still and self._name == f"states {UAV}"):
                super().send(payload, now_s)

    monkeypatch.setattr(bad_links, "_Direction", Direction)
    flight = bad_links.fly_over(
        scenario_with(law, "realistic", [], {"duration_s": 4.5}), Impairment()
    )
    assert declared(flight) == []


@pytest.mark.parametrize("law", LAWS)
def test_a_rudder_that_is_free_again_is_back_at_once(law: str) -> None:
    """Each tenth of a second costs two degrees of heading."""
    fault = {"uav": UAV, "actuator": "rudder", "stuck_deg": 0.0, "start_s": 4.0, "end_s": 5.0}
    flight = fly_in_process(scenario_with(law, "realistic", [fault], {"duration_s": 8.0}))
    i, c = flight.uav_ids.index(UAV), ACTUATORS.index("rudder")
    lost = flight.time_s[flight.signals["phase"][:, i, c] == LOST]
    assert lost[0] < 4.3
    assert 5.0 < lost[-1] < 5.35
    assert attitude_errors(flight)[i, 2] < 60.0
