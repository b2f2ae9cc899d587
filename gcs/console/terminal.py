"""Output of the commands: consoles that show text of others safely, and tables that cut nothing.

Results go to standard output, everything else to standard error.
"""

import os
import re
from collections.abc import Iterable
from io import StringIO
from typing import Any

from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
from rich.measure import Measurement
from rich.segment import Segment
from rich.table import Column, Table
from rich.text import Text

from mavlink_defs.visible import visible_lines

_PIPE_WIDTH = 10_000
_NARROWEST_TEXT = 12
"""Width down to which a column of texts is folded."""
MAX_WORD = 24
"""Length up to which a word, or a number in a text, is not broken."""


class Terminal(Console):
    """A console that prints text as it is: no markup, no control characters, nothing cut."""

    def __init__(
        self, *, stderr: bool = False, quiet: bool = False, pipe_has_edge: bool = False
    ) -> None:
        super().__init__(stderr=stderr, quiet=quiet, markup=False, emoji=False, highlight=False)
        if not (pipe_has_edge or self.is_terminal or os.environ.get("COLUMNS")):
            self.width = _PIPE_WIDTH  # rich assumes 80 columns, but a pipe has no edge

    def render_str(self, text: str, **options: Any) -> Text:
        """Return text to lay out, with control characters made visible."""
        return super().render_str(visible_lines(text), **options)

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Yield the segments of anything, with control characters of its texts made visible."""
        for segment in super().render(renderable, options):
            if segment.control or segment.text.isprintable():
                yield segment
            else:
                yield Segment(visible_lines(segment.text), segment.style)

    def print(self, *objects: Any, crop: bool = False, **options: Any) -> None:
        """Print; what is wider than the terminal is not cut."""
        super().print(*objects, crop=crop, **options)

    def on_broken_pipe(self) -> None:
        """Leave it to the command line: the reader of our output has ended."""
        raise  # noqa: PLE0704 - rich calls this while it handles the error


def console_of(
    stderr: bool = True, quiet: bool = False, *, pipe_has_edge: bool = False
) -> Terminal:
    """Return the console for progress and remarks, or for results.

    Args:
        stderr: For progress and remarks.
        quiet: Print nothing.
        pipe_has_edge: Into a pipe, too, fold at the width of the terminal, or at 80 columns.
    """
    return Terminal(stderr=stderr, quiet=quiet, pipe_has_edge=pipe_has_edge)


def as_text(shown: RenderableType, width: int) -> str:
    """Return what a terminal of a width [characters] shows, without colours."""
    console = _recording(width)
    console.print(shown)
    return console.export_text().rstrip("\n")


def as_html(shown: RenderableType, width: int) -> str:
    """Return the same, with colours, as an element of HTML."""
    console = _recording(width)
    console.print(shown)
    style = "font-family: monospace; line-height: 1.2; white-space: pre"
    code = f'<pre style="{style}">{{code}}</pre>'
    return console.export_html(inline_styles=True, code_format=code)


def _recording(width: int) -> Terminal:
    console = Terminal()
    console.record, console.file, console.width = True, StringIO(), width
    console.is_jupyter = False  # a notebook would show it at once
    return console


def texts(heading: str) -> Column:
    """Return a column of texts: it is folded at spaces where the terminal is narrow."""
    return Column(heading, overflow="fold")


def numbers(heading: str) -> Column:
    """Return a column of numbers, right-aligned: as wide as the widest, whatever the terminal.

    Where the terminal is narrow, the heading is folded.
    """
    return Column(Text(heading, no_wrap=False), justify="right", no_wrap=True)


def table_of(*columns: Column, **options: Any) -> Table:
    """Return a table of columns that `texts` and `numbers` make; options as of rich's table."""
    return _Uncut(*columns, **options)


def marked(text: str, is_marked: bool) -> Text:
    """Return a text as it is, or in bold and with an asterisk, which a pipe shows as well."""
    return Text(f"{text}*", "bold") if is_marked and text else Text(text)


def names_and_texts(rows: Iterable[tuple[str, RenderableType]], width: int) -> Table:
    """Return names in a column of a width [characters], each with its text beside it, folded."""
    table = Table(show_header=False, box=None, expand=True, pad_edge=False)
    table.add_column(style="bold cyan", width=width, overflow="fold")
    table.add_column(ratio=1)
    for name, text in rows:
        table.add_row(Text(name), text)
    return table


def bulleted(items: Iterable[Text]) -> Table:
    """Return a list of texts, each folded beside its bullet."""
    table = Table.grid(Column(), Column(overflow="fold"))
    for item in items:
        table.add_row(Text(" • ", style="bold"), item)
    return table


class _Uncut(Table):
    """A table that is wider than the terminal where it would have to cut a number."""

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield its segments, with columns as wide as they need be."""
        for column in self.columns:
            column.min_width = column.max_width = None
        natural = Measurement.get(console, options.update_width(_PIPE_WIDTH), self).maximum
        room = {}  # of each column of texts: how far it can be folded
        surplus = natural - options.max_width
        for index, column in enumerate(self.columns):
            cells, heading = list(map(str, column.cells)), str(column.header)
            lines = [line for cell in cells for line in cell.split("\n")]
            widest = _longest((*lines, *heading.split("\n")))
            if column.no_wrap:
                unbroken = re.findall(r"\[[^]]*\]|\S+", heading)  # a unit stays whole
                column.min_width = max(_longest(lines), _longest(unbroken))
                if natural > options.max_width:
                    column.max_width = column.min_width
                surplus -= widest - column.min_width
            else:
                word = _longest(word for text in (heading, *cells) for word in text.split())
                column.min_width = min(widest, max(_NARROWEST_TEXT, min(word, MAX_WORD)))
                room[index] = range(column.min_width, widest)
        while surplus > 0 and any(room.values()):  # rich's own way forgets what the least is
            widest = max(room, key=lambda one: (bool(room[one]), room[one].stop))
            room[widest] = room[widest][:-1]
            self.columns[widest].max_width = room[widest].stop
            surplus -= 1
        yield from super().__rich_console__(
            console, options.update_width(options.max_width + max(surplus, 0))
        )


def _longest(texts: Iterable[str]) -> int:
    return max(map(cell_len, texts), default=0)
