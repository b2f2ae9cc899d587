"""A table of which only what has changed is drawn again.

Textual's DataTable updates cell by cell; with 30 vehicles and 20 columns several times a second
that costs more than everything else together. A `Grid` is given all rows at once, compares them
with those it shows, and draws the lines that differ.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from rich.cells import cell_len, set_cell_size
from rich.segment import Segment
from rich.style import Style
from textual import events
from textual.binding import Binding, BindingType
from textual.geometry import Region, Size
from textual.message import Message
from textual.reactive import reactive
from textual.scroll_view import ScrollView
from textual.strip import Strip

from gcs.tui.formatting import Cell
from gcs.tui.guard import Guarded, guarded
from mavlink_defs.visible import visible

_ROLES = ("good", "warn", "bad", "muted", "strong", "accent")
_OF_A_NUMBER = "0123456789.,+-e"
_GOES_ON = re.compile(r"[.,]?[0-9]|e?[+-]?[0-9]")  # what is cut off there is of a number


@dataclass(frozen=True)
class GridColumn:
    """A column; one of width 0 takes what is left of the widget's width, at least 8.

    A text that is too long ends with "…", never within a number; a number that is too long loses
    digits behind the point.

    Columns with the same `group` after each other get it as a common heading above theirs.
    """

    title: str
    width: int
    align: Literal["left", "right"] = "right"
    group: str = ""


@dataclass(frozen=True)
class Row:
    """A row: the key of its subject, and its cells."""

    key: Any
    cells: tuple[Cell, ...]


class Grid(Guarded, ScrollView, can_focus=True):
    """A table with fixed headings and a cursor."""

    COMPONENT_CLASSES: ClassVar[set[str]] = {
        "grid--head",
        "grid--group",
        "grid--cursor",
        *(f"grid--{role}" for role in _ROLES),
    }
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("up", "move(-1)", "up", show=False),
        Binding("down", "move(1)", "down", show=False),
        Binding("pageup", "page(-1)", "page up", show=False),
        Binding("pagedown", "page(1)", "page down", show=False),
        Binding("home", "edge(0)", "first", show=False),
        Binding("end", "edge(-1)", "last", show=False),
        Binding("enter", "activate", "choose", show=False),
    ]

    cursor: reactive[int] = reactive(0)

    class Moved(Message):
        """The operator moved the cursor to another row."""

        def __init__(self, grid: "Grid", key: Any) -> None:
            super().__init__()
            self.grid, self.key = grid, key

        @property
        def control(self) -> "Grid":
            """The grid."""
            return self.grid

    class Marked(Message):
        """The operator marks the vehicle whose system id is a row's key, or unmarks it."""

        def __init__(self, system: int) -> None:
            super().__init__()
            self.system = system

    class Activated(Moved):
        """The operator pressed enter on a row, or clicked on the row of the cursor."""

    def __init__(self, empty: str = "", follow: bool = False, **kwargs: Any) -> None:
        """Prepare an empty table.

        Args:
            empty: What it says while it has no rows.
            follow: Keep to the last row for as long as the cursor is there.
            kwargs: Of Widget.
        """
        super().__init__(**kwargs)
        self.empty = empty
        self.columns: tuple[GridColumn, ...] = ()
        self.rows: tuple[Row, ...] = ()
        self._follow = follow
        self._looks: dict[str, Style] = {}
        self._widths: list[int] = []
        self._room = 0

    # data in

    def show(self, columns: Sequence[GridColumn], rows: Sequence[Row]) -> None:
        """Show these rows; the cursor stays on the row with the same key if there is one."""
        columns, rows = tuple(columns), tuple(rows)
        before, at_end = self.rows, self.cursor >= len(self.rows) - 1
        key = self.key
        alike = columns == self.columns and len(rows) == len(before)
        self.columns, self.rows = columns, rows
        if not alike:
            self._resize()
            self.refresh(layout=self.styles.auto_dimensions)
        elif rows != before:
            for i, (old, new) in enumerate(zip(before, rows, strict=True)):
                if old != new:
                    self._refresh_row(i)
        if self._follow and at_end:
            self.cursor = max(len(rows) - 1, 0)
            self._show_cursor()
        elif key is not None and self.key != key:
            self.move_to(key)

    def move_to(self, key: Any) -> None:
        """Put the cursor on the row with this key, if there is one."""
        place = next((i for i, row in enumerate(self.rows) if row.key == key), None)
        self.cursor = min(self.cursor, max(len(self.rows) - 1, 0)) if place is None else place

    def action_mark(self) -> None:
        """Mark the vehicle of the cursor, or no longer."""
        if self.key is not None:
            self.post_message(self.Marked(self.key))

    @property
    def key(self) -> Any:
        """Key of the row of the cursor; None without rows."""
        return self.rows[self.cursor].key if self.cursor < len(self.rows) else None

    @property
    def text(self) -> str:
        """All rows as text, one line each."""
        return "\n".join(" ".join(text for text, _ in row.cells) for row in self.rows)

    # drawing

    @property
    def _head(self) -> int:
        return 2 if any(column.group for column in self.columns) else 1

    @property
    def room(self) -> int:
        """Width without a scroll bar."""
        return self.scrollable_content_region.width

    def _resize(self) -> None:
        """Work out the widths of the columns: they change less often than lines are drawn."""
        self._room = self.room
        fixed = sum(column.width + 1 for column in self.columns) - 1
        free = max(self._room - fixed, 8)
        self._widths = [column.width or free for column in self.columns]
        self.virtual_size = Size(self._room, self._head + max(len(self.rows), 1))

    @guarded
    def on_resize(self, event: events.Resize) -> None:
        """Fit the column of width 0, and keep the cursor in sight."""
        self._resize()
        self._show_cursor()

    def watch_show_vertical_scrollbar(self) -> None:
        """Fit the column of width 0 beside the scroll bar."""
        self._resize()

    def notify_style_update(self) -> None:
        """Forget the colours of the theme before."""
        super().notify_style_update()
        self._looks.clear()

    def _look(self, role: str) -> Style:
        """The style of a role, "" for plain text."""
        if role not in self._looks:
            base = self.rich_style
            if f"grid--{role}" in self.COMPONENT_CLASSES:
                base += self.get_component_rich_style(f"grid--{role}", partial=True)
            self._looks[role] = base
        return self._looks[role]

    def render_line(self, y: int) -> Strip:
        """Draw one line of the widget."""
        place = y - self._head + self.scroll_offset.y
        if y < self._head:
            runs = self._groups() if y < self._head - 1 else self._titles()
        elif place < len(self.rows):
            runs = self._cells(place)
        else:
            runs = [(self.empty, "muted")] if not self.rows and place == 0 else []
        strip = Strip([Segment(text, self._look(role)) for text, role in runs])
        strip = strip.adjust_cell_length(self._room, self._look(""))
        at_cursor = y >= self._head and place == self.cursor and self.rows
        if at_cursor and self.has_focus:
            cursor = Style(bgcolor=self._look("cursor").bgcolor)  # colours of text stay
            strip = Strip(
                [Segment(text, (style or Style()) + cursor) for text, style, _ in strip],
                strip.cell_length,
            )
        return strip

    def _titles(self) -> list[Cell]:
        titles = [(column.title, "head") for column in self.columns]
        return _joined(titles, self.columns, self._widths)

    def _groups(self) -> list[Cell]:
        texts, i = [], 0
        while i < len(self.columns):
            end = i + 1
            group = self.columns[i].group
            while end < len(self.columns) and self.columns[end].group == group:
                end += 1
            width = sum(self._widths[i:end]) + end - i - 1
            texts.append(f" {group} ".center(width, "─")[:width] if group else " " * width)
            i = end
        return [(" ".join(texts), "group")]

    def _cells(self, place: int) -> list[Cell]:
        return _joined(self.rows[place].cells, self.columns, self._widths)

    def _refresh_row(self, place: int) -> None:
        y = place + self._head - self.scroll_offset.y
        if self._head <= y < self.size.height:
            self.refresh(Region(0, y, self.size.width, 1))

    # the cursor

    def watch_cursor(self, before: int, now: int) -> None:
        """Draw the row that had the cursor, and the one that has it."""
        self._refresh_row(before)
        self._refresh_row(now)
        self._show_cursor()

    def _show_cursor(self) -> None:
        page = max(self.size.height - self._head, 1)
        top = self.scroll_offset.y
        if self.cursor < top:
            self.scroll_to(y=self.cursor, animate=False)
        elif self.cursor >= top + page:
            self.scroll_to(y=self.cursor - page + 1, animate=False)

    def _go(self, place: int) -> None:
        place = min(max(place, 0), len(self.rows) - 1)
        if place >= 0 and place != self.cursor:
            self.cursor = place
            self.post_message(self.Moved(self, self.key))

    def action_move(self, step: int) -> None:
        """Move the cursor."""
        self._go(self.cursor + step)

    def action_page(self, pages: int) -> None:
        """Move the cursor by what is visible."""
        self._go(self.cursor + pages * max(self.size.height - self._head - 1, 1))

    def action_edge(self, place: int) -> None:
        """Move the cursor to the first row (0) or the last (-1)."""
        self._go(place if place >= 0 else len(self.rows) - 1)

    def action_activate(self) -> None:
        """Choose the row of the cursor."""
        if self.key is not None:
            self.post_message(self.Activated(self, self.key))

    @guarded
    def on_click(self, event: events.Click) -> None:
        """Move the cursor where the mouse is; there already: choose the row."""
        place = event.y - self._head + self.scroll_offset.y
        if event.y >= self._head and place < len(self.rows):
            if place == self.cursor:
                self.action_activate()
            self._go(place)


