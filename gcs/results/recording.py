"""The recording of a flight, the same however it was flown: arrays over steps and UAVs.

The plant records the true state of every step. An autopilot records what it computed: nothing
where it received no state, and while disarmed only what it measures and holds.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Self, TypeAlias

import numpy as np

from ftc_autopilot.common.angles import wrap
from ftc_autopilot.control.signals import SIGNALS
from ftc_autopilot.hot.navigation import ESTIMATED
from mavlink_defs.constants import ACTUATORS, N_CHANNELS
from mavlink_defs.runtime.jit import compiled

Mode = Literal["lockstep", "real_time", "in_process"]


class Steps(NamedTuple):
    """Consecutive steps of all n UAVs of a flight; the arrays are as of `Recording`."""

    first: int  # step number of row 0
    states: np.ndarray  # (steps, n, 12)
    wind: np.ndarray  # (steps, n, 3)
    applied: np.ndarray  # (steps, n, 4)
    signals: np.ndarray  # (steps, n), dtype SIGNALS
    estimates: np.ndarray  # (steps, n, ESTIMATED), or (steps, n, 0) by true states

    @classmethod
    def joined(cls, parts: Sequence[Self], n: int) -> Self:
        """Return consecutive steps of n UAVs, from step 0 on, in arrays of their own."""
        estimated = bool(parts) and parts[0].estimates.shape[-1] > 0
        none = cls.room(0, n, estimated=estimated)
        arrays = zip(*(part[1:] for part in (none, *parts)), strict=True)
        return cls(0, *(np.concatenate(same) for same in arrays))

    @property
    def length(self) -> int:
        """Number of steps."""
        return len(self.states)

    @classmethod
    def room(cls, steps: int, n: int, *, estimated: bool = False) -> Self:
        """Return room for so many steps of n UAVs, from step 0 on.

        Args:
            steps: How many.
            n: UAVs.
            estimated: Whether they fly by an estimated state, which is recorded, too.
        """
        return cls(
            0,
            np.zeros((steps, n, 12)),
            np.zeros((steps, n, 3)),
            np.zeros((steps, n, N_CHANNELS)),
            np.zeros((steps, n), SIGNALS),
            np.zeros((steps, n, ESTIMATED if estimated else 0)),
        )

    def part(self, begin: int, end: int) -> Self:
        """Return the rows from `begin` to `end`, as views."""
        return type(self)(
            self.first + begin,
            self.states[begin:end],
            self.wind[begin:end],
            self.applied[begin:end],
            self.signals[begin:end],
            self.estimates[begin:end],
        )


@dataclass(frozen=True)
class Ending:
    """What is known of a flight when it is over, besides its steps.

    Attributes:
        mode: How it was flown.
        steps: Control periods flown.
        repeats: Shape (n, 4), events sent again because the plant had not applied them.
        wall_s: Wall-clock time that the simulated time took [s].
        loss: Why the flight was lost; None if it was not.
        restarts: How often each autopilot was started again; empty: none could be.
        plugin_failed: Whether it was lost because a plug-in failed.
        contacts: What became of each aircraft on the ground, None of one without gear, as
            `sitl_plant.loop.fleet.contacts_of` returns it; empty if nothing is known.
    """

    mode: Mode
    steps: int
    repeats: np.ndarray
    wall_s: float
    loss: str | None
    restarts: tuple[int, ...] = ()
    plugin_failed: bool = False
    contacts: Sequence[dict[str, Any] | None] = ()


@dataclass(frozen=True)
class Recording:
    """One flight at full rate. UAVs in the order of the scenario; angles in rad, SI units.

    Attributes:
        mode: How it was flown.
        step_us: Control period [µs].
        uav_ids: System ids, length n.
        states: Shape (steps, n, 12), at the start of each step; see `rigid_body.State`.
        wind: Shape (steps, n, 3), velocity of the air at the start of each step, body axes [m/s].
        applied: Shape (steps, n, 4), applied at the start of each period: aileron, elevator,
            rudder, thrust.
        signals: Shape (steps, n), dtype `ftc_autopilot.control.signals.SIGNALS`; NaN where an
            autopilot received no state, and what the law computes also while it is disarmed.
        repeats: Shape (n, 4), events sent again because the plant had not applied them.
        wall_s: Wall-clock time that the simulated time took [s].
        loss: Why the flight was lost; None if it was not.
        restarts: How often each autopilot was started again, length n; empty if none was.
        plugin_failed: Whether it was lost because a plug-in failed.
        estimates: Shape (steps, n, `ESTIMATED`), by which the laws flew: position NED, velocity
            [m/s], attitude, rates [rad/s], wind [m/s], body axes; NaN where an autopilot received
            nothing. None if they flew by true states.
        contacts: As of `Ending`.
    """

    mode: Mode
    step_us: int
    uav_ids: tuple[int, ...]
    states: np.ndarray
    wind: np.ndarray
    applied: np.ndarray
    signals: np.ndarray
    repeats: np.ndarray
    wall_s: float
    loss: str | None
    restarts: tuple[int, ...] = ()
    plugin_failed: bool = False
    estimates: np.ndarray | None = None
    contacts: Sequence[dict[str, Any] | None] = ()

    @classmethod
    def of(cls, steps: Steps, ending: Ending, uav_ids: tuple[int, ...], step_us: int) -> Self:
        """Return the recording of a flight, given all its steps."""
        return cls(
            mode=ending.mode,
            step_us=step_us,
            uav_ids=uav_ids,
            states=steps.states,
            wind=steps.wind,
            applied=steps.applied,
            signals=steps.signals,
            repeats=ending.repeats,
            wall_s=ending.wall_s,
            loss=ending.loss,
            restarts=ending.restarts,
            plugin_failed=ending.plugin_failed,
            estimates=steps.estimates if steps.estimates.shape[-1] else None,
            contacts=ending.contacts,
        )

    @property
    def steps(self) -> Steps:
        """All steps."""
        estimates = self.estimates
        if estimates is None:
            estimates = np.zeros((*self.states.shape[:2], 0))
        return Steps(0, self.states, self.wind, self.applied, self.signals, estimates)

    @property
    def ending(self) -> Ending:
        """What is known of the flight besides its steps."""
        return Ending(
            mode=self.mode,
            steps=len(self.states),
            repeats=self.repeats,
            wall_s=self.wall_s,
            loss=self.loss,
            restarts=self.restarts,
            plugin_failed=self.plugin_failed,
            contacts=self.contacts,
        )

    @property
    def time_s(self) -> np.ndarray:
        """Simulation time of each step [s], shape (steps,)."""
        return np.arange(len(self.states)) * self.step_us / 1e6

    @property
    def duration_s(self) -> float:
        """Simulated time flown [s]."""
        return len(self.states) * self.step_us / 1e6

    @property
    def missing(self) -> np.ndarray:
        """Steps in which a UAV's autopilot received no state, a mask of shape (steps, n)."""
        missing: np.ndarray = np.isnan(self.signals["V"])
        return missing

    @property
    def response(self) -> np.ndarray:
        """True airspeed [m/s], roll, pitch, yaw [rad], shape (steps, n, 4)."""
        u, v, w = np.moveaxis(self.states[..., 3:6] - self.wind, -1, 0)
        airspeed = np.sqrt(u * u + v * v + w * w)
        return np.concatenate([airspeed[..., None], self.states[..., 6:9]], axis=-1)

    def error(self, against: Literal["command", "reference"]) -> np.ndarray:
        """Return true response minus what it tracks, angles wrapped [m/s, rad], (steps, n, 4).

        Over missing steps the last command or reference recorded holds; before an autopilot's
        first step, the first one recorded. NaN while disarmed.

        Args:
            against: The unfiltered commands, or the filtered reference.
        """
        error: np.ndarray = self.response - self._held_over(self.signals[against])
        wrap_all(error[..., 1])
        wrap_all(error[..., 3])
        return error

    def _held_over(self, values: np.ndarray) -> np.ndarray:
        """Return values of an autopilot, shape (steps, n, 4), with missing steps filled in."""
        missing = self.missing
        if not missing.any():
            return values
        flown = np.where(missing, -1, np.arange(len(missing))[:, None])
        newest = np.maximum.accumulate(flown, axis=0)
        source = np.where(newest < 0, missing.argmin(axis=0), newest)
        return np.take_along_axis(values, source[..., None], axis=0)


