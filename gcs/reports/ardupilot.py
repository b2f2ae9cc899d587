"""The results of a flight by ArduPilot as tables for the terminal."""

from collections.abc import Iterator
from dataclasses import astuple

from rich.table import Table

from gcs.console.terminal import numbers, table_of, texts
from gcs.reports.flight import least_separation, lowest_altitude, transmissions_table
from gcs.results.ardupilot import ArduPilotSummary
from gcs.results.quantities import milliseconds, percent
from gcs.scenario.model import Scenario


def ardupilot_tables(summary: ArduPilotSummary, scenario: Scenario) -> list[Table | str]:
    """Return what `gcs ardupilot` prints at the end: transmissions, frames, motion, totals."""
    flight = summary.flight
    names = {uav.id: f"{uav.id} {uav.name}" for uav in scenario.uavs}
    pace = f"{flight.real_time_factor:.1f}× real time, " if flight.real_time_factor else ""
    total = (
        f"{flight.duration_s:g} s in {flight.wall_s:.2f} s ({pace}lockstep with ArduPilot); saved "
        f"{percent(flight.saving)} of sending every channel every "
        f"{milliseconds(scenario.step_us / 1e6)}"
    )
    return [
        transmissions_table(flight, names),
        _frames(summary, names),
        _motion(summary, names),
        *_remarks(summary),
        *least_separation(flight),
        *lowest_altitude(flight),
        total,
    ]


def _frames(summary: ArduPilotSummary, names: dict[int, str]) -> Table:
    columns = ("channels", "rate\n[Hz]", "frames", "changed", "repeated", "missing")
    title = "Frames of ArduPilot; changed: an output changed, in the flight"
    table = table_of(texts("UAV"), *map(numbers, (*columns, "restarts", "dropped")), title=title)
    for one, uav in zip(summary.frames, summary.flight.uavs, strict=True):
        figures = (
            *(one.channels, one.rate_hz, one.frames, uav.actuator_messages),
            *(one.repeated, one.missing, one.restarts, sum(one.dropped.values())),
        )
        table.add_row(names[one.uav], *map(str, figures))
    return table


def _motion(summary: ArduPilotSummary, names: dict[int, str]) -> Table:
    columns = ("roll\n[deg]", "pitch\n[deg]", "altitude\n[m]", "airspeed\n[m/s]")
    title = "Motion in the flight, least and greatest"
    table = table_of(texts("UAV"), *map(numbers, columns), title=title)
    for one in summary.frames:
        bands = astuple(one.motion) if one.motion else ()
        figures = (f"{least:.1f} to {greatest:.1f}" for least, greatest in bands)
        table.add_row(names[one.uav], *figures)
    return table


def _remarks(summary: ArduPilotSummary) -> Iterator[str]:
    for one in summary.frames:
        for reason, count in one.dropped.items():
            yield f"UAV {one.uav}: dropped {count} datagrams: {reason}"
