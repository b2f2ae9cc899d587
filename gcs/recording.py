"""What a flight leaves behind, the same for every way to fly it: arrays over steps and UAVs."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

__all__ = ["Mode", "Recording"]

Mode = Literal["lockstep", "real_time", "in_process"]


@dataclass(frozen=True)
class Recording:
    """One flight at full rate. UAVs in the order of the scenario; angles in rad, SI units.

    Attributes:
        mode: How it was flown.
        step_us: Control period [µs].
        uav_ids: System ids, length n.
        states: Shape (steps, n, 12), at the begin of each step; see `sitl_plant.rigid_body.State`.
        applied: Shape (steps, n, 4), what the actuators did as each period began: aileron,
            elevator, rudder, thrust.
        signals: Shape (steps, n), dtype `ftc_autopilot.controller.SIGNALS`.
        repeats: Shape (n, 4), events sent again because the plant had not applied them.
        wall_s: Wall-clock time that the simulated time took [s].
        loss: Why the flight ended early; None if it was flown to its end.
    """

    mode: Mode
    step_us: int
    uav_ids: tuple[int, ...]
    states: np.ndarray
    applied: np.ndarray
    signals: np.ndarray
    repeats: np.ndarray
    wall_s: float
    loss: str | None

    @property
    def time_s(self) -> np.ndarray:
        """Simulation time of each step [s], shape (steps,)."""
        return np.arange(len(self.states)) * self.step_us / 1e6

    @property
    def duration_s(self) -> float:
        """Simulated time flown [s]."""
        return len(self.states) * self.step_us / 1e6
