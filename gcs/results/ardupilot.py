"""Figures of a flight by ArduPilot: what any flight has, and its frames."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from gcs.results.figures import FlightSummary
from gcs.results.recording import Steps
from mavlink_defs.capture.saving import saving
from mavlink_defs.config.output_files import write_text

Band: TypeAlias = tuple[float, float]
"""Least and greatest value."""


@dataclass(frozen=True)
class MotionBands:
    """Between what values the true motion of one UAV was: whether it flew, or tumbled.

    Attributes:
        roll_deg: [deg].
        pitch_deg: [deg].
        altitude_m: Above the origin [m].
        airspeed_m_s: [m/s].
    """

    roll_deg: Band
    pitch_deg: Band
    altitude_m: Band
    airspeed_m_s: Band


class MotionExtremes:
    """Least and greatest values of the motion of n UAVs, while it is flown."""

    def __init__(self, n: int) -> None:
        self._least = np.full((n, 4), np.inf)
        self._greatest = np.full((n, 4), -np.inf)

    def add(self, steps: Steps) -> None:
        """Take the next steps."""
        roll, pitch = np.rad2deg(np.moveaxis(steps.states[:, :, 6:8], 2, 0))
        roll = (roll + 180.0) % 360.0 - 180.0
        values = np.stack((roll, pitch, -steps.states[:, :, 2], steps.signals["V"]), axis=2)
        np.minimum(self._least, np.nanmin(values, axis=0), out=self._least)
        np.maximum(self._greatest, np.nanmax(values, axis=0), out=self._greatest)

    def bands(self, i: int) -> MotionBands | None:
        """Return the bands of the i-th UAV; None before the first step."""
        if not np.isfinite(self._least[i]).all():
            return None
        return MotionBands(*zip(self._least[i].tolist(), self._greatest[i].tolist(), strict=True))


@dataclass(frozen=True)
class FrameSummary:
    """What came from the ArduPilot of one UAV, the hold and the launch included.

    Attributes:
        uav: System id of the UAV.
        port: UDP port of the plant.
        channels: Outputs in a packet, 16 or 32; 0: none came.
        rate_hz: Frames per second of simulated time that it asked for last; 0: none came.
        frames: Frames flown.
        repeated: Frames that came again: answered again, and not flown.
        missing: Frames that never came, gaps of its count.
        restarts: How often it was started again, each time with a new flight.
        dropped: Datagrams that were not followed, by reason.
        motion: Of the flight; None if it never began.
    """

    uav: int
    port: int
    channels: int
    rate_hz: int
    frames: int
    repeated: int
    missing: int
    restarts: int
    dropped: Mapping[str, int]
    motion: MotionBands | None


@dataclass(frozen=True)
class ArduPilotSummary:
    """The content of `summary.json` of a flight by ArduPilot.

    Attributes:
        flight: As of any flight; there is no error, as what ArduPilot tracks is not known here.
        frames: Of each UAV.
    """

    flight: FlightSummary
    frames: tuple[FrameSummary, ...]

    def to_json(self) -> dict[str, Any]:
        """Return it as plain data: a flight's, and `ardupilot`, a list of the UAVs' frames."""
        return {**self.flight.to_json(), "ardupilot": [asdict(one) for one in self.frames]}

    def save(self, folder: Path) -> None:
        """Write `summary.json`; OSError with its name if it cannot."""
        write_text(folder / "summary.json", json.dumps(self.to_json(), indent=2) + "\n")


def ardupilot_summary(summary: FlightSummary, frames: Sequence[FrameSummary]) -> ArduPilotSummary:
    """Return the figures of a flight by ArduPilot.

    ArduPilot controls in every step flown, so the saving counts its changed outputs against a
    sender of every channel in every control period. Bytes are not counted: it has other messages.

    Args:
        summary: Of the recorded steps, in which no law of ours was active.
        frames: Of each UAV, in the order of the summary.
    """
    steps = summary.steps
    uavs = tuple(
        replace(
            uav,
            active_steps=steps,
            saving=saving(uav.events, steps),
            link_bytes=dict.fromkeys(uav.link_bytes, 0),
        )
        for uav in summary.uavs
    )
    every = saving(sum(uav.events for uav in uavs), steps * len(uavs))
    return ArduPilotSummary(replace(summary, uavs=uavs, saving=every), tuple(frames))
