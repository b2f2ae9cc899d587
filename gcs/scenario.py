"""Scenario files: one YAML tree that says everything about a flight.

The parts are those of plant and autopilots; here they are put together, checked against each
other, and taken apart again into what each process is told. Times of the profile and of faults
count simulation time, which starts together with the mission.
"""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Literal, TypeAlias

from pydantic import Field, model_validator

from ftc_autopilot.config import AutopilotConfig, ControllerParameters, Neighbour, Trigger
from ftc_autopilot.network import formation_problems
from mavlink_defs.config import HostPort, Loc, Model, Port, Problems, SystemId, load, repeated
from mavlink_defs.endpoint import EndpointError, parse_address
from mavlink_defs.faults import ACTUATORS, MAX_FAULTS, MAX_FREQUENCY_HZ, Fault
from mavlink_defs.profile import MAX_SEGMENTS, Segment
from mavlink_defs.quantity import quantity, whole
from sitl_plant.config import (
    Aircraft,
    Disturbance,
    InitialState,
    PlantConfig,
    PlantUav,
    Uncertainty,
    true_aircraft,
)

__all__ = [
    "Edge", "Links", "Network", "ProfileSegment", "Scenario", "ScenarioFault", "ScenarioUav",
    "load_scenario",
]  # fmt: skip

Found: TypeAlias = Iterator[tuple[Loc, str]]

Weight = Annotated[float, quantity("", gt=0.0, doc="Weight in the communication graph.")]


class ScenarioUav(Model):
    """One UAV of the fleet."""

    id: SystemId
    name: str = Field(min_length=1)
    initial: InitialState


class Edge(Model):
    """An undirected edge of the communication graph."""

    between: tuple[SystemId, SystemId] = Field(description="Two UAVs, a_ij = a_ji.")
    weight: Weight


class Network(Model):
    """The communication graph, section II-D of the paper."""

    leader_access: dict[SystemId, Weight] = Field(description="h_i of the UAVs that have it.")
    edges: tuple[Edge, ...] = ()


class ProfileSegment(Model):
    """Reference values from a time on; those of a ramp are reached when the next one starts."""

    start_s: float = quantity("s", ge=0.0, doc="Start, exclusive.")
    airspeed_m_s: float = quantity("m/s", gt=0.0, doc="V_r.")
    roll_deg: float = quantity("deg", ge=-90.0, le=90.0, default=0.0, doc="Roll angle.")
    pitch_deg: float = quantity("deg", gt=-90.0, lt=90.0, default=0.0, doc="Pitch angle.")
    yaw_deg: float = quantity("deg", ge=-180.0, le=180.0, default=0.0, doc="Yaw angle.")
    shape: Literal["step", "ramp"] = "step"

    def segment(self) -> Segment:
        """The segment as it is uploaded."""
        return Segment(
            start_s=self.start_s,
            airspeed_m_s=self.airspeed_m_s,
            roll_deg=self.roll_deg,
            pitch_deg=self.pitch_deg,
            yaw_deg=self.yaw_deg,
            ramp=self.shape == "ramp",
        )


