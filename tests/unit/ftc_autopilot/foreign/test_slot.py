"""Where an ArduPlane is told to fly so that it keeps its slot."""

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from ftc_autopilot.common.geography import position_of
from ftc_autopilot.config import AutopilotConfig
from ftc_autopilot.foreign.base import PlantStep
from ftc_autopilot.foreign.slot import SlotKeeper
from ftc_autopilot.guidance.path import point_at
from gcs.scenario.changes import with_changes
from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.framing import codec
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.frames import FramePacker
from sitl_plant.vec3 import Vec3

SPEED = 40.0
SLOT = (-20.0, -20.0, 0.0)


def scenario(**changes: Any) -> Scenario:
    plane = {"uavs[2].autopilot": {"kind": "ardupilot", "binary": "arduplane"}}
    return with_changes("missions/hexagon", [], plane | changes, "--set")


@pytest.fixture(scope="module")
def config() -> AutopilotConfig:
    return scenario().autopilot_config(3)


def said(step: int, path_id: int = 7, system: int = 1, **changes: Any) -> bytes:
    """Return what the leader says at a step, northwards at 100 m since step 0."""
    fields: dict[str, Any] = {
        "position": [SPEED * step / 1e3, 0.0, -100.0],
        "ground_velocity": [SPEED, 0.0, 0.0],
        "path_position": SPEED * step / 1e3,
        "path_rate": SPEED,
    }
    message = np.zeros(1, codec.NEIGHBOUR)[0]
    for name, value in (fields | {"step": step, "path_id": path_id} | changes).items():
        message[name] = value
    values = [message[name].tolist() for name in dialect.MAVLink_ftc_neighbour_message.fieldnames]
    return FramePacker(system, 1).pack(dialect.MAVLink_ftc_neighbour_message(*values))


def at(step: int, north: float = 0.0, east: float = 0.0, up: float = 0.0) -> PlantStep:
    """Return a step at which it is so far from its slot, northwards with the leader."""
    state = np.zeros(1, codec.SIM_STATE)[0]
    state["position"] = SPEED * step / 1e3 + SLOT[0] + north, SLOT[1] + east, -100.0 - up
    state["velocity"] = SPEED, 0.0, 0.0
    return PlantStep(step, step * 1000, state)


def told(keeper: SlotKeeper, step: PlantStep) -> dict[str, Any]:
    """Return what it is told, by the message or command."""
    found = {}
    for message in keeper.targets(step, lockstep=True):
        number = getattr(message, "command", 0)
        found[dialect.enums["MAV_CMD"][number].name if number else "height"] = message
    return found


def airspeed_and_bearing(
    config: AutopilotConfig, step: PlantStep, found: dict[str, Any]
) -> tuple[float, float]:
    """Return the airspeed that it is asked for, and the direction of the place [rad]."""
    place, origin = found["MAV_CMD_DO_REPOSITION"], config.origin
    north, east = position_of(origin, place.x, place.y)
    assert step.state is not None
    x, y, _ = step.state["position"].tolist()
    return found["MAV_CMD_GUIDED_CHANGE_SPEED"].param2, math.atan2(east - y, north - x)


def northwards(config: AutopilotConfig, **off: float) -> tuple[float, float]:
    keeper, step = SlotKeeper(config, None), at(1, **off)
    assert keeper.receive(said(0)) is None
    return airspeed_and_bearing(config, step, told(keeper, step))


def test_in_its_slot_it_flies_on(config: AutopilotConfig) -> None:
    airspeed, bearing = northwards(config)
    assert airspeed == pytest.approx(SPEED, abs=0.1)
    assert bearing == pytest.approx(0.0, abs=1e-3)


def test_it_keeps_its_slot_beside_a_path_that_is_planned_for_no_wind() -> None:
    calm = scenario(**{"guidance.wind_max_m_s": 0.0}).autopilot_config(3)
    assert northwards(calm)[0] == pytest.approx(SPEED, abs=0.1)


@pytest.mark.parametrize("off", [{"north": -5.0}, {"north": 5.0}])
def test_behind_it_is_faster(config: AutopilotConfig, off: dict[str, float]) -> None:
    airspeed, _ = northwards(config, **off)
    assert math.copysign(1.0, airspeed - SPEED) == -math.copysign(1.0, off["north"])


