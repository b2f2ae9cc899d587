"""The path that the mission of a scenario asks for, as figures of a flight need it."""

import numpy as np

from ftc_autopilot.guidance.path import PATH
from gcs.scenario.model import Scenario
from sitl_plant.fleet import new_plant_state, observe


def paths_of(scenario: Scenario) -> np.ndarray | None:
    """Return the path of each UAV, shape (n,), dtype `PATH`; None without a mission."""
    if scenario.mission is None:
        return None
    fleet, planner = new_plant_state(scenario.plant_config()), scenario.planner()
    items = scenario.mission_items()
    paths = np.zeros(len(scenario.uavs), PATH)
    for i in range(len(paths)):
        observe(fleet, i, 0, scenario.step_us)
        paths[i] = planner.first_path(items, fleet.messages[i])
    return paths


def leaders_of(scenario: Scenario) -> tuple[int, ...]:
    """Return the indices of the UAVs that slots count from; none without a formation."""
    if scenario.formation is None:
        return ()
    access = scenario.network.leader_access
    return tuple(i for i, uav in enumerate(scenario.uavs) if uav.id in access)
