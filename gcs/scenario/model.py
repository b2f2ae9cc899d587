"""Scenario files: one YAML tree that fully describes a flight.

The sections are the plant's and the autopilots'; this module assembles them, checks them against
each other, and derives the configuration of each process. Times of the profile and of faults
are simulated time, which starts together with the mission.
"""

from pathlib import Path
from typing import Any, Self

from pydantic import model_validator

from ftc_autopilot.config import AutopilotConfig
from ftc_autopilot.control.config import Neighbour, plugins_of
from ftc_autopilot.guidance.formation import Formation
from ftc_autopilot.plugins.loading import calling, without_code
from gcs.scenario.aircraft_file import with_named_files, without_nulls
from gcs.scenario.bundled import base_of, find_scenario
from gcs.scenario.fence import (
    Areas,
    numbered,
    parameters_in,
)
from gcs.scenario.foreign_uavs import network_without
from gcs.scenario.scenario_sections import ScenarioSections
from gcs.scenario.section_checks import section_problems
from gcs.scenario.sections import (
    ScenarioFault,
)
from mavlink_defs.config import renamed
from mavlink_defs.config.files import validate
from mavlink_defs.config.inherit import read_inherited
from mavlink_defs.config.models import (
    ConfigError,
    Problem,
    Problems,
)
from mavlink_defs.faults.fault import Fault
from mavlink_defs.mission_files import is_mission_file
from mavlink_defs.profile import Segment, segments_to_items
from mavlink_defs.services.mission import MissionItem
from sitl_plant.actuators.config import ActuatorServos
from sitl_plant.airframe.config import true_aircraft
from sitl_plant.config import PlantConfig, PlantUav

BEFORE = "ardupilot"
"""A section of earlier versions; it has gone when `mavlink_defs.config.renamed.GONE` comes."""


class Scenario(ScenarioSections):
    """One flight: fleet, aircraft, controller, network, references, faults, links."""

    def plant_config(self, speed: float | None = None, *, endless: bool = False) -> PlantConfig:
        """Return the configuration of the plant process.

        Args:
            speed: Real-time factor; None for lockstep.
            endless: Ignore the scenario's duration, and wait for autopilots that have fallen
                silent.
        """
        return PlantConfig(
            step_us=self.step_us,
            duration_s=None if endless else self.duration_s,
            speed=speed,
            wait_for_restart=endless,
            bind=self.links.address(self.links.plant_port),
            signing_key=self.links.signing_key,
            disturbance=self.disturbance,
            wind=self.wind,
            ground=self.ground,
            runway=self.runway,
            sensors=self.sensors,
            navigation=self.navigation,
            origin=self.origin,
            seed=self.seed,
            uavs=tuple(
                PlantUav(
                    id=uav.id,
                    initial=uav.initial,
                    aircraft=true_aircraft(self.aircraft_of(uav.id), self.uncertainty),
                    servos=self.servos_of(uav.id),
                    plant=uav.plant or self.plant,
                )
                for uav in self.uavs
            ),
        )

    def autopilot_config(self, uav_id: int) -> AutopilotConfig:
        """Return the configuration of the autopilot process of one UAV.

        Raises:
            KeyError: The scenario has no such UAV.
        """
        uavs = {uav.id: uav for uav in self.uavs}
        links = self.links
        with calling(type(self.controller), "with_servos"):
            controller = self.controller.with_servos(self.servos_of(uav_id))
        return AutopilotConfig(
            id=uav_id,
            name=uavs[uav_id].name,
            autopilot=uavs[uav_id].autopilot or self.autopilot,
            step_us=self.step_us,
            identity=self.identity,
            fleet=tuple(uavs),
            origin=self.origin,
            navigation=self.navigation,
            sensors=self.sensors.navigation,
            sensor_seed=self.seed,
            estimator=self.estimator,
            aircraft=self.aircraft_of(uav_id),
            controller=controller,
            trigger=self.trigger,
            formation_trigger=links.formation.trigger,
            guidance=self.guidance,
            runway_guidance=self._on_runway,
            failsafe=self.failsafe,
            plugins=plugins_of(self.controller, self.trigger, self.guidance),
            formation=self._formation_of(uav_id),
            leader_access=self.network.leader_access.get(uav_id, 0.0),
            neighbours=tuple(
                Neighbour(id=other, weight=weight, address=self._formation_address(other))
                for other, weight in self.neighbours(uav_id) or self.heard_by(uav_id)
            ),
            listeners=tuple(map(self._formation_address, self.listeners(uav_id))),
            neighbour_timeout_s=links.formation.neighbour_timeout_s,
            formation_bind=self._formation_address(uav_id),
            plant=links.plant_relay or links.address(links.plant_port),
            gcs=(links.address(links.gcs_port),),
            telemetry_clock=links.telemetry_clock,
            signing_key=links.signing_key,
            runway=self.runway,
            **parameters_in(self.fence, self.rally),
        )

    def servos_of(self, uav_id: int) -> ActuatorServos:
        """Return the servos of a UAV, whose throttle has at least the lag of the aircraft's engine.

        Raises:
            KeyError: The scenario has no such UAV.
        """
        own = {uav.id: uav.servos for uav in self.uavs}[uav_id]
        propulsion = self.aircraft_of(uav_id).propulsion
        lag_s = 0.0 if propulsion is None else propulsion.lag_s
        return (own or self.servos).by_actuator().with_engine_lag(lag_s)

    def neighbours(self, uav_id: int) -> list[tuple[int, float]]:
        """Return id and weight of each neighbour of a UAV; a foreign autopilot has none."""
        return [
            (edge.between[1 - end], edge.weight)
            for edge in network_without(self.network, self.foreign).edges
            for end in (0, 1)
            if edge.between[end] == uav_id
        ]

    def heard_by(self, uav_id: int) -> list[tuple[int, float]]:
        """Return id and weight of each UAV of ours by which one with a foreign autopilot flies."""
        if uav_id not in self.slot_keepers:
            return []
        return [
            (edge.between[1 - end], edge.weight)
            for edge in self.network.edges
            for end in (0, 1)
            if edge.between[end] == uav_id and edge.between[1 - end] not in self.foreign
        ]

    def listeners(self, uav_id: int) -> list[int]:
        """Return the UAVs with foreign autopilots that fly by one of ours."""
        heard = {uav: self.heard_by(uav) for uav in sorted(self.slot_keepers)}
        return [uav for uav, of_ours in heard.items() if uav_id in dict(of_ours)]

    def signed(self, key_file: Path) -> Self:
        """Return the same scenario with every link signed."""
        links = self.links.model_copy(update={"signing_key": str(key_file.resolve())})
        return self.model_copy(update={"links": links})

    def segments(self) -> tuple[Segment, ...]:
        """Return the profile; empty if a mission is flown."""
        return tuple(segment.segment() for segment in self.profile)

    def mission_items(self) -> tuple[MissionItem, ...]:
        """Return profile or mission as it is uploaded to every UAV; item 0 is home."""
        if self.mission is not None:
            return self.mission.mission_items(self.origin)
        return tuple(segments_to_items(self.segments(), 0, 0))

    def areas(self) -> Areas:
        """Return fence and rally points as they are uploaded to every UAV."""
        sections = (self.fence, self.rally)
        return Areas(*(() if one is None else numbered(one.items, self.origin) for one in sections))

    def fault_commands(self) -> list[tuple[int, Fault]]:
        """Return UAV id and fault of each fault, in the order of the file."""
        return [(fault.uav, fault.command()) for fault in self.faults]

    @property
    def actuator_faults(self) -> tuple[ScenarioFault, ...]:
        """The faults of actuators."""
        return tuple(fault for fault in self.faults if isinstance(fault, ScenarioFault))

    def _formation_of(self, uav_id: int) -> Formation | None:
        """Return the formation as a UAV has it; None: it flies in none."""
        if uav_id in self.slot_keepers:
            return self.formation
        return None if uav_id in self.foreign else self.own_formation

    def _formation_address(self, uav_id: int) -> str:
        return self.links.address(self.links.formation_base_port + uav_id)

    @model_validator(mode="before")
    @classmethod
    def _of_before(cls, data: Any) -> Any:
        """Take the section `ardupilot` of earlier versions as the outputs of the autopilot."""
        if not isinstance(data, dict) or BEFORE not in data:
            return data
        rest = {key: value for key, value in data.items() if key != BEFORE}
        own = rest.get("autopilot")
        if isinstance(own, dict) and own.get("kind") == "ardupilot":
            renamed.warn(BEFORE, "autopilot.outputs")
            rest["autopilot"] = {"outputs": data[BEFORE], **own}
        return rest

    @model_validator(mode="after")
    def _sections_fit_together(self) -> "Scenario":
        Problems.check(section_problems(self))
        return self

    @property
    def steps(self) -> int:
        """Control periods of the whole flight."""
        return round(self.duration_s * 1e6 / self.step_us)


