"""A sweep's results: table.csv with everything, table.md and the terminal's for one UAV.

Savings and errors of a lost flight cover only the part flown: table.csv has them beside the time
flown; the other tables leave them out.
"""

import csv
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich import box
from rich.table import Table

from ftc_lab.campaigns.points import FILE, Point, dimensions_of, position, uav_of
from ftc_lab.reports.markdown import bold, save_markdown, table
from gcs.console.terminal import marked, numbers, table_of, texts
from gcs.results.figures import UAV_FIGURES, shown_figure
from gcs.results.quantities import IAE_UNITS, QUANTITIES
from gcs.results.rivals import LEGEND, beaten_by, cost_of, flight_of, law_of
from gcs.results.runs.details import leaves
from gcs.scenario.settings import plain
from mavlink_defs.config.output_files import naming
from mavlink_defs.visible import visible

_TERMINAL_ROWS = 50
_MARKED = ("outcome", "saving", *(f"iae_{quantity}" for quantity in QUANTITIES), "events")
"""Columns of which a simpler law may do better, in the order of table.md."""
_LOSSES = ("heading_lost", "attitude_lost")


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
    triggered, worse = _has_formation_trigger(points), _beaten(points, uav_id)
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
        cells = [" ".join(cell.split()).replace("|", "\\|") for cell in cells]
        for place, name in enumerate(_MARKED, len(where)):
            cells[place] = bold(cells[place], name in worse[point.row])
        rows.append(cells)
    legend = f"\n**Bold**: {LEGEND}.\n" if any(worse.values()) else ""
    save_markdown(path, f"{_title(uav_id)}\n\n{table(head, rows)}{legend}")


def terminal_table(points: Sequence[Point], uav_id: int | None) -> Table:
    """Return what `gcs sweep` prints at the end: less than table.md, for a narrow terminal."""
    left = len(points) - _TERMINAL_ROWS
    caption = (
        f"{left} more points in table.md"
        if left > 0
        else "red: not flown to the end, attitude or heading lost; reasons in table.md"
    )
    worse = _beaten(points, uav_id)
    if not left > 0 and not any(point.reason or _lost(point, uav_id) for point in points):
        caption = ""
    if any(worse[point.row] for point in points[:_TERMINAL_ROWS]):
        caption = f"{caption}; *: {LEGEND}".removeprefix("; ")
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
        caption=caption or None,
        box=box.SIMPLE_HEAD,
        padding=0,
        pad_edge=False,
    )
    for point in points[:_TERMINAL_ROWS]:
        where = [position(point, name) for name in names]
        saving, *iae = _figures(point, uav_id)[:-2]
        done = point.outcome == "completed"
        cells = [saving if done else point.outcome, *iae]
        names_of_cells = ("saving" if done else "outcome", *_MARKED[2:])
        shown_cells = (
            marked(text, name in worse[point.row])
            for text, name in zip(cells, names_of_cells, strict=False)
        )
        style = "red" if not done or _lost(point, uav_id) else None
        messages = _neighbour_figures(point, uav_id)[:1] if triggered else []
        shown.add_row(*where, *shown_cells, *messages, style=style)
    return shown


def _beaten(points: Sequence[Point], uav_id: int | None) -> dict[int, set[str]]:
    """Return the figures, and the outcome, in which a simpler law did better, by the point's row.

    A point that was not flown to its end has no figures to compare, only an outcome.
    """
    found: dict[int, set[str]] = {point.row: set() for point in points}
    flown = [(one, one.scenario) for one in points if one.scenario is not None]
    if len({scenario.controller.kind for _, scenario in flown}) < 2:
        return found
    groups: dict[frozenset[tuple[str, str]], list[tuple[Point, str]]] = {}
    for point, scenario in flown:
        keys = dict(leaves(plain(scenario.model_dump()), ""))
        groups.setdefault(flight_of(keys), []).append((point, law_of(keys)))
    for group in groups.values():
        for name in _MARKED:
            costs = [(law, _cost(point, uav_id, name)) for point, law in group]
            for (point, _), (law, cost) in zip(group, costs, strict=True):
                if beaten_by(law, cost, costs):
                    found[point.row].add(name)
    return found


def _cost(point: Point, uav_id: int | None, name: str) -> float:
    uav = uav_of(point, uav_id)
    if name != "outcome":
        return math.nan if uav is None else cost_of(name, uav[name])
    if uav is None:
        return math.nan if point.outcome in {"invalid", "failed"} else float(len(_LOSSES) + 1)
    lost = (uav[f"{what}_at_s"] is not None for what in _LOSSES)
    return float(max((place * gone for place, gone in enumerate(lost, 1)), default=0))


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
