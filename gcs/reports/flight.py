"""A flight's figures as tables for the terminal."""

from collections.abc import Iterator
from typing import Any

from rich.table import Table
from rich.text import Text

from gcs.results.summary import PAPER_ORDER, QUANTITIES
from gcs.scenario.model import Scenario

__all__ = ["flight_tables"]

_UNITS = {"airspeed": "m", "roll": "deg s", "pitch": "deg s", "yaw": "deg s"}


def flight_tables(summary: dict[str, Any], scenario: Scenario) -> list[Table | Text | str]:
    """Give what `gcs fly` prints at the end: transmissions, tracking, one line of totals."""
    names = {uav.id: f"{uav.id} {uav.name}" for uav in scenario.uavs}
    factor = summary["real_time_factor"]
    pace = f"{factor:.1f}× real time, " if factor else ""
    total = (
        f"{summary['duration_s']:g} s in {summary['wall_s']:.2f} s ({pace}"
        f"{summary['mode'].replace('_', ' ')}); saved {_percent(summary['saving'])} of "
        "periodic transmissions"
    )
    remarks = [line for uav in summary["uavs"] for line in _remarks(uav, summary["steps"])]
    return [_transmissions(summary, names), _tracking(summary, names), *remarks, total]


def _remarks(uav: dict[str, Any], steps: int) -> Iterator[Text]:
    """What the tables do not show of a UAV."""
    for key, what in (("attitude_lost_at_s", "roll or pitch"), ("heading_lost_at_s", "yaw")):
        if uav[key] is not None:
            yield Text.assemble(
                (f"UAV {uav['id']} lost its {key.partition('_')[0]}", "bold red"),
                f": {what} was more than 90° off first at {uav[key]:.3f} s",
            )
    if missing := uav["missing_steps"]:
        yield Text.assemble(
            (f"UAV {uav['id']} missed {missing} of {steps} steps", "bold red"),
            ": no state reached it; errors are those of the true state against the last command",
        )
    if disarmed := steps - uav["active_steps"] - missing:
        yield Text(
            f"UAV {uav['id']} was disarmed for {disarmed} of {steps} steps, which count neither "
            "as control periods nor as errors"
        )


def _transmissions(summary: dict[str, Any], names: dict[int, str]) -> Table:
    table = Table(title=f"Transmissions in {summary['steps']} control periods")
    table.add_column("UAV")
    table.add_column("channel")
    for heading in ("events", "saved", "smallest interval", "repeats"):
        table.add_column(heading, justify="right")
    for uav in summary["uavs"]:
        for channel in PAPER_ORDER:
            row = uav["channels"][channel]
            shortest = row["min_interval_s"]
            saved = 1.0 - row["events"] / uav["active_steps"] if uav["active_steps"] else None
            table.add_row(
                names[uav["id"]] if channel == PAPER_ORDER[0] else "",
                channel,
                str(row["events"]),
                _percent(saved),
                "-" if shortest is None else f"{1e3 * shortest:g} ms",
                str(row["repeats"]),
            )
        total = sum(uav["channels"][c]["events"] for c in PAPER_ORDER)
        table.add_row("", "all", str(total), _percent(uav["saving"]), "", "", style="bold")
        table.add_section()
    return table


def _tracking(summary: dict[str, Any], names: dict[int, str]) -> Table:
    table = Table(title="Tracking: integral of absolute error (IAE), largest error after 1 s")
    table.add_column("UAV")
    table.add_column("")
    for quantity in QUANTITIES:
        table.add_column(f"{quantity}\n[{_UNITS[quantity]}]", justify="right")
    rows = (
        ("iae", "IAE vs commands", "{:.2f}"),
        ("iae_filtered", "IAE vs reference", "{:.2f}"),
        ("max_error", "max error [m/s, deg]", "{:.3f}"),
    )
    for uav in summary["uavs"]:
        for key, label, shape in rows:
            values = (uav[key][q] for q in QUANTITIES)
            shown = ("-" if value is None else shape.format(value) for value in values)
            table.add_row(names[uav["id"]] if key == "iae" else "", label, *shown)
        table.add_section()
    return table


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100.0 * share:.2f} %"
