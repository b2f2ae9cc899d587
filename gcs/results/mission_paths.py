"""The paths that the missions of a scenario lead along, and whose slots count from whom."""

import numpy as np

from ftc_autopilot.guidance.path import PATH
from ftc_autopilot.hot.navigation import navigate, new_navigation, note_gps
from gcs.scenario.model import Scenario
from mavlink_defs.framing.codec import SIM_STATE, copy_step
from sitl_plant.loop.fleet import PlantState, navigates, new_plant_state, observe


def paths_of(scenario: Scenario) -> np.ndarray | None:
    """Return the path of each UAV, shape (n,), dtype `PATH`; None without a mission.

    It begins where the UAV finds itself before the first step.
    """
    if scenario.mission is None:
        return None
    fleet = new_plant_state(scenario.plant_config())
    items = scenario.mission_items()
    paths = np.zeros(len(scenario.uavs), PATH)
    for i, uav in enumerate(scenario.uavs):
        observe(fleet, i, 0, scenario.step_us)
        here = fleet.uavs[i]["message"]
        if navigates(fleet):
            here = _first_estimate(scenario, uav.id, fleet, i)
        paths[i] = scenario.planner(uav.id).first_path(items, here)
    return paths


def _first_estimate(scenario: Scenario, system: int, fleet: PlantState, i: int) -> np.void:
    """Return what a UAV estimates before the first step, a record of dtype SIM_STATE."""
    navigation = new_navigation(scenario.autopilot_config(system))
    state, samples = navigation.state[0], fleet.sensing.imus[i]
    state["imus"][: len(samples)] = samples
    if fleet.sensing.sites[i]["delivered"] == 1:
        note_gps(state, fleet.sensing.gps[i])
    copy_step(fleet.uavs[i]["message"], fleet.uavs[i]["step"])
    measured = np.zeros(1, SIM_STATE)
    navigate(state, navigation.history, fleet.uavs[i]["step"], measured[0])
    own: np.void = measured[0]
    return own


def leaders_of(scenario: Scenario) -> tuple[int, ...]:
    """Return the indices of the UAVs that slots count from; none without a formation."""
    if scenario.formation is None:
        return ()
    access = scenario.network.leader_access
    return tuple(i for i, uav in enumerate(scenario.uavs) if uav.id in access)


def silent_in(scenario: Scenario) -> list[int]:
    """Return the indices of the UAVs whose autopilots do not say where on the path they are."""
    silent = scenario.foreign.keys() - scenario.slot_keepers
    return [i for i, uav in enumerate(scenario.uavs) if uav.id in silent]
