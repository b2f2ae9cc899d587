"""Take-off and landing on the plant's ground: from standstill to standstill, and what fails."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from scenario_edits import edit

from ftc_autopilot.guidance.runway_state import (
    AROUND,
    CLIMBING,
    FINAL,
    FLARE,
    FLYING,
    NO_THRUST,
    OFF_LINE,
    REJECTED,
    ROLL_OUT,
    ROLLING,
    STOPPED,
)
from gcs.fleet import in_process
from gcs.fleet.remarks import remarks_of
from gcs.results.recording import Steps
from gcs.scenario.model import load_scenario, scenario_of, scenario_tree
from mavlink_defs.config.models import ConfigError
from mavlink_defs.mission_files import mission_item

_LOOK_STEPS = 100
CIRCUIT = Path("scenarios/runway/circuit.yaml")
SHORT: dict[str, Any] = {
    "mission.items": [
        {"take_off": {"height_m": 40.0}},
        {"waypoint": {"north_m": 1000.0, "east_m": 0.0, "height_m": 40.0}},
        {"waypoint": {"north_m": 1000.0, "east_m": -950.0, "height_m": 40.0}},
        {"waypoint": {"north_m": -1650.0, "east_m": -950.0, "height_m": 40.0}},
        {"waypoint": {"north_m": -1650.0, "east_m": 0.0, "height_m": 40.0}},
        {"land": {"north_m": 0.0, "east_m": 0.0}},
    ],
    "duration_s": 190.0,
}
LAND = {"land": {"north_m": 0.0, "east_m": 0.0}}
FAR = {"waypoint": {"north_m": -2500.0, "east_m": 0.0, "height_m": 60.0}}


class Flown(NamedTuple):
    """Phases in their order, and how the flight ended."""

    phases: list[int]
    reason: int
    position: Any  # at its end [m]
    off: float  # largest distance from the centre line on the ground [m]
    gear: np.void


@pytest.fixture
def fly(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Flown]:
    """Return what flies the circuit with changes at dotted places."""
    monkeypatch.setattr(in_process, "_CHUNK_STEPS", _LOOK_STEPS)

    def flown(**changes: Any) -> Flown:
        scenario = scenario_of(CIRCUIT, edit(scenario_tree(CIRCUIT), changes))
        flight = in_process.begin(scenario)
        runway, own = flight.controllers.uavs[0]["guidance"]["runway"], flight.fleet.uavs[0]
        phases, off = list[int](), [0.0]

        def look(_: Steps) -> None:
            phase = int(runway["phase"])
            if not phases or phases[-1] != phase:
                phases.append(phase)
            if phase in {ROLLING, ROLL_OUT, REJECTED}:
                off.append(abs(float(own["state"][1])))

        room = in_process.room_of(scenario, _LOOK_STEPS)
        ending = in_process.fly_on(
            scenario,
            flight,
            lambda begin, end: room.part(0, end - begin)._replace(first=begin),
            on_steps=look,
        )
        assert ending.loss is None
        return Flown(phases, int(runway["reason"]), own["state"][:3], max(off), own["gear"])

    return flown


@pytest.mark.parametrize("law", ["pid", "surviving"])
def test_a_circuit_is_flown_from_standstill_to_standstill(
    fly: Callable[..., Flown], law: str
) -> None:
    circuit = fly(**{**SHORT, "controller": {"kind": law}})
    assert circuit.phases == [ROLLING, CLIMBING, FLYING, FINAL, FLARE, ROLL_OUT, STOPPED]
    worst = circuit.gear["worst"]
    assert circuit.off <= 3.0
    assert abs(worst["position"][1]) <= 3.0
    assert worst["sink"] <= 1.0
    assert abs(math.degrees(worst["bank"])) <= 5.0


def test_a_line_too_short_for_a_landing_is_flown_over_and_around_to_a_longer_one(
    fly: Callable[..., Flown],
) -> None:
    start = {"north_m": -900.0, "east_m": 0.0, "altitude_m": 40.0, "airspeed_m_s": 40.0}
    near = {"waypoint": {"north_m": -300.0, "east_m": 0.0, "height_m": 40.0}}
    changes = {"uavs.0.initial": start, "mission.items": [near, LAND], "duration_s": 200.0}
    landed = fly(**changes)
    assert landed.phases == [FLYING, FINAL, FLARE, ROLL_OUT, STOPPED]
    assert abs(landed.gear["worst"]["position"][1]) <= 3.0
    assert abs(landed.position[0]) <= 300.0
    remarks = remarks_of(scenario_of(CIRCUIT, edit(scenario_tree(CIRCUIT), changes)))
    begin = "mission: item 2: an approach of 300 m is too short for 40 m of height at 35.9 m/s"
    assert any(remark.startswith(begin) for remark in remarks)


@pytest.mark.parametrize(
    ("fault", "most_m"),
    [
        ({"actuator": "aileron", "stuck_deg": 6.0}, 10.0),
        ({"actuator": "rudder", "stuck_deg": 15.0}, 10.0),
        ({"actuator": "throttle", "effectiveness": 0.3}, 3.0),
    ],
)
def test_who_leans_or_is_slow_on_the_final_lands_on_the_line_all_the_same(
    fly: Callable[..., Flown], fault: dict[str, Any], most_m: float
) -> None:
    """Stuck, they drifted away by tens of metres in the flare; weak, it went around for ever."""
    start = {"north_m": -2200.0, "east_m": 0.0, "altitude_m": 40.0, "airspeed_m_s": 40.0}
    changes = {
        "uavs.0.initial": start,
        "mission.items": [SHORT["mission.items"][4], LAND],
        "faults": [{"uav": 1, "start_s": 5.0, **fault}],
        "duration_s": 110.0,
    }
    landed = fly(**changes)
    assert landed.phases == [FLYING, FINAL, FLARE, ROLL_OUT, STOPPED]
    assert abs(landed.gear["worst"]["position"][1]) <= most_m
    assert landed.gear["worst"]["sink"] <= 1.5


@pytest.mark.parametrize("name", ["runway/aileron_stuck", "runway/launcher"])
def test_bundled_flights_with_a_fault_end_on_the_runway(name: str) -> None:
    _lands_well(name)


def test_the_bundled_glide_ends_on_the_runway() -> None:
    _lands_well("runway/engine_lost")


def test_a_cessna_of_jsbsim_flies_from_its_wheels_to_its_wheels() -> None:
    _lands_well("runway/c172p")


def _lands_well(name: str) -> None:
    ground = in_process.fly_and_summarise(load_scenario(name)).uavs[0].ground
    assert ground is not None
    assert ground.outcome == "landed"
    assert ground.worst is not None
    assert abs(ground.worst.east_m) <= 5.0


def test_a_take_off_without_thrust_is_rejected(fly: Callable[..., Flown]) -> None:
    """Half of the thrust is more than a take-off takes of the paper's aircraft; a tenth is not."""
    fault = {"uav": 1, "actuator": "throttle", "effectiveness": 0.1, "start_s": 0.0}
    rejected = fly(faults=[fault], duration_s=40.0)
    assert rejected.phases == [ROLLING, REJECTED, STOPPED]
    assert rejected.reason == NO_THRUST
    assert rejected.gear["touchdowns"] == 0


