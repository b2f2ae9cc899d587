"""The page of what was flown: one file that fetches nothing."""

import html
import json
import math
import os
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote

from gcs.console.outputs import write_file
from gcs.results.quantities import IAE_UNITS, QUANTITIES, UNITS
from gcs.results.rivals import LEGEND, beaten_by, cost_of, flight_of, law_of
from gcs.results.runs.details import curves_of, figure_of, own_keys, scenario_keys, thumbnail
from gcs.results.runs.run import Run
from gcs.results.runs.scan import Foreign
from mavlink_defs.visible import visible_lines


class Cell(NamedTuple):
    """A cell of the table: what is shown, and a number by which it is sorted, if it is one."""

    text: str
    number: float | None = None


_COLUMNS: dict[str, Callable[[Run], Cell]] = {
    "run": lambda run: Cell(run.name),
    "outcome": lambda run: Cell(run.outcome.replace("_", " ")),
    **{
        f"IAE {name} [{IAE_UNITS[name]}]": lambda run, name=name: _number(  # type: ignore[misc]  # a default binds the name
            run.iae.get(name), "{:.2f}"
        )
        for name in QUANTITIES
    },
    "saved [%]": lambda run: _number(None if run.saving is None else 100.0 * run.saving, "{:.2f}"),
    "law": lambda run: Cell(run.law),
    "trigger": lambda run: Cell(run.trigger),
    "changes": lambda run: Cell("\n".join(run.changes)),
    "faults": lambda run: Cell("\n".join(run.faults)),
    "scenario": lambda run: Cell(run.scenario),
    "kind": lambda run: Cell(run.kind),
    "time": lambda run: _moment(run.time),
    "flights": lambda run: _number(run.flights, "{:.0f}"),
    "messages": lambda run: _number(run.messages, "{:.0f}"),
    "events": lambda run: _number(run.events, "{:.0f}"),
    "duration [s]": lambda run: _number(run.duration_s, "{:g}"),
    "reason": lambda run: Cell(run.reason),
    "version": lambda run: Cell(run.version),
    "note": lambda run: Cell(run.note),
}
"""In this order: what a flight was and how good it was is seen without scrolling."""
_PROSE = {"changes", "faults", "reason", "note"}
_COMPARED: dict[str, Callable[[Run], float]] = {
    **{
        f"IAE {name} [{IAE_UNITS[name]}]": lambda run, name=name: cost_of(  # type: ignore[misc]  # a default binds the name
            f"iae_{name}", run.iae.get(name)
        )
        for name in QUANTITIES
    },
    "saved [%]": lambda run: cost_of("saving", run.saving),
    "messages": lambda run: cost_of("messages", run.messages),
    "events": lambda run: cost_of("events", run.events),
}
"""What a figure costs, of the columns in which laws are compared."""
_NO_FIGURES = {"interrupted", "killed", "unfinished", "under_way"}
_LOST = {"ground", "control_failed", "lost"}


def save_page(
    path: Path,
    root: Path,
    runs: Sequence[Run],
    foreign: Sequence[Foreign],
    compared: Sequence[str],
    figures: int,
    on_run: Callable[[str], None] = lambda _: None,
) -> None:
    """Write the page.

    Args:
        path: The file.
        root: Folder that the runs are in.
        runs: In the order in which the page shows them at first.
        foreign: What is no run.
        compared: Names of the runs that are compared at first.
        figures: How many of the first runs have a thumbnail, curves and the keys of their scenario.
        on_run: Called with the name of each of these when it is done.

    Raises:
        OSError: It cannot be written; it is named.
    """
    keys, curves, thumbnails = [], {}, {}
    for run in runs[:figures]:
        folder = _folder(root, run)
        keys.append(scenario_keys(folder))
        curves[run.name] = curves_of(folder)
        if (figure := figure_of(folder)) is not None:
            thumbnails[run.name] = (thumbnail(figure), _link(figure, path))
        on_run(run.name)
    head = "".join(
        f"<th data-column='{name}'><button>{name}</button></th>"
        for name in map(html.escape, _COLUMNS)
    )
    rows = "\n".join(_row(run, _link(_folder(root, run), path), thumbnails) for run in runs)
    strange = "".join(f"<li>{_text(one.name)}: {_text(one.reason)}</li>" for one in foreign)
    page = _resource("page.html")
    for name, value in {
        "title": _text(f"What was flown: {root}"),
        "counts": _text(f"{len(runs)} runs, as of {datetime.now().astimezone():%Y-%m-%d %H:%M %Z}"),
        "style": _resource("page.css"),
        "head": head,
        "rows": rows,
        "foreign": f"<h2>No runs</h2><ul>{strange}</ul>" if strange else "",
        "data": _data(keys, curves, _beaten(runs[:figures], keys), compared),
        "script": _resource("page.js"),
    }.items():
        page = page.replace(f"<!-- {name} -->", value)
    write_file(path, page)


