"""A vehicle on paths: missions, circles, the way home."""

import math
from typing import Any

import pytest
from path_bench import HOME, SET_MODE, SPEED, TRIANGLE, PathBench, waypoint
from vehicle_bench import ACCEPTED, START, UAV, of_type

from ftc_autopilot.control.controllers import ReferenceSource
from ftc_autopilot.guidance.path import point_at
from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.constants import AUTO, LOITER, RTL
from mavlink_defs.mission_files import mission_item


@pytest.fixture
def bench(scenario1: Scenario) -> PathBench:
    return PathBench(scenario1)


def test_a_mission_is_flown_from_where_the_aircraft_is(bench: PathBench) -> None:
    bench.put(200.0, 100.0, 90.0)
    assert bench.upload_items((HOME, *TRIANGLE)) == dialect.MAV_MISSION_ACCEPTED
    bench.fly()
    assert bench.command(START) == ACCEPTED
    assert (bench.vehicle.modes.mode, bench.guidance["follows"]) == (AUTO, ReferenceSource.PATH)
    begin = point_at(bench.path.record, 0.0)
    assert (begin.north, begin.east) == (200.0, 100.0)
    assert bench.path.item() == 1


def test_items_are_reached_in_their_turn_and_the_mission_completes(bench: PathBench) -> None:
    speed = mission_item(2, SPEED, (0.0, 45.0, -1.0))
    items = (HOME, TRIANGLE[0], speed, waypoint(3, 3000.0, 3000.0))
    bench.upload_items(items)
    bench.fly()
    bench.command(START)
    path, reported, states = bench.path.record, list[Any](), list[int]()
    for k in range(int(path["count"])):
        reported += bench.go_to(float(path["start"][k]) + 0.1)
        states.append(bench.mission_state())
    assert [m.seq for m in of_type(reported, "MISSION_ITEM_REACHED")] == [1, 3]
    currents = [m.seq for m in of_type(reported, "MISSION_CURRENT")]
    assert [seq for k, seq in enumerate(currents) if currents[k - 1] != seq or k == 0] == [1, 3]
    active, complete = dialect.MISSION_STATE_ACTIVE, dialect.MISSION_STATE_COMPLETE
    assert states == [active] * (len(states) - 1) + [complete]


def test_commands_are_announced_where_they_are_passed_and_downloaded_as_sent(
    bench: PathBench,
) -> None:
    servo = mission_item(2, dialect.MAV_CMD_DO_SET_SERVO, (9.0, 1500.0, 3.0, math.nan), 5, -6, 7.0)
    later = mission_item(3, dialect.MAV_CMD_CONDITION_DELAY, (20.0,))
    camera = mission_item(4, dialect.MAV_CMD_DO_SET_CAM_TRIGG_DIST, (25.0,))
    trigger = mission_item(6, dialect.MAV_CMD_DO_DIGICAM_CONTROL)
    sent = (HOME, TRIANGLE[0], servo, later, camera, waypoint(5, 3000.0, 3000.0), trigger)
    assert bench.upload_items(sent) == dialect.MAV_MISSION_ACCEPTED
    held = bench.vehicle._plan.mission.server.items
    assert [str(item.to_dict()) for item in held[1:]] == [str(item.to_dict()) for item in sent[1:]]
    bench.fly()
    bench.command(START)
    begun = float(bench.path.record["passed"][0])
    assert "item" not in bench.texts(bench.go_to(begun - 1.0))
    assert bench.texts(bench.go_to(begun + 1.0)) == "item 2: DO_SET_SERVO 9 1500 3"
    assert "item" not in bench.texts(bench.go_to(begun - 1.0))  # thrown back by a gust
    assert "item" not in bench.texts(bench.go_to(begun + 799.0))
    told = bench.texts(bench.go_to(begun + 801.0))
    assert told == "item 4: DO_SET_CAM_TRIGG_DIST 25"
    told = bench.texts(bench.go_to(float(bench.path.record["passed"][2]) + 1.0))
    assert told == "item 6: DO_DIGICAM_CONTROL"


def test_a_fence_is_disabled_where_the_mission_says_so(bench: PathBench) -> None:
    disable = mission_item(1, dialect.MAV_CMD_DO_FENCE_ENABLE, (0.0,))
    bench.upload_items((HOME, disable, waypoint(2, 3000.0, 0.0)))
    fence = bench.vehicle._plan.fence
    bench.fly()
    bench.command(START)
    fence._record["enable"] = 1
    assert "fence disabled" in bench.texts(bench.go_to(10.0))
    assert not fence.enabled


def test_what_is_flown_otherwise_is_said_once(bench: PathBench) -> None:
    said: list[str] = []
    bench.vehicle.modes._say = lambda _, text: said.append(text)
    x, y = TRIANGLE[1].x, TRIANGLE[1].y
    bench.upload_items((HOME, TRIANGLE[0], mission_item(2, 82, (), x, y, 100.0)))
    assert said == [
        "mission of 2 items in force",
        "mission: 1 spline or arc flown as waypoint, on a line",
    ]


def test_a_restarted_vehicle_announces_no_command_twice(bench: PathBench) -> None:
    command = mission_item(1, dialect.MAV_CMD_DO_SET_SERVO, (9.0,))
    bench.upload_items((HOME, command, waypoint(2, 3000.0, 0.0)))
    bench.fly()
    bench.command(START)
    assert "item 1" in bench.texts(bench.go_to(10.0))
    mission = bench.vehicle._plan.mission
    mission.resume(mission.server.items, 2)
    assert "item 1" not in bench.texts(bench.go_to(20.0))


