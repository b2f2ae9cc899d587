"""Which autopilot flies a UAV: ours, or the program of another project beside its bridge."""

from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Discriminator, Field, Tag

from mavlink_defs import dialect
from mavlink_defs.config.models import Model, Title
from mavlink_defs.config.quantity import quantity
from sitl_plant.ardupilot.config import ArduPilot

_MODES = {"TAKEOFF": 13, "LOITER": 12, "CRUISE": 7, "FBWB": 6, "GUIDED": 15}
"""custom_mode numbers of ArduPlane."""


class FtcAutopilot(Model):
    """The autopilot of ftc-sitl.

    Attributes:
        kind: The autopilot of ftc-sitl, with the scenario's law.
    """

    kind: Literal["ftc"] = "ftc"


class ArduPlaneAutopilot(Model):
    """An ArduPlane SITL, which a bridge starts and flies by its JSON interface.

    Attributes:
        kind: ArduPlane.
        binary: Its program, built for SITL.
        defaults: File of its parameters, --defaults; none: derived from the aircraft.
        mode: Mode in which it is armed; none: AUTO with a mission, else LOITER.
        outputs: Which of its outputs moves which actuator, and its launch.
    """

    kind: Literal["ardupilot"]
    binary: Title = Field(min_length=1)
    defaults: Title | None = None
    mode: Literal["AUTO", "TAKEOFF", "LOITER", "CRUISE", "FBWB", "GUIDED"] | None = None
    ready_within_s: float = quantity(
        "s", "Longest time, by its own clock, until its EKF is ready.", 120.0, gt=0.0
    )
    outputs: ArduPilot = ArduPilot()

    def commands(self, has_mission: bool) -> list[tuple[int, tuple[float, ...]]]:
        """Return the commands that a station gives before it arms: MAV_CMD and parameters.

        Args:
            has_mission: Whether a mission is there to be flown.
        """
        mode = self.mode or ("AUTO" if has_mission else "LOITER")
        if mode == "AUTO":
            return [(dialect.MAV_CMD_MISSION_START, ())]
        custom = dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        return [(dialect.MAV_CMD_DO_SET_MODE, (custom, _MODES[mode]))]


def _kind(value: Any) -> Any:
    if isinstance(value, dict):
        return value.get("kind", "ftc")
    return getattr(value, "kind", "ftc")


ForeignSection: TypeAlias = ArduPlaneAutopilot
"""A foreign autopilot; another one is another class in this union and in `AutopilotSection`."""

AutopilotSection: TypeAlias = Annotated[
    Annotated[FtcAutopilot, Tag("ftc")] | Annotated[ArduPlaneAutopilot, Tag("ardupilot")],
    Discriminator(_kind),
]
"""Which autopilot flies a UAV, discriminated by `kind`. What flies by a foreign one implements
`ftc_autopilot.foreign.base.ForeignAutopilot`."""
