"""Tables of several laws on the same flights: a column for each, what a simpler one beats in bold.

Documentation and reports are drawn by the same functions.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from rich import box
from rich.table import Table
from rich.text import Text

from ftc_lab.reports.markdown import bold, table
from gcs.console.terminal import marked, numbers, table_of, texts
from gcs.results.rivals import LEGEND, beaten_by

LOST = "lost"


class Value(NamedTuple):
    """A figure in a cell: its text, and its cost as of `gcs.results.rivals`."""

    text: str
    cost: float = math.nan

    @classmethod
    def of(cls, cost: float, digits: int = 1) -> "Value":
        """Return a figure of which less is better; one of a flight that was lost is infinite."""
        text = LOST if math.isinf(cost) else "" if math.isnan(cost) else f"{cost:.{digits}f}"
        return cls(text, cost)


class LawRow(NamedTuple):
    """A row: flights that all laws flew.

    Attributes:
        labels: What was flown.
        cells: Of each column, by its name, one figure or several; a column may be missing.
    """

    labels: Sequence[str]
    cells: Mapping[str, Sequence[Value]]


def law_markdown(head: Sequence[str], rows: Sequence[LawRow], columns: Mapping[str, str]) -> str:
    """Return a Markdown table, with its legend where something is bold.

    Args:
        head: Headings of the labels.
        rows: The rows.
        columns: The law of each column, by the column's name, in the order of the table.
    """
    cells = [
        [*row.labels, *(", ".join(bold(*one) for one in cell) for cell in _marked(row, columns))]
        for row in rows
    ]
    marked = any("**" in cell for line in cells for cell in line[len(head) :])
    legend = f"\n**Bold**: {LEGEND}.\n" if marked else ""
    return table([*head, *columns], cells, columns) + legend


def law_terminal(head: Sequence[str], rows: Sequence[LawRow], columns: Mapping[str, str]) -> Table:
    """Return the same for the terminal."""
    shown = table_of(*map(texts, head), *map(numbers, columns), box=box.SIMPLE_HEAD)
    has_marks = False
    for row in rows:
        cells = [
            Text(", ").join(marked(text, beaten) for text, beaten in cell)
            for cell in _marked(row, columns)
        ]
        has_marks = has_marks or any("*" in cell.plain for cell in cells)
        shown.add_row(*row.labels, *cells)
    shown.caption = f"*: {LEGEND}" if has_marks else None
    return shown


def _marked(row: LawRow, columns: Mapping[str, str]) -> Iterator[list[tuple[str, bool]]]:
    """Yield the texts of each cell, and whether a simpler law is better."""
    for name, law in columns.items():
        values = row.cells.get(name, ())
        yield [
            (value.text, beaten_by(law, value.cost, _rivals(row, columns, place)) is not None)
            for place, value in enumerate(values)
        ]


def _rivals(row: LawRow, columns: Mapping[str, str], place: int) -> Iterator[tuple[str, float]]:
    for name, law in columns.items():
        values = row.cells.get(name, ())
        if place < len(values):
            yield law, values[place].cost
