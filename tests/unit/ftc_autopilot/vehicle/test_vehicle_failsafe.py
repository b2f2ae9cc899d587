"""What a vehicle does by itself when an actuator is declared lost."""

from typing import Any

import numpy as np
import pytest
from flying_bench import FlyingBench
from vehicle_bench import ACCEPTED, ARM, DENIED, START, Bench, of_type

from ftc_autopilot.common.phases import HEALTHY, LOST
from ftc_autopilot.guidance.runway_state import FINAL, FLYING, STOPPED
from ftc_autopilot.hot.checkpoint import VEHICLE
from gcs.scenario.model import Scenario, load_scenario
from mavlink_defs import dialect
from mavlink_defs.constants import AUTO, AUTOLAND, LOITER, RTL, RUDDER, THROTTLE

CIRCUIT, ENGINE_LOST = load_scenario("runway/circuit"), load_scenario("runway/engine_lost")
REPORT, TO_LOITER, TO_LAND, TO_RTL = range(4)


class FailsafeBench(Bench):
    """A bench whose aircraft flies its mission, and whose diagnosis says what a test says."""

    def __init__(self, action: int, scenario: Scenario = CIRCUIT) -> None:
        super().__init__(scenario)
        self.hot.measured["position"] = (-4000.0, 0.0, -60.0)
        self.upload_items(list(scenario.mission_items()))
        self.say(dialect.MAVLink_param_set_message(1, 1, b"COM_ACT_FAIL_ACT", action, 6))
        assert self.command(ARM, 1.0) == ACCEPTED
        assert self.command(START) == ACCEPTED
        self.run()
        self.modes = self.vehicle.modes

    def lose(self, channel: int, looks: int = 2) -> str:
        """Let the diagnosis declare an actuator lost; return what the vehicle tells."""
        self.controllers.uavs[0]["signals"]["phase"][channel] = LOST
        return "".join(self.look() for _ in range(looks))

    def resume(self) -> None:
        """Go on from a checkpoint; the signals of the diagnosis are not in it."""
        saved, plan = np.zeros(1, VEHICLE)[0], self.vehicle.mission_checkpoint()[1]
        self.vehicle.save(saved)
        phases = self.controllers.uavs[0]["signals"]["phase"]
        before, phases[:] = phases.copy(), 0
        self.vehicle.resume(saved, plan)
        phases[:] = before

    def look(self) -> str:
        self.hot.step += 1000
        self.now += 1.0
        self.vehicle.handle_timer(self.now)
        texts = of_type(self.vehicle.gcs_messages(), "STATUSTEXT")
        return "".join(message.text for message in texts)


@pytest.mark.parametrize(
    ("action", "mode", "text"),
    [
        (REPORT, AUTO, ""),
        (TO_LOITER, LOITER, "LOITER"),
        (TO_LAND, AUTO, "landing"),
        (TO_RTL, RTL, "RTL"),
    ],
)
def test_a_lost_actuator_does_what_is_set(action: int, mode: int, text: str) -> None:
    bench = FailsafeBench(action)
    item = bench.modes.current_item()
    said = bench.lose(RUDDER)
    assert ("rudder lost: " + text if text else "") in said
    assert ("failsafe" in said or "lost:" in said) == bool(text)
    assert bench.modes.mode == mode
    assert (bench.modes.current_item() == 5) == (action == TO_LAND or item == 5)


def test_a_surface_that_is_soon_back_does_not_act() -> None:
    bench = FailsafeBench(TO_RTL)
    for _ in range(3):
        bench.lose(RUDDER, looks=1)
        bench.controllers.uavs[0]["signals"]["phase"][RUDDER] = HEALTHY
        bench.look()
    assert bench.modes.mode == AUTO


def test_it_acts_once_and_whoever_changes_the_mode_is_obeyed() -> None:
    bench = FailsafeBench(TO_RTL)
    bench.lose(RUDDER)
    assert bench.command(dialect.MAV_CMD_DO_SET_MODE, 1.0, LOITER) == ACCEPTED
    bench.look()
    assert bench.modes.mode == LOITER


