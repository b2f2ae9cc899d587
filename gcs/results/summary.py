"""Figures of one flight: events, savings, intervals, tracking errors."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal, Self

import numpy as np

from ftc_autopilot.control.diagnosis import LOST
from gcs.results.quantities import PAPER_ORDER, QUANTITIES, in_degrees, integrated_error
from gcs.results.recording import Mode, Recording
from gcs.results.synchronisation import synchronisation_errors
from gcs.results.traffic import bytes_by_link
from gcs.scenario.model import Scenario
from mavlink_defs.capture.transmissions import saving
from mavlink_defs.constants import ACTUATORS

__all__ = [
    "ChannelSummary",
    "DiagnosisSummary",
    "FlightSummary",
    "UavSummary",
    "event_table",
    "summarise",
]

_SETTLING_S = 1.0  # the largest error counts after this time
_FINAL_S = 1.0  # the final error is the largest one of this long before the end
_MAX_ANGLE = np.pi / 2.0  # error of an angle beyond which attitude or heading is lost [rad]


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
        stuck: Where it stands when it is declared lost [deg, throttle N]; None when it is back.
    """

    actuator: str
    phase: Literal["lost", "back"]
    time_s: float
    delay_s: float | None
    stuck: float | None


@dataclass(frozen=True)
class UavSummary:
    """One UAV's part of a flight; errors are by quantity, None where no step has one.

    Attributes:
        id: System id.
        active_steps: Steps at which its law was evaluated.
        missing_steps: Steps at which no state reached its autopilot.
        saving: Share of the periodic sender's transmissions that were not sent.
        channels: By name, in the order of the paper's tables.
        actuator_messages: Messages that carried the events; several may travel in one.
        neighbour_messages: Messages to neighbours, one to each, after the first step.
        neighbour_saving: Share of those of a sender in every step that were not sent; None
            without neighbours.
        link_bytes: Size of `states` received, and of both kinds of messages sent, by kind; see
            `gcs.results.traffic`.
        iae: Integrals of absolute errors against the commands [m, deg s].
        iae_filtered: The same against the filtered reference.
        iae_sync: Those of the synchronisation errors (31) and (32) between the true states.
        max_error: Largest errors against the reference after the first second [m/s, deg].
        final_error: Largest ones within the last second [m/s, deg].
        attitude_lost_at_s: When roll or pitch was first more than 90° off [s]; None if never.
        heading_lost_at_s: The same for yaw.
        diagnosis: Decisions of its diagnosis, in order; none of a law without one.
        restarts: How often its autopilot was started again.
    """

    id: int
    active_steps: int
    missing_steps: int
    saving: float | None
    channels: Mapping[str, ChannelSummary]
    actuator_messages: int
    neighbour_messages: int
    neighbour_saving: float | None
    link_bytes: Mapping[str, int]
    iae: Mapping[str, float | None]
    iae_filtered: Mapping[str, float | None]
    iae_sync: Mapping[str, float | None]
    max_error: Mapping[str, float | None]
    final_error: Mapping[str, float | None]
    attitude_lost_at_s: float | None
    heading_lost_at_s: float | None
    diagnosis: tuple[DiagnosisSummary, ...] = ()
    restarts: int = 0

    @property
    def false_alarms(self) -> int:
        """Actuators declared lost in which no fault had begun."""
        return sum(one.phase == "lost" and one.delay_s is None for one in self.diagnosis)

    def first_delay_s(self, phase: Literal["lost", "back"]) -> float | None:
        """Return the delay of the first such decision that follows a fault [s]; None without."""
        return next(
            (o.delay_s for o in self.diagnosis if o.phase == phase and o.delay_s is not None), None
        )

    @property
    def events(self) -> int:
        """Events of all channels."""
        return sum(channel.events for channel in self.channels.values())

    @property
    def min_interval_s(self) -> float | None:
        """Shortest time between two events of one channel [s]; None if no channel has two."""
        gaps = (channel.min_interval_s for channel in self.channels.values())
        return min((gap for gap in gaps if gap is not None), default=None)


