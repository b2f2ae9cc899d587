"""A vehicle with a fence and rally points: what it says of a breach, and what it flies then."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from vehicle_bench import ACCEPTED, ARM, DENIED, START, UAV, Bench, of_type
from vehicle_requests import second_process

from ftc_autopilot.common.geography import Origin, place_of
from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.constants import AUTO, GUIDED, LOITER, RTL
from mavlink_defs.mission_files import mission_item
from mavlink_defs.services.mission import MissionItem

ORIGIN = Origin()
FENCE, RALLY = dialect.MAV_MISSION_TYPE_FENCE, dialect.MAV_MISSION_TYPE_RALLY
ENABLE, SET_MODE = dialect.MAV_CMD_DO_FENCE_ENABLE, dialect.MAV_CMD_DO_SET_MODE
SET_HOME = dialect.MAV_CMD_DO_SET_HOME
CIRCLE = dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION
NO_GO = dialect.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION
RETURN_POINT, RALLY_POINT = (
    dialect.MAV_CMD_NAV_FENCE_RETURN_POINT,
    dialect.MAV_CMD_NAV_RALLY_POINT,
)
FAILED = dialect.MAV_RESULT_FAILED
GEOFENCE = dialect.MAV_SYS_STATUS_GEOFENCE


def item(
    seq: int, command: int, north: float, east: float, param: float = 0.0, height: float = 0.0
) -> MissionItem:
    place = place_of(ORIGIN, north, east, 0.0)[:2]
    return mission_item(seq, command, (param,), *place, height)


AROUND = (item(0, CIRCLE, 0.0, 0.0, 1000.0),)


class FenceBench(Bench):
    """A vehicle that flies, and is where it is put."""

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        self.plan, self.modes = self.vehicle._plan, self.vehicle.modes
        self.position(0.0, 0.0)

    def position(self, north: float, east: float, height: float = 100.0) -> None:
        self.hot.measured["position"] = (north, east, -height)

    def put(self, north: float, east: float = 0.0, height: float = 100.0) -> str:
        """Put the aircraft somewhere, and let a check pass; return what the vehicle says."""
        self.position(north, east, height)
        self.hot.step = (max(self.hot.step, 0) // 1000 + 1) * 1000
        self.hot.measured["time_usec"] = self.hot.step * 1000
        self.now += 1.0
        self.vehicle.handle_timer(self.now)
        return texts(self.vehicle.gcs_messages())

    def upload_type(self, mission_type: int, items: Sequence[MissionItem]) -> tuple[int, str]:
        """Upload a list of a type; return MAV_MISSION_RESULT, and what the vehicle says."""
        answers = self.say(dialect.MAVLink_mission_count_message(UAV, 1, len(items), mission_type))
        while requests := of_type(answers, "MISSION_REQUEST_INT"):
            one = items[requests[0].seq]
            one.target_system, one.target_component, one.mission_type = UAV, 1, mission_type
            answers = self.say(one)
        (ack,) = of_type(answers, "MISSION_ACK")
        assert ack.mission_type == mission_type
        return ack.type, texts(answers)

    def set(self, **params: float) -> str:
        said = ""
        for name, value in params.items():
            said += texts(
                self.say(dialect.MAVLink_param_set_message(UAV, 1, name.encode(), value, 9))
            )
        return said

    def fly(self) -> None:
        assert self.command(ARM, 1.0) == ACCEPTED
        self.run()

    def made(self, message: type[Any]) -> Any:
        return self.vehicle.telemetry[0].make(message.id)

    @property
    def status(self) -> tuple[int, int, int]:
        """What FENCE_STATUS says: whether there is a breach, how many there were, of which type."""
        status = self.made(dialect.MAVLink_fence_status_message)
        return status.breach_status, status.breach_count, status.breach_type

    def goal(self) -> tuple[float, float, float]:
        """Centre and height of the circle that the path ends in."""
        path = self.modes.path.record
        last = int(path["count"]) - 1
        north, east, course, curvature, height = (
            float(path[name][last]) for name in ("north", "east", "course", "curvature", "height")
        )
        side = course + math.pi / 2.0
        place = north + math.cos(side) / curvature, east + math.sin(side) / curvature
        return round(place[0]), round(place[1]), round(height)


def texts(messages: list[Any]) -> str:
    joined = ""
    for message in of_type(messages, "STATUSTEXT"):
        joined += message.text + ("" if len(message.text) == 50 else "\n")
    return joined


@pytest.fixture
def bench(scenario1: Scenario) -> FenceBench:
    return FenceBench(scenario1)


@pytest.fixture
def fenced(bench: FenceBench) -> FenceBench:
    """One in LOITER, in a circle of 1000 m around home."""
    result, said = bench.upload_type(FENCE, AROUND)
    assert (result, said) == (ACCEPTED, "fence of 1 circle held, FENCE_ENABLE is 0\n")
    assert bench.command(ENABLE, 1.0) == ACCEPTED
    bench.fly()
    assert bench.put(0.0) == ""
    return bench


def test_a_breach_is_reported_and_rtl_is_flown(fenced: FenceBench) -> None:
    sys_status = dialect.MAVLink_sys_status_message
    assert fenced.status == (0, 0, 0)
    assert fenced.made(sys_status).onboard_control_sensors_health & GEOFENCE
    said = fenced.put(1001.0)
    assert "mode RTL\n" in said
    assert "fence breached: outside the inclusion circle of item 0; RTL\n" in said
    assert fenced.modes.mode == RTL
    assert fenced.status == (1, 1, dialect.FENCE_BREACH_BOUNDARY)
    status = fenced.made(sys_status)
    assert not status.onboard_control_sensors_health & GEOFENCE
    assert status.onboard_control_sensors_enabled & GEOFENCE
    assert fenced.put(997.0) == "inside the fence\n"
    assert fenced.status == (0, 1, dialect.FENCE_BREACH_BOUNDARY)
    assert fenced.made(sys_status).onboard_control_sensors_health & GEOFENCE


def test_a_breach_is_over_only_inside_by_the_margin(fenced: FenceBench) -> None:
    fenced.put(1001.0)
    for north in (999.5, 1000.5, 998.1, 1003.0, 999.0):
        assert fenced.put(north) == ""
    assert fenced.status == (1, 1, dialect.FENCE_BREACH_BOUNDARY)
    fenced.set(FENCE_MARGIN=0.5)
    assert fenced.put(999.0) == "inside the fence\n"


def test_who_changes_the_mode_after_a_breach_is_respected(fenced: FenceBench) -> None:
    fenced.put(1001.0)
    assert fenced.command(SET_MODE, 1.0, LOITER) == ACCEPTED
    for north in (1010.0, 1200.0, 999.0, 1100.0):
        assert fenced.put(north) == ""
        assert fenced.modes.mode == LOITER
    fenced.put(900.0)
    assert "; RTL" in fenced.put(1001.0)
    assert fenced.modes.mode == RTL


def test_what_the_fence_has_begun_goes_on_through_further_breaches(fenced: FenceBench) -> None:
    fenced.put(1001.0)
    number = fenced.modes.path.number
    for count in range(2, 5):
        fenced.put(990.0)
        assert fenced.put(1001.0).endswith("item 0; goes on in RTL\n")
        assert fenced.status == (1, count, dialect.FENCE_BREACH_BOUNDARY)
    assert fenced.modes.path.number == number


def test_nothing_is_checked_between_two_checks(fenced: FenceBench) -> None:
    fenced.position(1500.0, 0.0)
    for step in (1001, 1050, 1099):
        fenced.hot.step = step
        fenced.vehicle.handle_timer(fenced.now)
        assert fenced.status[0] == 0
        assert fenced.vehicle.next_check_step() == 1100
    fenced.hot.step = 1100
    fenced.vehicle.handle_timer(fenced.now)
    assert fenced.status[0] == 1
    fenced.set(FENCE_ENABLE=0)
    fenced.vehicle.handle_timer(fenced.now)
    assert fenced.status[0] == 0
    assert fenced.vehicle.next_check_step() > 10**12


def test_a_report_changes_no_mode(fenced: FenceBench) -> None:
    fenced.set(FENCE_ACTION=0)
    assert fenced.put(1001.0) == "fence breached: outside the inclusion circle of item 0\n"
    assert (fenced.modes.mode, fenced.status[1]) == (LOITER, 1)


def test_loiter_circles_where_the_breach_is(fenced: FenceBench) -> None:
    fenced.set(FENCE_ACTION=4)
    fenced.command(SET_MODE, 1.0, GUIDED)
    fenced.put(1001.0)
    assert fenced.modes.mode == LOITER
    assert math.dist(fenced.goal()[:2], (1001.0, 0.0)) < 600.0


def test_guided_leads_to_the_return_point_or_home(fenced: FenceBench) -> None:
    fenced.set(FENCE_ACTION=6)
    fenced.put(1001.0)
    assert (fenced.modes.mode, fenced.goal()) == (GUIDED, (0, 0, 100))
    fenced.upload_type(FENCE, (*AROUND, item(1, RETURN_POINT, 300.0, -200.0)))
    fenced.set(FENCE_RET_ALT=70)
    fenced.put(0.0)
    fenced.command(SET_MODE, 1.0, LOITER)
    fenced.put(1001.0)
    assert (fenced.modes.mode, fenced.goal()) == (GUIDED, (300, -200, 70))
    fenced.upload_type(RALLY, (item(0, RALLY_POINT, 500.0, 0.0, height=60.0),))
    fenced.set(FENCE_RET_RALLY=1)
    fenced.put(0.0)
    fenced.command(SET_MODE, 1.0, LOITER)
    fenced.put(1001.0)
    assert (fenced.modes.mode, fenced.goal()) == (GUIDED, (500, 0, 60))


def test_an_action_that_no_plane_has_is_refused(bench: FenceBench) -> None:
    text = "FENCE_ACTION is 2, must be 0 report, 1 rtl, 4 loiter, 6 guided\n"
    assert bench.set(FENCE_ACTION=2) == text


def test_heights_are_watched_and_left_again(bench: FenceBench) -> None:
    bench.set(FENCE_TYPE=9, FENCE_ALT_MAX=150, FENCE_ALT_MIN=50, FENCE_MARGIN=10)
    assert bench.command(ENABLE, 1.0) == ACCEPTED
    bench.fly()
    bench.put(500.0, height=140.0)
    assert "fence breached: above 150 m; RTL" in bench.put(500.0, height=151.0)
    assert bench.status == (1, 1, dialect.FENCE_BREACH_MAXALT)
    assert bench.goal() == (0, 0, 140)
    assert bench.put(500.0, height=141.0) == ""
    assert bench.put(500.0, height=139.0) == "inside the fence\n"
    bench.command(SET_MODE, 1.0, LOITER)
    assert "below 50 m" in bench.put(500.0, height=49.0)
    assert bench.status == (1, 2, dialect.FENCE_BREACH_MINALT)
    assert bench.goal() == (0, 0, 60)


def test_the_floor_alone_can_be_left_out(bench: FenceBench) -> None:
    bench.set(FENCE_TYPE=9, FENCE_ALT_MAX=150, FENCE_ALT_MIN=50)
    bench.command(ENABLE, 1.0)
    bench.fly()
    assert bench.command(ENABLE, 2.0) == ACCEPTED
    assert bench.put(0.0, height=20.0) == ""
    assert bench.command(ENABLE, 1.0) == ACCEPTED
    assert "below 50 m" in bench.put(0.0, height=20.0)


def test_the_circle_around_home_follows_it(bench: FenceBench) -> None:
    bench.set(FENCE_TYPE=2, FENCE_RADIUS=800)
    bench.command(ENABLE, 1.0)
    bench.fly()
    assert "more than 800 m from home" in bench.put(801.0)
    latitude, longitude = (x / 1e7 for x in place_of(ORIGIN, 500.0, 0.0, 0.0)[:2])
    bench.command(SET_HOME, 0.0, 0.0, 0.0, 0.0, latitude, longitude, 584.0)
    assert bench.put(801.0) == "inside the fence\n"


@pytest.mark.parametrize(
    ("params", "result", "text"),
    [
        ((1.0,), FAILED, "Fence: there is no fence\n"),
        ((3.0,), DENIED, "Fence: param 1 is 3, must be 0 (off), 1 (on) or 2 (no floor)\n"),
        ((math.nan,), DENIED, "Fence: param 1 is nan, must be 0 (off), 1 (on) or 2 (no floor)\n"),
        ((1.0, 4.0), DENIED, "Fence: param 2 is 4, must be 0; FENCE_TYPE says what is watched\n"),
        ((0.0,), ACCEPTED, "fence disabled\n"),
    ],
)
def test_commands_that_enable(
    bench: FenceBench, params: tuple[float, ...], result: int, text: str
) -> None:
    seven: Any = (*params, *[0.0] * 7)[:7]
    answers = bench.say(dialect.MAVLink_command_long_message(UAV, 1, ENABLE, 0, *seven))
    (ack,) = of_type(answers, "COMMAND_ACK")
    assert (ack.result, texts(answers)) == (result, text)


def test_a_disabled_fence_does_nothing(fenced: FenceBench) -> None:
    fenced.command(ENABLE, 0.0)
    assert fenced.put(5000.0) == ""
    status = fenced.made(dialect.MAVLink_sys_status_message)
    assert not status.onboard_control_sensors_enabled & GEOFENCE
    assert status.onboard_control_sensors_health & GEOFENCE


def test_arming_is_refused_outside_and_without_a_fence(bench: FenceBench) -> None:
    bench.set(FENCE_ENABLE=1)
    assert bench.command(ARM, 1.0) == DENIED
    bench.upload_type(FENCE, AROUND)
    bench.position(1200.0, 0.0)
    answers = bench.say(dialect.MAVLink_command_long_message(UAV, 1, ARM, 0, 1, *[0.0] * 6))
    assert texts(answers) == "Arm: outside the fence: outside the inclusion circle of item 0\n"
    bench.position(0.0, 0.0)
    assert bench.command(ARM, 1.0) == ACCEPTED
    bench.position(1200.0, 0.0)
    assert bench.command(ARM, 0.0) == ACCEPTED


def test_a_fence_that_is_refused_leaves_the_one_before(fenced: FenceBench) -> None:
    result, said = fenced.upload_type(FENCE, (item(0, CIRCLE, 900.0, 0.0, 500.0),))
    assert result == dialect.MAV_MISSION_INVALID
    expected = "Fence: Item 0: home is 400 m outside the inclusion circle of item 0\n"
    assert said == expected
    assert len(fenced.plan.fence.server.items) == 1
    assert fenced.put(950.0) == ""


def test_a_fence_that_is_cleared_ends_its_breach(fenced: FenceBench) -> None:
    fenced.put(1001.0)
    assert fenced.upload_type(FENCE, ())[1] == "fence of no area in force\n"
    assert fenced.put(2000.0) == "inside the fence\n"


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


def test_another_flight_begins_without_breaches(fenced: FenceBench) -> None:
    fenced.put(1001.0)
    fenced.vehicle.restart()
    assert fenced.status == (0, 0, 0)
    assert len(fenced.plan.fence.server.items) == 1
    assert fenced.plan.fence.enabled


def test_no_fence_means_no_checks(bench: FenceBench) -> None:
    bench.fly()
    bench.put(50_000.0)
    assert bench.vehicle.next_check_step() > 10**12


def test_a_circle_around_home_that_leaves_the_fence_is_told(bench: FenceBench) -> None:
    said = bench.upload_type(FENCE, (item(0, CIRCLE, 100.0, 0.0, 500.0),))[1]
    assert said.endswith("the circle around home, 449 m, leaves the fence\n")
    assert "circle around" not in bench.upload_type(FENCE, AROUND)[1]
