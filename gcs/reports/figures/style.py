"""Shared by all figures: page, palette, lines, axes, fault windows, files.

A figure is 10 inches wide with text of 8 to 10 points; set across a page of A4 or letter, text
has 6 to 7 points. Coinciding lines are nested bands, the widest and lightest at the bottom,
so that they can be distinguished without colour. Every panel can be read by itself: it has
numbers and units of its own.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from string import ascii_lowercase
from tempfile import TemporaryDirectory
from threading import Lock
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

from gcs.reports.figures.flown import PlottedFlight, fault_windows
from mavlink_defs.config.output_files import complete_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH_IN = 10.0
"""Width of a figure [in]."""

SMALL = 8.0
"""Size of secondary text [pt]."""

GREY = "0.35"
"""Colour of notes."""

SINGLE = "#0072B2"
"""Colour of what has a panel to itself."""

Layout: TypeAlias = Literal["constrained"]
Dashes: TypeAlias = str | tuple[float, tuple[float, ...]]


@dataclass(frozen=True)
class Style:
    """Line style of one UAV or one controller: colour, dashes, line width [pt]."""

    colour: str
    dashes: Dashes
    width: float

    @property
    def line(self) -> dict[str, Any]:
        """The style of a curve, as matplotlib's arguments."""
        return {"color": self.colour, "ls": self.dashes, "lw": self.width}

    @property
    def thin(self) -> dict[str, Any]:
        """The style of a curve that is busy, or whose panel is small."""
        return self.line | {"lw": max(0.6 * self.width, 0.7)}


STYLES = (
    Style("#56B4E9", "-", 3.6),
    Style("#D55E00", "-", 1.9),
    Style("#00573F", "-", 0.8),
    Style("#CC79A7", "-.", 1.4),
    Style("#E69F00", (0.0, (7.0, 2.0)), 1.2),
    Style("#332288", ":", 1.8),
)
"""Hues of Okabe and Ito, and of Tol, safe for colour-blind readers; lines that differ in grey."""
_AGAIN: tuple[Dashes, ...] = ((0.0, (2.5, 1.5)), (0.0, (6.0, 1.5, 1.0, 1.5, 1.0, 1.5)))
"""Dashes of those that share a colour with an earlier one."""

REFERENCE: dict[str, Any] = {"color": "black", "ls": (0.0, (4.0, 3.0)), "lw": 0.9, "zorder": 3.0}
"""The line of the reference."""

_BRIEF_S = 0.2  # in all, of extremes of a signal that its axis may leave out
_BRIEF_SHARE = 0.1  # of a signal that are left out at most, however short it is
_ROOM = 0.25  # of a signal's range above and below, that its extremes may take
_WIDE = 8.0  # ratio of largest to smallest value from which on an axis is logarithmic
_BUCKETS = 600  # of a curve; a panel has fewer pixels
_SHADE = "0.88"
_HANDLE_IN = 0.6  # of an entry of a legend, with the space around it
_LETTER_IN = 0.066  # of its text, on the average
_DIGIT_IN = 0.64 * SMALL / 72.0  # of a number
_LABEL_IN = 0.4  # of an axis, with the space around it
_BELOW_IN = 0.45  # a panel, for numbers and label of its x axis
_ABOVE_IN, _NOTE_IN = 0.07, 0.17  # a panel, without and with a note
_EDGE_IN = 0.12  # of the page, right of the panels
_LEGEND_IN, _LEGEND_LINE_IN = 0.08, 0.19  # of a legend, and of each of its lines
_PNG_DPI = 150.0
_SHOWN_DPI = 100.0
_SVG_DPI = 200.0  # of its images: dots
_saving = Lock()


def style(i: int) -> Style:
    """Return the style of the i-th UAV or controller: no two of the first 18 have the same."""
    again, own = i // len(STYLES), STYLES[i % len(STYLES)]
    return Style(own.colour, _AGAIN[(again - 1) % len(_AGAIN)], 1.2) if again else own