def load_scenario(name: Path | str) -> Scenario:
    """Read a scenario, with what it extends, and check it.

    Args:
        name: A file, or the name of a bundled scenario.

    Raises:
        ConfigError: The file cannot be used; it names every problem found.
    """
    path = find_scenario(name)
    return scenario_of(path, scenario_tree(path))


def read_scenario(name: Path | str) -> Scenario:
    """Read a scenario as `load_scenario` does, but run no code of plug-ins: it cannot be flown."""
    with without_code():
        return load_scenario(name)


def scenario_tree(name: Path | str, *, is_base: bool = False) -> dict[Any, Any]:
    """Read a scenario and what it extends, as plain data that is not checked yet.

    Args:
        name: A file, or the name of a bundled scenario.
        is_base: Another file names it: what is no scenario is not quoted.

    Raises:
        ConfigError: A file cannot be read, is not a YAML mapping, or extends itself.
    """
    path = find_scenario(name)
    if is_mission_file(path):
        raise ConfigError(path, [Problem((), "a mission, not a scenario; see gcs mission")])
    known = {*Scenario.model_fields, BEFORE}
    tree = read_inherited(path, known, base_of, with_named_files, is_base=is_base)
    return without_nulls(tree)


def scenario_of(path: Path | str, tree: dict[Any, Any]) -> Scenario:
    """Check plain data read from a scenario file.

    Raises:
        ConfigError: It is not a valid scenario; every problem is named, after the path.
    """
    if "scenario" in tree and "aircraft" not in tree:
        raise ConfigError(path, [Problem((), "a campaign, not a scenario; see gcs campaign")])
    scenario = validate(path, without_nulls(with_named_files(path, tree)), Scenario)
    key = scenario.links.signing_key
    return scenario if key is None else scenario.signed(Path(path).parent / key)