def _beaten(runs: Sequence[Run], keys: Sequence[dict[str, str]]) -> dict[str, dict[str, list[str]]]:
    """Return, by run and column, which flights of the same by a simpler law are better by a tenth.

    A flight that was lost is worse than any; one that did not end is not compared.
    """
    same: dict[frozenset[tuple[str, str]], list[tuple[Run, str]]] = {}
    for run, own in zip(runs, keys, strict=True):
        if run.kind == "flight" and own and run.outcome not in _NO_FIGURES:
            same.setdefault(flight_of(own), []).append((run, law_of(own)))
    return {
        run.name: {
            column: [
                other.name
                for other, rival in flights
                if beaten_by(law, _cost(run, column), [(rival, _cost(other, column))])
            ]
            for column in _COMPARED
        }
        for flights in same.values()
        for run, law in flights
        if len({law for _, law in flights}) > 1
    }


def _cost(run: Run, column: str) -> float:
    return math.inf if run.outcome in _LOST else _COMPARED[column](run)


def _data(
    keys: Sequence[dict[str, str]],
    curves: Mapping[str, object],
    beaten: Mapping[str, object],
    compared: Sequence[str],
) -> str:
    """Return what the page's script draws and compares, as JSON within HTML."""
    common, own = own_keys(keys)
    data = {
        "common": common,
        "runs": {
            name: {"curves": curve, "keys": mine, "has_keys": bool(all_)}
            for (name, curve), mine, all_ in zip(curves.items(), own, keys, strict=True)
        },
        "beaten": beaten,
        "legend": f"*: {LEGEND}",
        "compared": list(compared),
        "panels": {
            **{name: f"largest error of {name} [{UNITS[name]}]" for name in QUANTITIES},
            "events": "events so far",
        },
    }
    return json.dumps(data, allow_nan=False).replace("<", "\\u003c")


def _row(run: Run, link: str, thumbnails: dict[str, tuple[str, str]]) -> str:
    name = _text(run.name)
    small, figure = thumbnails.get(run.name, ("", ""))
    image = (
        f"<a href='{html.escape(figure)}'><img alt='figure of {name}' src='{small}'></a>"
        if small
        else ""
    )
    cells = []
    for column, of in _COLUMNS.items():
        text, number = of(run)
        shown = f"<a href='{html.escape(link)}'>{_text(text)}</a>" if column == "run" else None
        kind = (
            " class='prose'" if column in _PROSE else " class='short'" if column == "time" else ""
        )
        if number is not None and column != "time":
            kind = " class='number'"
        value = "" if number is None else f" data-value='{number!r}'"
        cells.append(f"<td{kind}{value}>{shown or _text(text)}</td>")
    check = f"<td><input type='checkbox' aria-label='compare {name}'></td>"
    outcome = html.escape(run.outcome)
    return (
        f"<tr data-name='{name}' data-outcome='{outcome}'>{check}<td>{image}</td>"
        f"{''.join(cells)}</tr>"
    )


def _folder(root: Path, run: Run) -> Path:
    """Return the folder of a run; a list of one run has that run's own folder."""
    folder = root / run.name
    return folder if folder.is_dir() else root


def _link(target: Path, page: Path) -> str:
    """Return the address of a file as seen from the page."""
    return quote(Path(os.path.relpath(target.resolve(), page.resolve().parent)).as_posix())


def _text(text: str) -> str:
    return html.escape(visible_lines(text))


def _number(value: float | None, shape: str) -> Cell:
    return Cell("") if value is None else Cell(shape.format(value), float(value))


def _moment(time: str) -> Cell:
    """Return a time of a run to the minute, in local time."""
    moment = datetime.fromisoformat(time).astimezone()
    return Cell(moment.strftime("%Y-%m-%d %H:%M"), moment.timestamp())


def _resource(name: str) -> str:
    return (files("gcs.results.runs") / name).read_text(encoding="utf-8")