def test_beside_it_turns_to_its_way_at_the_distance_of_l1(config: AutopilotConfig) -> None:
    _, bearing = northwards(config, east=10.0)
    ahead = 17.0 * SPEED / (2.0 * math.pi * 0.75)
    assert bearing == pytest.approx(-math.atan2(10.0, ahead), abs=1e-3)


def test_it_is_told_its_height(config: AutopilotConfig) -> None:
    keeper = SlotKeeper(config, None)
    keeper.receive(said(0))
    assert told(keeper, at(1, up=9.0))["height"].alt == pytest.approx(584.0 + 100.0)


def test_in_a_turn_the_outer_one_is_faster_and_aims_along_an_arc(config: AutopilotConfig) -> None:
    keeper, rate = SlotKeeper(config, None), 0.1
    radius = SPEED / rate
    for k in range(0, 4000, 200):
        course = rate * k / 1e3
        cos, sin = math.cos(course), math.sin(course)
        position = [radius * sin, radius * (1.0 - cos), -100.0]
        keeper.receive(said(k, position=position, ground_velocity=[SPEED * cos, SPEED * sin, 0.0]))
        step = at(k + 1)
        assert step.state is not None
        own, wide, fast = course + (rate / 1e3) - 20.0 / radius, radius + 20.0, SPEED + 20.0 * rate
        step.state["position"][:2] = wide * math.sin(own), radius - wide * math.cos(own)
        step.state["attitude"][2], step.state["velocity"][0] = own, fast
        found = told(keeper, step)
    airspeed, bearing = airspeed_and_bearing(config, step, found)
    assert airspeed == pytest.approx(fast, abs=0.2)
    ahead = 17.0 * fast / (2.0 * math.pi * 0.75)
    assert bearing - own == pytest.approx(0.5 * ahead / wide, abs=0.02)


@pytest.mark.parametrize("known", [True, False])
def test_before_a_turn_of_the_mission_the_outer_one_is_faster(
    config: AutopilotConfig, known: bool
) -> None:
    """It knows the path if it has been given the mission that the neighbour flies."""
    flown = scenario()
    items, keeper = flown.mission_items(), SlotKeeper(config, None)
    path = flown.planner(1).path(items)
    keeper.plan(items if known else items[:-1])
    turn = int(np.flatnonzero(path["curvature"])[0])
    slot = point_at(path, path["start"][turn] - SPEED)  # a second before the turn
    cos, sin = math.cos(slot.course), math.sin(slot.course)
    place = [slot.north - SLOT[0] * cos, slot.east - SLOT[0] * sin, -slot.height]
    s = path["start"][turn] - SPEED - SLOT[0]
    velocity = [SPEED * cos, SPEED * sin, 0.0]
    way = {"position": place, "ground_velocity": velocity, "path_position": s - SPEED / 1e3}
    keeper.receive(said(0, path_id=int(path["id"]), **way))
    step = at(1)
    assert step.state is not None
    step.state["position"][:2] = slot.north - SLOT[1] * sin, slot.east + SLOT[1] * cos
    step.state["attitude"][2] = slot.course
    airspeed, bearing = airspeed_and_bearing(config, step, told(keeper, step))
    assert (airspeed > SPEED + 0.5) == known
    assert bearing == pytest.approx(slot.course, abs=0.01), "it turns only when its slot does"


def test_what_is_of_the_same_step_changes_nothing(config: AutopilotConfig) -> None:
    """A neighbour that is ahead in lockstep has said it already, one that is behind has not."""
    results = []
    for coming in ([], [said(1, position=[50.0, 9.0, -90.0])]):
        keeper = SlotKeeper(config, None)
        for datagram in (said(0), *coming):
            assert keeper.receive(datagram) is None
        results.append([one.to_dict() for one in keeper.targets(at(1), lockstep=True)])
    assert str(results[0]) == str(results[1])


def test_it_is_told_five_times_a_second_and_where_its_slot_is(config: AutopilotConfig) -> None:
    keeper, heights = SlotKeeper(config, None), 0
    for step in range(1, 1001):
        keeper.receive(said(step - 1))
        heights += "height" in told(keeper, at(step))
        assert keeper.place is not None
        assert keeper.place[0] == pytest.approx(SPEED * step / 1e3 + SLOT[0])
        assert keeper.place[1] == SLOT
    assert heights == 5


