"""A vehicle whose process was started again resumes from its checkpoint."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from vehicle_bench import ACCEPTED, ARM, START, UAV, Bench, of_type

from ftc_autopilot.control.reference import profile_record, profile_segments
from ftc_autopilot.hot.checkpoint import save
from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.constants import AUTO
from mavlink_defs.float32 import decimal_of_float32
from mavlink_defs.profile import Segment, segments_to_items


def angle(limit: float) -> st.SearchStrategy[float]:
    return st.integers(int(-limit * 1e7), int(limit * 1e7)).map(lambda n: n / 1e7)


def float32(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, width=32).map(decimal_of_float32)


@given(
    st.lists(
        st.builds(
            Segment,
            float32(0.0, 1e6),
            float32(0.0, 100.0),
            angle(90.0),
            angle(89.9),
            float32(-180.0, 180.0),
            st.booleans(),
        ),
        max_size=50,
    )
)
def test_a_kept_profile_is_the_mission_that_was_uploaded(segments: list[Segment]) -> None:
    kept = profile_segments(profile_record(tuple(segments)))
    uploaded, reported = (
        [
            (*map(np.float32, (i.param1, i.param2, i.param3, i.param4)), i.x, i.y)
            for i in segments_to_items(profile, UAV, 1)
        ]
        for profile in (segments, kept)
    )
    assert reported == uploaded
    again = profile_record(kept)
    assert math.isclose(
        float(np.abs(again["value"] - profile_record(tuple(segments))["value"]).max()),
        0.0,
        abs_tol=1e-12,
    )


class Process(Bench):
    """One process of a vehicle with a file."""

    def __init__(self, scenario: Scenario, path: Path) -> None:
        super().__init__(scenario, checkpoint=path)
        if self.resumes:
            self.vehicle.resume(self.autopilots.own[0]["vehicle"])

    def save(self) -> None:
        autopilots = self.autopilots
        self.vehicle.save(autopilots.own[0]["vehicle"])
        save(autopilots.checkpoint, autopilots.own, autopilots.edges)

    def reported(self) -> list[str]:
        self.now += 1.0
        self.vehicle.handle_timer(self.now)
        return [text.text for text in of_type(self.vehicle.gcs_messages(), "STATUSTEXT")]

    def downloaded(self) -> list[tuple[float, ...]]:
        (count,) = of_type(
            self.say(dialect.MAVLink_mission_request_list_message(UAV, 1)), "MISSION_COUNT"
        )
        items: list[tuple[float, ...]] = []
        for seq in range(count.count):
            request = dialect.MAVLink_mission_request_int_message(UAV, 1, seq)
            (item,) = of_type(self.say(request), "MISSION_ITEM_INT")
            items.append((item.param1, item.param2, item.param3, item.param4, item.x, item.y))
        return items


def test_profile_mode_arming_and_parameters_come_back(scenario1: Scenario, tmp_path: Path) -> None:
    first = Process(scenario1, tmp_path / "checkpoint")
    assert first.upload(scenario1) == dialect.MAV_MISSION_ACCEPTED
    first.say(dialect.MAVLink_param_set_message(UAV, 1, b"K1_ROLL", 42.5, 9))
    assert first.command(START) == ACCEPTED
    assert first.command(ARM, 1.0) == ACCEPTED
    first.run()
    first.hot.step = 9_000
    first.hot.measured["time_usec"] = 9_000_000
    first.controllers.uavs["controller"]["events"] = (5, 6, 7, 8)
    first.reported()
    first.save()

    second = Process(scenario1, tmp_path / "checkpoint")
    assert (second.vehicle.modes.mode, second.vehicle.modes.armed) == (AUTO, True)
    assert second.downloaded() == first.downloaded()
    assert second.vehicle._plan.mission.server.current == first.vehicle._plan.mission.server.current
    (value,) = of_type(
        second.say(dialect.MAVLink_param_request_read_message(UAV, 1, b"K1_ROLL", -1)),
        "PARAM_VALUE",
    )
    assert value.param_value == pytest.approx(42.5)
    events: Any = second.vehicle.telemetry[0].make(dialect.MAVLINK_MSG_ID_FTC_EVENTS)
    assert events.events == [5, 6, 7, 8]

    second.run()
    second.hot.measured["time_usec"] = 9_400_000
    text = "".join(second.reported())
    assert "autopilot restarted" in text
    assert "the flight of 9.000 s, 0.400 s old" in text
    assert "restarted" not in "".join(second.reported())


def test_before_the_start_there_is_no_flight_to_restore(
    scenario1: Scenario, tmp_path: Path
) -> None:
    first = Process(scenario1, tmp_path / "checkpoint")
    first.upload(scenario1)
    first.save()
    second = Process(scenario1, tmp_path / "checkpoint")
    assert not second.vehicle.modes.armed
    text = "".join(second.reported())
    assert "restored" in text
    assert "flight of" not in text


def test_with_another_plant_only_the_profile_stays(scenario1: Scenario, tmp_path: Path) -> None:
    first = Process(scenario1, tmp_path / "checkpoint")
    first.upload(scenario1)
    first.command(ARM, 1.0)
    first.run()
    first.save()
    second = Process(scenario1, tmp_path / "checkpoint")
    assert second.vehicle.modes.armed
    second.vehicle.restart()  # as the process does when the plant's run differs from the kept one
    assert not second.vehicle.modes.armed
    text = "".join(second.reported())
    assert len(second.downloaded()) == len(scenario1.segments()) + 1
    assert "plant restarted" in text
    assert "restored" not in text
