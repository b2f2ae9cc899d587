"""Figures of one flight: events, savings, intervals, tracking errors."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal, Self

import numpy as np

from gcs.results.events import events_of
from gcs.results.path_following import PathSummary
from gcs.results.quantities import PAPER_ORDER, QUANTITIES, in_degrees
from gcs.results.recording import Recording
from gcs.results.separation import SeparationSummary
from gcs.results.steps import Ending, Mode
from gcs.results.tally import FINAL_S, Decision, Tally
from gcs.results.traffic import KINDS
from gcs.scenario.model import Scenario
from mavlink_defs.capture.saving import saving
from mavlink_defs.constants import ACTUATORS


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
        path: How it followed the path of the mission; None in a flight without one.
        lowest_altitude_m: Least height above the ground, that of the origin [m]; below 0 it has
            hit the ground. None of a flight without steps, or of an earlier version.
        control_failure: Commands of its law that were not finite; None if all were.
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
    path: PathSummary | None = None
    lowest_altitude_m: float | None = None
    control_failure: ControlFailure | None = None

    @property
    def hit_ground(self) -> bool:
        """Whether it went below the ground, where its flight ended."""
        return self.lowest_altitude_m is not None and self.lowest_altitude_m < 0.0

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
        completed: Whether the flight reached the scenario's end, and all laws controlled it.
        loss: Why it did not, or which law failed; None if it is completed.
        mode: How it was flown.
        duration_s: Simulated time flown [s].
        steps: Control periods flown.
        wall_s: Wall-clock time that they took [s].
        real_time_factor: Simulated by wall-clock time; None if the latter is 0.
        saving: Share of the periodic senders' transmissions that were not sent.
        neighbour_saving: The same of the neighbour messages; None without neighbours.
        uavs: In the order of the scenario.
        separation: Least distance between two UAVs; None for a single one.
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
    separation: SeparationSummary | None = None

    @property
    def hit_ground(self) -> bool:
        """Whether an aircraft hit the ground, which ended the flight."""
        return any(uav.hit_ground for uav in self.uavs)

    @property
    def control_failed(self) -> bool:
        """Whether a law gave a command that was not finite."""
        return any(uav.control_failure is not None for uav in self.uavs)

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
    """Compute the figures of a recorded flight, as `summary_of` does."""
    tally = Tally(scenario)
    tally.add(recording.steps)
    return summary_of(tally, recording.ending, scenario)


def summary_of(tally: Tally, ending: Ending, scenario: Scenario) -> FlightSummary:
    """Return the figures of a flight.

    Saving is the share of the periodic sender's transmissions that the triggers did without;
    a periodic sender transmits every channel in every step that the law is evaluated at.
    Errors are those of the true state, as `Recording.error` gives them.

    Args:
        tally: The counts of all its steps.
        ending: Of the flight.
        scenario: What was flown.
    """
    tally.finish()
    uavs = tuple(
        _summarise_uav(tally, i, uav.id, ending, scenario) for i, uav in enumerate(scenario.uavs)
    )
    duration_s, wall_s, loss = ending.steps * scenario.step_us / 1e6, ending.wall_s, ending.loss
    if loss is None and ending.steps < scenario.steps:
        loss = f"stopped at {duration_s:g} s of {scenario.duration_s:g} s"
    loss = _control_failure(uavs, loss)
    return FlightSummary(
        scenario=scenario.name,
        completed=loss is None,
        loss=loss,
        mode=ending.mode,
        duration_s=duration_s,
        steps=ending.steps,
        wall_s=wall_s,
        real_time_factor=duration_s / wall_s if wall_s > 0.0 else None,
        saving=saving(sum(uav.events for uav in uavs), sum(uav.active_steps for uav in uavs)),
        neighbour_saving=saving(
            sum(uav.neighbour_messages for uav in uavs),
            sum(
                len(scenario.neighbours(uav.id)) * int(own["neighbour_periods"])
                for uav, own in zip(scenario.uavs, tally.uavs, strict=True)
            ),
            channels=1,
        ),
        uavs=uavs,
        separation=tally.separation.summary(),
    )


def _summarise_uav(
    tally: Tally, i: int, system: int, ending: Ending, scenario: Scenario
) -> UavSummary:
    """Summarise the i-th UAV."""
    own, step_us, degree = tally.uavs[i], scenario.step_us, len(scenario.neighbours(system))
    together = tally.synchronisation
    apart = together.sums[i] * step_us / 1e6
    duration_s = ending.steps * step_us / 1e6
    active = int(own["active"])
    channels = {
        name: _summarise_channel(own, ending.repeats[i], ACTUATORS.index(name), step_us)
        for name in PAPER_ORDER
    }
    integrals = np.where(own["counted"][:, None] > 0, own["sum"] * step_us / 1e6, np.nan)
    largest = own["largest"] if own["settled"] else np.full(len(QUANTITIES), np.nan)
    return UavSummary(
        id=system,
        active_steps=active,
        missing_steps=int(own["missing"]),
        saving=saving(sum(channel.events for channel in channels.values()), active),
        channels=channels,
        actuator_messages=int(own["messages"]),
        neighbour_messages=degree * int(own["neighbour_messages"]),
        neighbour_saving=saving(
            degree * int(own["neighbour_messages"]),
            degree * int(own["neighbour_periods"]),
            channels=1,
        ),
        link_bytes=dict(zip(KINDS, tally.traffic.bytes[i].tolist(), strict=True)),
        iae=_by_quantity(integrals[0]),
        iae_filtered=_by_quantity(integrals[1]),
        iae_sync=_by_quantity(apart if together.counted[i] else np.full(len(QUANTITIES), np.nan)),
        max_error=_by_quantity(largest),
        final_error=_by_quantity(tally.largest_final_error(i, duration_s - FINAL_S)),
        attitude_lost_at_s=_time_s(own["attitude_lost"], step_us),
        heading_lost_at_s=_time_s(own["heading_lost"], step_us),
        diagnosis=tuple(_diagnosis(tally.decisions(i), system, scenario)),
        restarts=ending.restarts[i] if ending.restarts else 0,
        path=None if tally.following is None else tally.following.summary(i),
        lowest_altitude_m=_finite(-own["highest_down"]),
        control_failure=_failure(own, step_us),
    )


def _failure(own: np.void, step_us: int) -> ControlFailure | None:
    """Return what a UAV's law asked for that is not finite; None if nothing."""
    time_s = _time_s(own["control_failed"], step_us)
    if time_s is None:
        return None
    counts = zip(ACTUATORS, own["not_finite"].tolist(), strict=True)
    return ControlFailure(time_s, {name: steps for name, steps in counts if steps > 0})


