"""A vehicle on a runway: commands for take-off and landing, and what it tells of them."""

import math
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from vehicle_bench import ACCEPTED, ARM, DENIED, START, Bench, of_type

from ftc_autopilot.common.geography import place_of
from ftc_autopilot.guidance.path import point_at
from ftc_autopilot.guidance.runway_state import (
    FINAL,
    ROLL_OUT,
    STANDING,
    STOPPED,
)
from gcs.scenario.model import Scenario, load_scenario
from mavlink_defs import dialect
from mavlink_defs.constants import AUTO, AUTOLAND, LOITER, TAKEOFF

SCENARIO = load_scenario(Path("scenarios/runway/circuit.yaml"))
SET_MODE, TAKE_OFF = dialect.MAV_CMD_DO_SET_MODE, dialect.MAV_CMD_NAV_TAKEOFF
LAND, GO_AROUND = dialect.MAV_CMD_NAV_LAND, dialect.MAV_CMD_DO_GO_AROUND
LAND_START = dialect.MAV_CMD_DO_LAND_START
LONG = dialect.MAVLink_command_long_message(1, 1, LAND, 0, *[0.0] * 7)
LANDING = 6
"""Item of the landing."""


class RunwayBench(Bench):
    """A bench whose aircraft stands on the runway, or flies."""

    def __init__(self) -> None:
        super().__init__(SCENARIO)
        self.path, self.modes = self.vehicle.modes.path, self.vehicle.modes
        self.runway = self.controllers.uavs[0]["guidance"]["runway"]
        self.hot.measured["velocity"] = 0.0
        self.upload_items(list(SCENARIO.mission_items()))

    def fly(self, north: float = -1000.0) -> None:
        """Put the aircraft into the air, on the line of the runway."""
        self.hot.measured["position"] = (north, 0.0, -60.0)
        self.hot.measured["velocity"] = (40.0, 0.0, 0.0)

    def be(self, phase: int) -> list[Any]:
        """Let the guidance come to a phase; return what the vehicle tells."""
        self.runway["phase"] = phase
        self.now += 1.0
        self.vehicle.handle_timer(self.now)
        return self.vehicle.gcs_messages()

    def landed_state(self) -> int:
        made: Any = self.vehicle._runway.extended_sys_state()
        return int(made.landed_state)


@pytest.fixture
def bench() -> RunwayBench:
    return RunwayBench()


def said(messages: list[Any]) -> str:
    return "".join(message.text for message in of_type(messages, "STATUSTEXT"))


def test_who_stands_takes_off_to_the_height_that_is_commanded(bench: RunwayBench) -> None:
    assert bench.landed_state() == dialect.MAV_LANDED_STATE_ON_GROUND
    assert bench.command(TAKE_OFF, *[0.0] * 6, 80.0) == ACCEPTED
    assert bench.modes.mode == TAKEOFF
    assert bench.path.record["climb_to"] == 80.0
    assert bench.path.record["take_off"] > 0.0
    assert bench.command(SET_MODE, 1.0, LOITER) == ACCEPTED
    assert bench.command(TAKE_OFF) == ACCEPTED
    assert bench.path.record["climb_to"] == SCENARIO.runway_guidance.take_off_m


@pytest.mark.parametrize("height", [math.inf, 1e9, -5.0, 3.0])
def test_a_take_off_to_where_no_place_may_be_is_refused(bench: RunwayBench, height: float) -> None:
    """The first two climbed for ever, the third to the usual height."""
    assert bench.command(TAKE_OFF, *[0.0] * 6, height) == DENIED
    assert bench.modes.mode == LOITER
    assert bench.command(TAKE_OFF, *[0.0] * 6, math.nan) == ACCEPTED
    assert bench.path.record["climb_to"] == SCENARIO.runway_guidance.take_off_m


def test_who_flies_does_not_take_off(bench: RunwayBench) -> None:
    bench.fly()
    assert bench.landed_state() == dialect.MAV_LANDED_STATE_IN_AIR
    assert bench.command(TAKE_OFF) == DENIED
    assert bench.command(SET_MODE, 1.0, TAKEOFF) == DENIED
    assert bench.modes.mode == LOITER


def test_a_landing_is_flown_from_the_place_before_it(bench: RunwayBench) -> None:
    bench.fly(-4000.0)
    assert bench.command(ARM, 1.0) == ACCEPTED
    bench.run()
    assert bench.command(LAND) == ACCEPTED
    assert bench.modes.mode == AUTO
    assert bench.modes.current_item() == LANDING - 1


class Landing(NamedTuple):
    """Touchdown of a path: north, east [m], course [deg]."""

    north: float
    east: float
    course: float


