"""A sweep's results: table.csv with everything, table.md and the terminal's for one UAV.

Savings and errors of a lost flight cover only the part flown: table.csv has them beside the time
flown; the other tables leave them out.
"""

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeAlias

from rich import box
from rich.table import Table

from gcs.errors import BadInput
from gcs.reports.formatting import milliseconds, percent
from gcs.results.quantities import IAE_UNITS, PAPER_ORDER, QUANTITIES
from gcs.results.summary import UavSummary
from gcs.results.traffic import KINDS
from gcs.sweeps.axes import label
from gcs.sweeps.folder import Result
from gcs.sweeps.grid import Run
from mavlink_defs.runtime.files import naming, write_text

__all__ = [
    "Dimension",
    "choose_uav",
    "dimensions_of",
    "position",
    "terminal_table",
    "uav_of",
    "write_csv",
    "write_markdown",
]

_TERMINAL_ROWS = 50
_WIDEST_VALUE = 14  # characters of the terminal


def choose_uav(runs: Sequence[Run], wanted: int | None) -> int | None:
    """Return the UAV that table.md and the plot show.

    Args:
        runs: The grid.
        wanted: System id; None for the first UAV with a fault, or else the last UAV.

    Returns:
        Its system id; None if no run can be flown.

    Raises:
        BadInput: No run has the wanted UAV.
    """
    scenarios = [run.scenario for run in runs if run.scenario is not None]
    if not scenarios:
        return wanted
    ids = sorted({uav.id for scenario in scenarios for uav in scenario.uavs})
    if wanted is None:
        faulted = [fault.uav for scenario in scenarios for fault in scenario.faults]
        return faulted[0] if faulted else scenarios[0].uavs[-1].id
    if wanted not in ids:
        raise BadInput(f"--uav is {wanted}, expected one of {', '.join(map(str, ids))}")
    return wanted


# tables


def write_csv(results: Sequence[Result], path: Path) -> None:
    """Write one row for each UAV of each run; one row for a run without a flight."""
    keys = list(results[0].run.values)
    head = [
        "run",
        "scenario",
        *keys,
        "outcome",
        "reason",
        "duration_s",
        "saving",
        "uav",
        "uav_saving",
    ]
    head += [f"iae_{quantity}_{IAE_UNITS[quantity].replace(' ', '_')}" for quantity in QUANTITIES]
    head += [f"events_{channel}" for channel in PAPER_ORDER]
    head += ["min_interval_s", "attitude_lost_at_s", "heading_lost_at_s"]
    head += ["messages", "neighbour_messages", "neighbour_saving"]
    head += [f"iae_sync_{quantity}" for quantity in QUANTITIES]
    head += [f"bytes_{kind}" for kind in KINDS]
    with naming(path), path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(head)
        for result in results:
            run, summary = result.run, result.summary
            values = [label(run.values[key]) for key in keys]
            start = [run.digest, run.file, *values, result.outcome, result.reason]
            if summary is None:
                rows.writerow(start + [None] * (len(head) - len(start)))
                continue
            start += [summary.duration_s, summary.saving]
            rows.writerows(start + _uav_columns(uav) for uav in summary.uavs)


def _uav_columns(uav: UavSummary) -> list[Any]:
    iae = [uav.iae[quantity] for quantity in QUANTITIES]
    events = [uav.channels[channel].events for channel in PAPER_ORDER]
    lost = [uav.attitude_lost_at_s, uav.heading_lost_at_s]
    told = [uav.actuator_messages, uav.neighbour_messages, uav.neighbour_saving]
    sync = [uav.iae_sync[quantity] for quantity in QUANTITIES]
    size = [uav.link_bytes[kind] for kind in KINDS]
    return [uav.id, uav.saving, *iae, *events, uav.min_interval_s, *lost, *told, *sync, *size]


def write_markdown(results: Sequence[Result], uav_id: int | None, path: Path) -> None:
    """Write the main columns for one UAV as a Markdown table."""
    names = [name for name, _ in dimensions_of(results)]
    iae = [f"IAE {quantity} [{IAE_UNITS[quantity]}]" for quantity in QUANTITIES]
    head = [*names, "outcome", "saving", *iae, "events", "smallest interval", "reason"]
    triggered = _has_formation_trigger(results)
    if triggered:
        head[-1:-1] = ["neighbour messages", "neighbour messages saved"]
    lines = [_title(uav_id), "", _markdown_row(head), _markdown_row(["---"] * len(head))]
    for result in results:
        where = [position(result.run, name) for name in names]
        cells = [*where, result.outcome, *_figures(result, uav_id), result.reason]
        if lost := _lost(result, uav_id):
            cells[len(where)], cells[-1] = lost
        if triggered:
            cells[-1:-1] = _neighbour_figures(result, uav_id)
        lines.append(_markdown_row(cells))
    write_text(path, "\n".join(lines) + "\n")


