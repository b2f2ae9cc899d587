"""Flights on paths: as close as the documentation says, and close again after a fault."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from scenario_edits import edit

from gcs.fleet.in_process import fly_in_process
from gcs.results.figures import FlightSummary
from gcs.results.summary import summarise
from gcs.scenario.model import scenario_of, scenario_tree

SCENARIO_1 = Path("scenarios/paper/scenario1.yaml")
HEXAGON = Path("scenarios/missions/hexagon.yaml")
FASTER = {"controller.reference_bandwidth_rad_s": 6.0}
WIND = {"wind": {"steady": {"north_m_s": 3.0, "east_m_s": -4.0}}}


def flown(duration_s: float = 65.0, **changes: Any) -> FlightSummary:
    """The hexagon, three of its turns, with changes at dotted places."""
    tree = edit(scenario_tree(HEXAGON), {"duration_s": duration_s, **changes})
    scenario = scenario_of(HEXAGON, tree)
    summary = summarise(fly_in_process(scenario), scenario)
    assert summary.loss is None
    return summary


def worst(summary: FlightSummary, figure: str) -> float:
    values = [getattr(uav.path, figure) for uav in summary.uavs]
    assert all(value is not None for value in values)
    return float(max(values))


def alone(**changes: Any) -> dict[str, Any]:
    """One UAV without a formation."""
    tree = scenario_tree(HEXAGON)
    network = {"leader_access": {1: 1.0}, "edges": []}
    return {"uavs": tree["uavs"][:1], "network": network, "formation": None, **changes}


@pytest.mark.parametrize(
    ("changes", "straights", "turns", "height", "slot_rms", "slot_max"),
    [
        ({}, 0.5, 1.0, 0.8, 0.4, 1.3),
        (WIND, 1.5, 2.0, 1.0, 0.5, 1.5),
        (FASTER, 0.3, 0.4, 0.8, 0.15, 0.5),
        ({**FASTER, **WIND}, 0.5, 0.5, 1.0, 0.15, 0.5),  # turns 0.35 to 0.45 by 2 % of wind
    ],
    ids=["calm", "wind", "calm, faster filter", "wind, faster filter"],
)
def test_a_formation_keeps_to_its_path(
    changes: dict[str, Any],
    straights: float,
    turns: float,
    height: float,
    slot_rms: float,
    slot_max: float,
) -> None:
    summary = flown(**changes)
    assert worst(summary, "straight_cross_track_m") <= straights
    assert worst(summary, "turn_cross_track_m") <= turns
    assert worst(summary, "height_max_m") <= height
    assert worst(summary, "slot_rms_m") <= slot_rms
    assert worst(summary, "slot_max_m") <= slot_max
    assert summary.separation is not None
    assert summary.separation.least_m >= 25.0


def messages_per_s(summary: FlightSummary) -> float:
    total = sum(uav.actuator_messages for uav in summary.uavs)
    return total / len(summary.uavs) / summary.duration_s


@pytest.fixture(scope="module")
def usual_messages() -> float:
    """Of a UAV in scenario 1 of the paper, with the same law and no fault."""
    changes = {"controller": {"kind": "surviving"}, "faults": []}
    scenario = scenario_of(SCENARIO_1, edit(scenario_tree(SCENARIO_1), changes))
    return messages_per_s(summarise(fly_in_process(scenario), scenario))


@pytest.mark.parametrize("changes", [{}, WIND], ids=["calm", "wind"])
def test_a_path_takes_few_messages_more(changes: dict[str, Any], usual_messages: float) -> None:
    assert messages_per_s(flown(150.0, **changes)) <= 1.15 * usual_messages


def waypoints(*places: tuple[float, float, float]) -> dict[str, Any]:
    keys = ("north_m", "east_m", "height_m")
    items = [{"waypoint": dict(zip(keys, place, strict=True))} for place in places]
    return {"mission": {"items": items}}


def test_after_a_turn_a_straight_stays() -> None:
    corner = waypoints((800.0, 0.0, 100.0), (800.0, 2500.0, 100.0))
    summary = flown(**alone(), **corner, duration_s=55.0)
    assert worst(summary, "straight_cross_track_m") <= 0.3
    assert worst(summary, "turn_cross_track_m") <= 1.0


def test_a_climb_is_flown_with_its_corners_rounded() -> None:
    """From 10 s on, 3 m/s for 35 s, then level."""
    up = waypoints((500.0, 0.0, 100.0), (1900.0, 0.0, 205.0), (4000.0, 0.0, 205.0))
    summary = flown(**alone(), **up)
    assert worst(summary, "height_max_m") <= 1.5
    assert worst(summary, "height_rms_m") <= 0.3


@pytest.mark.parametrize(
    ("fault", "most"),
    [
        ({"actuator": "rudder", "effectiveness": 0.5}, 8.0),
        ({"actuator": "aileron", "stuck_deg": 4.0}, 3.0),
        ({"actuator": "throttle", "effectiveness": 0.5}, 1.0),
    ],
    ids=["half a rudder", "aileron stuck at trim", "half the thrust"],
)
def test_a_degraded_aircraft_stays_on_its_path(fault: dict[str, Any], most: float) -> None:
    """The fault begins in the first turn and stays."""
    faults: Sequence[dict[str, Any]] = [{"uav": 1, "start_s": 22.0, **fault}]
    healthy = worst(flown(**alone()), "turn_cross_track_m")
    degraded = worst(flown(**alone(faults=faults)), "turn_cross_track_m")
    assert degraded <= most
    assert degraded != healthy


def test_who_starts_beside_the_path_joins_it() -> None:
    """A formation's path begins at home; the leader begins 150 m to its right."""
    summary = flown(45.0, **{"uavs.0.initial.east_m": 150.0})
    assert worst(summary, "turn_cross_track_m") <= 5.0


def test_a_public_survey_is_flown_and_says_where_its_commands_were_passed() -> None:
    """The file is of elsewhere and moved; trigger on and off follow the ends of the first line."""
    tree = scenario_tree(Path("scenarios/airframes/skywalker_x8_designed.yaml"))
    mission = {"file": "tests/data/others/survey.plan", "here": True}
    tree = edit(tree, {"mission": mission, "profile": [], "duration_s": 70.0, "faults": []})
    scenario = scenario_of(Path("survey.yaml"), tree)
    summary = summarise(fly_in_process(scenario), scenario)
    assert summary.loss is None
    commands = summary.uavs[0].commands
    assert [(one.item, one.command) for one in commands] == [
        (3, "DO_SET_CAM_TRIGG_DIST"),
        (5, "DO_SET_CAM_TRIGG_DIST"),
        (7, "DO_SET_CAM_TRIGG_DIST"),
    ]
    corners = [(200.0, 0.0), (800.0, 0.0), (800.0, 200.0)]
    for one, corner in zip(commands, corners, strict=True):
        assert math.dist((one.north_m, one.east_m), corner) < 60.0
    assert FlightSummary.from_json(summary.to_json()) == summary
