"""A vehicle whose mission, fence and rally points meet: where RTL leads, and what is outside."""

from pathlib import Path
from typing import Any

import pytest
from fence_bench import (
    AROUND,
    CIRCLE,
    ENABLE,
    FENCE,
    ORIGIN,
    RALLY,
    RALLY_POINT,
    SET_HOME,
    SET_MODE,
    FenceBench,
    item,
    texts,
)
from vehicle_bench import ACCEPTED, START, UAV
from vehicle_requests import second_process

from ftc_autopilot.common.geography import place_of
from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.constants import AUTO, LOITER, RTL
from mavlink_defs.mission_files import mission_item
from mavlink_defs.services.mission import MissionItem


@pytest.fixture
def bench(scenario1: Scenario) -> FenceBench:
    return FenceBench(scenario1)


@pytest.fixture
def fenced(bench: FenceBench) -> FenceBench:
    bench.fly_fenced()
    return bench


def test_rtl_leads_to_the_nearest_rally_point(bench: FenceBench) -> None:
    points = (
        item(0, RALLY_POINT, 4000.0, 0.0, height=80.0),
        item(1, RALLY_POINT, 0.0, 3000.0, height=120.0),
    )
    assert bench.upload_type(RALLY, points) == (ACCEPTED, "2 rally points in force\n")
    bench.fly()

    def flown() -> tuple[float, float, float]:
        bench.command(SET_MODE, 1.0, LOITER)
        bench.command(SET_MODE, 1.0, RTL)
        return bench.goal()

    bench.position(0.0, 1000.0)
    assert flown() == (0, 3000, 120)
    bench.position(3000.0, 0.0)
    assert flown() == (4000, 0, 80)
    bench.position(1500.0, 100.0)
    assert flown() == (4000, 0, 80)
    bench.set(RALLY_INCL_HOME=1)
    assert flown() == (0, 0, 100)
    bench.set(RALLY_INCL_HOME=0, RALLY_LIMIT_KM=2)
    assert flown() == (0, 0, 100)
    bench.set(RALLY_LIMIT_KM=0)
    bench.position(-50_000.0, 0.0)
    assert flown() == (0, 3000, 120)


def test_a_rally_point_outside_the_fence_is_not_used(fenced: FenceBench) -> None:
    points = (
        item(0, RALLY_POINT, 1500.0, 0.0, height=80.0),
        item(1, RALLY_POINT, -900.0, 0.0, height=80.0),
    )
    said = fenced.upload_type(RALLY, points)[1]
    assert "rally point 0 is outside the fence, not used while that is enabled\n" in said
    assert "the circle around rally point 1, 449 m, leaves the fence\n" in said
    assert "home" not in said
    assert "RTL leads to rally point 1\n" in fenced.put(1001.0)
    assert fenced.goal() == (-900, 0, 80)
    fenced.command(ENABLE, 0.0)
    fenced.command(SET_MODE, 1.0, LOITER)
    fenced.command(SET_MODE, 1.0, RTL)
    assert fenced.goal() == (1500, 0, 80)


def mission(height: float = 100.0) -> list[MissionItem]:
    places = ((800.0, 0.0), (800.0, 1500.0))
    items = [
        item(seq, dialect.MAV_CMD_NAV_WAYPOINT, *place, height=height)
        for seq, place in enumerate(places, start=1)
    ]
    return [mission_item(0, 16), *items]


def test_a_mission_that_leaves_the_fence_is_taken_and_told(fenced: FenceBench) -> None:
    told = "the mission leaves the fence on the way to item 2\n"
    result, said = fenced.upload_type(dialect.MAV_MISSION_TYPE_MISSION, mission())
    assert (result, told in said) == (ACCEPTED, True)
    assert fenced.upload_type(FENCE, (item(0, CIRCLE, 0.0, 0.0, 9000.0),))[1].count("leaves") == 0
    assert told in fenced.upload_type(FENCE, AROUND)[1]


def test_home_moved_outside_is_told(fenced: FenceBench) -> None:
    latitude, longitude = (x / 1e7 for x in place_of(ORIGIN, 2000.0, 0.0, 0.0)[:2])
    place = (0.0, 0.0, 0.0, 0.0, latitude, longitude, 584.0)
    answers = fenced.say(dialect.MAVLink_command_long_message(UAV, 1, SET_HOME, 0, *place))
    assert "home is outside the fence\n" in texts(answers)


def test_home_may_be_below_the_least_height(bench: FenceBench) -> None:
    bench.set(FENCE_TYPE=8, FENCE_ALT_MIN=50)
    latitude, longitude = (x / 1e7 for x in place_of(ORIGIN, 10.0, 0.0, 0.0)[:2])
    place = (0.0, 0.0, 0.0, 0.0, latitude, longitude, 584.0)
    answers = bench.say(dialect.MAVLink_command_long_message(UAV, 1, SET_HOME, 0, *place))
    assert texts(answers) == "home set\n"


def test_a_second_process_flies_on_what_the_fence_has_begun(
    fenced: FenceBench, scenario1: Scenario, tmp_path: Path
) -> None:
    fenced.set(FENCE_TYPE=5, FENCE_ALT_MAX=150)
    fenced.put(1001.0)
    second = second_process(fenced, scenario1, tmp_path)
    second.run()
    second.hot.step = fenced.hot.step + 1000
    second.hot.measured["position"] = (1001.0, 0.0, -160.0)
    second.vehicle.handle_timer(second.now + 1.0)
    assert "above 150 m; goes on in RTL" in texts(second.vehicle.gcs_messages())


def test_a_second_process_has_fence_rally_points_and_the_breach(
    fenced: FenceBench, scenario1: Scenario, tmp_path: Path
) -> None:
    assert fenced.upload_items(mission()) == ACCEPTED
    fenced.upload_type(RALLY, (item(0, RALLY_POINT, 500.0, 0.0, height=60.0),))
    fenced.set(FENCE_ACTION=4, RALLY_LIMIT_KM=7)
    fenced.command(START)
    fenced.put(1001.0)
    fenced.command(SET_MODE, 1.0, AUTO)
    before, _ = fenced.vehicle.mission_checkpoint()
    second = second_process(fenced, scenario1, tmp_path)
    plan = second.vehicle._plan
    assert len(plan.mission.server.items) == 3
    assert [i.command for i in plan.fence.server.items] == [CIRCLE]
    assert [i.command for i in plan.rally.server.items] == [RALLY_POINT]
    values = {p.name: p.get() for p in second.vehicle._params._parameters}
    assert (values["FENCE_ENABLE"], values["FENCE_ACTION"]) == (1.0, 4.0)
    assert values["RALLY_LIMIT_KM"] == 7.0
    second.run()
    second.hot.step = fenced.hot.step + 1000
    second.hot.measured["position"] = (1100.0, 0.0, -100.0)
    second.vehicle.handle_timer(second.now + 1.0)
    assert second.vehicle.modes.mode == AUTO
    status: Any = second.vehicle.telemetry[0].make(dialect.MAVLINK_MSG_ID_FENCE_STATUS)
    assert (status.breach_status, status.breach_count) == (1, 1)
    fenced.put(0.0)
    assert fenced.vehicle.mission_checkpoint()[0] != before


def test_a_circle_around_home_that_leaves_the_fence_is_told(bench: FenceBench) -> None:
    said = bench.upload_type(FENCE, (item(0, CIRCLE, 100.0, 0.0, 500.0),))[1]
    assert said.endswith("the circle around home, 449 m, leaves the fence\n")
    assert "circle around" not in bench.upload_type(FENCE, AROUND)[1]
