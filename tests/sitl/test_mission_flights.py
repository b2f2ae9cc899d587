"""Missions in space by real processes: the same as in one process, and resumed after a crash."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flying import fly_well, scenario_tree, write_scenario

from gcs.fleet.flight import fly_and_record
from gcs.fleet.in_process import fly_in_process
from gcs.results.recording import Recording
from gcs.scenario.model import Scenario, scenario_of

pytestmark = pytest.mark.sitl

MISSION = [
    {"waypoint": {"north_m": 90.0, "east_m": 0.0, "height_m": 100.0}},
    {"speed": {"airspeed_m_s": 45.0}},
    {"waypoint": {"north_m": 1200.0, "east_m": 900.0, "height_m": 110.0, "within_m": 5.0}},
    {"return_to_launch": {}},
]


def mission_tree(**changes: Any) -> dict[str, Any]:
    """Scenario 1, but each UAV flies the mission from where it is."""
    tree = scenario_tree(mission={"items": MISSION}, controller={"kind": "surviving"}, **changes)
    del tree["profile"], tree["faults"]
    return tree


def test_flights_of_a_mission_are_equal_bit_for_bit(tmp_path: Path) -> None:
    wind = {"steady": {"north_m_s": 3.0, "east_m_s": -4.0}}
    scenario = write_scenario(tmp_path, mission_tree(duration_s=4.0, wind=wind))
    udp, in_process = tmp_path / "udp", tmp_path / "in_process"
    fly_well(scenario, "--quiet", "--free-ports", "--record=npz", "--out", udp)
    fly_well(scenario, "--quiet", "--in-process", "--record=npz", "--out", in_process)
    with np.load(udp / "trajectory.npz") as ours, np.load(in_process / "trajectory.npz") as theirs:
        assert ours.files == theirs.files
        for key in ours.files:
            assert ours[key].tobytes() == theirs[key].tobytes(), key
        assert ours["path_position"][-1].min() > 120.0  # past the first waypoint


def flown(scenario: Scenario, folder: Path) -> Recording:
    return fly_and_record(scenario, folder, restart=True, crashes={2: [1200]})


def test_an_autopilot_that_dies_goes_on_with_its_mission(tmp_path: Path) -> None:
    scenario = scenario_of(tmp_path / "scenario.yaml", mission_tree(duration_s=6.0))
    flight, undisturbed = flown(scenario, tmp_path), fly_in_process(scenario)
    assert flight.restarts == (0, 1, 0)
    position = flight.signals["path_position"][:, 1]
    away = np.flatnonzero(flight.missing[:, 1])
    before, after = position[away[0] - 1], position[away[-1] + 100]
    assert 30.0 < after - before < 60.0  # a second later, on the same path
    # held for a second, its commands led it a little aside and slower
    assert position[-1] == pytest.approx(undisturbed.signals["path_position"][-1, 1], abs=10.0)
    assert flight.states[-1, 1, :2] == pytest.approx(undisturbed.states[-1, 1, :2], abs=15.0)
