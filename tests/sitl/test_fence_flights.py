"""Flights with a fence by real processes: turned back at a fixed step, the same each time."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flying import fly, fly_well, scenario_tree, write_scenario

from gcs.fleet.flight import fly_and_record
from gcs.scenario.model import scenario_of

pytestmark = pytest.mark.sitl

RADIUS_M = 600.0


def fence_tree(**changes: Any) -> dict[str, Any]:
    """One aircraft that a mission leads out of a circle around home."""
    tree = scenario_tree(controller={"kind": "surviving"}, **changes)
    del tree["profile"], tree["faults"]
    tree["uavs"] = tree["uavs"][:1]
    tree["network"] = {"leader_access": {1: 1.0}, "edges": []}
    tree["mission"] = {"items": [{"waypoint": {"north_m": 3000, "east_m": 0, "height_m": 100}}]}
    circle = {"north_m": 0.0, "east_m": 0.0, "radius_m": RADIUS_M}
    tree["fence"] = {"items": [{"circle": circle}]}
    tree["rally"] = {"items": [{"point": {"north_m": -100, "east_m": 50, "height_m": 120}}]}
    return tree


def distances(folder: Path) -> tuple[np.ndarray, bytes]:
    """Distance from home in each step, and the bits of the states."""
    with np.load(folder / "trajectory.npz") as recorded:
        return np.hypot(*recorded["state"][:, 0, :2].T), recorded["state"].tobytes()


def test_a_breach_turns_the_aircraft_back_with_the_same_bits(tmp_path: Path) -> None:
    scenario = write_scenario(tmp_path, fence_tree(duration_s=70.0))
    flights = []
    for name in ("one", "other"):
        folder = tmp_path / name
        done = fly_well(scenario, "--free-ports", "--record=npz", "--out", folder)
        assert "warning: the mission leaves the fence on the way to item 1: a breach there is" in (
            done.stderr.replace("\n", " ")
        )
        flights.append(distances(folder))
    (away, bits), (_, others) = flights
    assert bits == others
    assert away[-1] < RADIUS_M
    assert RADIUS_M < away.max() < RADIUS_M + 700.0  # a turn of 450 m


def test_an_autopilot_that_dies_before_the_breach_still_has_its_fence(tmp_path: Path) -> None:
    scenario = scenario_of(tmp_path / "scenario.yaml", fence_tree(duration_s=40.0))
    flight = fly_and_record(scenario, tmp_path, restart=True, crashes={1: [5000]})
    assert flight.restarts == (1,)
    away = np.hypot(*flight.states[:, 0, :2].T)
    assert RADIUS_M < away.max() < RADIUS_M + 700.0  # 1600 m without a fence


def test_in_process_nobody_watches_it_and_that_is_told(tmp_path: Path) -> None:
    scenario = write_scenario(tmp_path, fence_tree(duration_s=0.5))
    done = fly(scenario, "--in-process", "--out", tmp_path / "flight")
    assert done.returncode == 0
    assert "warning: nobody watches the fence of a flight in process" in done.stderr