class ScenarioFault(Model):
    """An actuator fault (13), (19): applied = effectiveness * commanded + value.

    The value is a bias on what is left of the command, or what the actuator is stuck at.
    """

    uav: SystemId
    actuator: Literal["aileron", "elevator", "rudder", "throttle"]
    effectiveness: float | None = quantity(
        "", ge=0.0, le=1.0, default=None, doc="What is left of the command; 1 unless stuck."
    )
    bias_deg: float | None = quantity("deg", default=None, doc="Bias of a surface.")
    bias_n: float | None = quantity("N", default=None, doc="Bias of the throttle.")
    stuck_deg: float | None = quantity("deg", default=None, doc="Angle of a stuck surface.")
    stuck_n: float | None = quantity("N", default=None, doc="Thrust of a stuck throttle.")
    frequency_hz: float = quantity(
        "Hz", ge=0.0, le=MAX_FREQUENCY_HZ, default=0.0, doc="Of the value; 0: constant."
    )
    start_s: float = quantity("s", ge=0.0, doc="Start, exclusive.")
    end_s: float | None = quantity("s", gt=0.0, default=None, doc="End, inclusive; none: never.")

    @model_validator(mode="after")
    def _consistent(self) -> "ScenarioFault":
        Problems.check(self._problems())
        return self

    def _problems(self) -> Found:
        fits, other = ("n", "deg") if self.actuator == "throttle" else ("deg", "n")
        for kind in ("bias", "stuck"):
            if getattr(self, f"{kind}_{other}") is not None:
                text = f"does not fit the {self.actuator}; did you mean '{kind}_{fits}'?"
                yield (f"{kind}_{other}",), text
        bias, stuck = self._values(fits)
        if stuck is not None:
            if bias is not None:
                yield (f"bias_{fits}",), f"cannot stand together with 'stuck_{fits}'"
            if self.effectiveness:
                text = f"expected 0 or none with 'stuck_{fits}', got {self.effectiveness!r}"
                yield ("effectiveness",), text
        elif bias is not None and self.effectiveness == 0.0:
            yield (f"bias_{fits}",), f"nothing is left to be biased; did you mean 'stuck_{fits}'?"
        elif bias is None and self.effectiveness is None and not any(self._values(other)):
            text = f"expected 'effectiveness', 'bias_{fits}' or 'stuck_{fits}', got none of them"
            yield (), text
        if self.end_s is not None and self.end_s <= self.start_s:
            yield ("end_s",), f"expected > start_s = {self.start_s!r} s, got {self.end_s!r}"

    def _values(self, unit: str) -> tuple[float | None, float | None]:
        return getattr(self, f"bias_{unit}"), getattr(self, f"stuck_{unit}")

    @property
    def value_key(self) -> str | None:
        """The key that holds the fault's value; None if it has none."""
        keys = ("bias_deg", "bias_n", "stuck_deg", "stuck_n")
        return next((key for key in keys if getattr(self, key) is not None), None)

    @property
    def window(self) -> str:
        """When it acts, in words."""
        end = "...)" if self.end_s is None else f"{self.end_s:g}]"
        return f"({self.start_s:g}, {end} s"

    def overlaps(self, other: "ScenarioFault") -> bool:
        """Tell whether both act on the same actuator at some time."""
        ends = [math.inf if fault.end_s is None else fault.end_s for fault in (self, other)]
        same = (self.uav, self.actuator) == (other.uav, other.actuator)
        return same and self.start_s < ends[1] and other.start_s < ends[0]

    def command(self) -> Fault:
        """The fault as MAV_CMD_FTC_SET_FAULT carries it."""
        key = self.value_key
        healthy = 0.0 if key is not None and key.startswith("stuck") else 1.0
        return Fault(
            actuator=ACTUATORS.index(self.actuator),
            effectiveness=healthy if self.effectiveness is None else self.effectiveness,
            value=0.0 if key is None else getattr(self, key),
            frequency_hz=self.frequency_hz,
            start_s=self.start_s,
            end_s=math.nan if self.end_s is None else self.end_s,
        )


class Links(Model):
    """Addresses and ports; everything binds `host`."""

    host: str = "127.0.0.1"
    gcs_port: Port = 14550
    plant_port: Port = 14560
    formation_base_port: Port = Field(default=14600, description="UAV i binds this plus i.")
    plant_relay: HostPort | None = Field(
        default=None, description="Where autopilots send instead of to the plant itself."
    )

    @model_validator(mode="after")
    def _host_usable(self) -> "Links":
        try:
            parse_address(self.address(self.gcs_port))
        except EndpointError:
            text = f"expected an IPv4 address or a host name, got {self.host!r}"
            raise Problems([(("host",), text)]) from None
        return self

    def address(self, port: int) -> str:
        """A port of this host as host:port."""
        return f"{self.host}:{port}"