@dataclass(frozen=True)
class FlightSummary:
    """The content of `summary.json`.

    Attributes:
        scenario: Name of the scenario.
        completed: Whether the flight reached the scenario's end.
        loss: Why it did not; None if it did.
        mode: How it was flown.
        duration_s: Simulated time flown [s].
        steps: Control periods flown.
        wall_s: Wall-clock time that they took [s].
        real_time_factor: Simulated by wall-clock time; None if the latter is 0.
        saving: Share of the periodic senders' transmissions that were not sent.
        neighbour_saving: The same of the neighbour messages; None without neighbours.
        uavs: In the order of the scenario.
    """

    scenario: str
    completed: bool
    loss: str | None
    mode: Mode
    duration_s: float
    steps: int
    wall_s: float
    real_time_factor: float | None
    saving: float | None
    neighbour_saving: float | None
    uavs: tuple[UavSummary, ...]

    def uav(self, system: int) -> UavSummary | None:
        """Return the part of one UAV, by its system id; None if it did not fly."""
        return next((uav for uav in self.uavs if uav.id == system), None)

    def to_json(self) -> dict[str, Any]:
        """Return the summary as plain data, with the keys of `summary.json`."""
        return asdict(self)

    @classmethod
    def from_json(cls, tree: object) -> Self:
        """Read what `to_json` made.

        Raises:
            ValueError: It is something else.
        """
        from pydantic import TypeAdapter

        return TypeAdapter(cls).validate_python(tree)


def summarise(recording: Recording, scenario: Scenario) -> FlightSummary:
    """Compute the figures of a flight.

    Saving is the share of the periodic sender's transmissions that the triggers did without;
    a periodic sender transmits every channel in every step that the law is evaluated at.
    Errors are those of the true state, as `Recording.error` gives them.
    """
    steps = len(recording.states)
    commands, reference = recording.error("command"), recording.error("reference")
    uavs = tuple(
        _summarise_uav(recording, i, commands[:, i], reference, scenario)
        for i in range(len(recording.uav_ids))
    )
    wall_s = recording.wall_s
    loss = recording.loss
    if loss is None and steps < scenario.steps:
        loss = f"stopped at {recording.duration_s:g} s of {scenario.duration_s:g} s"
    return FlightSummary(
        scenario=scenario.name,
        completed=loss is None,
        loss=loss,
        mode=recording.mode,
        duration_s=recording.duration_s,
        steps=steps,
        wall_s=wall_s,
        real_time_factor=recording.duration_s / wall_s if wall_s > 0.0 else None,
        saving=saving(sum(uav.events for uav in uavs), sum(uav.active_steps for uav in uavs)),
        neighbour_saving=saving(
            sum(uav.neighbour_messages for uav in uavs),
            sum(_neighbour_periods(recording, i, scenario) for i in range(len(uavs))),
            channels=1,
        ),
        uavs=uavs,
    )


def _summarise_uav(
    recording: Recording,
    i: int,
    commands: np.ndarray,
    references: np.ndarray,
    scenario: Scenario,
) -> UavSummary:
    """Summarise the i-th UAV.

    Args:
        recording: The flight.
        i: Index of the UAV.
        commands: Its errors against the commands, shape (steps, 4).
        references: The errors of all UAVs against their references, shape (steps, n, 4).
        scenario: What was flown.
    """
    reference = references[:, i]
    degree = len(scenario.neighbours(recording.uav_ids[i]))
    told = degree * int(np.count_nonzero(recording.signals["neighbour_message"][:, i]))
    active = int(np.count_nonzero(recording.active[:, i]))
    time_s = recording.time_s
    channels = {name: _summarise_channel(recording, i, name) for name in PAPER_ORDER}
    return UavSummary(
        id=recording.uav_ids[i],
        active_steps=active,
        missing_steps=int(np.count_nonzero(recording.missing[:, i])),
        saving=saving(sum(channel.events for channel in channels.values()), active),
        channels=channels,
        actuator_messages=int(np.count_nonzero(recording.signals["events"][:, i])),
        neighbour_messages=told,
        neighbour_saving=saving(told, _neighbour_periods(recording, i, scenario), channels=1),
        link_bytes=bytes_by_link(recording, scenario, i, degree),
        iae=_by_quantity(integrated_error(commands, recording.step_us)),
        iae_filtered=_by_quantity(integrated_error(reference, recording.step_us)),
        iae_sync=_by_quantity(
            integrated_error(
                synchronisation_errors(references, i, recording.uav_ids, scenario),
                recording.step_us,
            )
        ),
        max_error=_by_quantity(_largest(reference[time_s > _SETTLING_S])),
        final_error=_by_quantity(_largest(reference[time_s >= recording.duration_s - _FINAL_S])),
        attitude_lost_at_s=_lost_at_s(time_s, reference[:, 1:3]),
        heading_lost_at_s=_lost_at_s(time_s, reference[:, 3:]),
        diagnosis=tuple(_decisions(recording, i, scenario)),
        restarts=recording.restarts[i] if recording.restarts else 0,
    )


