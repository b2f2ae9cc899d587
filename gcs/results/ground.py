"""What became of an aircraft with gear on the ground, as the plant judged it."""

from dataclasses import dataclass
from typing import Literal, TypeAlias

GroundOutcome: TypeAlias = Literal[
    "in the air",
    "on the launcher",
    "on the ground",
    "landed",
    "landed hard",
    "off the runway",
    "crashed",
]
"""Where it was at the end; "off the runway" is one that was on the ground beside it."""


@dataclass(frozen=True)
class TouchdownSummary:
    """A touchdown, by the last state before it.

    Attributes:
        time_s: When [s].
        sink_m_s: Speed into the ground [m/s].
        bank_deg: Bank against the ground [deg].
        pitch_deg: Pitch angle against the ground [deg].
        drift_m_s: Speed across its heading, to the right [m/s].
        speed_m_s: Speed along the ground [m/s].
        north_m: Place [m].
        east_m: Place [m].
    """

    time_s: float
    sink_m_s: float
    bank_deg: float
    pitch_deg: float
    drift_m_s: float
    speed_m_s: float
    north_m: float
    east_m: float


@dataclass(frozen=True)
class GroundSummary:
    """An aircraft on the ground.

    Attributes:
        outcome: Where it was at the end, and how it came there.
        reason: Why it crashed; None if it did not.
        touchdowns: How often it touched down, bounces among them.
        worst: The touchdown with the largest sink rate; None without one.
        off_centre_m: Farthest from the runway's centre line on the ground [m]; None without one.
    """

    outcome: GroundOutcome
    reason: str | None
    touchdowns: int
    worst: TouchdownSummary | None
    off_centre_m: float | None
