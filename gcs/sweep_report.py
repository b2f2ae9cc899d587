"""A sweep's results: table.csv with everything, table.md and the plot for one UAV.

What a lost flight saved, and its errors, count only its beginning: table.csv has them beside the
time flown; the other two leave them out.
"""

import csv
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from rich import box
from rich.markup import escape
from rich.table import Table

from gcs.errors import BadInput
from gcs.figures.style import GREY, SMALL, STYLES, new_figure, save, tidy
from gcs.summary import CHANNELS, QUANTITIES
from gcs.sweep import Result, Run, label

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["choose_uav", "draw_sweep", "terminal_table", "write_csv", "write_markdown"]

_UNITS = {"airspeed": "m", "roll": "deg s", "pitch": "deg s", "yaw": "deg s"}  # of the IAE
_TERMINAL_ROWS = 50
_WIDEST_VALUE = 14  # characters of the terminal


def choose_uav(runs: Sequence[Run], wanted: int | None) -> int | None:
    """The UAV that table.md and the plot are about.

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
    head = ["run", "scenario", *keys, "outcome", "reason", "duration_s", "saving",
            "uav", "uav_saving"]  # fmt: skip
    head += [f"iae_{quantity}_{_UNITS[quantity].replace(' ', '_')}" for quantity in QUANTITIES]
    head += [f"events_{channel}" for channel in CHANNELS]
    head += ["min_interval_s", "departed_at_s"]
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(head)
        for result in results:
            run, summary = result.run, result.summary or {}
            values = [label(run.values[key]) for key in keys]
            begin = [run.digest, run.file, *values, result.outcome, result.reason,
                     summary.get("duration_s"), summary.get("saving")]  # fmt: skip
            for uav in summary.get("uavs", [None]):
                row = begin + (_uav_columns(uav) if uav else [])
                rows.writerow(row + [None] * (len(head) - len(row)))


def _uav_columns(uav: dict[str, Any]) -> list[Any]:
    iae = [uav["iae"][quantity] for quantity in QUANTITIES]
    events = [uav["channels"][channel]["events"] for channel in CHANNELS]
    return [uav["id"], uav["saving"], *iae, *events, _shortest_s(uav), uav["departed_at_s"]]


def write_markdown(results: Sequence[Result], uav_id: int | None, path: Path) -> None:
    """Write the main columns for one UAV as a Markdown table."""
    names = [name for name, _ in _axes(results)]
    iae = [f"IAE {quantity} [{_UNITS[quantity]}]" for quantity in QUANTITIES]
    head = [*names, "outcome", "saving", *iae, "events", "smallest interval", "reason"]
    lines = [_title(uav_id), "", _markdown_row(head), _markdown_row(["---"] * len(head))]
    for result in results:
        where = [_position(result.run, name) for name in names]
        cells = [*where, result.outcome, *_figures(result, uav_id), result.reason]
        if departure := _departure(result, uav_id):
            cells[len(where)], cells[-1] = "departed", departure
        lines.append(_markdown_row(cells))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _markdown_row(cells: Sequence[str]) -> str:
    escaped = (" ".join(cell.split()).replace("|", "\\|") for cell in cells)
    return f"| {' | '.join(escaped)} |"


def terminal_table(results: Sequence[Result], uav_id: int | None) -> Table:
    """Give what `gcs sweep` prints at the end: less than table.md, for a narrow terminal."""
    left = len(results) - _TERMINAL_ROWS
    caption = (
        f"{left} more runs in table.md"
        if left > 0
        else "red: not flown to the end, or departed; reasons in table.md"
    )
    marked = any(result.reason or _departure(result, uav_id) for result in results)
    shown = left > 0 or marked
    table = Table(
        title=_title(uav_id),
        caption=caption if shown else None,
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        collapse_padding=True,
    )
    names = [name for name, _ in _axes(results)]
    short = [name.rpartition(".")[2] for name in names]
    headings = short if len(set(short)) == len(short) else names
    for heading, (_, labels) in zip(headings, _axes(results), strict=True):
        width = min(max(map(len, labels)), _WIDEST_VALUE)
        table.add_column(escape(heading), justify="right", overflow="fold", min_width=width)
    table.add_column("saving", justify="right", no_wrap=True)
    for quantity in QUANTITIES:
        heading = escape(f"{quantity}\n[{_UNITS[quantity]}]")
        table.add_column(heading, justify="right", no_wrap=True)
    for result in results[:_TERMINAL_ROWS]:
        where = [escape(_position(result.run, name)) for name in names]
        saving, *iae = _figures(result, uav_id)[:-2]
        done = result.outcome == "completed"
        style = "red" if not done or _departure(result, uav_id) else None
        table.add_row(*where, saving if done else result.outcome, *iae, style=style)
    return table


def _title(uav_id: int | None) -> str:
    return f"UAV {uav_id}: transmissions saved, integrals of absolute errors (IAE)"


def _figures(result: Result, uav_id: int | None) -> list[str]:
    """Saving, IAEs, events and smallest interval of a complete flight, for people."""
    uav = _uav(result, uav_id)
    if uav is None:
        return ["-"] * (3 + len(QUANTITIES))
    shortest_s = _shortest_s(uav)
    return [
        f"{100.0 * uav['saving']:.2f} %",
        *(f"{uav['iae'][quantity]:.2f}" for quantity in QUANTITIES),
        str(sum(uav["channels"][channel]["events"] for channel in CHANNELS)),
        "-" if shortest_s is None else f"{1e3 * shortest_s:g} ms",
    ]


def _departure(result: Result, uav_id: int | None) -> str:
    """How far a UAV that departed came back; empty if it did not depart, or did not end."""
    uav = _uav(result, uav_id)
    if uav is None or uav["departed_at_s"] is None:
        return ""
    left = max(uav["final_error"][angle] for angle in QUANTITIES[1:])
    return (
        f"attitude more than 90° off first at {uav['departed_at_s']:g} s, "
        f"up to {left:.3g}° in the last second"
    )


def _uav(result: Result, uav_id: int | None) -> dict[str, Any] | None:
    """What a complete flight's summary says about a UAV."""
    if result.summary is None or result.outcome != "completed":
        return None
    return next((uav for uav in result.summary["uavs"] if uav["id"] == uav_id), None)


