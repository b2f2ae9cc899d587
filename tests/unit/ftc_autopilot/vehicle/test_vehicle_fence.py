"""A vehicle with a fence and rally points: what it says of a breach, and what it flies then."""

import math
from typing import Any

import pytest
from fence_bench import (
    AROUND,
    CIRCLE,
    ENABLE,
    FAILED,
    FENCE,
    GEOFENCE,
    ORIGIN,
    RALLY,
    RALLY_POINT,
    RETURN_POINT,
    SET_HOME,
    SET_MODE,
    FenceBench,
    item,
    texts,
)
from vehicle_bench import ACCEPTED, ARM, DENIED, UAV, of_type

from ftc_autopilot.common.geography import place_of
from ftc_autopilot.guidance.runway_state import AROUND as GOING_AROUND
from ftc_autopilot.guidance.runway_state import CLIMBING, FINAL, FLARE, FLYING, ROLLING
from gcs.scenario.model import Scenario, load_scenario
from mavlink_defs import dialect
from mavlink_defs.constants import AUTOLAND, GUIDED, LOITER, MODE_NAMES, RTL


@pytest.fixture
def bench(scenario1: Scenario) -> FenceBench:
    return FenceBench(scenario1)


@pytest.fixture
def fenced(bench: FenceBench) -> FenceBench:
    bench.fly_fenced()
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


@pytest.mark.parametrize(
    ("name", "mode", "text"),
    [
        ("runway/circuit", AUTOLAND, "; landing"),
        ("paper/scenario1", RTL, "; RTL"),
    ],
)
def test_a_breach_ends_in_a_landing_if_the_aircraft_can_land(
    name: str, mode: int, text: str
) -> None:
    bench = FenceBench(load_scenario(name))
    bench.fly_fenced()
    bench.set(FENCE_ACTION=8)
    assert bench.put(1001.0).endswith(f"circle of item 0{text}\n")
    assert bench.modes.mode == mode
    bench.put(0.0)
    assert bench.put(1001.0).endswith(f"goes on in {MODE_NAMES[mode]}\n")


def test_an_action_that_no_plane_has_is_refused(bench: FenceBench) -> None:
    text = "FENCE_ACTION is 2, must be 0 report, 1 rtl, 4 loiter, 6 guided, 8 land\n"
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


def test_the_least_height_is_not_watched_on_the_ground_on_takeoff_and_landing() -> None:
    bench = FenceBench(load_scenario("runway/circuit"))
    bench.set(FENCE_TYPE=8, FENCE_ALT_MIN=50)
    bench.command(ENABLE, 1.0)
    bench.position(0.0, 0.0, 1.0)
    assert bench.command(ARM, 1.0) == DENIED
    velocity = bench.hot.measured["velocity"].copy()
    bench.hot.measured["velocity"] = 0.0
    bench.fly()
    bench.hot.measured["velocity"] = velocity
    runway = bench.controllers.uavs[0]["guidance"]["runway"]
    for phase in (ROLLING, CLIMBING, FINAL, FLARE, GOING_AROUND):
        runway["phase"] = phase
        assert "fence" not in bench.put(0.0, height=20.0)
    runway["phase"] = FLYING
    assert bench.command(SET_MODE, 1.0, AUTOLAND) == ACCEPTED
    assert "fence" not in bench.put(0.0, height=20.0)
    assert bench.command(SET_MODE, 1.0, LOITER) == ACCEPTED
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
