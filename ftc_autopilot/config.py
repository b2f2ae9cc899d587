"""Configuration of one autopilot: controller, links, identity.

It holds nothing of faults, disturbances or the true aircraft: the controller must not know.
"""

from typing import Annotated, Literal, TypeAlias

from pydantic import Field, model_validator

from ftc_autopilot.common.geography import Origin
from ftc_autopilot.control.config import ControllerConfig
from ftc_autopilot.control.laws import LAWS
from ftc_autopilot.control.laws.base import LawParameters
from ftc_autopilot.estimation.parameters import EstimatorParameters
from ftc_autopilot.guidance.fence_parameters import FenceParameters, RallyParameters
from ftc_autopilot.guidance.formation import MAX_MEMBERS
from ftc_autopilot.kinds import AutopilotSection, FtcAutopilot
from mavlink_defs import dialect
from mavlink_defs.config.models import AtMost, HostPort, Problems, SystemId, Title
from mavlink_defs.config.quantity import quantity, whole
from sitl_plant.airframe.gear import Runway
from sitl_plant.sensing.config import Navigation, NavigationSensors

Identity: TypeAlias = Literal["ardupilot", "generic"]
"""Whose conventions a vehicle follows where they differ.

Clients choose modes and the encoding of parameters by HEARTBEAT.autopilot. As ArduPilot,
integers travel C-cast; as a generic autopilot, bytewise, and clients do not know the modes.
"""

TelemetryClockKind: TypeAlias = Literal["wall", "simulated"]
"""What intervals of telemetry count in lockstep; see `ftc_autopilot.vehicle.telemetry_clock`."""


PLUGIN_FAILED = 3
"""Exit status of an autopilot whose flight a plug-in has ended."""

NEIGHBOUR_TIMEOUT_S = 0.25
"""Silence after which a neighbour's edge is dropped, if it sends in every period [s]."""


class AutopilotConfig(ControllerConfig):
    """All that one autopilot process needs.

    Attributes:
        name: Name of the UAV.
        autopilot: Which autopilot flies it; with a foreign one, this is its bridge's configuration.
        identity: Autopilot whose MAVLink conventions it follows.
        fleet: UAVs of the fleet, this one included; none: it does not say.
        origin: Geographic coordinates of north = east = down = 0.
        sensors: What an estimated state comes from.
        sensor_seed: Seed of the sensors of a foreign autopilot.
        estimator: Parameters of its estimator.
        fence: Parameters of its fence.
        rally: Parameters of its rally points.
        runway: The runway that it lands on if its mission has none; none: it knows of none.
        neighbour_timeout_s: Silence after which a neighbour's edge is dropped.
        formation_bind: Where the formation link is received.
        listeners: Where foreign UAVs with a slot are sent this one's state.
        plant: Where the plant receives the simulator link.
        gcs: Addresses of the ground stations, host:port.
        telemetry_clock: What intervals of telemetry count in lockstep.
        signing_key: Key file; none: unsigned.
        silence_timeout_s: Silence after which the plant counts as gone.
    """

    name: Title = Field(min_length=1)
    autopilot: AutopilotSection = FtcAutopilot()
    identity: Identity = "ardupilot"
    fleet: tuple[SystemId, ...] = ()
    origin: Origin = Origin()
    navigation: Navigation = "true_state"
    sensors: NavigationSensors = NavigationSensors()
    sensor_seed: int = whole("", default=1, ge=0)
    estimator: EstimatorParameters = EstimatorParameters()
    fence: FenceParameters = FenceParameters()
    rally: RallyParameters = RallyParameters()
    runway: Runway | None = None
    neighbour_timeout_s: float = quantity("s", default=NEIGHBOUR_TIMEOUT_S, gt=0.0)
    formation_bind: HostPort
    listeners: Annotated[tuple[HostPort, ...], AtMost(MAX_MEMBERS)] = ()
    plant: HostPort
    gcs: tuple[HostPort, ...] = Field(min_length=1)
    telemetry_clock: TelemetryClockKind = "wall"
    signing_key: str | None = None
    silence_timeout_s: float = quantity("s", default=5.0, gt=0.0)

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
    def _is_of_the_fleet(self) -> "AutopilotConfig":
        if self.fleet and self.id not in self.fleet:
            raise Problems([(("fleet",), f"expected UAV {self.id} among them")])
        return self


def parts_of(
    law: LawParameters, navigation: str, *, on_path: bool, has_gear: bool = False
) -> list[str]:
    """Return the parts of the numeric core, of `ftc_autopilot.warm_up.PARTS`, that a UAV flies by.

    Args:
        law: Its parameters. A plug-in is no part, but a law of ours that it extends is one.
        navigation: "true" or "estimated".
        on_path: Whether it may fly a path.
        has_gear: Whether it may take off and land on one.
    """
    uses = {
        "controller": True,
        **{f"law {kind}": isinstance(law, one) for kind, one in LAWS.items()},
        "estimator": navigation == "estimated",
        "guidance": on_path,
        "runway": on_path and has_gear,
    }
    return [part for part, used in uses.items() if used]