def _markdown_row(cells: Sequence[str]) -> str:
    escaped = (" ".join(cell.split()).replace("|", "\\|") for cell in cells)
    return f"| {' | '.join(escaped)} |"


def terminal_table(results: Sequence[Result], uav_id: int | None) -> Table:
    """Return what `gcs sweep` prints at the end: less than table.md, for a narrow terminal."""
    left = len(results) - _TERMINAL_ROWS
    caption = (
        f"{left} more runs in table.md"
        if left > 0
        else "red: not flown to the end, attitude or heading lost; reasons in table.md"
    )
    marked = any(result.reason or _lost(result, uav_id) for result in results)
    shown = left > 0 or marked
    table = Table(
        title=_title(uav_id),
        caption=caption if shown else None,
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        collapse_padding=True,
    )
    names = [name for name, _ in dimensions_of(results)]
    short = [name.rpartition(".")[2] for name in names]
    headings = short if len(set(short)) == len(short) else names
    for heading, (_, labels) in zip(headings, dimensions_of(results), strict=True):
        width = min(max(map(len, labels)), _WIDEST_VALUE)
        table.add_column(heading, justify="right", overflow="fold", min_width=width)
    table.add_column("saving", justify="right", no_wrap=True)
    for quantity in QUANTITIES:
        heading = f"{quantity}\n[{IAE_UNITS[quantity]}]"
        table.add_column(heading, justify="right", no_wrap=True)
    triggered = _has_formation_trigger(results)
    if triggered:
        table.add_column("neighbour\nmessages", justify="right", no_wrap=True)
    for result in results[:_TERMINAL_ROWS]:
        where = [position(result.run, name) for name in names]
        saving, *iae = _figures(result, uav_id)[:-2]
        done = result.outcome == "completed"
        style = "red" if not done or _lost(result, uav_id) else None
        told = _neighbour_figures(result, uav_id)[:1] if triggered else []
        table.add_row(*where, saving if done else result.outcome, *iae, *told, style=style)
    return table


def _title(uav_id: int | None) -> str:
    return f"UAV {uav_id}: transmissions saved, integrals of absolute errors (IAE)"


def _figures(result: Result, uav_id: int | None) -> list[str]:
    """Format saving, IAEs, events and smallest interval of a complete flight."""
    uav = uav_of(result, uav_id)
    if uav is None:
        return ["-"] * (3 + len(QUANTITIES))
    return [
        percent(uav.saving),
        *(f"{uav.iae[quantity]:.2f}" for quantity in QUANTITIES),
        str(uav.events),
        milliseconds(uav.min_interval_s),
    ]


def _has_formation_trigger(results: Sequence[Result]) -> bool:
    """Return whether neighbour messages were triggered in any run, and are worth a column."""
    scenarios = (result.run.scenario for result in results)
    return any(s is not None and s.links.formation.trigger is not None for s in scenarios)


def _neighbour_figures(result: Result, uav_id: int | None) -> list[str]:
    """Format number and saving of the neighbour messages of a complete flight."""
    uav = uav_of(result, uav_id)
    if uav is None:
        return ["-", "-"]
    return [str(uav.neighbour_messages), percent(uav.neighbour_saving)]


def _lost(result: Result, uav_id: int | None) -> tuple[str, str] | None:
    """Return what a UAV lost, and its final error; None if nothing, or if the flight was lost."""
    uav = uav_of(result, uav_id)
    if uav is None:
        return None
    losses = (  # the worse one first
        ("attitude lost", uav.attitude_lost_at_s, ("roll", "pitch")),
        ("heading lost", uav.heading_lost_at_s, ("yaw",)),
    )
    for what, lost_at_s, angles in losses:
        if lost_at_s is not None:
            left = max(uav.final_error[angle] or 0.0 for angle in angles)
            return what, (
                f"{' or '.join(angles)} more than 90° off first at {lost_at_s:g} s, "
                f"up to {left:.3g}° in the last second"
            )
    return None


def uav_of(result: Result, uav_id: int | None) -> UavSummary | None:
    """Return a UAV's part of a complete flight; None if the flight is not complete."""
    if result.summary is None or result.outcome != "completed" or uav_id is None:
        return None
    return result.summary.uav(uav_id)


Dimension: TypeAlias = tuple[str, list[str]]
"""A column of the tables and a dimension of the plot: its name, and labels of its values."""

_FILE = "scenario"


def dimensions_of(results: Sequence[Result]) -> list[Dimension]:
    """Return the keys that were swept, and the files if there are several."""
    names = [*results[0].run.values, _FILE]
    axes = [(name, list(dict.fromkeys(position(r.run, name) for r in results))) for name in names]
    return [axis for axis in axes if axis[0] != _FILE or len(axis[1]) > 1]


def position(run: Run, name: str) -> str:
    """Return the label of a run's value in a dimension."""
    return run.name if name == _FILE else label(run.values.get(name, ""))