def test_an_approach_that_is_not_stable_is_given_up_and_flown_again(
    fly: Callable[..., Flown],
) -> None:
    """The wind moves it from the line by more than half of a runway so narrow."""
    start = {"north_m": -1900.0, "east_m": 0.0, "altitude_m": 40.0, "airspeed_m_s": 40.0}
    around = fly(
        **{
            "uavs.0.initial": start,
            "mission.items": [SHORT["mission.items"][4], LAND],
            "runway": None,
            "wind.turbulence": "light",
            "runway_guidance": {"width_m": 0.02, "go_arounds": 1},
            "duration_s": 300.0,
        }
    )
    assert around.phases == [FLYING, FINAL, AROUND, FLYING, FINAL, FLARE, ROLL_OUT, STOPPED]
    assert around.reason == OFF_LINE
    assert abs(around.gear["worst"]["position"][1]) <= 3.0


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"mission.items": [FAR, LAND]}, "stands on the ground; begin with NAV_TAKEOFF"),
        ({"aircraft.gear.kind": "belly"}, "neither wheels nor a launcher"),
        ({"navigation": "estimated"}, "flights by sensors begin in the air"),
        ({"runway.length_m": 100.0}, "the runway is 100 m long, a take-off takes"),
        ({"mission.items.4.waypoint.height_m": 1.0}, "raise the item before"),
        ({"mission": None, "profile": [{"start_s": 0.0}]}, "a profile begins in the air"),
    ],
)
def test_what_cannot_be_flown_is_refused_before_the_flight(
    changes: dict[str, Any], text: str
) -> None:
    if "profile" in changes:
        angles = {"airspeed_m_s": 40.0, "roll_deg": 0.0, "pitch_deg": 0.0, "yaw_deg": 0.0}
        changes["profile"] = [{"start_s": 0.0, **angles}]
    with pytest.raises(ConfigError, match=text):
        scenario_of(CIRCUIT, edit(scenario_tree(CIRCUIT), changes))


@pytest.mark.parametrize(
    ("height_m", "remark"),
    [
        (-3.0, ["item 6: touchdown 3 m below the ground; flown on it"]),
        (0.5, []),
        (30.0, ["item 6: touchdown 30 m above home: that is in the air, if it is flat"]),
    ],
)
def test_a_landing_that_is_not_on_the_ground_is_remarked_on(
    height_m: float, remark: list[str]
) -> None:
    scenario = scenario_of(CIRCUIT, scenario_tree(CIRCUIT))
    *before, land = scenario.mission_items()
    lands = mission_item(6, 21, (), land.x, land.y, height_m)
    assert list(scenario.planner().remarks((*before, lands))) == remark


def test_an_aircraft_without_gear_does_not_land() -> None:
    start = {"north_m": -2600.0, "east_m": 0.0, "altitude_m": 60.0, "airspeed_m_s": 40.0}
    changes = {"aircraft.gear": None, "uavs.0.initial": start, "mission.items": [FAR, LAND]}
    with pytest.raises(ConfigError, match="no gear to land on"):
        scenario_of(CIRCUIT, edit(scenario_tree(CIRCUIT), changes))
