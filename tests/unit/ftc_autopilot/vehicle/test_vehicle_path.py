"""A vehicle on paths: missions, circles, the way home, and places that a station sends."""

import math
from typing import Any

import pytest
from vehicle_bench import ACCEPTED, ARM, DENIED, START, UAV, Bench, of_type

from ftc_autopilot.common.geography import Origin, place_of
from ftc_autopilot.control.controllers import ReferenceSource
from ftc_autopilot.guidance.path import point_at
from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.constants import AUTO, GUIDED, INT32_MAX, LOITER, RTL
from mavlink_defs.mission_files import mission_item
from mavlink_defs.services.mission import MissionItem

ORIGIN = Origin()
SET_MODE = dialect.MAV_CMD_DO_SET_MODE
WAYPOINT, SPEED = dialect.MAV_CMD_NAV_WAYPOINT, dialect.MAV_CMD_DO_CHANGE_SPEED
HOME = mission_item(0, WAYPOINT)
PLACE = (-353500000, 1491652370)


def waypoint(seq: int, north: float, east: float, height: float = 100.0) -> MissionItem:
    place = place_of(ORIGIN, north, east, 0.0)[:2]
    return mission_item(seq, WAYPOINT, (), *place, height)


TRIANGLE = (waypoint(1, 3000.0, 0.0), waypoint(2, 3000.0, 3000.0), waypoint(3, 0.0, 3000.0))


class PathBench(Bench):
    """A bench whose aircraft is where it is put."""

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        self.path = self.vehicle.modes.path
        self.guidance = self.controllers.uavs[0]["guidance"]
        self.put(0.0, 0.0)

    def put(self, north: float, east: float, height: float = 100.0) -> None:
        self.hot.measured["position"] = (north, east, -height)

    def fly(self) -> None:
        """Arm, and let simulated time run."""
        assert self.command(ARM, 1.0) == ACCEPTED
        self.run()

    def go_to(self, s: float) -> list[Any]:
        """Put the aircraft on its path; return what the vehicle tells."""
        self.guidance["path_position"] = s
        point = point_at(self.path.record, s)
        self.put(point.north, point.east, point.height)
        self.now += 1.0
        self.vehicle.handle_timer(self.now)
        return self.vehicle.gcs_messages()

    def mission_state(self) -> int:
        current: Any = self.vehicle._plan.mission.current()
        return int(current.mission_state)

    def texts(self, messages: list[Any]) -> str:
        return "".join(message.text for message in of_type(messages, "STATUSTEXT"))

    def circle(self) -> tuple[float, float, float]:
        """Centre and radius, positive clockwise, of the circle that the path ends in."""
        path = self.path.record
        last = int(path["count"]) - 1
        radius = 1.0 / float(path["curvature"][last])
        course = float(path["course"][last])
        north = float(path["north"][last]) - radius * math.sin(course)
        return north, float(path["east"][last]) + radius * math.cos(course), radius


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


def reposition(
    bench: PathBench,
    speed: float,
    flags: float,
    radius: float,
    side: float,
    *,
    x: int,
    y: int,
    z: float,
    frame: int,
) -> int:
    command = dialect.MAV_CMD_DO_REPOSITION
    message = dialect.MAVLink_command_int_message(
        UAV, 1, frame, command, 0, 0, speed, flags, radius, side, x, y, z
    )
    (ack,) = of_type(bench.say(message), "COMMAND_ACK")
    return int(ack.result)


def test_reposition_leads_into_a_circle_around_the_place(bench: PathBench) -> None:
    bench.fly()
    place = place_of(ORIGIN, 3000.0, -2000.0, 0.0)[:2]
    where: dict[str, Any] = {
        "x": place[0],
        "y": place[1],
        "z": 700.0,
        "frame": dialect.MAV_FRAME_GLOBAL_INT,
    }
    assert reposition(bench, -1.0, 0.0, 0.0, 0.0, **where) == DENIED
    assert reposition(bench, 45.0, 1.0, 600.0, 1.0, **where) == ACCEPTED
    assert bench.vehicle.modes.mode == GUIDED
    assert bench.circle() == pytest.approx((3000.0, -2000.0, -600.0), abs=0.02)
    path = bench.path.record
    assert path["airspeed"][0] == 45.0
    assert path["height"][path["count"] - 1] == pytest.approx(116.0)
    assert reposition(bench, -1.0, 1.0, 50.0, 0.0, **where) == DENIED  # too tight
    nowhere: dict[str, Any] = {"x": INT32_MAX, "y": INT32_MAX, "z": math.nan, "frame": 5}
    assert reposition(bench, -1.0, 1.0, math.nan, math.nan, **nowhere) == ACCEPTED
    assert bench.circle()[:2] == pytest.approx((0.0, 0.0), abs=1e-6)


def test_position_targets_are_for_guided(bench: PathBench) -> None:
    bench.fly()
    place = place_of(ORIGIN, 4000.0, 100.0, 0.0)[:2]
    target = dialect.MAVLink_set_position_target_global_int_message(
        0, UAV, 1, 6, 0b111111111000, *place, 150.0, *[0.0] * 8
    )
    circled = bench.circle()
    bench.say(target)
    assert bench.circle() == circled
    bench.command(SET_MODE, 1.0, GUIDED)
    bench.say(target)
    assert bench.circle()[:2] == pytest.approx((4000.0, 100.0), abs=0.02)
    reported: Any = bench.vehicle.telemetry[0].make(dialect.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT)
    assert reported.wp_dist > 3000
    assert reported.alt_error == pytest.approx(0.0, abs=1e-3)