def _fit(text: str, width: int, align: Literal["left", "right"]) -> str:
    text = visible(text)
    size = len(text) if text.isascii() else cell_len(text)
    if size > width:
        text = _rounded(text, width) if align == "right" else _cut(text, width)
        size = cell_len(text)
    space = " " * (width - size)
    return text + space if align == "left" else space + text


def _cut(text: str, width: int) -> str:
    """Return the beginning of a text and "…"; a number in it is there as a whole, or not."""
    kept = set_cell_size(text, max(width - 1, 0))
    if _GOES_ON.match(text, len(kept)):
        kept = kept.rstrip(_OF_A_NUMBER)
    return kept + "…" if width > 0 else ""


def _rounded(text: str, width: int) -> str:
    """Return a number with as many digits as there is room for; "…" if there is none."""
    try:
        value = float(text.replace(" ", ""))
    except ValueError:
        return "…"[:width]
    texts = (f"{value:{form}}" for form in (".2f", ".1f", ".0f", ".1e", ".0e"))
    return next((rounded for rounded in texts if len(rounded) <= width), "…"[:width])


def _joined(
    cells: Sequence[Cell], columns: Sequence[GridColumn], widths: Sequence[int]
) -> list[Cell]:
    """The text of a line, in runs of the same role."""
    runs: list[Cell] = []
    for (text, role), column, width in zip(cells, columns, widths, strict=True):
        fitted = _fit(text, width, column.align) + " "
        if runs and (runs[-1][1] == role or not text):
            runs[-1] = (runs[-1][0] + fitted, runs[-1][1])
        else:
            runs.append((fitted, role))
    return runs