def test_a_loop_reaches_its_items_again_and_again(bench: PathBench) -> None:
    jump = mission_item(4, dialect.MAV_CMD_DO_JUMP, (1.0, -1.0))
    bench.upload_items((HOME, *TRIANGLE, jump))
    bench.fly()
    bench.command(START)
    path = bench.path.record
    end, again = float(path["start"][path["count"]]), float(path["start"][path["loop"]])
    reported: list[Any] = []
    s = 0.0
    while s < again + 2.0 * (end - again):
        reported += bench.go_to(s)
        s += 100.0
    reached = [m.seq for m in of_type(reported, "MISSION_ITEM_REACHED")]
    assert reached[:7] == [1, 2, 3, 1, 2, 3, 1]
    assert bench.mission_state() == dialect.MISSION_STATE_ACTIVE


def test_setting_the_current_item_leads_to_it_from_here(bench: PathBench) -> None:
    bench.upload_items((HOME, *TRIANGLE))
    bench.fly()
    bench.command(START)
    bench.put(50.0, 500.0)
    assert bench.command(dialect.MAV_CMD_DO_SET_MISSION_CURRENT, 3.0) == ACCEPTED
    assert set(bench.path.record["item"][: bench.path.record["count"]]) == {3}
    assert point_at(bench.path.record, 0.0).east == 500.0


def test_after_a_pause_the_mission_goes_on_with_its_item(bench: PathBench) -> None:
    bench.upload_items((HOME, *TRIANGLE))
    bench.fly()
    bench.command(START)
    path = bench.path.record
    second = int((path["item"] == 2).argmax())
    bench.go_to(float(path["start"][second]) + 10.0)
    assert bench.command(SET_MODE, 1.0, LOITER) == ACCEPTED
    assert bench.mission_state() == dialect.MISSION_STATE_PAUSED
    assert bench.command(SET_MODE, 1.0, AUTO) == ACCEPTED
    assert bench.path.item() == 2


def test_another_mission_in_flight_is_flown_from_here(bench: PathBench) -> None:
    bench.upload_items((HOME, *TRIANGLE))
    bench.fly()
    bench.command(START)
    bench.put(1000.0, 0.0)
    bench.upload_items((HOME, waypoint(1, 5000.0, -900.0)))
    assert point_at(bench.path.record, 0.0).north == 1000.0
    bench.say(dialect.MAVLink_mission_clear_all_message(UAV, 1, 0))
    assert bench.vehicle.modes.mode == LOITER
    assert bench.guidance["follows"] == ReferenceSource.PATH


def test_loiter_circles_to_the_right_of_where_the_aircraft_is(bench: PathBench) -> None:
    bench.put(700.0, 50.0, 123.0)
    bench.fly()
    assert bench.command(dialect.MAV_CMD_NAV_LOITER_UNLIM) == ACCEPTED
    north, east, radius = bench.circle()
    assert radius > 0.0
    assert (north, east) == pytest.approx((700.0, 50.0 + radius))
    assert bench.path.point().height == 123.0
    bench.put(900.0, 0.0)
    bench.command(SET_MODE, 1.0, LOITER)
    assert bench.circle()[0] == pytest.approx(700.0)  # it goes on


def test_it_returns_home_and_circles_there_at_its_height(bench: PathBench) -> None:
    bench.put(5000.0, 1000.0, 140.0)
    bench.fly()
    assert bench.command(dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH) == ACCEPTED
    assert bench.vehicle.modes.mode == RTL
    assert bench.circle()[:2] == pytest.approx((0.0, 0.0), abs=1e-6)
    assert set(bench.path.record["height"][:3]) == {140.0}


@pytest.mark.parametrize("first", [1, 2])
def test_a_takeoff_at_the_head_is_passed(bench: PathBench, first: int) -> None:
    takeoff = mission_item(1, dialect.MAV_CMD_NAV_TAKEOFF, (15.0, 0.0, 0.0, math.nan), 0, 0, 50.0)
    items = (HOME, takeoff, waypoint(2, 3000.0, 0.0), waypoint(3, 3000.0, 3000.0))
    assert bench.upload_items(items) == dialect.MAV_MISSION_ACCEPTED
    held = bench.vehicle._plan.mission.server.items[1]
    assert (held.command, held.param1, held.z) == (dialect.MAV_CMD_NAV_TAKEOFF, 15.0, 50.0)
    bench.fly()
    bench.command(dialect.MAV_CMD_DO_SET_MISSION_CURRENT, float(first))
    assert bench.command(START) == ACCEPTED
    assert bench.path.item() == 2
    path = bench.path.record
    reported = [m for s in path["start"][: path["count"]] for m in bench.go_to(float(s) + 0.1)]
    assert [m.seq for m in of_type(reported, "MISSION_ITEM_REACHED")] == [2, 3]


def test_a_mission_that_cannot_be_flown_is_refused_and_the_old_one_stays(bench: PathBench) -> None:
    bench.upload_items((HOME, *TRIANGLE))
    far = mission_item(1, dialect.MAV_CMD_NAV_LOITER_UNLIM, (0.0, 0.0, 1e9), 1, 1, 100.0)
    assert bench.upload_items((HOME, far)) == dialect.MAV_MISSION_INVALID_PARAM3
    land = mission_item(1, dialect.MAV_CMD_NAV_LAND)
    assert bench.upload_items((HOME, land)) == dialect.MAV_MISSION_UNSUPPORTED
    mixed = mission_item(2, dialect.MAV_CMD_FTC_REFERENCE_SEGMENT)
    assert bench.upload_items((HOME, TRIANGLE[0], mixed)) == dialect.MAV_MISSION_UNSUPPORTED
    assert len(bench.vehicle._plan.mission.server.items) == 4
    assert len(bench.path.items) == 4
