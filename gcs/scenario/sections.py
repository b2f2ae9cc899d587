"""Parts of a scenario that are neither the plant's nor the autopilots' own.

Each part is checked by itself here; `gcs.scenario.model` checks that they fit together.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias, Union, cast

from pydantic import Discriminator, Field, Tag, create_model, model_validator

from ftc_autopilot.config import NEIGHBOUR_TIMEOUT_S, TelemetryClockKind
from ftc_autopilot.control.config import FormationTrigger
from ftc_autopilot.kinds import AutopilotSection
from mavlink_defs.capture.impairment import Impairment
from mavlink_defs.config.models import (
    AtMost,
    HostPort,
    Loc,
    Model,
    Port,
    Problem,
    Problems,
    SystemId,
    Title,
)
from mavlink_defs.config.quantity import quantity
from mavlink_defs.constants import LAST_SYSTEM
from mavlink_defs.endpoint import EndpointError, parse_address
from mavlink_defs.faults.spec import SPECS, ActuatorFaultSpec, FaultSpec, SensorFaultSpec
from mavlink_defs.ports import FORMATION_BASE_PORT, GCS_PORT, PLANT_PORT
from mavlink_defs.profile import Segment
from sitl_plant.actuators.config import Servos
from sitl_plant.airframe.config import Aircraft
from sitl_plant.config import InitialState
from sitl_plant.simulators.config import PlantSection

Found: TypeAlias = Iterator[Problem | tuple[Loc, str]]

_MAX_EDGES = LAST_SYSTEM * (LAST_SYSTEM - 1) // 2

Weight = Annotated[float, quantity("", "Weight in the communication graph.", gt=0.0)]


class ScenarioUav(Model):
    """One UAV of the fleet.

    Attributes:
        name: Name that displays show.
        initial: State at t = 0.
        servos: Its servos, in place of the scenario's.
        aircraft: Its nominal aircraft, in place of the scenario's.
        plant: What flies it, in place of the scenario's.
        autopilot: Which autopilot flies it, in place of the scenario's.
    """

    id: SystemId
    name: Title = Field(min_length=1)
    initial: InitialState
    servos: Servos | None = None
    aircraft: Aircraft | None = None
    plant: PlantSection | None = None
    autopilot: AutopilotSection | None = None


class Edge(Model):
    """An undirected edge of the communication graph.

    Attributes:
        between: Two UAVs, a_ij = a_ji.
    """

    between: tuple[SystemId, SystemId]
    weight: Weight


class Network(Model):
    """The communication graph, section II-D of the paper.

    Attributes:
        leader_access: h_i of the UAVs that have it.
        edges: Pairs of UAVs that communicate.
    """

    leader_access: Annotated[dict[SystemId, Weight], AtMost(LAST_SYSTEM)]
    edges: Annotated[tuple[Edge, ...], AtMost(_MAX_EDGES)] = ()


class ProfileSegment(Model):
    """Reference values from a time on; a ramp reaches its values when the next segment starts.

    Attributes:
        start_s: Start, exclusive.
        airspeed_m_s: Airspeed V_r.
        roll_deg: Roll angle.
        pitch_deg: Pitch angle.
        yaw_deg: Yaw angle.
        shape: Values in force from the start, or approached linearly.
    """

    start_s: float = quantity("s", ge=0.0)
    airspeed_m_s: float = quantity("m/s", gt=0.0)
    roll_deg: float = quantity("deg", default=0.0, ge=-90.0, le=90.0)
    pitch_deg: float = quantity("deg", default=0.0, gt=-90.0, lt=90.0)
    yaw_deg: float = quantity("deg", default=0.0, ge=-180.0, le=180.0)
    shape: Literal["step", "ramp"] = "step"

    def segment(self) -> Segment:
        """Return the segment as it is uploaded."""
        return Segment(
            start_s=self.start_s,
            airspeed_m_s=self.airspeed_m_s,
            roll_deg=self.roll_deg,
            pitch_deg=self.pitch_deg,
            yaw_deg=self.yaw_deg,
            ramp=self.shape == "ramp",
        )


class FaultOfUav(FaultSpec):
    """A fault of one UAV of the fleet, in simulated time.

    Attributes:
        start_s: Start, exclusive.
    """

    uav: SystemId
    start_s: float = quantity("s", ge=0.0)

    def overlaps(self, other: "FaultOfUav") -> bool:
        """Return whether both act on the same actuator or sensor at some time."""
        one, two = (fault.command().resolved(0.0) for fault in (self, other))
        same = self.uav == other.uav and (one.covers(two) or two.covers(one))
        return same and one.window.overlaps(two.window)

    @property
    def shown_window(self) -> str:
        """Its window as a text."""
        end = "...)" if self.end_s is None else f"{self.end_s:g}]"
        return f"({self.start_s:g}, {end} s"


class ScenarioFault(FaultOfUav, ActuatorFaultSpec):
    """A fault of an actuator of one UAV of the fleet, in simulated time."""


class ScenarioSensorFault(FaultOfUav, SensorFaultSpec):
    """A fault of a navigation sensor of one UAV of the fleet, in simulated time."""


def _on_uav(spec: type[FaultSpec]) -> type[FaultOfUav]:
    bases: tuple[type[Any], ...] = (FaultOfUav, spec)
    return cast(type[FaultOfUav], create_model(f"Scenario{spec.__name__}", __base__=bases))


_OWN: dict[str, type[FaultOfUav]] = {"actuator": ScenarioFault, "sensor": ScenarioSensorFault}

SCENARIO_FAULTS = {key: _OWN.get(key) or _on_uav(spec) for key, spec in SPECS.items()}
"""The faults of a scenario, by the key that says what fails."""


def _part(fault: Any) -> str:
    """Return the tag of a fault of a scenario: what fails, an actuator if it says nothing."""
    if isinstance(fault, FaultOfUav):
        return f"<{fault.FAMILY.key}>"
    said = [key for key in SCENARIO_FAULTS if isinstance(fault, dict) and key in fault]
    return f"<{said[-1] if said else 'actuator'}>"


if TYPE_CHECKING:
    AnyScenarioFault: TypeAlias = FaultOfUav
else:
    AnyScenarioFault = Annotated[
        Union[*(Annotated[model, Tag(f"<{key}>")] for key, model in SCENARIO_FAULTS.items())],
        Discriminator(_part),
    ]
"""A fault of a scenario: of a sensor if it has the key `sensor`."""


class Impairments(Model):
    """Links that are relayed and impaired; a link with no keys is only relayed and counted.

    Attributes:
        plant: The simulator link; none: no relay.
        gcs: The GCS link; none: no relay.
        formation: The formation link; none: no relay.
    """

    plant: Impairment | None = None
    gcs: Impairment | None = None
    formation: Impairment | None = None


class FormationLinks(Model):
    """The links between neighbours.

    Attributes:
        trigger: Trigger of the neighbour messages; none: every period.
    """

    trigger: FormationTrigger | None = None

    @property
    def neighbour_timeout_s(self) -> float:
        """Silence after which a neighbour's edge is dropped [s]."""
        return self.trigger.neighbour_timeout_s if self.trigger else NEIGHBOUR_TIMEOUT_S


