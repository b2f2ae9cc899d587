"""A vehicle on the way to places that a station sends: GUIDED, its speed, home."""

import math
from typing import Any

import pytest
from path_bench import HOME, ORIGIN, PLACE, SET_MODE, SPEED, TRIANGLE, WAYPOINT, PathBench, waypoint
from vehicle_bench import ACCEPTED, DENIED, START, UAV, of_type

from ftc_autopilot.common.geography import place_of
from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.constants import GUIDED, INT32_MAX, LOITER, RTL
from mavlink_defs.mission_files import mission_item


@pytest.fixture
def bench(scenario1: Scenario) -> PathBench:
    return PathBench(scenario1)


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
