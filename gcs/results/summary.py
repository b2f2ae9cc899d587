"""Computing the figures of one flight: events, savings, intervals, tracking errors."""

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from ftc_autopilot.guidance.mission_commands import command_name
from gcs.results.figures import FlightSummary, UavSummary
from gcs.results.ground import GroundSummary, TouchdownSummary
from gcs.results.quantities import PAPER_ORDER, QUANTITIES, in_degrees
from gcs.results.recording import Ending, Recording
from gcs.results.summary_parts import (
    BesideSummary,
    ChannelSummary,
    ControlFailure,
    DiagnosisSummary,
    MotionBands,
)
from gcs.results.tally import FINAL_S, Decision, Tally
from gcs.results.traffic import KINDS
from gcs.scenario.model import Scenario
from mavlink_defs.capture.saving import saving
from mavlink_defs.constants import ACTUATORS, THROTTLE


def summarise(recording: Recording, scenario: Scenario) -> FlightSummary:
    """Compute the figures of a recorded flight, as `summary_of` does."""
    tally = Tally(scenario)
    tally.add(recording.steps)
    return summary_of(tally, recording.ending, scenario)


def summary_of(tally: Tally, ending: Ending, scenario: Scenario) -> FlightSummary:
    """Return the figures of a flight.

    Saving is the share of the periodic sender's transmissions that the triggers did without;
    a periodic sender transmits every channel that the aircraft has in every step that the law is
    evaluated at.
    Errors are the true state's, as `Recording.error` gives them.

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
    loss = loss if ending.plugin_failed else _control_failure(uavs, loss)
    return FlightSummary(
        scenario=scenario.name,
        completed=loss is None,
        loss=loss,
        mode=ending.mode,
        duration_s=duration_s,
        steps=ending.steps,
        wall_s=wall_s,
        real_time_factor=duration_s / wall_s if wall_s > 0.0 else None,
        saving=saving(
            sum(uav.events for uav in uavs),
            sum(uav.active_steps * _channels(scenario, uav.id) for uav in uavs),
            channels=1,
        ),
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


def _channels(scenario: Scenario, system: int) -> int:
    """Return how many channels the aircraft of a UAV has."""
    limits = scenario.aircraft_of(system).fault_limits
    return sum(map(limits.has, ACTUATORS))


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
    beside = tally.beside.get(i)
    integrals = np.where(own["counted"][:, None] > 0, own["sum"] * step_us / 1e6, np.nan)
    largest = own["largest"] if own["settled"] else np.full(len(QUANTITIES), np.nan)
    return UavSummary(
        id=system,
        active_steps=active,
        missing_steps=int(own["missing"]),
        saving=saving(
            sum(channel.events for channel in channels.values()),
            active,
            channels=_channels(scenario, system),
        ),
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
        commands=() if tally.following is None else tally.following.commands(i, _names(scenario)),
        lowest_altitude_m=_finite(-own["highest_down"]),
        control_failure=_failure(own, step_us),
        ground=_on_ground(ending.contacts[i] if ending.contacts else None),
        beside=None if beside is None else _beside(beside.counts, scenario.trigger.mode),
        motion=_motion(tally.motion.get(i)),
    )


def _beside(counts: np.void, trigger: str) -> BesideSummary:
    """Return what a trigger of ours would have sent of a foreign autopilot's commands."""
    apart = [*np.degrees(counts["apart"][:THROTTLE]), counts["apart"][THROTTLE]]
    return BesideSummary(
        trigger=trigger,
        messages=int(counts["messages"]),
        events={name: int(counts["events"][ACTUATORS.index(name)]) for name in PAPER_ORDER},
        apart={name: float(apart[ACTUATORS.index(name)]) for name in PAPER_ORDER},
    )


def _names(scenario: Scenario) -> dict[int, str]:
    """Return the names of the commands of a scenario's mission."""
    return {item.seq: command_name(item.command) for item in scenario.mission_items()}


def _on_ground(facts: dict[str, Any] | None) -> GroundSummary | None:
    """Return what the plant said of an aircraft on the ground."""
    if facts is None:
        return None
    worst = facts["worst"]
    return GroundSummary(**{**facts, "worst": worst and TouchdownSummary(**worst)})


def _motion(bands: np.ndarray | None) -> MotionBands | None:
    """Return the bands of a UAV's motion; None without any."""
    if bands is None or not np.isfinite(bands).all():
        return None
    return MotionBands(*zip(*bands.tolist(), strict=True))


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
        faults = (f for f in scenario.actuator_faults if f.uav == system and f.actuator == name)
        causes = (fault.start_s if lost else fault.end_s for fault in faults)
        cause = max((t for t in causes if t is not None and t <= time_s), default=None)
        position = offset if name == "throttle" else float(np.degrees(offset))
        yield DiagnosisSummary(
            actuator=name,
            phase="lost" if lost else "back",
            time_s=time_s,
            delay_s=None if cause is None else round(time_s - cause, 6),
            stuck=position if lost else None,
        )


def _summarise_channel(own: np.void, repeats: np.ndarray, c: int, step_us: int) -> ChannelSummary:
    gap = int(own["min_gap"][c])
    return ChannelSummary(
        events=int(own["events"][c]),
        repeats=int(repeats[c]),
        min_interval_s=gap * step_us / 1e6 if gap else None,
    )


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