def landing_of(bench: RunwayBench) -> Landing:
    there = point_at(bench.path.record, float(bench.path.record["landing"]))
    return Landing(there.north, there.east, math.degrees(there.course) % 360.0)


@pytest.fixture
def flying(bench: RunwayBench) -> RunwayBench:
    """A bench that flies in LOITER, and whose mission has no landing."""
    bench.fly()
    bench.upload_items(list(SCENARIO.mission_items()[:-1]))
    assert bench.command(ARM, 1.0) == ACCEPTED
    bench.run()
    return bench


@pytest.mark.parametrize(
    ("command", "params"), [(LAND, ()), (LAND_START, ()), (SET_MODE, (1.0, AUTOLAND))]
)
def test_without_a_landing_in_the_mission_the_runway_is_landed_on(
    flying: RunwayBench, command: int, params: tuple[float, ...]
) -> None:
    assert flying.command(command, *params) == ACCEPTED
    assert flying.modes.mode == AUTOLAND
    north, east, course = landing_of(flying)
    runway, figures = SCENARIO.runway, flying.path.planner.limits.runway
    assert runway is not None
    assert figures is not None
    before, behind = north - runway.north_m, runway.length_m + runway.north_m - north
    assert before == pytest.approx(behind - figures.landing_roll)
    assert (round(east, 6), round(course, 6)) == (0.0, 0.0)
    assert flying.landed_state() == dialect.MAV_LANDED_STATE_IN_AIR


def test_the_runway_is_landed_on_against_the_wind(flying: RunwayBench) -> None:
    flying.hot.measured["wind"] = (3.0, 1.0, 0.0)
    assert flying.command(LAND) == ACCEPTED
    assert landing_of(flying).course == pytest.approx(180.0)


@pytest.mark.parametrize("wind", [(0.0, 0.0), (-3.0, 0.0), (0.0, -4.0), (0.0, 4.0)])
def test_a_given_place_is_landed_at_against_the_wind(
    flying: RunwayBench, wind: tuple[float, float]
) -> None:
    """Degrees in COMMAND_LONG, as float32; in calm air the present course, north, is kept."""
    place = place_of(SCENARIO.origin, 900.0, -700.0, 0.0)
    flying.hot.measured["wind"] = (*wind, 0.0)
    assert flying.command(LAND, *[math.nan] * 4, place[0] * 1e-7, place[1] * 1e-7) == ACCEPTED
    found = landing_of(flying)
    assert found[:2] == pytest.approx((900.0, -700.0), abs=1.0)
    calm = wind == (0.0, 0.0)
    into = 0.0 if calm else math.degrees(math.atan2(-wind[1], -wind[0])) % 360.0
    assert found.course == pytest.approx(into)


def test_who_stands_does_not_land(bench: RunwayBench) -> None:
    bench.upload_items(list(SCENARIO.mission_items()[:-1]))
    assert "stands on the ground" in said(bench.say(LONG))
    assert bench.modes.mode == LOITER


def test_an_aircraft_without_gear_does_not_land(scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    assert "no gear to land on" in said(bench.say(LONG))
    assert bench.vehicle.modes.mode == LOITER


def test_an_approach_can_be_given_up(bench: RunwayBench) -> None:
    bench.fly()
    assert bench.command(GO_AROUND) == DENIED
    bench.be(FINAL)
    assert bench.command(GO_AROUND) == ACCEPTED
    assert bench.runway["asked"] == 1


def test_at_standstill_it_disarms_and_the_landing_is_reached(bench: RunwayBench) -> None:
    bench.fly(-4000.0)
    assert bench.command(START) == ACCEPTED
    assert bench.command(ARM, 1.0) == ACCEPTED
    bench.run()
    bench.runway["known"] = 1
    record = bench.path.record
    bench.controllers.uavs[0]["guidance"]["path_position"] = float(record["landing"]) + 1.0
    assert "touchdown" in said(bench.be(ROLL_OUT))
    assert bench.landed_state() == dialect.MAV_LANDED_STATE_ON_GROUND
    assert bench.command(ARM, 0.0) == DENIED
    told = bench.be(STOPPED)
    assert "stands on the runway" in said(told)
    assert not bench.modes.armed
    assert bench.modes.is_over()
    told += bench.be(STOPPED)
    assert [message.seq for message in of_type(told, "MISSION_ITEM_REACHED")][-1] == LANDING
    assert not math.isnan(bench.now)


def test_who_stands_disarms_without_force(bench: RunwayBench) -> None:
    assert bench.command(ARM, 1.0) == ACCEPTED
    bench.run()
    bench.be(STANDING)
    assert bench.command(ARM, 0.0) == ACCEPTED