def _shortest_s(uav: dict[str, Any]) -> float | None:
    gaps = [uav["channels"][channel]["min_interval_s"] for channel in CHANNELS]
    return min((gap for gap in gaps if gap is not None), default=None)


_Axis: TypeAlias = tuple[str, list[str]]
"""A column of the tables, a dimension of the plot: its name, and labels of its values."""

_FILE = "scenario"


def _axes(results: Sequence[Result]) -> list[_Axis]:
    """The keys that were swept; the files too if there are several."""
    names = [*results[0].run.values, _FILE]
    axes = [(name, list(dict.fromkeys(_position(r.run, name) for r in results))) for name in names]
    return [axis for axis in axes if axis[0] != _FILE or len(axis[1]) > 1]


def _position(run: Run, name: str) -> str:
    return run.name if name == _FILE else label(run.values.get(name, ""))


# plot

_COLOURS = [style.colour for style in (*STYLES[1:], STYLES[0])]  # the lightest one last
_SHAPES = "os^Dv<>Ph*"
_MOST_ROWS = 12
_WIDE = 8.0  # ratio of largest to smallest IAE from which on its axis is logarithmic
_NONE: _Axis = ("", [""])


@dataclass(frozen=True)
class _Styles:
    """How a run's place in the grid is shown: an axis as colours, one as markers, or `_NONE`."""

    colours: _Axis
    markers: _Axis

    def colour(self, value: str) -> Any:
        from matplotlib import colormaps  # noqa: PLC0415

        i, n = self.colours[1].index(value), len(self.colours[1])
        return _COLOURS[i] if n <= len(_COLOURS) else colormaps["viridis"](0.95 * i / (n - 1))

    def marker(self, value: str) -> dict[str, Any]:
        """A shape; a number where there are not enough shapes."""
        i, n = self.markers[1].index(value), len(self.markers[1])
        if n > len(_SHAPES):
            size = 6 if i < 9 else 10
            return {"marker": f"${i + 1}$", "markersize": size, "markeredgewidth": 0.0}
        return {"marker": _SHAPES[i], "markersize": 7, "markeredgewidth": 0.5}

    def of(self, run: Run) -> dict[str, Any]:
        """What matplotlib is told about a run's point."""
        colour, marker = (_position(run, name) for name, _ in (self.colours, self.markers))
        edge = {"markeredgecolor": "white", "alpha": 0.85}
        return {"color": self.colour(colour), **self.marker(marker), **edge}


def draw_sweep(results: Sequence[Result], uav_id: int | None, folder: Path) -> None:
    """Draw saving against IAE, a panel for each quantity, into sweep.png and sweep.svg.

    The axis with the most values gives the colours, if they are numbers or few; the next one
    the markers; each combination of the others has a row of panels. A line joins points whose
    colour means a number, and that differ in nothing else. Runs without a complete flight
    stand behind crosses at the right margin.
    """
    styles, rows = _arrange(results)
    legend_lines = 6 + len(styles.colours[1]) + len(styles.markers[1])
    one = len(rows) == 1  # row; its panels are two by two, and wider
    figure = new_figure(max(6.2 if one else 2.3 * len(rows) + 0.6, 0.2 * legend_lines))
    shape = (2, 2) if one else (len(rows), 4)
    panels = figure.subplots(*shape, sharex="none" if one else "col", sharey=True, squeeze=False)
    panels = panels.reshape(len(rows), 4)
    for row, (where, chosen) in zip(panels, rows, strict=True):
        for panel, quantity in zip(row, QUANTITIES, strict=True):
            _draw_points(panel, chosen, uav_id, quantity, styles)
        for panel in row[:: 2 if one else 4]:
            panel.set_ylabel(f"{where}\nsaving [%]" if where else "saving [%]")
        _draw_crosses(figure, row[-1], [r for r in chosen if _uav(r, uav_id) is None], styles)
    for panel, quantity in zip(panels[-1], QUANTITIES, strict=True):
        panel.set_xlabel(f"IAE of {quantity} [{_UNITS[quantity]}]")
    title = f"UAV {uav_id}: transmissions saved against integral of absolute error (IAE)"
    figure.suptitle(title, size=SMALL + 3.0)
    _draw_legends(figure, styles)
    save(figure, folder, "sweep")


