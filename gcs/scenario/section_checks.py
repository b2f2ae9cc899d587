"""Checks of the sections of a scenario against each other."""

from collections import Counter
from collections.abc import Mapping

from ftc_autopilot.control.config import plugin_problems, trigger_problems
from gcs.scenario.aircraft_checks import (
    aircraft_law_problems,
    hardware_problems,
    simulator_problems,
    uncertainty_problems,
)
from gcs.scenario.fence import fence_problems
from gcs.scenario.foreign_uavs import network_without
from gcs.scenario.formation_checks import (
    guidance_fit_problems,
    keeper_problems,
    mission_problems,
    network_problems,
    slot_problems,
)
from gcs.scenario.reference_checks import airspeed_problems, fault_problems, profile_problems
from gcs.scenario.scenario_sections import ScenarioSections
from gcs.scenario.sections import Found
from mavlink_defs.config.models import repeated
from mavlink_defs.profile import AirspeedLimits
from sitl_plant.config import start_problems
from sitl_plant.sensing.units import FAULT_NAMES, units_of


def section_problems(scenario: ScenarioSections) -> Found:
    """Yield what of a scenario's sections does not fit together."""
    foreign, uavs, step_us = scenario.foreign, scenario.uavs, scenario.step_us
    ids = [uav.id for uav in uavs]
    own_ids = [i for i in ids if i not in foreign]
    network, formation = network_without(scenario.network, foreign), scenario.own_formation
    trigger = scenario.links.formation.trigger
    silence_s = None if trigger is None else trigger.longest_silence_s
    fault_limits = {i: scenario.aircraft_of(i).fault_limits for i in ids}

    yield from _uav_problems(scenario)
    yield from uncertainty_problems(scenario.aircraft, scenario.uncertainty, uavs)
    yield from trigger_problems(scenario.controller, scenario.trigger, step_us)
    yield from aircraft_law_problems(scenario.aircraft, scenario.controller, uavs)
    yield from plugin_problems(
        scenario.plugins, scenario.controller, scenario.trigger, scenario.guidance
    )
    yield from hardware_problems(
        scenario.sensors, scenario.navigation, scenario.servos, uavs, step_us
    )
    yield from simulator_problems(
        scenario.plant, scenario.disturbance, scenario.uncertainty, scenario.ground, uavs, step_us
    )
    yield from network_problems(network, own_ids)
    yield from slot_problems(formation, network, own_ids, scenario.guidance.period_s, silence_s)
    yield from profile_problems(
        scenario.profile, scenario.mission is not None, _airspeeds(scenario)
    )
    yield from keeper_problems(scenario.slot_keepers, scenario.network, own_ids)
    yield from guidance_fit_problems(
        scenario.guidance, map(scenario.aircraft_of, [*own_ids, *scenario.slot_keepers]), formation
    )
    yield from mission_problems(
        scenario.mission, map(scenario.planner, ids), [uav.initial for uav in uavs], scenario.origin
    )
    yield from fence_problems(
        scenario.fence, scenario.rally, uavs, scenario.planner, scenario.origin
    )
    yield from fault_problems(scenario.faults, fault_limits, _fallible_sensors(scenario), foreign)
    yield from scenario.links.port_problems(ids)


def _uav_problems(scenario: ScenarioSections) -> Found:
    for key in ("id", "name"):
        for i, text in repeated([getattr(uav, key) for uav in scenario.uavs]):
            yield ("uavs", i, key), text
    by_sensors = scenario.navigation == "estimated"
    for i, uav in enumerate(scenario.uavs):
        aircraft, place = uav.aircraft or scenario.aircraft, ("uavs", i, "initial")
        for loc, text in start_problems(uav.initial, aircraft, scenario.ground):
            yield ("uavs", i, *loc), text
        if uav.initial.on_ground and by_sensors:
            text = "flights by sensors begin in the air, as the estimator needs the airspeed"
            yield (*place, "on_ground"), f"{text}; or set 'navigation: true_state'"
        if uav.id in scenario.foreign and by_sensors:
            text = "its sensors are made of the true state: expected 'ftc', or"
            section = ("autopilot",) if uav.autopilot is None else ("uavs", i, "autopilot")
            yield (*section, "kind"), f"{text} navigation: true_state"
        if not uav.initial.on_ground:
            yield from airspeed_problems(place, uav.initial.airspeed_m_s, aircraft.airspeed_limits)


def _airspeeds(scenario: ScenarioSections) -> AirspeedLimits:
    """Return the airspeeds that every aircraft accepts."""
    limits = [(uav.aircraft or scenario.aircraft).airspeed_limits for uav in scenario.uavs]
    lowest, highest = max(one.min_m_s for one in limits), min(one.max_m_s for one in limits)
    return AirspeedLimits(lowest, highest)


def _fallible_sensors(scenario: ScenarioSections) -> dict[int, Mapping[str, int]]:
    """Return how many sensors of each name can fail, by UAV; none of ours by its true state."""
    units = units_of(scenario.sensors.navigation, scenario.step_us)
    carried = Counter(FAULT_NAMES[unit.kind] for unit in units)
    ours = carried if scenario.navigation == "estimated" else {}
    foreign = {uav: own.fallible(carried) for uav, own in scenario.foreign.items()}
    return {uav.id: foreign.get(uav.id, ours) for uav in scenario.uavs}