class Scenario(Model):
    """One flight: fleet, aircraft, controller, network, references, faults, links."""

    name: str = Field(min_length=1)
    description: str = ""
    duration_s: float = quantity("s", gt=0.0, le=86_400.0, doc="Length of the flight.")
    step_us: int = whole("us", ge=1, le=100_000, default=1000, doc="Control period.")
    aircraft: Aircraft = Field(description="The nominal aircraft.")
    uncertainty: Uncertainty = Uncertainty()
    disturbance: Disturbance = Disturbance()
    controller: ControllerParameters = ControllerParameters()
    trigger: Trigger = Trigger()
    uavs: tuple[ScenarioUav, ...] = Field(min_length=1)
    network: Network
    profile: tuple[ProfileSegment, ...] = Field(min_length=1, max_length=MAX_SEGMENTS)
    faults: tuple[ScenarioFault, ...] = ()
    links: Links = Links()

    def plant_config(self, speed: float | None = None) -> PlantConfig:
        """What the plant is told.

        Args:
            speed: Real-time factor; None for lockstep.
        """
        aircraft = true_aircraft(self.aircraft, self.uncertainty)
        return PlantConfig(
            step_us=self.step_us,
            duration_s=self.duration_s,
            speed=speed,
            bind=self.links.address(self.links.plant_port),
            disturbance=self.disturbance,
            uavs=tuple(
                PlantUav(id=uav.id, initial=uav.initial, aircraft=aircraft) for uav in self.uavs
            ),
        )

    def autopilot_config(self, uav_id: int) -> AutopilotConfig:
        """What the autopilot of one UAV is told.

        Raises:
            KeyError: The scenario has no such UAV.
        """
        names = {uav.id: uav.name for uav in self.uavs}
        links = self.links
        return AutopilotConfig(
            id=uav_id,
            name=names[uav_id],
            step_us=self.step_us,
            aircraft=self.aircraft,
            controller=self.controller,
            trigger=self.trigger,
            neighbours=tuple(
                Neighbour(id=other, weight=weight, address=self._formation_address(other))
                for other, weight in self._neighbours(uav_id)
            ),
            formation_bind=self._formation_address(uav_id),
            plant=links.plant_relay or links.address(links.plant_port),
            gcs=(links.address(links.gcs_port),),
        )

    def segments(self) -> tuple[Segment, ...]:
        """The profile as it is uploaded to every UAV."""
        return tuple(segment.segment() for segment in self.profile)

    def fault_commands(self) -> list[tuple[int, Fault]]:
        """UAV id and fault of each fault, in the order of the file."""
        return [(fault.uav, fault.command()) for fault in self.faults]

    def _neighbours(self, uav_id: int) -> list[tuple[int, float]]:
        return [
            (edge.between[1 - end], edge.weight)
            for edge in self.network.edges
            for end in (0, 1)
            if edge.between[end] == uav_id
        ]

    def _formation_address(self, uav_id: int) -> str:
        return self.links.address(self.links.formation_base_port + uav_id)

    @model_validator(mode="after")
    def _sections_fit_together(self) -> "Scenario":
        checks = (
            self._uav_problems, self._aircraft_problems, self._network_problems,
            self._profile_problems, self._fault_problems, self._port_problems,
        )  # fmt: skip
        Problems.check(problem for check in checks for problem in check())
        return self

    def _uav_problems(self) -> Found:
        for key in ("id", "name"):
            for i, text in repeated([getattr(uav, key) for uav in self.uavs]):
                yield ("uavs", i, key), text
        for i, uav in enumerate(self.uavs):
            yield from self._airspeed_problems(("uavs", i, "initial"), uav.initial.airspeed_m_s)

    def _aircraft_problems(self) -> Found:
        try:
            true_aircraft(self.aircraft, self.uncertainty)
        except Problems as exc:
            yield from ((("uncertainty", *loc), text) for loc, text in exc.problems)

    def _network_problems(self) -> Found:
        edges = [(*edge.between, edge.weight) for edge in self.network.edges]
        access = self.network.leader_access
        for loc, text in formation_problems(self._ids, edges, access):
            yield ("network", *loc), text

    def _profile_problems(self) -> Found:
        if self.profile[0].start_s != 0.0:
            text = f"expected 0 s in the first segment, got {self.profile[0].start_s!r}"
            yield ("profile", 0, "start_s"), text
        for i in range(1, len(self.profile)):
            before, start = self.profile[i - 1].start_s, self.profile[i].start_s
            if start <= before:
                text = f"overlaps profile[{i - 1}]: expected > {before!r} s, got {start!r}"
                yield ("profile", i, "start_s"), text
        for i in sorted({0, len(self.profile) - 1}):
            if self.profile[i].shape == "ramp":
                text = "expected 'step' in the first and the last segment, got 'ramp'"
                yield ("profile", i, "shape"), text
        for i, segment in enumerate(self.profile):
            yield from self._airspeed_problems(("profile", i), segment.airspeed_m_s)

    def _airspeed_problems(self, loc: Loc, airspeed_m_s: float) -> Found:
        low, high = self.aircraft.airspeed_min_m_s, self.aircraft.airspeed_max_m_s
        if not low <= airspeed_m_s <= high:
            text = f"expected [{low:g}, {high:g}] m/s, the aircraft's limits, got {airspeed_m_s!r}"
            yield (*loc, "airspeed_m_s"), text

    def _fault_problems(self) -> Found:
        stop, thrust = self.aircraft.surface_limit_deg, self.aircraft.thrust_limit_n
        limits = {
            "bias_deg": (-stop, stop, "deg"),
            "stuck_deg": (-stop, stop, "deg"),
            "bias_n": (-thrust, thrust, "N"),
            "stuck_n": (0.0, thrust, "N"),
        }
        for i, fault in enumerate(self.faults):
            if sum(other.uav == fault.uav for other in self.faults[:i]) == MAX_FAULTS:
                text = f"UAV {fault.uav} has more than {MAX_FAULTS} faults, as many as fit"
                yield ("faults", i, "uav"), text
            if fault.uav not in self._ids:
                ids = ", ".join(map(str, self._ids))
                yield ("faults", i, "uav"), f"expected one of the UAVs {ids}, got {fault.uav}"
            if (key := fault.value_key) is not None:
                low, high, unit = limits[key]
                value = getattr(fault, key)
                if not low <= value <= high:
                    text = f"expected [{low:g}, {high:g}] {unit}, the aircraft's limits"
                    yield ("faults", i, key), f"{text}, got {value!r}"
            for j in range(i):
                if fault.overlaps(self.faults[j]):
                    text = (
                        f"overlaps faults[{j}]: the {fault.actuator} of UAV {fault.uav} has a "
                        f"fault in {self.faults[j].window} already, got {fault.window}"
                    )
                    yield ("faults", i), text

    def _port_problems(self) -> Found:
        links = self.links
        taken = {links.gcs_port: "gcs_port"}
        if links.plant_port in taken:
            yield (
                ("links", "plant_port"),
                f"expected another port than gcs_port, got {links.plant_port}",
            )
        taken[links.plant_port] = "plant_port"
        base = links.formation_base_port
        for uav_id in dict.fromkeys(self._ids):
            port = base + uav_id
            if port > 65535:
                text = f"expected at most 65535 with the UAV's id added, got {base} + {uav_id}"
                yield ("links", "formation_base_port"), text
            elif port in taken:
                text = f"clashes with {taken[port]}: UAV {uav_id} would bind {base} + {uav_id} too"
                yield ("links", "formation_base_port"), text
            taken.setdefault(port, f"the formation link of UAV {uav_id}")
        if links.plant_relay is not None:
            relay = parse_address(links.plant_relay)
            if relay.host == links.host and relay.port in taken:
                text = f"clashes with {taken[relay.port]}, got '{relay}'"
                yield ("links", "plant_relay"), text

    @property
    def _ids(self) -> list[int]:
        return [uav.id for uav in self.uavs]


def load_scenario(path: Path | str) -> Scenario:
    """Read a scenario file and check it.

    Raises:
        ConfigError: The file cannot be used; it names every problem found.
    """
    return load(path, Scenario)