def test_when_the_path_ends_it_circles_where_it_is(config: AutopilotConfig) -> None:
    keeper = SlotKeeper(config, None)
    keeper.receive(said(0))
    assert told(keeper, at(1))
    keeper.receive(said(1, path_id=0))
    assert set(told(keeper, at(2))) == {"MAV_CMD_DO_REPOSITION"}
    assert keeper.place is None
    assert not told(keeper, at(3))


def test_one_that_is_silent_is_not_followed(config: AutopilotConfig) -> None:
    keeper = SlotKeeper(config, None)
    keeper.receive(said(0))
    assert told(keeper, at(1))
    assert set(told(keeper, at(500))) == {"MAV_CMD_DO_REPOSITION"}


def test_what_is_no_neighbours_is_dropped(config: AutopilotConfig) -> None:
    keeper = SlotKeeper(config, None)
    assert keeper.receive(said(0, system=2)) == DropReason.STRANGER
    assert keeper.receive(b"") is not None
    assert keeper.receive(said(0)[:-1]) is not None
    assert keeper.receive(said(0, path_position=math.nan)) == DropReason.OUT_OF_RANGE
    assert keeper.receive(said(0, path_rate=math.nan)) == DropReason.OUT_OF_RANGE
    beat = dialect.MAVLink_heartbeat_message(1, 3, 0, 0, 0, 3)
    assert keeper.receive(FramePacker(1, 1).pack(beat)) == DropReason.UNEXPECTED
    assert keeper.targets(at(1), lockstep=True) == []


def test_what_is_of_a_later_step_steers_nobody(config: AutopilotConfig) -> None:
    """Two of them: late, forged, or both."""
    keeper = SlotKeeper(config, None)
    for step in (50, 10**9):
        assert keeper.receive(said(step)) is None
    assert told(keeper, at(1)) == {}


def places_of(keeper: SlotKeeper, *steps: int) -> list[Vec3]:
    """Return its slot at each of these steps."""
    found = []
    for step in steps:
        keeper.receive(said(step - 1))
        keeper.targets(at(step), lockstep=True)
        assert keeper.place is not None
        found.append(keeper.place[1])
    return found


def test_its_slot_changes_with_the_formations_as_those_of_ours_do() -> None:
    changes = {"formation.changes": [{"at_s": 0.1, "slots": {3: {"right_m": -60.0}}}]}
    keeper = SlotKeeper(scenario(**changes).autopilot_config(3), None)
    places = places_of(keeper, *range(1, 60_001, 100))
    assert places[0] == SLOT
    assert max(math.dist(p, q) for p, q in pairwise(places)) < 2.1 * 0.1, "slot_speed_m_s"
    assert places[-1] == pytest.approx((0.0, -60.0, 0.0), abs=0.01)


def test_a_slot_is_ordered_and_taken_back(config: AutopilotConfig) -> None:
    keeper = SlotKeeper(config, None)
    places_of(keeper, 1)
    keeper.order((-20.0, -20.0, 10.0))
    *_, last = places_of(keeper, *range(101, 30_001, 100))
    assert last == pytest.approx((-20.0, -20.0, 10.0), abs=0.01)
    keeper.receive(said(30_299))
    assert told(keeper, at(30_300))["height"].alt == pytest.approx(584.0 + 110.0, abs=0.1)
    keeper.order(None)
    *_, last = places_of(keeper, *range(30_401, 60_001, 100))
    assert last == pytest.approx(SLOT, abs=0.01)


def test_ours_send_it_what_they_are_to_send_it() -> None:
    of_hexagon = scenario()
    assert of_hexagon.slot_keepers == {3}
    bridge, leader = of_hexagon.autopilot_config(3), of_hexagon.autopilot_config(1)
    assert [one.id for one in bridge.neighbours] == [1]
    assert leader.listeners == (bridge.formation_bind,)
    assert [one.id for one in leader.neighbours] == [2]
    assert of_hexagon.autopilot_config(2).listeners == ()


def test_one_that_flies_its_mission_keeps_no_slot() -> None:
    auto = scenario(**{"uavs[2].autopilot.mode": "AUTO"})
    assert not auto.slot_keepers
    assert auto.autopilot_config(3).formation is None
    assert auto.autopilot_config(1).listeners == ()