def new_figure(height_in: float, layout: Layout | None = "constrained") -> "Figure":
    """Return an empty figure of the width of the page, with or without automatic layout.

    Notebooks show it, whatever backend they use.
    """
    from matplotlib.figure import Figure

    class ShownFigure(Figure):
        def _repr_png_(self) -> bytes:
            content = BytesIO()
            self.savefig(content, format="png", dpi=_SHOWN_DPI)
            return content.getvalue()

    return ShownFigure(figsize=(WIDTH_IN, height_in), layout=layout)


def decimated(t: np.ndarray, y: np.ndarray, buckets: int = _BUCKETS) -> tuple[np.ndarray, ...]:
    """Thin out a curve that is denser than the eye can resolve, but keep its extremes.

    Keeps the first and last sample and the minimum and maximum of every bucket of neighbouring
    samples; a curve with no more samples than that stays as it is. A bucket that is all NaN
    leaves a gap.
    """
    if len(y) <= 2 * buckets:
        return t, y
    size = -(-len(y) // buckets)
    starts = np.arange(0, len(y), size)
    rows = np.pad(y, (0, len(starts) * size - len(y)), mode="edge").reshape(-1, size)
    none = np.isnan(rows)
    least = np.where(none, np.inf, rows).argmin(axis=1)
    greatest = np.where(none, -np.inf, rows).argmax(axis=1)
    extremes = [starts + least, starts + greatest]
    kept = np.unique(np.concatenate([[0, len(y) - 1], *extremes]))
    return t[kept], y[kept]


def draw_curve(axis: "Axes", t: np.ndarray, y: np.ndarray, **properties: Any) -> None:
    """Draw a curve, decimated; where a wrapped angle [deg] jumps, the line breaks."""
    t, y = decimated(t, y)
    jumps = np.flatnonzero(np.abs(np.diff(y)) > 180.0) + 1
    axis.plot(np.insert(t, jumps, np.nan), np.insert(y, jumps, np.nan), **properties)


def usual_range(curves: Sequence[np.ndarray], step_s: float) -> tuple[float, float]:
    """Return the range of curves but for brief transients; NaN if they have no values.

    The range spans the curves without the greatest and the least values that each of them
    has for 0.2 s in all, and a quarter more for these, above and below, as far as they go.

    Args:
        curves: Signals at evenly spaced times, with gaps of NaN.
        step_s: Time between two of their values [s].
    """
    ordered = [np.sort(curve[np.isfinite(curve)]) for curve in curves]
    ordered = [values for values in ordered if len(values)]
    if not ordered:
        return math.nan, math.nan
    brief = [min(round(_BRIEF_S / step_s), int(_BRIEF_SHARE * len(own))) for own in ordered]
    low = min(own[k] for own, k in zip(ordered, brief, strict=True))
    high = max(own[-1 - k] for own, k in zip(ordered, brief, strict=True))
    room = _ROOM * (high - low)
    least, most = min(own[0] for own in ordered), max(own[-1] for own in ordered)
    return float(max(low - room, least)), float(min(high + room, most))


def frame(axis: "Axes", curves: Sequence[np.ndarray], low: float, high: float) -> None:
    """Limit an axis to the part of [low, high] that curves use; note how far they go beyond."""
    values = np.concatenate(curves)
    values = values[np.isfinite(values)]
    if len(values) == 0:
        return
    least, most = float(values.min()), float(values.max())
    low, high = max(low, least), min(high, most)
    if not low < high:
        low, high = least, most
    margin = 0.06 * (high - low) or 1.0
    bottom, top = low - margin, high + margin
    axis.set_ylim(bottom, top)
    beyond = []
    if least < bottom:
        beyond.append(f"min {_number(least, bottom - least, top - bottom)}")
    if most > top:
        beyond.append(f"max {_number(most, most - top, top - bottom)}")
    note(axis, ", ".join(beyond))


def note(axis: "Axes", text: str) -> None:
    """Write a note above the right corner of a panel."""
    axis.set_title(text, loc="right", size=SMALL, color=GREY, pad=3.0)


def _number(value: float, beyond: float, span: float) -> str:
    """Return a value with as many digits as it takes to see how far it leaves an axis."""
    text = f"{value:.0f}" if abs(value) >= 100.0 else f"{value + 0.0:.2g}"  # no −0
    exact = max(0.25 * beyond, 0.0025 * span)
    if abs(float(text) - value) > exact:
        text = f"{value:.{max(0, math.ceil(-math.log10(exact)))}f}"
    return text.replace("-", "−")


def shade_faults(axis: "Axes", flights: Sequence[PlottedFlight], uav_id: int | None = None) -> None:
    """Shade and label the fault windows of one UAV or of all."""
    for window in fault_windows(flights, uav_id):
        axis.axvspan(window.start_s, window.end_s, color=_SHADE, lw=0, zorder=-1, label=window.text)


def mark_loss(axis: "Axes", flight: PlottedFlight) -> None:
    """Mark the end of a flight that was lost."""
    if flight.recording.loss is not None:
        t = flight.recording.duration_s
        axis.axvline(t, color=GREY, ls=":", lw=1.2, label=f"flight {flight.lost}")


def tidy(axis: "Axes", duration_s: float | None = None) -> None:
    """Remove the box, draw a faint grid, and number the axes; name and limit a time axis."""
    axis.spines[["top", "right"]].set_visible(False)
    axis.grid(color="0.9", lw=0.6)
    axis.set_axisbelow(True)
    axis.tick_params(labelsize=SMALL, labelbottom=True, labelleft=True)  # also if they are shared
    if duration_s is not None:
        axis.set_xlabel("time [s]")
        axis.set_xlim(0.0, duration_s)


def logarithmic_intervals(axis: "Axes") -> None:
    """Make the y axis, of intervals [ms], logarithmic."""
    axis.set_yscale("log")
    axis.yaxis.set_major_formatter("{x:g}")
    axis.minorticks_off()


def logarithmic_if_wide(axis: "Axes", values: Sequence[float] | np.ndarray) -> bool:
    """Make the x axis logarithmic if its values are positive and far apart; return whether."""
    if not len(values) or not max(values) > _WIDE * min(values) > 0.0:
        return False
    from matplotlib.ticker import LogLocator, NullFormatter, ScalarFormatter

    axis.set_xscale("log")
    subs = (1.0, 2.0, 5.0) if max(values) < 100.0 * min(values) else (1.0,)
    axis.xaxis.set_major_locator(LogLocator(subs=subs))
    axis.xaxis.set_major_formatter(ScalarFormatter())
    axis.xaxis.set_minor_formatter(NullFormatter())
    return True


def letter(axis: "Axes", k: int) -> None:
    """Write the k-th panel's letter above its corner."""
    text = ascii_lowercase[k % 26] * (k // 26 + 1)
    axis.set_title(f"({text})", loc="left", size=SMALL + 1.0, pad=3.0)


def draw_legend(figure: "Figure") -> int:
    """Put one legend above a figure, with each label of its panels once; return its lines."""
    named: dict[str, Any] = {}
    for axis in figure.axes:
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True):
            named.setdefault(label, handle)
    columns = _columns(list(named))
    if named:
        figure.legend(
            list(named.values()),
            list(named),
            frameon=False,
            loc="outside upper center" if figure.get_layout_engine() else "upper center",
            ncols=columns,
            fontsize=SMALL + 1.0,
            handlelength=2.6,
        )
    return -(-len(named) // columns)


def fit_margins(figure: "Figure", legend_lines: int) -> None:
    """Place the panels of a grid so that numbers and labels have room, below a legend.

    The room is known by the length of the numbers. Matplotlib's own layouts measure each text of a
    page, twice: that takes as long as to draw it.
    """
    from matplotlib.transforms import Bbox

    grid = figure.axes[0].get_gridspec()
    assert grid is not None
    page = np.array([WIDTH_IN, figure.get_figheight()])
    above = np.full(grid.nrows, _ABOVE_IN)
    for axis in figure.axes:
        if axis.get_title("right"):
            above[_place(axis)[0].start] = _NOTE_IN
    top = page[1] - _LEGEND_IN - _LEGEND_LINE_IN * legend_lines
    ratios = np.array(grid.get_height_ratios())
    tall = (top - above.sum() - grid.nrows * _BELOW_IN) * ratios / ratios.sum()
    floor = top - np.cumsum(above + tall + _BELOW_IN) + _BELOW_IN
    for _ in range(2):  # how many numbers a panel has depends on its size
        beside = np.zeros(grid.ncols)
        for axis in figure.axes:
            first = _place(axis)[1].start
            beside[first] = max(beside[first], _numbers_in(axis) + _LABEL_IN)
        wide = (WIDTH_IN - _EDGE_IN - beside.sum()) / grid.ncols
        begin = np.cumsum(beside) + wide * np.arange(grid.ncols)
        for axis in figure.axes:
            rows, column = _place(axis)
            low = begin[column.start], floor[rows.stop - 1]
            high = begin[column.stop - 1] + wide, floor[rows.start] + tall[rows.start]
            axis.set_position(Bbox(np.array([low, high]) / page))


def _place(axis: "Axes") -> tuple[range, range]:
    """Return which rows and columns of the grid a panel spans."""
    spec = axis.get_subplotspec()
    assert spec is not None
    return spec.rowspan, spec.colspan


def _numbers_in(axis: "Axes") -> float:
    """Return the width of the longest number of a panel's y axis [in]."""
    ticks, (low, high) = axis.yaxis.get_majorticklocs(), sorted(axis.get_ylim())
    shown = ticks[(ticks >= low) & (ticks <= high)]
    texts = axis.yaxis.get_major_formatter().format_ticks(list(shown))
    return max((_DIGIT_IN * (len(text) - 0.5 * text.count(".")) for text in texts), default=0.0)


def _columns(labels: list[str]) -> int:
    """Return how many columns of a legend fit on the page."""
    widths = [_HANDLE_IN + _LETTER_IN * len(label) for label in labels]
    fits = [
        n
        for n in range(1, len(labels) + 1)
        if sum(column.max() for column in np.array_split(widths, n)) < WIDTH_IN
    ]
    return max(fits, default=1)


def load_matplotlib() -> None:
    """Load what drawing takes, fonts included, by a page that nobody sees."""
    figure = new_figure(1.0)
    figure.subplots()
    with TemporaryDirectory() as folder:
        save(figure, Path(folder), "page")


def save(figure: "Figure", folder: Path, stem: str) -> None:
    """Write a figure as PNG and SVG, the same bytes for the same figure, and clear it."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    folder.mkdir(parents=True, exist_ok=True)
    if (layout := figure.get_layout_engine()) is not None:
        layout.execute(figure)
        figure.set_layout_engine("none")  # not once more for each file
    # the salt of an SVG's ids is a global setting only
    with _saving, mpl.rc_context({"svg.hashsalt": stem, "svg.fonttype": "path"}):
        # savefig would draw twice for each file
        figure.set_dpi(_PNG_DPI)
        with complete_file(folder / f"{stem}.png") as file:
            FigureCanvasAgg(figure).print_png(file)  # type: ignore[no-untyped-call]  # matplotlib's own
        figure.set_dpi(_SVG_DPI)
        with complete_file(folder / f"{stem}.svg") as file:
            FigureCanvasSVG(figure).print_svg(file, metadata={"Date": None})  # type: ignore[no-untyped-call]  # as above
    figure.clear()
