"""Checks of a scenario's fleet as a formation: its graph, its slots, guidance, the common path."""

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence

from ftc_autopilot.common.geography import Origin
from ftc_autopilot.control.communication_graph import formation_problems
from ftc_autopilot.guidance.aircraft_limits import guidance_problems, limits_of
from ftc_autopilot.guidance.formation import Formation
from ftc_autopilot.guidance.laws import Guidance
from ftc_autopilot.guidance.legs import Pose
from ftc_autopilot.guidance.mission_path import Start
from ftc_autopilot.guidance.planner import Planner
from ftc_autopilot.guidance.reach import most_links, reach_problems
from gcs.scenario.mission import MissionSection
from gcs.scenario.sections import Found, Network
from mavlink_defs.config.models import Loc
from mavlink_defs.profile import ItemError
from sitl_plant.airframe.config import Aircraft
from sitl_plant.config import InitialState


def network_problems(network: Network, ids: Sequence[int]) -> Found:
    """Yield what is wrong with the communication graph of the UAVs with these ids."""
    edges = [(*edge.between, edge.weight) for edge in network.edges]
    if not ids:  # all have foreign autopilots
        return
    for loc, text in formation_problems(ids, edges, network.leader_access):
        yield ("network", *loc), text


def slot_problems(
    formation: Formation | None,
    network: Network,
    ids: Sequence[int],
    period_s: float,
    silence_s: float | None,
) -> Found:
    """Yield what is wrong with the slots of a formation.

    Args:
        formation: The formation, if there is one.
        network: The communication graph.
        ids: Of the UAVs.
        period_s: Of guidance [s].
        silence_s: Longest time between two messages to a neighbour [s]; None: sent in each step.
    """
    if formation is None:
        return
    for uav_id in sorted(set(ids) - formation.slots.keys()):
        yield ("formation", "slots"), f"expected a slot of each UAV, got none of UAV {uav_id}"
    for uav_id in sorted(formation.slots.keys() - set(ids)):
        known = ", ".join(map(str, ids))
        yield ("formation", "slots", uav_id), f"expected one of the UAVs {known}, got {uav_id}"
    if formation.slots.keys() != set(ids):
        return
    edges = [edge.between for edge in network.edges]
    most = most_links(len(ids), period_s, silence_s)
    for loc, text in reach_problems(formation, edges, most):
        yield ("formation", *loc), text


def keeper_problems(keepers: Iterable[int], network: Network, ours: Sequence[int]) -> Found:
    """Yield which UAVs with foreign autopilots have a slot, and hear nobody who knows where it is.

    Args:
        keepers: Their ids.
        network: The communication graph, with them.
        ours: Ids of the UAVs with autopilots of ours.
    """
    for uav in sorted(keepers):
        joined = {end for edge in network.edges if uav in edge.between for end in edge.between}
        if joined.isdisjoint(ours):
            text = f"expected an edge of UAV {uav}, which keeps a slot, to a UAV of ours"
            yield ("network", "edges"), f"{text}; or set its autopilot.mode to AUTO"


def guidance_fit_problems(
    guidance: Guidance, aircraft: Iterable[Aircraft], formation: Formation | None
) -> Found:
    """Yield which airspeeds of guidance the aircraft cannot have, or cannot share.

    The members of a formation fly one path, at one airspeed.
    """
    fleet = list(aircraft)
    problems = (guidance_problems(guidance, one) for one in fleet)
    yield from dict.fromkeys(itertools.chain.from_iterable(problems))  # each once
    cruises = {limits_of(guidance, one).cruise_m_s for one in fleet}
    if formation is not None and len(cruises) > 1:
        own = " and ".join(f"{V:g}" for V in sorted(cruises))
        text = f"missing; expected one airspeed for all members, whose own are {own} m/s"
        yield ("guidance", "cruise_m_s"), text


def mission_problems(
    mission: MissionSection | None,
    planners: Iterable[Planner],
    starts: Iterable[InitialState],
    origin: Origin,
) -> Found:
    """Yield what is wrong with a mission.

    Args:
        mission: The mission, if one is flown.
        planners: Of every UAV.
        starts: Where each of them begins.
        origin: Of the scenario.
    """
    found: dict[tuple[Loc, str], None] = {}  # each once, though of several aircraft
    for i, (planner, initial) in enumerate(zip(planners, starts, strict=True)):
        if mission is not None:
            found |= dict.fromkeys(_path_problems(mission, planner, initial, origin))
        elif initial.on_ground:
            text = "a profile begins in the air; give a mission that begins with take_off"
            found[("uavs", i, "initial", "on_ground"), text] = None
    yield from found


def _path_problems(
    mission: MissionSection, planner: Planner, initial: InitialState, origin: Origin
) -> Iterator[tuple[Loc, str]]:
    items = mission.mission_items(origin)
    pose = Pose(initial.north_m, initial.east_m, math.radians(initial.yaw_deg))
    try:
        planner.check(items)
        if initial.on_ground:
            planner.path(items, Start(pose, 0.0, planner.limits.cruise_m_s, stands=True))
    except ItemError as error:
        yield ("mission", "items", error.seq - 1), error.reason