def test_a_resumed_vehicle_does_not_act_again() -> None:
    bench = FailsafeBench(TO_RTL)
    bench.lose(RUDDER)
    assert bench.command(dialect.MAV_CMD_DO_SET_MODE, 1.0, LOITER) == ACCEPTED
    bench.resume()
    assert "lost:" not in bench.look()
    assert bench.modes.mode == LOITER


@pytest.mark.parametrize(("phase", "again"), [(FLYING, 1), (FINAL, 0)])
def test_a_resumed_glide_is_planned_again_up_to_its_final(phase: int, again: int) -> None:
    bench = FailsafeBench(TO_RTL, ENGINE_LOST)
    bench.hot.measured["position"] = (300.0, -400.0, -100.0)
    assert "glide to the runway" in bench.lose(THROTTLE)
    bench.resume()
    bench.controllers.uavs[0]["guidance"]["runway"]["phase"] = phase
    bench.hot.measured["position"][2] -= 10.0
    before = bench.modes.path.number
    assert "lost:" not in bench.look()
    assert bench.modes.path.number == before + again


def test_no_glide_is_planned_for_who_flies_no_path() -> None:
    bench = FailsafeBench(TO_RTL, ENGINE_LOST)
    bench.hot.measured["position"] = (300.0, -400.0, -100.0)
    bench.lose(THROTTLE)
    bench.modes.point((0.0, 0.0, 0.0))
    bench.hot.measured["position"][2] -= 10.0
    bench.look()
    assert not bench.modes.path.flown


def test_without_a_landing_in_the_mission_it_lands_all_the_same() -> None:
    bench = FailsafeBench(TO_LAND)
    bench.upload_items(list(CIRCUIT.mission_items()[:-1]))
    assert "rudder lost: landing" in bench.lose(RUDDER)
    assert bench.modes.mode == AUTOLAND


def test_without_gear_it_returns() -> None:
    bench = FailsafeBench(TO_LAND, load_scenario("missions/race_track"))
    assert "rudder lost: RTL" in bench.lose(RUDDER)
    assert bench.modes.mode == RTL


def test_an_approach_is_flown_to_its_end() -> None:
    bench = FailsafeBench(TO_RTL)
    bench.controllers.uavs[0]["guidance"]["runway"]["phase"] = FINAL
    assert "rudder lost: the approach goes on" in bench.lose(RUDDER)
    assert bench.modes.mode == AUTO


def test_a_throttle_that_holds_the_height_is_no_glide() -> None:
    bench = FailsafeBench(TO_RTL)
    bench.controllers.uavs[0]["signals"]["offset"][THROTTLE] = 1e4
    assert "throttle lost: RTL" in bench.lose(THROTTLE)


@pytest.mark.parametrize(("north", "text"), [(300.0, "glide to the runway"), (-9000.0, "straight")])
def test_without_its_engine_it_glides_to_the_runway_or_straight_ahead(
    north: float, text: str
) -> None:
    """In level flight it would lose its airspeed; out of reach it comes down with wings level."""
    changes: dict[str, Any] = {
        "uavs.0.initial.north_m": north,
        "mission.items.0.waypoint.north_m": north - 2000.0,
    }
    bench = FlyingBench("runway/engine_lost", changes)
    bench.fly_on(170.0, lambda: bench.runway["phase"] == STOPPED)
    assert any(text in one for one in bench.told), bench.told
    assert bench.loss is None
    assert bench.outcome in {"landed", "off the runway"}
    assert abs(float(bench.plant["gear"]["worst"]["bank"])) < 0.1
    assert bench.command(dialect.MAV_CMD_DO_GO_AROUND) == DENIED
    if north == 300.0:
        assert abs(float(bench.plant["state"][1])) < 7.5
