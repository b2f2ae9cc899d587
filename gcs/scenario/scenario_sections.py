"""The sections of a scenario, and what several of them together say."""

from typing import Annotated

from pydantic import Field

from ftc_autopilot.common.geography import Origin
from ftc_autopilot.config import Identity
from ftc_autopilot.control.config import LawTrigger
from ftc_autopilot.control.laws import Controller
from ftc_autopilot.control.laws.proposed import Proposed
from ftc_autopilot.estimation.parameters import EstimatorParameters
from ftc_autopilot.guidance.failsafe_parameters import FailsafeParameters
from ftc_autopilot.guidance.formation import Formation
from ftc_autopilot.guidance.laws import Guidance
from ftc_autopilot.guidance.laws.path_following import PathFollowing
from ftc_autopilot.guidance.planner import Planner
from ftc_autopilot.guidance.runway import RunwayParameters, figures_of
from ftc_autopilot.kinds import AutopilotSection, ForeignSection, FtcAutopilot
from gcs.scenario.fence import (
    FenceSection,
    RallySection,
)
from gcs.scenario.foreign_uavs import formation_without
from gcs.scenario.mission import MissionSection
from gcs.scenario.sections import (
    AnyScenarioFault,
    Links,
    Network,
    ProfileSegment,
    ScenarioUav,
)
from mavlink_defs.config.models import (
    AtMost,
    Model,
    Prose,
    Title,
)
from mavlink_defs.config.quantity import quantity, whole
from mavlink_defs.constants import LAST_SYSTEM
from mavlink_defs.profile import MAX_SEGMENTS
from sitl_plant.actuators.config import Servos
from sitl_plant.air.config import Disturbance, Wind
from sitl_plant.airframe.config import Aircraft, Uncertainty
from sitl_plant.airframe.gear import Ground, Runway
from sitl_plant.config import Seed
from sitl_plant.sensing.config import Navigation, Sensors
from sitl_plant.simulators.config import OwnPlant, PlantSection


class ScenarioSections(Model):
    """The sections of a scenario, and what several of them together say.

    Attributes:
        name: Name of the scenario.
        description: Purpose of the scenario, in a line or more.
        duration_s: Length of the flight.
        step_us: Control period.
        aircraft: The nominal aircraft of every UAV that has none of its own.
        plant: What flies the aircraft of every UAV that says nothing else.
        autopilot: Which autopilot flies every UAV that says nothing else.
        uncertainty: True aircraft relative to the nominal one.
        disturbance: Disturbances of every aircraft.
        wind: Motion of the air.
        ground: The ground.
        runway: A runway on it; none: the ground is the same everywhere.
        servos: Servos of every aircraft that has none of its own.
        sensors: Sensors of every aircraft.
        estimator: Parameters of the estimator of every UAV.
        controller: Control law of every UAV, and its parameters.
        trigger: Event triggers of every UAV; its law's if there is no `mode`.
        guidance: Guidance law of every UAV on a path.
        runway_guidance: Take-off and landing of every UAV.
        failsafe: What every UAV does by itself.
        plugins: Digest of the code of each plug-in, by its name: filled in when the scenario is
            read. Other code is not flown.
        uavs: The fleet.
        network: The communication graph.
        formation: Slots on the path of the mission; none: all fly on it.
        profile: Reference of the flight, if no mission.
        mission: Path of the flight, in place of a profile.
        fence: Areas and heights that UAVs must not leave; none: no fence.
        rally: Points that RTL leads to; none: it leads home.
        faults: Faults of actuators and sensors, at most 1000.
        links: Addresses, ports, signing, impairments.
        origin: Geographic coordinates of north = east = down = 0.
        identity: Autopilot whose MAVLink conventions the UAVs follow.
    """

    name: Title = Field(min_length=1)
    description: Prose = ""
    duration_s: float = quantity("s", gt=0.0, le=86_400.0)
    step_us: int = whole("us", default=1000, ge=1, le=100_000)
    aircraft: Aircraft
    plant: PlantSection = OwnPlant()
    autopilot: AutopilotSection = FtcAutopilot()
    uncertainty: Uncertainty = Uncertainty()
    disturbance: Disturbance = Disturbance()
    wind: Wind = Wind()
    ground: Ground = Ground()
    runway: Runway | None = None
    servos: Servos = Servos()
    sensors: Sensors = Sensors()
    navigation: Navigation = "true_state"
    estimator: EstimatorParameters = EstimatorParameters()
    seed: Seed = 1
    controller: Controller = Proposed()
    trigger: LawTrigger = Field(default={}, validate_default=True)
    guidance: Guidance = PathFollowing()
    runway_guidance: RunwayParameters = RunwayParameters()
    failsafe: FailsafeParameters = FailsafeParameters()
    plugins: Annotated[dict[str, str], AtMost(100)] = Field(default={})
    uavs: Annotated[tuple[ScenarioUav, ...], AtMost(LAST_SYSTEM)] = Field(min_length=1)
    network: Network
    formation: Formation | None = None
    profile: Annotated[tuple[ProfileSegment, ...], AtMost(MAX_SEGMENTS)] = ()
    mission: MissionSection | None = None
    fence: FenceSection | None = None
    rally: RallySection | None = None
    faults: Annotated[tuple[AnyScenarioFault, ...], AtMost(1000)] = ()
    links: Links = Links()
    origin: Origin = Origin()
    identity: Identity = "ardupilot"

    def aircraft_of(self, uav_id: int) -> Aircraft:
        """Return the nominal aircraft of a UAV.

        Raises:
            KeyError: The scenario has no such UAV.
        """
        return {uav.id: uav.aircraft or self.aircraft for uav in self.uavs}[uav_id]

    def planner(self, uav_id: int | None = None) -> Planner:
        """Return what makes the paths of missions.

        Args:
            uav_id: For the aircraft of this UAV; None: for the scenario's.
        """
        aircraft = self.aircraft if uav_id is None else self.aircraft_of(uav_id)
        bandwidth = self.controller.reference_bandwidth_rad_s
        runway = figures_of(self._on_runway, self.guidance, aircraft, bandwidth)
        return Planner(aircraft, self.guidance, self.origin, self.own_formation, runway)

    @property
    def _on_runway(self) -> RunwayParameters:
        """Take-off and landing on the runway, if there is one."""
        own, runway = self.runway_guidance, self.runway
        return own if runway is None else own.on(runway.length_m, runway.width_m)

    @property
    def foreign(self) -> dict[int, ForeignSection]:
        """Which foreign autopilots fly which UAVs, by system id."""
        flown = ((uav.id, uav.autopilot or self.autopilot) for uav in self.uavs)
        return {uav: own for uav, own in flown if not isinstance(own, FtcAutopilot)}

    @property
    def slot_keepers(self) -> frozenset[int]:
        """UAVs with foreign autopilots that their bridges steer to their slots on the path."""
        if self.formation is None or self.mission is None:
            return frozenset()
        foreign, slots = self.foreign, self.formation.slots
        return frozenset(uav for uav, own in foreign.items() if own.takes_slots and uav in slots)

    @property
    def own_formation(self) -> Formation | None:
        """The formation of UAVs with autopilots of ours; None: there is none."""
        return formation_without(self.formation, self.foreign)
