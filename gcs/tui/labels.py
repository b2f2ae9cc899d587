"""Labels of a map in characters: none covers or touches another, so that numbers stay apart."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from gcs.tui.curves import Colour, Palette, ticks

Cell: TypeAlias = tuple[int, int]
"""Column from the left and line from below."""
Place: TypeAlias = tuple[float, float]
"""North and east [m]."""

_AXES = 2  # characters: at both edges
_TICK_LINES = 1


@dataclass(frozen=True)
class MapMark:
    """A vehicle to be drawn: its id, the arrow of its heading, its place, whether selected."""

    system: int
    arrow: str
    place: Place
    chosen: bool


@dataclass
class Sheet:
    """The characters of a plot, and which of them labels have.

    Attributes:
        plt: The plot.
        size: Columns and lines within the axes.
        low: South western corner of what is shown, north and east [m].
        span: From there to the north eastern corner [m].
        taken: Cells of labels.
    """

    plt: Any
    size: Cell
    low: Place
    span: Place
    taken: set[Cell] = field(default_factory=set)

    def cell_of(self, place: Place) -> Cell | None:
        """Return where a place is; None if it is not shown."""
        line, column = (
            (p - low) / span for p, low, span in zip(place, self.low, self.span, strict=True)
        )
        if not (0.0 <= line <= 1.0 and 0.0 <= column <= 1.0):
            return None
        return int(0.5 + column * (self.size[0] - 1)), int(0.5 + line * (self.size[1] - 1))

    def is_free(self, text: str, cell: Cell, apart: int = 1) -> bool:
        """Return whether a text fits, with so many blanks between it and the labels beside it."""
        column, line = cell
        if not (0 <= column <= self.size[0] - len(text) and 0 <= line < self.size[1]):
            return False
        return not any(
            (k, line) in self.taken for k in range(column - apart, column + len(text) + apart)
        )

    def write(self, text: str, cells: Iterable[Cell], colour: Colour, apart: int = 1) -> None:
        """Write a text at the first of the cells where it fits; nowhere if there is none."""
        spot = next((cell for cell in cells if self.is_free(text, cell, apart)), None)
        if spot is None:
            return
        column, line = spot
        self.taken |= {(column + k, line) for k in range(len(text))}
        share = column / max(self.size[0] - 1, 1), line / max(self.size[1] - 1, 1)
        east, north = self.low[1] + share[0] * self.span[1], self.low[0] + share[1] * self.span[0]
        self.plt.text(text, east, north, colour, "default", alignment="left")

    def write_number(self, number: int, place: Place, colour: Colour) -> None:
        """Write a number at a place, else above or below; leave it out where all is taken."""
        if (cell := self.cell_of(place)) is not None:
            text, (column, line) = str(number), cell
            columns = (column, column - len(text) + 1)
            cells = [(at, line + up) for up in (0, 1, -1) for at in columns]
            self.write(text, cells, colour)

    def write_sign(self, sign: str, place: Place, colour: Colour) -> None:
        """Write a sign that no number can be confused with at a place, if that is free."""
        if (cell := self.cell_of(place)) is not None:
            self.write(sign, [cell], colour, apart=0)


def sheet_of(plt: Any, size: tuple[int, int], middle: Place, reach: Place) -> Sheet:
    """Set limits and ticks of a plot, and return its sheet.

    Args:
        plt: The plot.
        size: Its width and height in characters.
        middle: Of what is shown, north and east [m].
        reach: From there to the edges, to north and east [m].
    """
    (north, east), (up, across) = middle, reach
    plt.xlim(east - across, east + across)
    plt.ylim(north - up, north + up)
    plt.xticks(ticks(east - across, east + across))
    heights = ticks(north - up, north + up)
    names = [f"{height:g}" for height in heights]
    plt.yticks(heights, names)
    plt.grid(False, False)
    columns = size[0] - _AXES - max(map(len, names), default=0)
    inside = max(columns, 1), max(size[1] - _AXES - _TICK_LINES, 1)
    return Sheet(plt, inside, (north - up, east - across), (2.0 * up, 2.0 * across))


def draw_marks(sheet: Sheet, marks: Iterable[MapMark], palette: Palette) -> None:
    """Draw vehicles: those too close to be distinguished are one label with their number."""
    shown = [(mark, cell) for mark in marks if (cell := sheet.cell_of(mark.place)) is not None]
    shown.sort(key=lambda pair: (not pair[0].chosen, pair[0].system))
    together: dict[Cell, list[MapMark]] = {}
    for mark, cell in shown:
        together.setdefault(cell, []).append(mark)
    groups = list(together.items())
    while (crowded := _crowded(sheet, groups)) is not None:
        i, k = crowded
        _, others = groups.pop(i)
        groups[k][1].extend(others)
    for cell, group in groups:
        colour = palette.actual if group[0].chosen else palette.text
        for text, spot in _ways(group, cell, sheet.size[0]):
            if sheet.is_free(text, spot):
                sheet.write(text, [spot], colour)
                break


def _crowded(sheet: Sheet, groups: Sequence[tuple[Cell, list[MapMark]]]) -> tuple[int, int] | None:
    """Return a group without room and the nearest one before it that it can join."""
    trial = Sheet(None, sheet.size, sheet.low, sheet.span, set(sheet.taken))
    for i, (cell, group) in enumerate(groups):
        ways = _ways(group, cell, sheet.size[0])
        way = next((way for way in ways if trial.is_free(*way)), None)
        if way is not None:
            text, (column, line) = way
            trial.taken |= {(column + k, line) for k in range(len(text))}
            continue
        near = [k for k in range(i) if groups[k][0][1] == cell[1]]
        if near:
            return i, min(near, key=lambda k: abs(groups[k][0][0] - cell[0]))
    return None


def _ways(group: Sequence[MapMark], cell: Cell, columns: int) -> Iterator[tuple[str, Cell]]:
    """Yield labels of vehicles and where they would begin: the arrow stays in its cell."""
    first, (column, line) = group[0], cell
    if len(group) == 1:
        yield f"{first.arrow}{first.system}", cell
        yield f"{first.system}{first.arrow}", (column - len(str(first.system)), line)
        return
    text = f"{first.arrow}{first.system} +{len(group) - 1}" if first.chosen else f"{len(group)}×"
    yield text, (min(column, columns - len(text)), line)