def test_a_single_item_of_ardupilots_clients_is_a_target(bench: PathBench) -> None:
    bench.fly()
    item = waypoint(0, 2500.0, 2500.0)
    item.target_system, item.target_component, item.current = UAV, 1, 2
    (ack,) = of_type(bench.say(item), "MISSION_ACK")
    assert ack.type == dialect.MAV_MISSION_ACCEPTED
    assert bench.vehicle.modes.mode == GUIDED
    assert bench.circle()[:2] == pytest.approx((2500.0, 2500.0), abs=0.02)


def test_a_target_message_tells_where_the_path_leads(bench: PathBench) -> None:
    bench.upload_items((HOME, *TRIANGLE))
    bench.fly()
    bench.command(START)
    reported: Any = bench.vehicle.telemetry[0].make(
        dialect.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT
    )
    near = place_of(ORIGIN, 3000.0, 0.0, 0.0)
    assert (reported.lat_int, reported.lon_int) == pytest.approx(
        near[:2], abs=2e4
    )  # inside the corner
    assert reported.alt == pytest.approx(684.0)


def test_another_speed_is_flown_if_the_turns_allow_it(bench: PathBench) -> None:
    bench.upload_items((HOME, *TRIANGLE))
    bench.fly()
    bench.command(START)
    assert bench.command(SPEED, 0.0, 45.0) == ACCEPTED
    assert set(bench.path.record["airspeed"][: bench.path.record["count"]]) == {45.0}
    answers = bench.say(
        dialect.MAVLink_command_long_message(UAV, 1, SPEED, 0, 0.0, 59.0, *[0.0] * 5)
    )
    assert of_type(answers, "COMMAND_ACK")[0].result == DENIED
    assert "is too tight, must be >= " in bench.texts(answers)


def test_home_can_be_set(bench: PathBench) -> None:
    bench.upload_items((HOME, *TRIANGLE))
    bench.fly()
    bench.put(1000.0, 2000.0, 150.0)
    assert bench.command(dialect.MAV_CMD_DO_SET_HOME, 1.0) == ACCEPTED
    position: Any = bench.vehicle.telemetry[0].make(dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT)
    home: Any = bench.vehicle.telemetry[0].make(dialect.MAVLINK_MSG_ID_HOME_POSITION)
    assert position.relative_alt == 0
    assert (home.latitude, home.longitude) == (position.lat, position.lon)
    item = bench.vehicle._plan.mission.server.items[0]
    assert (item.x, item.y, item.z) == (home.latitude, home.longitude, 734.0)
    bench.put(8000.0, 2000.0, 150.0)
    bench.command(SET_MODE, 1.0, RTL)
    assert bench.circle()[:2] == pytest.approx((1000.0, 2000.0), abs=1e-6)
    assert bench.command(dialect.MAV_CMD_DO_SET_HOME, 0.0, 0, 0, 0, 95.0, 0.0, 0.0) == DENIED


@pytest.mark.parametrize("command", [84, 85])
def test_what_no_vehicle_in_the_air_can_do_is_refused_with_the_reason(
    command: int, bench: PathBench
) -> None:
    message = dialect.MAVLink_command_long_message(UAV, 1, command, 0, *[0.0] * 7)
    answers = bench.say(message)
    assert of_type(answers, "COMMAND_ACK")[0].result == DENIED
    assert f"command {command} is not supported: " in bench.texts(answers)


def test_home_moves_relative_heights_at_once(bench: PathBench) -> None:
    altitude = dialect.MAV_FRAME_GLOBAL
    bench.upload_items(
        (HOME, *TRIANGLE[:2], mission_item(3, WAYPOINT, (), *PLACE, 734.0, altitude))
    )
    bench.fly()
    bench.command(START)
    assert bench.path.target()[2] == pytest.approx(100.0)
    to = (dialect.MAV_CMD_DO_SET_HOME, 0.0, 0, 0, 0, -35.36, 149.16)
    assert bench.command(*to, 634.0) == ACCEPTED
    assert bench.path.target()[2] == pytest.approx(150.0)
    bench.command(SET_MODE, 1.0, RTL)
    assert bench.command(*to, 644.0) == ACCEPTED
    assert bench.circle()[0] == pytest.approx(363.1, abs=0.1)
    answers = bench.say(dialect.MAVLink_command_long_message(UAV, 1, to[0], 0, *to[1:], 800.0))
    assert of_type(answers, "COMMAND_ACK")[0].result == DENIED
    text = "the mission could not be flown, Item 3: altitude is -66 m above home, must be 0 to"
    assert text in bench.texts(answers)


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


@pytest.mark.parametrize(
    ("radius", "z", "frame", "text"),
    [
        (math.inf, 684.0, 0, "radius inf, must be at most 100000 m"),
        (0.0, -500.0, 6, "altitude is -500 m above home, must be 0 to 10000 m"),
        (0.0, 50_000.0, 6, "altitude is 50000 m above home, must be 0 to 10000 m"),
        (0.0, 583.0, 0, "altitude is -1 m above home, must be 0 to 10000 m"),
    ],
)
def test_a_target_has_the_limits_of_an_item(
    bench: PathBench, radius: float, z: float, frame: int, text: str
) -> None:
    bench.fly()
    place = place_of(ORIGIN, 3000.0, -2000.0, 0.0)[:2]
    reposition = dialect.MAVLink_command_int_message(
        UAV, 1, frame, dialect.MAV_CMD_DO_REPOSITION, 0, 0, -1.0, 1.0, radius, 0.0, *place, z
    )
    answers = bench.say(reposition)
    assert of_type(answers, "COMMAND_ACK")[0].result == DENIED
    assert text in bench.texts(answers)
    assert bench.vehicle.modes.mode == LOITER


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