class Links(Model):
    """Addresses and ports; everything binds `host`.

    Attributes:
        host: IPv4 address or name of the host that all processes bind.
        gcs_port: UDP port on which ground stations receive.
        plant_port: UDP port of the simulator link.
        formation_base_port: UAV i binds this UDP port plus i.
        plant_relay: Where autopilots send instead of to the plant itself.
        telemetry_clock: What intervals of telemetry count in lockstep: simulated time, or the
            slower of simulated and wall-clock time.
        signing_key: Key file; none: unsigned.
        formation: The links between neighbours.
        impairments: Relays that the flight puts in front of links.
    """

    host: str = "127.0.0.1"
    gcs_port: Port = GCS_PORT
    plant_port: Port = PLANT_PORT
    formation_base_port: Port = FORMATION_BASE_PORT
    plant_relay: HostPort | None = None
    telemetry_clock: TelemetryClockKind = "wall"
    signing_key: str | None = None
    formation: FormationLinks = FormationLinks()
    impairments: Impairments | None = None

    @model_validator(mode="after")
    def _host_usable(self) -> "Links":
        try:
            parse_address(self.address(self.gcs_port))
        except EndpointError:
            text = f"expected an IPv4 address or a host name, got {self.host!r}"
            raise Problems([(("host",), text)]) from None
        return self

    @model_validator(mode="after")
    def _one_relay(self) -> "Links":
        if self.plant_relay is not None and self.impairments is not None:
            text = "cannot be combined with 'impairments', which bring a relay of their own"
            raise Problems([(("plant_relay",), text)])
        return self

    def address(self, port: int) -> str:
        """Return a port of this host as host:port."""
        return f"{self.host}:{port}"

    def port_problems(self, uav_ids: list[int]) -> Found:
        """Yield place in a scenario and text where two sockets would share a port."""
        taken = {self.gcs_port: "gcs_port"}
        if self.plant_port in taken:
            text = f"expected another port than gcs_port, got {self.plant_port}"
            yield ("links", "plant_port"), text
        taken[self.plant_port] = "plant_port"
        base = self.formation_base_port
        for uav_id in dict.fromkeys(uav_ids):
            port = base + uav_id
            if port > 65535:
                text = f"expected at most 65535 with the UAV's id added, got {base} + {uav_id}"
                yield ("links", "formation_base_port"), text
            elif port in taken:
                text = f"clashes with {taken[port]}: UAV {uav_id} would bind {base} + {uav_id} too"
                yield ("links", "formation_base_port"), text
            taken.setdefault(port, f"the formation link of UAV {uav_id}")
        if self.plant_relay is not None:
            relay = parse_address(self.plant_relay)
            if relay.host == self.host and relay.port in taken:
                text = f"clashes with {taken[relay.port]}, got '{relay}'"
                yield ("links", "plant_relay"), text