def _control_failure(uavs: Iterable[UavSummary], loss: str | None) -> str | None:
    """Return which law failed first, and how, before what the flight was lost by, if it was."""
    failures = [(uav.control_failure, uav.id) for uav in uavs if uav.control_failure is not None]
    if not failures:
        return loss
    failure, system = min(failures, key=lambda one: one[0].time_s)
    text = (
        f"the law of UAV {system} gave no finite command of {failure.channels} at "
        f"{failure.time_s:g} s, and the last one was held"
    )
    return text if loss is None else f"{text}; {loss}"


def _diagnosis(
    decisions: list[Decision], system: int, scenario: Scenario
) -> Iterator[DiagnosisSummary]:
    """Set the decisions of a UAV's diagnosis beside the injected faults."""
    for step, c, lost, offset in decisions:
        name, time_s = ACTUATORS[c], step * scenario.step_us / 1e6
        faults = (f for f in scenario.faults if f.uav == system and f.actuator == name)
        causes = (fault.start_s if lost else fault.end_s for fault in faults)
        cause = max((t for t in causes if t is not None and t <= time_s), default=None)
        stands = offset if name == "throttle" else float(np.degrees(offset))
        yield DiagnosisSummary(
            actuator=name,
            phase="lost" if lost else "back",
            time_s=time_s,
            delay_s=None if cause is None else round(time_s - cause, 6),
            stuck=stands if lost else None,
        )


def _summarise_channel(own: np.void, repeats: np.ndarray, c: int, step_us: int) -> ChannelSummary:
    gap = int(own["min_gap"][c])
    return ChannelSummary(
        events=int(own["events"][c]),
        repeats=int(repeats[c]),
        min_interval_s=gap * step_us / 1e6 if gap else None,
    )


def event_table(recording: Recording) -> dict[str, np.ndarray]:
    """Return every event of the flight as columns of equal length, ordered by time.

    Columns: `uav` (system id), `channel` (number as in `mavlink_defs.faults.ACTUATORS`),
    `step`, `time_s`, `value` (held from then on: rad, or N for the throttle).
    """
    return events_of(recording.signals, 0, recording.uav_ids, recording.step_us)


def _time_s(step: int, step_us: int) -> float | None:
    """Return the time of a step [s]; None for -1."""
    return None if step < 0 else int(step) * step_us / 1e6


def _finite(value: float) -> float | None:
    """Return a number; None for one that is not finite."""
    return float(value) if np.isfinite(value) else None


def _by_quantity(values: np.ndarray) -> dict[str, float | None]:
    """Name four values; angles from rad to deg; NaN becomes None."""
    return {
        name: _finite(value) for name, value in zip(QUANTITIES, in_degrees(values), strict=True)
    }
