"""Parts of the summary of a UAV's flight."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class ChannelSummary:
    """One actuator channel of one UAV.

    Attributes:
        events: Events, each a transmission.
        repeats: Events sent again because the plant had not applied them.
        min_interval_s: Shortest time between two events [s]; None with fewer than two.
    """

    events: int
    repeats: int
    min_interval_s: float | None


@dataclass(frozen=True)
class DiagnosisSummary:
    """A decision of a UAV's diagnosis about one of its actuators.

    Attributes:
        actuator: The actuator.
        phase: "lost", or "back" in service.
        time_s: When [s].
        delay_s: Since the start, or the end, of the injected fault that it follows [s]; None if it
            follows none.
        stuck: Its position when it is declared lost [deg, throttle N]; None when it is back.
    """

    actuator: str
    phase: Literal["lost", "back"]
    time_s: float
    delay_s: float | None
    stuck: float | None


@dataclass(frozen=True)
class ControlFailure:
    """A law that asked for commands that are not finite: they were not sent, the last ones held.

    Attributes:
        time_s: When it did first [s].
        steps: At how many steps, by the name of each such channel.
    """

    time_s: float
    steps: Mapping[str, int]

    @property
    def channels(self) -> str:
        """The channels."""
        return " and ".join(self.steps)


@dataclass(frozen=True)
class BesideSummary:
    """What the scenario's trigger would have sent of the commands of a foreign autopilot.

    It was asked about them, and did not fly.

    Attributes:
        trigger: Its name.
        messages: Messages.
        events: Events, by channel.
        apart: Largest difference of a command to what would have been held, by channel [deg, N].
    """

    trigger: str
    messages: int
    events: Mapping[str, int]
    apart: Mapping[str, float]


@dataclass(frozen=True)
class MotionBands:
    """Between what values the true motion of one UAV was: whether it flew, or tumbled.

    Attributes:
        roll_deg: Least and greatest [deg].
        pitch_deg: [deg].
        altitude_m: Above the origin [m].
        airspeed_m_s: [m/s].
    """

    roll_deg: tuple[float, float]
    pitch_deg: tuple[float, float]
    altitude_m: tuple[float, float]
    airspeed_m_s: tuple[float, float]
