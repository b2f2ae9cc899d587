"""The plot of a sweep: transmissions saved against the integral of absolute error."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ftc_lab.campaigns.points import Dimension, Point, dimensions_of, position, uav_of
from gcs.reports.figures.flown import literal
from gcs.reports.figures.style import (
    GREY,
    SMALL,
    STYLES,
    logarithmic_if_wide,
    new_figure,
    save,
    tidy,
)
from gcs.results.quantities import IAE_UNITS, QUANTITIES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLOURS = [style.colour for style in (*STYLES[1:], STYLES[0])]  # the lightest one last
_SHAPES = "os^Dv<>Ph*"
_MAX_ROWS = 12
_NONE: Dimension = ("", [""])


@dataclass(frozen=True)
class _Styles:
    """Colour and marker of a point: which axes of the grid they show, or `_NONE`."""

    colours: Dimension
    markers: Dimension

    def colour(self, value: str) -> Any:
        from matplotlib import colormaps

        i, n = self.colours[1].index(value), len(self.colours[1])
        return _COLOURS[i] if n <= len(_COLOURS) else colormaps["viridis"](0.95 * i / (n - 1))

    def marker(self, value: str) -> dict[str, Any]:
        """Return a shape; a number where there are not enough shapes."""
        i, n = self.markers[1].index(value), len(self.markers[1])
        if n > len(_SHAPES):
            size = 6 if i < 9 else 10
            return {"marker": f"${i + 1}$", "markersize": size, "markeredgewidth": 0.0}
        return {"marker": _SHAPES[i], "markersize": 7, "markeredgewidth": 0.5}

    def of(self, point: Point) -> dict[str, Any]:
        """Return matplotlib's arguments for a point."""
        colour, marker = (position(point, name) for name, _ in (self.colours, self.markers))
        edge = {"markeredgecolor": "white", "alpha": 0.85}
        return {"color": self.colour(colour), **self.marker(marker), **edge}


def draw_sweep(points: Sequence[Point], uav_id: int | None, folder: Path) -> None:
    """Draw saving against IAE, a panel for each quantity, into sweep.png and sweep.svg.

    The axis with the most values sets the colours if its values are numbers or few, the next
    axis the markers; each combination of the others has a row of panels. If the colours mean
    numbers, a line joins points that differ in colour only. Points without a complete flight are
    listed beside crosses at the right margin.
    """
    styles, rows = _arrange(points)
    legend_lines = 6 + len(styles.colours[1]) + len(styles.markers[1])
    one = len(rows) == 1  # row; its panels are two by two, and wider
    figure = new_figure(max(6.2 if one else 2.6 * len(rows) + 0.6, 0.2 * legend_lines))
    shape = (2, 2) if one else (len(rows), 4)
    panels = figure.subplots(*shape, sharex="none" if one else "col", sharey=True, squeeze=False)
    panels = panels.reshape(len(rows), 4)
    for row, (where, chosen) in zip(panels, rows, strict=True):
        for panel, quantity in zip(row, QUANTITIES, strict=True):
            _draw_points(panel, chosen, uav_id, quantity, styles)
            panel.set_xlabel(f"IAE of {quantity} [{IAE_UNITS[quantity]}]")
            panel.set_ylabel("saving [%]")
        if where:
            row[0].set_ylabel(literal(f"{where}\nsaving [%]"))
        _draw_crosses(figure, row[-1], [p for p in chosen if uav_of(p, uav_id) is None], styles)
    title = f"UAV {uav_id}: transmissions saved against integral of absolute error (IAE)"
    figure.suptitle(title, size=SMALL + 3.0)
    _draw_legends(figure, styles)
    save(figure, folder, "sweep")


def _arrange(points: Sequence[Point]) -> tuple[_Styles, list[tuple[str, list[Point]]]]:
    """Divide the axes among colours, markers and rows; return each row's name and points."""
    left = sorted(
        (axis for axis in dimensions_of(points) if len(axis[1]) > 1), key=lambda a: -len(a[1])
    )
    fit = (axis for axis in left if _is_numeric(axis) or len(axis[1]) <= len(_COLOURS))
    colours = next(fit, _NONE)
    markers = next((axis for axis in left if axis is not colours), _NONE)
    names = [name for name, values in left if (name, values) not in (colours, markers)]
    rows: dict[str, list[Point]] = {}
    for point in points:
        where = ", ".join(f"{name} = {position(point, name)}" for name in names)
        rows.setdefault(where, []).append(point)
    if len(rows) > _MAX_ROWS:
        rows = {f"any {', '.join(names)}": list(points)}
    return _Styles(colours, markers), list(rows.items())


def _is_numeric(axis: Dimension) -> bool:
    try:
        return all(math.isfinite(float(value)) for value in axis[1])
    except ValueError:
        return False


def _draw_points(
    panel: "Axes", points: Sequence[Point], uav_id: int | None, quantity: str, styles: _Styles
) -> None:
    lines: dict[str, list[tuple[float, float]]] = {}
    for point in points:
        uav = uav_of(point, uav_id)
        if uav is not None and None not in (uav["saving"], uav[f"iae_{quantity}"]):
            at = (uav[f"iae_{quantity}"], 100.0 * uav["saving"])
            lines.setdefault(position(point, styles.markers[0]), []).append(at)
            panel.plot(*at, **styles.of(point), zorder=3)
    for line in lines.values():
        if _is_numeric(styles.colours) and len(line) <= len(styles.colours[1]):
            panel.plot(*zip(*line, strict=True), color="0.8", lw=0.7)
    values = [x for line in lines.values() for x, _ in line]
    if not logarithmic_if_wide(panel, values):
        panel.locator_params(axis="x", nbins=6)
    panel.margins(0.08)
    tidy(panel)


def _draw_crosses(
    figure: "Figure", panel: "Axes", missing: Sequence[Point], styles: _Styles
) -> None:
    """Draw a cross beside the panel for each point without an IAE; return how many there are."""
    from matplotlib.transforms import offset_copy

    right = [offset_copy(panel.transAxes, figure, x, units="points") for x in (9, 19, 26)]
    for k, point in enumerate(missing):
        at = (1.0, (k + 0.5) / max(len(missing), 14))
        panel.plot(*at, "kx", transform=right[0], clip_on=False)
        panel.plot(*at, **styles.of(point), transform=right[1], clip_on=False)
    counts = Counter(point.outcome for point in missing)
    text = ", ".join(f"{count} {outcome}" for outcome, count in counts.items())
    panel.text(1.0, 0.0, text, rotation=90, va="bottom", size=SMALL, transform=right[2])


def _draw_legends(figure: "Figure", styles: _Styles) -> None:
    from matplotlib.lines import Line2D

    colours, markers = styles.colours, styles.markers
    dots = [Line2D([], [], ls="", marker="o", color=styles.colour(v)) for v in colours[1]]
    signs = [Line2D([], [], ls="", color=GREY, **styles.marker(v)) for v in markers[1]]
    look: dict[str, Any] = {"frameon": False, "fontsize": SMALL, "title_fontsize": SMALL}
    if colours[0]:
        texts = [literal(text) for text in colours[1]]
        figure.legend(dots, texts, title=colours[0], loc="outside right upper", **look)
    if markers[0]:
        texts = [literal(text) for text in markers[1]]
        figure.legend(signs, texts, title=markers[0], loc="outside right lower", **look)
