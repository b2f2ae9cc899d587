"""A flight as the figures show it: m/s and degrees, names instead of numbers."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gcs.results.quantities import PAPER_ORDER, in_degrees
from gcs.results.recording import Recording
from gcs.scenario.model import Scenario
from gcs.scenario.sections import FaultOfUav, ScenarioFault
from mavlink_defs.constants import ACTUATORS


@dataclass(frozen=True)
class FaultWindow:
    """A time window in which faults act [s], and their description."""

    start_s: float
    end_s: float
    text: str


def literal(text: str) -> str:
    """Return a user's text with $ escaped, which starts a formula in matplotlib."""
    return text.replace("$", r"\$")


@dataclass(frozen=True)
class PlottedFlight:
    """A flight and its label in a legend, such as the controller."""

    label: str
    scenario: Scenario
    recording: Recording

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the UAVs, in the order of the recording, and how many steps they missed."""
        names = {uav.id: literal(uav.name) for uav in self.scenario.uavs}
        missing = np.count_nonzero(self.recording.missing, axis=0)
        return tuple(
            f"{names[uav_id]} ({count} steps missing)" if count else names[uav_id]
            for uav_id, count in zip(self.recording.uav_ids, missing, strict=True)
        )

    @property
    def title(self) -> str:
        """The label, with the time of the loss if the flight was lost."""
        label = literal(self.label)
        return label if self.recording.loss is None else f"{label} ({self.lost})"

    @property
    def lost(self) -> str:
        """The time at which the flight was lost."""
        return f"lost at {self.recording.duration_s:.2f} s"

    def response(self, i: int) -> np.ndarray:
        """Return airspeed [m/s] and wrapped angles [deg] of the i-th UAV, shape (steps, 4)."""
        return wrapped(in_degrees(self.recording.response[:, i]))

    def reference(self, i: int = 0) -> np.ndarray:
        """Return the reference of the i-th UAV, as `response`; NaN where it has none."""
        return wrapped(in_degrees(self.recording.signals["reference"][:, i]))

    def error(self, i: int) -> np.ndarray:
        """Return the tracking errors of the i-th UAV [m/s, deg], shape (steps, 4).

        NaN where it has no reference.
        """
        return in_degrees(self.recording.signals["error"][:, i])

    def sync_error(self, i: int) -> np.ndarray:
        """Return errors (31), (32) of synchronisation of the i-th UAV [m/s, deg], (steps, 4)."""
        return in_degrees(self.recording.signals["sync_error"][:, i])

    def event_times(self, i: int, channel: str) -> np.ndarray:
        """Return the times at which a channel of the i-th UAV had an event [s]."""
        bit = 1 << ACTUATORS.index(channel)
        return np.flatnonzero(self.recording.signals["events"][:, i] & bit) * self.step_s

    def event_counts(self, i: int) -> list[int]:
        """Return the events of each channel of the i-th UAV, in the order of `PAPER_ORDER`."""
        return [len(self.event_times(i, channel)) for channel in PAPER_ORDER]

    @property
    def step_s(self) -> float:
        """Control period [s]."""
        return self.recording.step_us / 1e6


def wrapped(channels: np.ndarray) -> np.ndarray:
    """Wrap the angles of columns m/s, deg, deg, deg to [-180, 180)."""
    return np.column_stack([channels[:, 0], (channels[:, 1:] + 180.0) % 360.0 - 180.0])


def fault_windows(flights: Sequence[PlottedFlight], uav_id: int | None = None) -> list[FaultWindow]:
    """Return when faults act in some of the flights, on one UAV or on any, ordered by time.

    Faults that act at the same time share a window; if they differ, it only names the UAVs.
    """
    faults: dict[tuple[float, float], dict[str, str]] = {}
    for flight in flights:
        names = {uav.id: literal(uav.name) for uav in flight.scenario.uavs}
        duration_s = flight.scenario.duration_s
        for fault in flight.scenario.faults:
            if uav_id in {None, fault.uav} and fault.start_s < duration_s:
                end_s = duration_s if fault.end_s is None else min(fault.end_s, duration_s)
                found = faults.setdefault((fault.start_s, end_s), {})
                found[_text(fault, names[fault.uav])] = names[fault.uav]
    return [
        FaultWindow(start_s, end_s, f"{_summary(found)}, {start_s:g} s to {end_s:g} s")
        for (start_s, end_s), found in sorted(faults.items())
    ]


def _summary(found: dict[str, str]) -> str:
    if len(found) == 1:
        return f"fault: {next(iter(found))}"
    return f"faults of {' and '.join(dict.fromkeys(found.values()))}"


def _text(fault: FaultOfUav, name: str) -> str:
    """Describe a fault and its actuator or sensor, as in ``rudder of leader at 90 % + 1°``."""
    if not isinstance(fault, ScenarioFault):
        target, what = fault.command().parts()
        return f"{target} of {name} {what}"
    text = f"{fault.actuator} of {name}"
    if fault.effectiveness is not None:
        text += f" at {100.0 * fault.effectiveness:g} %"
    if fault.value is not None:
        kind, value = fault.value
        unit = {"deg": "°"}.get(unit := kind.unit_of(fault.target), f" {unit}")
        wave = f", {fault.frequency_hz:g} Hz" if fault.frequency_hz else ""
        text += f" {kind.describe(value, unit, wave, '−')}"
    return text
