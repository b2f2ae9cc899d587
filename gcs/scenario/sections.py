"""Parts of a scenario that are neither the plant's nor the autopilots' own.

Each part is right by itself; that they fit together is checked by `gcs.scenario.model`.
"""

import math
from collections.abc import Iterator
from typing import Annotated, Literal, TypeAlias

from pydantic import Field, model_validator

from mavlink_defs.capture.impairment import Impairment
from mavlink_defs.config.models import HostPort, Loc, Model, Port, Problems, SystemId
from mavlink_defs.config.quantity import quantity
from mavlink_defs.endpoint import EndpointError, parse_address
from mavlink_defs.faults import ACTUATORS, MAX_FREQUENCY_HZ, Fault
from mavlink_defs.profile import Segment
from sitl_plant.config import InitialState

__all__ = [
    "Edge", "Found", "Impairments", "Links", "Network", "ProfileSegment", "ScenarioFault",
    "ScenarioUav",
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
        """Return the segment as it is uploaded."""
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
        """Return the fault as MAV_CMD_FTC_SET_FAULT carries it."""
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


class Impairments(Model):
    """Links that are relayed and made worse; one with no keys is relayed and counted only."""

    plant: Impairment | None = None
    gcs: Impairment | None = None
    formation: Impairment | None = None


class Links(Model):
    """Addresses and ports; everything binds `host`."""

    host: str = "127.0.0.1"
    gcs_port: Port = 14550
    plant_port: Port = 14560
    formation_base_port: Port = Field(default=14600, description="UAV i binds this plus i.")
    plant_relay: HostPort | None = Field(
        default=None, description="Where autopilots send instead of to the plant itself."
    )
    signing_key: str | None = Field(default=None, description="Key file; none: unsigned.")
    impairments: Impairments | None = Field(
        default=None, description="Relays that the flight puts in front of links."
    )

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
            text = "cannot stand together with 'impairments', which bring a relay of their own"
            raise Problems([(("plant_relay",), text)])
        return self

    def address(self, port: int) -> str:
        """Return a port of this host as host:port."""
        return f"{self.host}:{port}"
