"""A sweep's results: table.csv with everything, table.md and the terminal's for one UAV.

Savings and errors of a lost flight cover only the part flown: table.csv has them beside the time
flown; the other tables leave them out.
"""

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich import box
from rich.table import Table

from ftc_lab.campaigns.points import FILE, Point, dimensions_of, position, uav_of
from ftc_lab.reports.markdown import save_markdown, table
from gcs.console.terminal import numbers, table_of, texts
from gcs.results.figures import UAV_FIGURES, shown_figure
from gcs.results.quantities import IAE_UNITS, QUANTITIES
from mavlink_defs.config.output_files import naming
from mavlink_defs.visible import visible

_TERMINAL_ROWS = 50


def write_csv(points: Sequence[Point], path: Path) -> None:
    """Write one row for each UAV of each point; one row for a point without a flight."""
    keys = list(points[0].values)
    head = ["row", FILE, *keys, "outcome", "reason", "duration_s", "saving", "uav"]
    head += ["uav_saving" if f.name == "saving" else f.heading for f in UAV_FIGURES]
    with naming(path), path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(head)
        for point in points:
            named = (point.file, *point.values.values(), point.outcome, point.reason)
            start: list[Any] = [point.row, *map(visible, named)]
            ids = point.uav_ids()
            if not ids:
                rows.writerow(start + [None] * (len(head) - len(start)))
                continue
            start += [point.figures["duration_s"], point.figures["saving"]]
            for uav_id in ids:
                uav = point.uav(uav_id)
                rows.writerow([*start, uav_id, *(uav.get(figure.name) for figure in UAV_FIGURES)])


def write_markdown(points: Sequence[Point], uav_id: int | None, path: Path) -> None:
    """Write the main columns for one UAV as a Markdown table."""
    names = [name for name, _ in dimensions_of(points)]
    iae = [f"IAE {quantity} [{IAE_UNITS[quantity]}]" for quantity in QUANTITIES]
    head = [*names, "outcome", "saving", *iae, "events", "smallest interval", "reason"]
    triggered = _has_formation_trigger(points)
    if triggered:
        head[-1:-1] = ["neighbour messages", "neighbour messages saved"]
    rows = []
    for point in points:
        where = [position(point, name) for name in names]
        cells = [*where, point.outcome, *_figures(point, uav_id), point.reason]
        if lost := _lost(point, uav_id):
            cells[len(where)], cells[-1] = lost
        if triggered:
            cells[-1:-1] = _neighbour_figures(point, uav_id)
        rows.append([" ".join(cell.split()).replace("|", "\\|") for cell in cells])
    save_markdown(path, f"{_title(uav_id)}\n\n{table(head, rows)}")


def terminal_table(points: Sequence[Point], uav_id: int | None) -> Table:
    """Return what `gcs sweep` prints at the end: less than table.md, for a narrow terminal."""
    left = len(points) - _TERMINAL_ROWS
    caption = (
        f"{left} more points in table.md"
        if left > 0
        else "red: not flown to the end, attitude or heading lost; reasons in table.md"
    )
    marked = any(point.reason or _lost(point, uav_id) for point in points)
    names = [name for name, _ in dimensions_of(points)]
    short = [name.rpartition(".")[2] for name in names]
    headings = short if len(set(short)) == len(short) else names
    triggered = _has_formation_trigger(points)
    shown = table_of(
        *map(texts, headings),
        numbers("saving"),
        *(numbers(f"{quantity}\n[{IAE_UNITS[quantity]}]") for quantity in QUANTITIES),
        *[numbers("neighbour\nmessages")] * triggered,
        title=_title(uav_id),
        caption=caption if left > 0 or marked else None,
        box=box.SIMPLE_HEAD,
        padding=0,
        pad_edge=False,
    )
    for point in points[:_TERMINAL_ROWS]:
        where = [position(point, name) for name in names]
        saving, *iae = _figures(point, uav_id)[:-2]
        done = point.outcome == "completed"
        style = "red" if not done or _lost(point, uav_id) else None
        messages = _neighbour_figures(point, uav_id)[:1] if triggered else []
        shown.add_row(*where, saving if done else point.outcome, *iae, *messages, style=style)
    return shown


def _title(uav_id: int | None) -> str:
    return f"UAV {uav_id}: transmissions saved, integrals of absolute errors (IAE)"


def _figures(point: Point, uav_id: int | None) -> list[str]:
    """Format saving, IAEs, events and smallest interval of a complete flight."""
    uav = uav_of(point, uav_id)
    if uav is None:
        return ["-"] * (3 + len(QUANTITIES))
    names = ("saving", *(f"iae_{quantity}" for quantity in QUANTITIES), "events", "min_interval_s")
    return [shown_figure(name, uav[name]) for name in names]


def _has_formation_trigger(points: Sequence[Point]) -> bool:
    """Return whether neighbour messages were triggered in any point, and are worth a column."""
    scenarios = (point.scenario for point in points)
    return any(s is not None and s.links.formation.trigger is not None for s in scenarios)


def _neighbour_figures(point: Point, uav_id: int | None) -> list[str]:
    """Format number and saving of the neighbour messages of a complete flight."""
    uav = uav_of(point, uav_id)
    if uav is None:
        return ["-", "-"]
    names = ("neighbour_messages", "neighbour_saving")
    return [shown_figure(name, uav[name]) for name in names]


def _lost(point: Point, uav_id: int | None) -> tuple[str, str] | None:
    """Return what a UAV lost, and its final error; None if nothing, or if the flight was lost."""
    uav = uav_of(point, uav_id)
    if uav is None:
        return None
    losses = (  # the worse one first
        ("attitude lost", uav["attitude_lost_at_s"], ("roll", "pitch")),
        ("heading lost", uav["heading_lost_at_s"], ("yaw",)),
    )
    for what, lost_at_s, angles in losses:
        if lost_at_s is not None:
            left = max(uav[f"final_error_{angle}"] or 0.0 for angle in angles)
            return what, (
                f"{' or '.join(angles)} more than 90° off first at {lost_at_s:g} s, "
                f"up to {left:.3g}° in the last second"
            )
    return None
