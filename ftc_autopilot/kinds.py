"""Which autopilot flies a UAV: ours, or the program of another project beside its bridge."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, TypeAlias

from pydantic import Discriminator, Field, Tag, model_validator

from mavlink_defs import dialect
from mavlink_defs.config.models import AtMost, Model, Problems, Title
from mavlink_defs.config.quantity import quantity, whole
from mavlink_defs.faults.fault import Fault
from sitl_plant.foreign.ardupilot.config import JSON_INSTRUMENTS, PORT, ArduPilot
from sitl_plant.foreign.px4.config import Px4Outputs

_MODES = {"TAKEOFF": 13, "LOITER": 12, "CRUISE": 7, "FBWB": 6, "GUIDED": 15}
"""custom_mode numbers of ArduPlane."""
_PX4_AUTO = 4
_PX4_SUB_MODES = {"TAKEOFF": 2, "HOLD": 3, "MISSION": 4}
"""Main mode AUTO of PX4, and its sub-modes."""
_PX4_NAME = re.compile("[A-Z][A-Z0-9_]{1,15}")


class FtcAutopilot(Model):
    """The autopilot of ftc-sitl.

    Attributes:
        kind: The autopilot of ftc-sitl, with the scenario's law.
    """

    kind: Literal["ftc"] = "ftc"


class ArduPlaneAutopilot(Model):
    """An ArduPlane SITL, which a bridge flies by its JSON interface.

    Attributes:
        kind: ArduPlane.
        binary: Its program, built for SITL, which the bridge starts; none: somebody starts it by
            hand.
        port: By hand: UDP port of the physics of UAV 1, --sim-port-out; UAV i has one 10 (i - 1)
            higher. Its MAVLink goes to the next one, --serial0.
        defaults: File of its parameters, --defaults; none: derived from the aircraft.
        mode: Mode in which it is armed; none: GUIDED to its slot if the formation has one for it,
            else AUTO with a mission, else LOITER. GUIDED, with a slot, is the same.
        ready_within_s: Longest time, by its own clock, until its EKF is ready.
        answers_within_s: Longest time until it sends a frame, by the wall clock.
        outputs: Which of its outputs moves which actuator, and its launch.
    """

    kind: Literal["ardupilot"]
    binary: Title | None = Field(default=None, min_length=1)
    port: int = whole("", default=PORT, ge=1, le=60_000)
    defaults: Title | None = None
    mode: Literal["AUTO", "TAKEOFF", "LOITER", "CRUISE", "FBWB", "GUIDED"] | None = None
    ready_within_s: float = quantity("s", default=120.0, gt=0.0)
    answers_within_s: float = quantity("s", default=60.0, gt=0.0)
    outputs: ArduPilot = ArduPilot()

    def fallible(self, sensors: Mapping[str, int]) -> dict[str, int]:
        """Return how many sensors can fail, by name, of those that an aircraft carries."""
        return {name: 1 for name in JSON_INSTRUMENTS if name in sensors}

    def refuses(self, fault: Fault) -> str | None:
        """Return why a fault of a sensor cannot reach it; None if it can."""
        name, kind = fault.target.name, fault.kind.name
        if name not in JSON_INSTRUMENTS:
            known = " and ".join(JSON_INSTRUMENTS)
            return f"ArduPlane makes its {name} itself; by JSON it gets {known}"
        if kind in {"off", "intermittent"}:
            return f"ArduPlane gets a value of the {name} in each frame: it is never {kind}"
        if name == "gps" and (kind not in {"bias", "drift"} or fault.axis not in {1, 2}):
            why = "ArduPlane's GPS and barometer share a position"
            return f"{why}: expected bias or drift with axis x or y"
        return None

    @property
    def takes_slots(self) -> bool:
        """Whether its bridge steers it to a slot, if it has one."""
        return self.mode in {None, "GUIDED"}

    def commands(self, has_mission: bool, has_slot: bool) -> list[tuple[int, tuple[float, ...]]]:
        """Return the commands that a station gives before it arms: MAV_CMD and parameters.

        Args:
            has_mission: Whether a mission is there to be flown.
            has_slot: Whether its bridge steers it to a slot.
        """
        mode = self.mode or ("GUIDED" if has_slot else "AUTO" if has_mission else "LOITER")
        if mode == "AUTO":
            return [(dialect.MAV_CMD_MISSION_START, ())]
        custom = dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        return [(dialect.MAV_CMD_DO_SET_MODE, (custom, _MODES[mode]))]


class Px4Autopilot(Model):
    """A PX4 SITL, which a bridge starts and flies by PX4's own lockstep.

    Attributes:
        kind: PX4.
        binary: Its program, bin/px4 of a build for SITL.
        data: Folder etc of its build; none: the one beside the program's folder.
        model: Its airframe, PX4_SIM_MODEL.
        parameters: Parameters that it starts with, by name.
        mode: Mode in which it is armed; none: MISSION with a mission, else TAKEOFF.
        rate_hz: Frames per second of its time, whole control periods each.
        simulator_host: Address at which it connects to its simulator, PX4_SIM_HOSTNAME.
        ready_within_s: Longest time, by its own clock, until it may be armed.
        connects_within_s: Longest time until it connects, by the wall clock.
        answers_within_s: Longest time until it answers a frame, by the wall clock.
        launch_throttle: Share of the thrust above which it is launched.
        launch_acceleration_m_s2: Acceleration of the launch.
        outputs: Which of its outputs moves which actuator.
    """

    kind: Literal["px4"]
    binary: Title = Field(min_length=1)
    data: Title | None = None
    model: Title = Field(default="gazebo-classic_plane", min_length=1)
    parameters: Annotated[dict[str, float], AtMost(2000)] = Field(default={})
    mode: Literal["MISSION", "TAKEOFF", "HOLD"] | None = None
    rate_hz: float = quantity("Hz", default=250.0, gt=0.0, le=1000.0)
    simulator_host: Title = Field(default="127.0.0.1", min_length=1)
    ready_within_s: float = quantity("s", default=120.0, gt=0.0)
    connects_within_s: float = quantity("s", default=60.0, gt=0.0)
    answers_within_s: float = quantity("s", default=60.0, gt=0.0)
    launch_throttle: float = quantity("", default=0.05, ge=0.0, lt=1.0)
    launch_acceleration_m_s2: float = quantity("m/s^2", default=15.0, gt=0.0, le=1000.0)
    outputs: Px4Outputs = Px4Outputs()

    def fallible(self, sensors: Mapping[str, int]) -> dict[str, int]:
        """Return how many sensors can fail, by name, of those that an aircraft carries."""
        return dict(sensors)

    def refuses(self, _: Fault) -> str | None:
        """Return why a fault of a sensor cannot reach it: any can, as all of them are ours."""
        return None

    @model_validator(mode="after")
    def _names_are_px4s(self) -> "Px4Autopilot":
        text = "expected a name of capital letters, digits and _, 16 at most"
        wrong = [name for name in self.parameters if not _PX4_NAME.fullmatch(name)]
        Problems.check((("parameters", name), text) for name in wrong)
        return self

    takes_slots: ClassVar[bool] = False

    @property
    def startup(self) -> Path:
        """Folder of its startup scripts."""
        if self.data is not None:
            return Path(self.data).expanduser().resolve()
        return Path(self.binary).expanduser().resolve().parent.parent / "etc"

    def commands(self, has_mission: bool, has_slot: bool) -> list[tuple[int, tuple[float, ...]]]:
        """Return the commands that a station gives before it arms, as of an ArduPlane."""
        mode = self.mode or ("MISSION" if has_mission else "TAKEOFF")
        custom = dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        return [(dialect.MAV_CMD_DO_SET_MODE, (custom, _PX4_AUTO, _PX4_SUB_MODES[mode]))]


def _kind(value: Any) -> Any:
    if isinstance(value, dict):
        return value.get("kind", "ftc")
    return getattr(value, "kind", "ftc")


ForeignSection: TypeAlias = ArduPlaneAutopilot | Px4Autopilot
"""A foreign autopilot; another one is another class in this union and in `AutopilotSection`."""

AutopilotSection: TypeAlias = Annotated[
    Annotated[FtcAutopilot, Tag("ftc")]
    | Annotated[ArduPlaneAutopilot, Tag("ardupilot")]
    | Annotated[Px4Autopilot, Tag("px4")],
    Discriminator(_kind),
]
"""Which autopilot flies a UAV, discriminated by `kind`. What flies by a foreign one implements
`ftc_autopilot.foreign.base.ForeignAutopilot`."""