def _neighbour_periods(recording: Recording, i: int, scenario: Scenario) -> int:
    """Return the messages to neighbours if the i-th UAV sent one in every step but the first."""
    steps = int(np.count_nonzero(~recording.missing[1:, i]))
    return len(scenario.neighbours(recording.uav_ids[i])) * steps


def _decisions(recording: Recording, i: int, scenario: Scenario) -> list[DiagnosisSummary]:
    """Return the decisions of the i-th UAV's diagnosis, in order."""
    lost = recording.signals["phase"][:, i] == LOST
    found = []
    for c, name in enumerate(ACTUATORS):
        faults = [
            fault
            for fault in scenario.faults
            if fault.uav == recording.uav_ids[i] and fault.actuator == name
        ]
        for k in np.flatnonzero(np.diff(lost[:, c], prepend=False)):
            time_s, is_lost = float(recording.time_s[k]), bool(lost[k, c])
            causes = (fault.start_s if is_lost else fault.end_s for fault in faults)
            cause = max((t for t in causes if t is not None and t <= time_s), default=None)
            stuck = float(recording.signals["offset"][k, i, c])
            found.append(
                DiagnosisSummary(
                    actuator=name,
                    phase="lost" if is_lost else "back",
                    time_s=time_s,
                    delay_s=None if cause is None else round(time_s - cause, 6),
                    stuck=(stuck if name == "throttle" else float(np.degrees(stuck)))
                    if is_lost
                    else None,
                )
            )
    return sorted(found, key=lambda decision: decision.time_s)


def _summarise_channel(recording: Recording, i: int, name: str) -> ChannelSummary:
    c = ACTUATORS.index(name)
    at = np.flatnonzero(recording.signals["events"][:, i] & (1 << c))
    gaps = np.diff(at)
    return ChannelSummary(
        events=len(at),
        repeats=int(recording.repeats[i, c]),
        min_interval_s=int(gaps.min()) * recording.step_us / 1e6 if len(gaps) else None,
    )


def event_table(recording: Recording) -> dict[str, np.ndarray]:
    """Return every event of the flight as columns of equal length, ordered by time.

    Columns: `uav` (system id), `channel` (number as in `mavlink_defs.faults.ACTUATORS`),
    `step`, `time_s`, `value` (held from then on: rad, or N for the throttle).
    """
    events = recording.signals["events"]
    bits = np.stack([events >> c & 1 for c in range(len(ACTUATORS))], axis=-1)
    step, uav, channel = np.nonzero(bits)
    return {
        "uav": np.array(recording.uav_ids)[uav],
        "channel": channel,
        "step": step,
        "time_s": step * recording.step_us / 1e6,
        "value": recording.signals["held"][step, uav, channel],
    }


def _largest(error: np.ndarray) -> np.ndarray:
    """Return the largest absolute error of the steps that have one; NaN if none has."""
    known = np.abs(error[np.isfinite(error).all(axis=1)])
    return np.asarray(known.max(axis=0)) if len(known) else np.full(len(QUANTITIES), np.nan)


def _lost_at_s(time_s: np.ndarray, angles: np.ndarray) -> float | None:
    """Return when an error in `angles`, shape (steps, k), first exceeded 90° [s], or None."""
    beyond = np.flatnonzero((np.abs(angles) > _MAX_ANGLE).any(axis=1))
    return float(time_s[beyond[0]]) if len(beyond) else None


def _by_quantity(values: np.ndarray) -> dict[str, float | None]:
    """Name four values; angles from rad to deg; NaN becomes None."""
    return {
        name: float(value) if np.isfinite(value) else None
        for name, value in zip(QUANTITIES, in_degrees(values), strict=True)
    }