def _arrange(results: Sequence[Result]) -> tuple[_Styles, list[tuple[str, list[Result]]]]:
    """Share the axes out between colours, markers and rows; a row is its name and its results."""
    left = sorted((axis for axis in _axes(results) if len(axis[1]) > 1), key=lambda a: -len(a[1]))
    fit = (axis for axis in left if _is_numeric(axis) or len(axis[1]) <= len(_COLOURS))
    colours = next(fit, _NONE)
    markers = next((axis for axis in left if axis is not colours), _NONE)
    names = [name for name, values in left if (name, values) not in (colours, markers)]
    rows: dict[str, list[Result]] = {}
    for result in results:
        where = ", ".join(f"{name} = {_position(result.run, name)}" for name in names)
        rows.setdefault(where, []).append(result)
    if len(rows) > _MOST_ROWS:
        rows = {f"any {', '.join(names)}": list(results)}
    return _Styles(colours, markers), list(rows.items())


def _is_numeric(axis: _Axis) -> bool:
    try:
        return all(math.isfinite(float(value)) for value in axis[1])
    except ValueError:
        return False


def _draw_points(
    panel: "Axes", results: Sequence[Result], uav_id: int | None, quantity: str, styles: _Styles
) -> None:
    lines: dict[str, list[tuple[float, float]]] = {}
    for result in results:
        if (uav := _uav(result, uav_id)) is not None:
            point = (uav["iae"][quantity], 100.0 * uav["saving"])
            lines.setdefault(_position(result.run, styles.markers[0]), []).append(point)
            panel.plot(*point, **styles.of(result.run), zorder=3)
    for line in lines.values():
        if _is_numeric(styles.colours) and len(line) <= len(styles.colours[1]):
            panel.plot(*zip(*line, strict=True), color="0.75", lw=1.0)
    values = [x for line in lines.values() for x, _ in line]
    if values and max(values) > _WIDE * min(values) > 0.0:
        from matplotlib.ticker import LogLocator, NullFormatter, ScalarFormatter  # noqa: PLC0415

        panel.set_xscale("log")
        subs = (1.0, 2.0, 5.0) if max(values) < 100.0 * min(values) else (1.0,)
        panel.xaxis.set_major_locator(LogLocator(subs=subs))
        panel.xaxis.set_major_formatter(ScalarFormatter())
        panel.xaxis.set_minor_formatter(NullFormatter())
    else:
        panel.locator_params(axis="x", nbins=6)
    panel.margins(0.08)
    tidy(panel)


def _draw_crosses(
    figure: "Figure", panel: "Axes", missing: Sequence[Result], styles: _Styles
) -> None:
    """Put a cross and its style beside the panel for each run without an IAE; count them."""
    from matplotlib.transforms import offset_copy  # noqa: PLC0415

    right = [offset_copy(panel.transAxes, figure, x, units="points") for x in (9, 19, 26)]
    for k, result in enumerate(missing):
        at = (1.0, (k + 0.5) / max(len(missing), 14))
        panel.plot(*at, "kx", transform=right[0], clip_on=False)
        panel.plot(*at, **styles.of(result.run), transform=right[1], clip_on=False)
    counts = Counter(result.outcome for result in missing)
    text = ", ".join(f"{count} {outcome}" for outcome, count in counts.items())
    panel.text(1.0, 0.0, text, rotation=90, va="bottom", size=SMALL, transform=right[2])


def _draw_legends(figure: "Figure", styles: _Styles) -> None:
    from matplotlib.lines import Line2D  # noqa: PLC0415

    colours, markers = styles.colours, styles.markers
    dots = [Line2D([], [], ls="", marker="o", color=styles.colour(v)) for v in colours[1]]
    signs = [Line2D([], [], ls="", color=GREY, **styles.marker(v)) for v in markers[1]]
    look: dict[str, Any] = {"frameon": False, "fontsize": SMALL, "title_fontsize": SMALL}
    if colours[0]:
        figure.legend(dots, colours[1], title=colours[0], loc="outside right upper", **look)
    if markers[0]:
        figure.legend(signs, markers[1], title=markers[0], loc="outside right lower", **look)
