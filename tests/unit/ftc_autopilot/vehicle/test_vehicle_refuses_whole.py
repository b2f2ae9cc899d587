"""What is not accepted changes nothing: every command, mode, mission and parameter."""

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from vehicle_bench import Bench
from vehicle_requests import Request, requests, start_flight, state_of

from ftc_autopilot.common.geography import Origin, place_of
from gcs.scenario.model import Scenario, load_scenario
from mavlink_defs import dialect
from mavlink_defs.mission_files import mission_item
from mavlink_defs.services.mission import MissionItem

SET_CURRENT = dialect.MAV_CMD_DO_SET_MISSION_CURRENT


def waypoint(seq: int, north: float, east: float) -> MissionItem:
    return mission_item(seq, 16, (), *place_of(Origin(), north, east, 0.0)[:2], 100.0)


@pytest.fixture(scope="module")
def formation() -> Scenario:
    return load_scenario("scenarios/missions/hexagon.yaml")


@settings(phases=(Phase.explicit, Phase.generate))  # shrinking takes minutes
@given(st.lists(requests(), min_size=4, max_size=12), st.booleans())
def test_what_is_not_accepted_changes_nothing(
    scenario1: Scenario, formation: Scenario, asked: list[Request], in_formation: bool
) -> None:
    bench = Bench(formation if in_formation else scenario1)
    speed = mission_item(3, dialect.MAV_CMD_DO_CHANGE_SPEED, (0.0, 45.0))
    start_flight(bench, [waypoint(1, 3e3, 0.0), waypoint(2, 3e3, 3e3), speed])
    for request in asked:
        before = state_of(bench)
        if not request(bench):
            assert state_of(bench) == before


def test_an_item_that_leads_nowhere_is_not_gone_to(scenario1: Scenario) -> None:
    bench = Bench(scenario1)
    speed = mission_item(2, dialect.MAV_CMD_DO_CHANGE_SPEED, (0.0, 45.0))
    start_flight(bench, [waypoint(1, 3e3, 0.0), speed])
    before = state_of(bench)
    assert bench.command(SET_CURRENT, 2.0) == dialect.MAV_RESULT_FAILED
    assert bench.command(SET_CURRENT, 7.0) == dialect.MAV_RESULT_FAILED
    bench.say(dialect.MAVLink_mission_set_current_message(1, 1, 2))
    assert state_of(bench) == before


def test_a_mission_that_can_be_flown_from_home_but_not_from_here_is_refused(
    scenario1: Scenario,
) -> None:
    bench, other = Bench(scenario1), Bench(scenario1)
    for each in (bench, other):
        start_flight(each, [waypoint(1, 3e3, 0.0)])
    bench.hot.measured["position"] = (300.0, 900.0, -100.0)
    assert bench.upload_items(zigzag()) == dialect.MAV_MISSION_ACCEPTED  # 4096 legs
    other.hot.measured["position"] = (5e3, 0.0, -100.0)
    before = state_of(other)
    assert other.upload_items(zigzag()) == dialect.MAV_MISSION_NO_SPACE  # an arc more
    assert state_of(other) == before


def zigzag() -> list[MissionItem]:
    """Return a mission of 4096 legs, the most of a path: twenty rounds, and a way off."""
    items = [mission_item(0, 16)]
    for k in range(1, 73):
        for v in range(2 if k <= 40 else k == 41):  # an airspeed on the way is one leg more
            items.append(mission_item(len(items), dialect.MAV_CMD_CONDITION_DELAY, (1.0,)))
            speed = (0.0, 40.0 + v)
            items.append(mission_item(len(items), dialect.MAV_CMD_DO_CHANGE_SPEED, speed))
        items.append(waypoint(len(items), 1000.0 * k, 1.5e3 * (k % 2)))
        if k == 40:
            items.append(mission_item(len(items), dialect.MAV_CMD_DO_JUMP, (1.0, 19.0)))
    return items