@compiled
def wrap_all(angles: np.ndarray) -> None:
    """Wrap angles of shape (steps, axes) to (-pi, pi] in place [rad]."""
    for k in range(angles.shape[0]):
        for i in range(angles.shape[1]):
            angles[k, i] = wrap(angles[k, i])


Events: TypeAlias = Mapping[str, np.ndarray]
"""Columns of equal length, as `events_of` returns them."""


def events_of(
    signals: np.ndarray, first: int, uav_ids: Sequence[int], step_us: int
) -> dict[str, np.ndarray]:
    """Return the events of consecutive steps as columns of equal length, ordered by time.

    Args:
        signals: Shape (steps, n), dtype `ftc_autopilot.control.signals.SIGNALS`.
        first: Number of the first step.
        uav_ids: System ids, length n.
        step_us: Control period [µs].

    Returns:
        `uav` (system id), `channel` (number as in `mavlink_defs.constants.ACTUATORS`), `step`,
        `time_s`, `value` (held from then on: rad, or N for the throttle).
    """
    masks = signals["events"]
    row, uav = np.nonzero(masks)
    bits = masks[row, uav, None] >> np.arange(len(ACTUATORS), dtype=np.uint8) & 1
    which, channel = np.nonzero(bits)
    row, uav = row[which], uav[which]
    step = first + row
    return {
        "uav": np.array(uav_ids)[uav],
        "channel": channel,
        "step": step,
        "time_s": step * step_us / 1e6,
        "value": signals["held"][row, uav, channel],
    }


def event_table(recording: Recording) -> dict[str, np.ndarray]:
    """Return every event of the flight as columns of equal length, ordered by time.

    Columns: `uav` (system id), `channel` (number as in `mavlink_defs.constants.ACTUATORS`),
    `step`, `time_s`, `value` (held from then on: rad, or N for the throttle).
    """
    return events_of(recording.signals, 0, recording.uav_ids, recording.step_us)
