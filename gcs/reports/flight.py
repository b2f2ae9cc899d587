"""The results of a flight as tables for the terminal."""

from collections.abc import Iterator
from dataclasses import astuple

from rich.table import Table
from rich.text import Text

from gcs.console.terminal import numbers, table_of, texts
from gcs.results.figures import FlightSummary, UavSummary
from gcs.results.ground import GroundSummary
from gcs.results.quantities import IAE_UNITS, QUANTITIES, milliseconds, percent
from gcs.scenario.model import Scenario
from mavlink_defs.capture.saving import saving
from mavlink_defs.config.problems import counted

_SHOWN_DECISIONS = 10  # of the diagnosis of a UAV


def flight_tables(summary: FlightSummary, scenario: Scenario) -> list[Table | Text | str]:
    """Return what `gcs fly` prints at the end: transmissions, tracking, one line of totals."""
    names = {uav.id: f"{uav.id} {uav.name}" for uav in scenario.uavs}
    factor = summary.real_time_factor
    pace = f"{factor:.1f}× real time, " if factor else ""
    total = (
        f"{summary.duration_s:g} s in {summary.wall_s:.2f} s ({pace}"
        f"{summary.mode.replace('_', ' ')}); saved {percent(summary.saving)} of "
        f"sending every channel every {milliseconds(scenario.step_us / 1e6)}"
    )
    remarks = [line for uav in summary.uavs for line in _remarks(uav, summary.steps)]
    tables: list[Table | Text] = [
        transmissions_table(summary, names),
        _links(summary, names),
        _tracking(summary, names),
    ]
    if any(uav.path is not None for uav in summary.uavs):
        tables.append(_path(summary, names))
    tables += _beside(summary, names)
    if any(uav.motion is not None for uav in summary.uavs):
        tables.append(_motion(summary, names))
    return [*tables, *remarks, *least_separation(summary), *lowest_altitude(summary), total]


def lowest_altitude(summary: FlightSummary) -> Iterator[str]:
    """Yield a line on the UAV that came closest to the ground; none of a flight without steps."""
    heights = [(u.lowest_altitude_m, u.id) for u in summary.uavs if u.lowest_altitude_m is not None]
    if heights:
        height, system = min(heights)
        yield f"lowest altitude {height:z.2f} m above the ground, of UAV {system}"


def _remarks(uav: UavSummary, steps: int) -> Iterator[Text]:
    """Yield what the tables do not show of a UAV."""
    losses = (
        ("attitude", "roll or pitch", uav.attitude_lost_at_s),
        ("heading", "yaw", uav.heading_lost_at_s),
    )
    for name, angles, lost_at_s in losses:
        if lost_at_s is not None:
            yield Text.assemble(
                (f"UAV {uav.id} lost its {name}", "bold red"),
                f": {angles} was more than 90° off first at {lost_at_s:.3f} s",
            )
    if (failure := uav.control_failure) is not None:
        counts = ", ".join(f"{name} {steps}" for name, steps in failure.steps.items())
        yield Text.assemble(
            (f"the law of UAV {uav.id} failed", "bold red"),
            f" first at {failure.time_s:.3f} s: steps without a finite command, where the last one "
            f"was held: {counts}",
        )
    if (ground := uav.ground) is not None:
        yield Text(f"UAV {uav.id}: {_on_ground(ground)}")
    for decision in uav.diagnosis[:_SHOWN_DECISIONS]:
        at = f"at {decision.time_s:.3f} s"
        caused = "start" if decision.phase == "lost" else "end"
        after = (
            f", {milliseconds(decision.delay_s)} after the fault's {caused}"
            if decision.delay_s is not None
            else ", without an injected fault"
        )
        what = "lost" if decision.phase == "lost" else "back in service"
        yield Text(f"UAV {uav.id} diagnosed its {decision.actuator} as {what} {at}{after}")
    if uav.diagnosis[_SHOWN_DECISIONS:]:
        last, more = uav.diagnosis[-1], len(uav.diagnosis) - _SHOWN_DECISIONS
        yield Text.assemble(
            (f"UAV {uav.id} diagnosed {more} times more", "bold red"),
            f", last its {last.actuator} at {last.time_s:.3f} s; summary.json has all",
        )
    if missing := uav.missing_steps:
        yield Text.assemble(
            (f"UAV {uav.id} missed {missing} of {steps} steps", "bold red"),
            ": no state reached it; errors compare the true state with the last command",
        )
    if disarmed := steps - uav.active_steps - missing:
        yield Text(
            f"UAV {uav.id} was disarmed for {disarmed} of {steps} steps, which count neither "
            "as control periods nor as errors"
        )


def _on_ground(ground: GroundSummary) -> str:
    """Describe what became of an aircraft on the ground."""
    text = ground.outcome if ground.reason is None else f"{ground.outcome}: {ground.reason}"
    if (worst := ground.worst) is not None:
        text += (
            f"; of {counted(ground.touchdowns, 'touchdown')} the hardest at {worst.time_s:.2f} s: "
            f"sink {worst.sink_m_s:.2f} m/s, bank {worst.bank_deg:.1f}°, drift "
            f"{worst.drift_m_s:.2f} m/s"
        )
    if ground.off_centre_m is not None:
        text += f"; at most {ground.off_centre_m:.1f} m beside the centre line on the ground"
    return text


