"""Flights in formation, in one process: slots are held, the late are waited for, gaps are closed.

Positions are the true ones, and distances from slots are taken on the path.
"""

from typing import Any

import numpy as np
import pytest

from ftc_autopilot.guidance.path import locate
from gcs.fleet.in_process import fly_in_process
from gcs.results.recording import Recording
from gcs.scenario.bundled import find_scenario
from gcs.scenario.model import Scenario, scenario_of, scenario_tree

TRIANGLE = [
    {"between": [1, 2], "weight": 1.0},
    {"between": [1, 3], "weight": 1.0},
    {"between": [2, 3], "weight": 1.0},
]
PER_S = 50  # samples


def flown(name: str, **changes: Any) -> tuple[Scenario, Recording]:
    tree = scenario_tree(name)
    tree["formation"] = tree["formation"] | changes.pop("formation", {})
    scenario = scenario_of(find_scenario(name), tree | changes)
    recording = fly_in_process(scenario)
    assert recording.loss is None
    return scenario, recording


def places(scenario: Scenario, recording: Recording) -> np.ndarray:
    """Path parameter, distance to the right and height of each UAV, shape (samples, n, 3) [m]."""
    planner = scenario.planner()
    path = planner.path(scenario.mission_items())
    states = recording.states[:: 1000 // PER_S]
    result = np.zeros((*states.shape[:2], 3))
    for i in range(states.shape[1]):
        near = 0.0
        for k, state in enumerate(states[:, i]):
            near, right = locate(path, state[0], state[1], near)
            result[k, i] = near, right, -state[2] - 100.0
    return result


def distances(recording: Recording) -> np.ndarray:
    """Least distance of any two UAVs, shape (samples,) [m]."""
    positions = recording.states[:: 1000 // PER_S, :, :3]
    apart = np.linalg.norm(positions[:, :, None] - positions[:, None], axis=-1)
    n = positions.shape[1]
    least: np.ndarray = apart[:, ~np.eye(n, dtype=bool)].min(axis=1)
    return least


@pytest.fixture(scope="module")
def hexagon() -> tuple[Scenario, Recording]:
    return flown("missions/hexagon", duration_s=45.0)


def test_a_formation_holds_its_slots_on_straights_and_in_turns(
    hexagon: tuple[Scenario, Recording],
) -> None:
    scenario, recording = hexagon
    place = places(scenario, recording)[15 * PER_S :]
    slots = np.array([[0.0, 0.0], [-20.0, 20.0], [-20.0, -20.0]])
    off = place[:, 1:, :2] - slots[1:]
    off[..., 0] -= place[:, :1, 0]
    off = np.hypot(*np.moveaxis(off, -1, 0))
    assert np.sqrt(np.mean(off**2)) <= 0.4
    assert off.max() <= 1.3
    assert distances(recording).min() >= 25.0
    assert np.abs(place[..., 2]).max() <= 0.8
    assert recording.signals["slot"][-1, :, :2].tolist() == slots.tolist()


@pytest.mark.parametrize("kind", ["virtual_structure", "leader_follower"])
def test_a_late_aircraft_makes_others_wait_unless_they_lead(kind: str) -> None:
    tree = scenario_tree("missions/hexagon")
    uavs = [dict(uav) for uav in tree["uavs"]]
    uavs[2]["initial"] = uavs[2]["initial"] | {"north_m": -80.0}
    scenario, recording = flown(
        "missions/hexagon", duration_s=30.0, uavs=uavs, formation={"kind": kind}
    )
    xi = places(scenario, recording)[..., 0] + np.array([0.0, 20.0, 20.0])
    assert np.ptp(xi[0]) == pytest.approx(60.0, abs=0.5)
    assert np.ptp(xi[-1]) < 5.0
    leader_speed = np.diff(xi[:, 0]) * PER_S
    slowest = leader_speed[PER_S : 8 * PER_S].min()
    if kind == "virtual_structure":
        assert slowest < 37.0
        assert np.ptp(xi[12 * PER_S]) < 10.0
    else:
        assert slowest > 39.5
    assert leader_speed[-1] == pytest.approx(40.0, abs=0.5)


def test_members_that_change_sides_keep_their_distance() -> None:
    right, left = {"ahead_m": -20, "right_m": 20}, {"ahead_m": -20, "right_m": -20}
    changes = [{"at_s": 8.0, "slots": {2: left, 3: right}}]
    tree = scenario_tree("missions/hexagon")
    scenario, recording = flown(
        "missions/hexagon",
        duration_s=50.0,
        network=tree["network"] | {"edges": TRIANGLE},
        formation={"changes": changes},
    )
    assert scenario.formation is not None
    assert distances(recording).min() >= scenario.formation.separation_m
    place = places(scenario, recording)[-1]
    assert place[:, 1] == pytest.approx([0.0, -20.0, 20.0], abs=2.0)


def test_without_the_barrier_they_would_come_close() -> None:
    """What the test before holds is the barrier's doing."""
    right, left = {"ahead_m": -20, "right_m": 20}, {"ahead_m": -20, "right_m": -20}
    _, recording = flown(
        "missions/hexagon",
        duration_s=25.0,
        formation={"separation_m": 0.0, "changes": [{"at_s": 8.0, "slots": {2: left, 3: right}}]},
    )
    assert distances(recording).min() < 5.0


GRAPHS = {
    "chain": [(1, 2), (2, 3), (3, 4)],
    "the ends are neighbours": [(1, 4), (2, 4), (2, 3)],
    "star of the last": [(1, 4), (2, 4), (3, 4)],
    "others than the slots": [(1, 3), (2, 3), (2, 4)],
}


def line_astern(edges: list[tuple[int, int]], thrust_n: float, time_s: float) -> float:
    """Return the least distance [m] if the first of four loses thrust, and falls back."""
    initial = {"east_m": 0.0, "altitude_m": 100.0, "airspeed_m_s": 40.0}
    fault = {"uav": 1, "actuator": "throttle", "stuck_n": thrust_n, "start_s": 10.0, "end_s": 30.0}
    scenario, recording = flown(
        "missions/hexagon",
        duration_s=time_s,
        uavs=[
            {"id": k + 1, "name": f"UAV {k + 1}", "initial": {"north_m": -25.0 * k, **initial}}
            for k in range(4)
        ],
        network={
            "leader_access": {1: 1.0},
            "edges": [{"between": list(edge), "weight": 1.0} for edge in edges],
        },
        formation={"slots": {k + 1: {"ahead_m": -25.0 * k} for k in range(4)}},
        faults=[fault],
    )
    assert scenario.formation is not None
    assert scenario.formation.separation_m == 15.0
    return float(distances(recording).min())


@pytest.mark.parametrize("edges", GRAPHS.values(), ids=GRAPHS)
def test_word_of_places_keeps_those_apart_who_do_not_hear_each_other(
    edges: list[tuple[int, int]],
) -> None:
    assert line_astern(edges, 500.0, 45.0) >= 14.0


@pytest.mark.parametrize(("thrust_n", "least_m"), [(300.0, 11.0), (0.0, 7.0)])
def test_who_becomes_too_slow_to_be_followed_is_passed(thrust_n: float, least_m: float) -> None:
    assert line_astern(GRAPHS["chain"], thrust_n, 17.0) >= least_m


def test_who_has_lost_an_actuator_leaves_and_the_gap_is_closed() -> None:
    fault = {"uav": 2, "actuator": "aileron", "stuck_deg": 4.0, "start_s": 10.0}
    scenario, recording = flown("missions/departure", duration_s=75.0, faults=[fault])
    slot = recording.signals["slot"]
    assert slot[9_000, :, 1] == pytest.approx([0.0, 20.0, -20.0, 40.0, -40.0])
    assert slot[-1, :, 1] == pytest.approx([0.0, 20.0, -20.0, 20.0, -40.0], abs=0.1)
    assert slot[-1, 1] == pytest.approx([-120.0, 20.0, 50.0], abs=0.1)
    assert scenario.formation is not None
    assert distances(recording).min() >= scenario.formation.separation_m
    place = places(scenario, recording)[-1]
    assert place[3, 1] == pytest.approx(20.0, abs=3.0)
    assert place[1, 2] > 40.0


def test_a_formation_slows_down_for_who_is_degraded() -> None:
    fault = {"uav": 3, "actuator": "aileron", "stuck_deg": 4.0, "start_s": 5.0}
    scenario, recording = flown(
        "missions/hexagon",
        duration_s=25.0,
        faults=[fault],
        formation={"on_lost": "slow", "slow_share": 0.1},
    )
    xi = places(scenario, recording)[..., 0]
    speed = (xi[-1] - xi[-5 * PER_S]) / 4.98
    assert speed == pytest.approx([36.0] * 3, abs=1.0)


def test_a_flight_without_a_formation_has_slots_of_zero(
    hexagon: tuple[Scenario, Recording],
) -> None:
    tree = scenario_tree("missions/hexagon")
    tree["formation"], tree["duration_s"] = None, 0.5
    recording = fly_in_process(scenario_of(find_scenario("missions/hexagon"), tree))
    assert np.all(recording.signals["slot"] == 0.0)
    assert np.all(recording.signals["report_size"] == 0)
    assert np.isfinite(hexagon[1].signals["path_position"]).all()
