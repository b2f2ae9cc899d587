"""Configuration of one autopilot: nominal aircraft, controller, trigger, neighbours, links.

It holds nothing of faults, disturbances or the true aircraft: the controller must not know.
Names are the paper's, in ASCII; defaults are the values of Table III, or where the paper gives
none, a set that flies well with Table III kept to the letter. Angles inside the laws are rad.
"""

from typing import Annotated, Literal, TypeAlias

from pydantic import AfterValidator, Field, model_validator

from ftc_autopilot.control.laws import Controller
from ftc_autopilot.control.laws.proposed import Proposed
from ftc_autopilot.control.schedule import Schedule, schedule
from ftc_autopilot.geography import Origin
from mavlink_defs import dialect
from mavlink_defs.config.models import HostPort, Model, Problems, SystemId, repeated
from mavlink_defs.config.quantity import quantity, whole
from sitl_plant.config import Aircraft
from sitl_plant.hardware import ActuatorServos

__all__ = ["AutopilotConfig", "Controller", "Identity", "Neighbour", "Origin", "Trigger"]

Identity: TypeAlias = Literal["ardupilot", "generic"]
"""Whose conventions a vehicle follows where they differ.

Clients choose modes and the encoding of parameters by HEARTBEAT.autopilot. As ArduPilot,
integers travel C-cast; as a generic autopilot, bytewise, and clients do not know the modes.
"""


class Trigger(Model):
    """Event triggers (25) and (29)."""

    mode: Literal["per_channel", "joint", "periodic"] = Field(
        default="per_channel",
        description="Each surface has its own events, any one's event updates all three, or "
        "there is no trigger: every channel is sent in every period.",
    )
    a1: Schedule[
        Annotated[float, quantity("", ge=0.0, lt=1.0, doc="Relative threshold of the thrust.")]
    ] = schedule(0.01, doc="Relative threshold of the thrust, a1 of (25).")
    a2_n: Schedule[
        Annotated[float, quantity("N", ge=0.0, doc="Absolute threshold of the thrust.")]
    ] = schedule(
        [{"until_s": 14.0, "value": 0.5}, {"value": 1.0}],
        doc="Absolute threshold of the thrust, a2 of (25) [N].",
    )
    b1: Schedule[
        Annotated[float, quantity("", ge=0.0, lt=1.0, doc="Relative threshold of a surface.")]
    ] = schedule(0.01, doc="Relative threshold of the surfaces, b1 of (29).")
    b2_deg: Schedule[
        Annotated[float, quantity("deg", ge=0.0, doc="Absolute threshold of a surface.")]
    ] = schedule(1.0, doc="Absolute threshold of the surfaces, b2 of (29) [deg].")


def _with_ideal_servos(controller: Controller) -> Controller:
    """Return the parameters, complete: who gives none of the servos has ideal ones."""
    return controller.with_servos(ActuatorServos())


class Neighbour(Model):
    """One edge of the graph, seen from one of its ends."""

    id: SystemId
    weight: float = quantity("", gt=0.0, doc="Weight a_ij.")
    address: HostPort = Field(description="Where its formation link is received.")


class AutopilotConfig(Model):
    """All that one autopilot process needs."""

    id: SystemId
    name: str = Field(min_length=1, description="Name of the UAV.")
    step_us: int = whole("us", ge=1, le=100_000, default=1000, doc="Control period.")
    identity: Identity = Field(
        default="ardupilot", description="Autopilot whose MAVLink conventions it follows."
    )
    origin: Origin = Field(
        default=Origin(), description="Geographic coordinates of north = east = down = 0."
    )
    aircraft: Aircraft = Field(description="The nominal aircraft.")
    controller: Annotated[Controller, AfterValidator(_with_ideal_servos)] = Field(
        default=Proposed(), description="Control law and its parameters."
    )
    trigger: Trigger = Field(default=Trigger(), description="Event triggers.")
    neighbours: tuple[Neighbour, ...] = Field(
        default=(), description="Neighbours in the communication graph."
    )
    neighbour_timeout_s: float = quantity(
        "s", gt=0.0, default=0.25, doc="Silence after which a neighbour's edge is dropped."
    )
    formation_bind: HostPort = Field(description="Where the formation link is received.")
    plant: HostPort = Field(description="Where the plant receives the simulator link.")
    gcs: tuple[HostPort, ...] = Field(
        min_length=1, description="Addresses of the ground stations, host:port."
    )
    signing_key: str | None = Field(default=None, description="Key file; none: unsigned.")
    silence_timeout_s: float = quantity(
        "s", gt=0.0, default=5.0, doc="Silence after which the plant counts as gone."
    )

    @property
    def mav_autopilot(self) -> int:
        """MAV_AUTOPILOT of the identity."""
        if self.identity == "ardupilot":
            return dialect.MAV_AUTOPILOT_ARDUPILOTMEGA
        return dialect.MAV_AUTOPILOT_GENERIC

    @property
    def param_capability(self) -> int:
        """MAV_PROTOCOL_CAPABILITY of the encoding of parameters."""
        if self.identity == "ardupilot":
            return dialect.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST
        return dialect.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE

    @model_validator(mode="after")
    def _neighbours_distinct(self) -> "AutopilotConfig":
        ids = [neighbour.id for neighbour in self.neighbours]
        problems = repeated(ids)
        problems += [(i, f"UAV {n} is this UAV itself") for i, n in enumerate(ids) if n == self.id]
        Problems.check((("neighbours", i, "id"), text) for i, text in problems)
        return self