def transmissions_table(summary: FlightSummary, names: dict[int, str]) -> Table:
    """Return the events of each channel; `names` has each UAV's by its id."""
    columns = (texts("UAV"), texts("channel"))
    figures = map(numbers, ("events", "saved", "smallest interval", "repeats"))
    title = f"Transmissions in {summary.steps} control periods"
    table = table_of(*columns, *figures, title=title)
    for uav in summary.uavs:
        for k, (name, channel) in enumerate(uav.channels.items()):
            table.add_row(
                names[uav.id] if k == 0 else "",
                name,
                str(channel.events),
                percent(saving(channel.events, uav.active_steps, channels=1)),
                milliseconds(channel.min_interval_s),
                str(channel.repeats),
            )
        table.add_row("", "all", str(uav.events), percent(uav.saving), "", "", style="bold")
        table.add_section()
    return table


def _beside(summary: FlightSummary, names: dict[int, str]) -> Iterator[Table | Text]:
    """Yield what our trigger would have sent of foreign autopilots' commands, if there are any."""
    columns = (texts("UAV"), texts("channel"))
    figures = map(numbers, ("changes", "events", "saved", "largest difference"))
    shown = [(uav, uav.beside) for uav in summary.uavs if uav.beside is not None]
    if not shown:
        return
    table = table_of(*columns, *figures, title=f"Trigger {shown[0][1].trigger} on their commands")
    for uav, own in shown:
        for k, (name, channel) in enumerate(uav.channels.items()):
            unit = "N" if name == "throttle" else "°"
            saved = saving(own.events[name], channel.events, channels=1)
            apart = f"{own.apart[name]:.2f} {unit}"
            label = names[uav.id] if k == 0 else ""
            table.add_row(
                label, name, str(channel.events), str(own.events[name]), percent(saved), apart
            )
        saved = saving(own.messages, uav.actuator_messages, channels=1)
        counts = (str(uav.actuator_messages), str(own.messages), percent(saved), "")
        table.add_row("", "messages", *counts, style="bold")
        table.add_section()
    yield table
    yield Text(
        "Asked about the commands that were flown: the largest difference is what it would have "
        "held back, and how a flight with it tracks is not known."
    )


def _links(summary: FlightSummary, names: dict[int, str]) -> Table:
    figures = map(numbers, ("messages", "bytes", "saved"))
    title = "Messages and bytes on the links, each once"
    table = table_of(texts("UAV"), texts(""), *figures, title=title)
    for uav in summary.uavs:
        size = uav.link_bytes
        rows = (
            ("states", summary.steps, "states", ""),
            ("actuators", uav.actuator_messages, "actuator_messages", ""),
            (
                "neighbours",
                uav.neighbour_messages,
                "neighbour_messages",
                percent(uav.neighbour_saving),
            ),
        )
        for k, (label, messages, kind, saved) in enumerate(rows):
            name = names[uav.id] if k == 0 else ""
            table.add_row(name, label, str(messages), str(size[kind]), saved)
        table.add_section()
    return table


def _tracking(summary: FlightSummary, names: dict[int, str]) -> Table:
    figures = [numbers(f"{quantity}\n[{IAE_UNITS[quantity]}]") for quantity in QUANTITIES]
    title = "Tracking: integral of absolute error (IAE), largest error after 1 s"
    table = table_of(texts("UAV"), texts(""), *figures, title=title)
    for uav in summary.uavs:
        rows = (
            (names[uav.id], "IAE vs commands", uav.iae, "{:.2f}"),
            ("", "IAE vs reference", uav.iae_filtered, "{:.2f}"),
            ("", "IAE synchronisation", uav.iae_sync, "{:.2f}"),
            ("", "max error [m/s, deg]", uav.max_error, "{:.3f}"),
        )
        for name, label, errors, shape in rows:
            values = (errors[quantity] for quantity in QUANTITIES)
            shown = ("-" if value is None else shape.format(value) for value in values)
            table.add_row(name, label, *shown)
        table.add_section()
    return table


def _path(summary: FlightSummary, names: dict[int, str]) -> Table:
    figures = map(numbers, ("straights", "turns", "height", "RMS", "slot", "RMS", "counted"))
    title = "Path: largest errors of the true place [m], from 10 s on the path on"
    table = table_of(texts("UAV"), *figures, title=title)
    for uav in summary.uavs:
        if (path := uav.path) is None:
            continue
        errors = (
            path.straight_cross_track_m,
            path.turn_cross_track_m,
            path.height_max_m,
            path.height_rms_m,
            path.slot_max_m,
            path.slot_rms_m,
        )
        shown = ("-" if value is None else f"{value:.2f}" for value in errors)
        share = path.counted_steps / path.flown_steps if path.flown_steps else None
        table.add_row(names[uav.id], *shown, percent(share))
    return table


def _motion(summary: FlightSummary, names: dict[int, str]) -> Table:
    columns = ("roll\n[deg]", "pitch\n[deg]", "altitude\n[m]", "airspeed\n[m/s]")
    title = "Motion, least and greatest, of UAVs whose references are not known"
    table = table_of(texts("UAV"), *map(numbers, columns), title=title)
    for uav in summary.uavs:
        if uav.motion is not None:
            bands = (f"{least:.1f} to {most:.1f}" for least, most in astuple(uav.motion))
            table.add_row(names[uav.id], *bands)
    return table


def least_separation(summary: FlightSummary) -> Iterator[str]:
    """Yield a line on the two UAVs that came closest to each other; none of a single UAV."""
    if (least := summary.separation) is not None:
        a, b = least.uavs
        yield (
            f"least separation {least.least_m:.2f} m, of UAV {a} and UAV {b} "
            f"at {least.time_s:.3f} s"
        )
