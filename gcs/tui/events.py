"""The event log: what vehicles said and did, and what came of the operator's actions."""

from typing import Any, ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical
from textual.widgets import Input, Select, Static

from gcs.station.notifications import severity_name
from gcs.tui.event_log import KINDS, Entry
from gcs.tui.formatting import clock, role_of, seconds
from gcs.tui.grid import Grid, GridColumn, Row
from gcs.tui.guard import on
from gcs.tui.requests import Refresh
from gcs.tui.view import FleetView, Panel
from mavlink_defs import dialect

_COLUMNS = (
    GridColumn("time", 8, "left"),
    GridColumn("t s", 6),
    GridColumn("UAV", 3),
    GridColumn("kind", 7, "left"),
    GridColumn("severity", 8, "left"),
    GridColumn("what", 0, "left"),
)
_SHORT = (*_COLUMNS[:3], *_COLUMNS[5:])
_SEVERITIES = tuple(
    (severity_name(level), level)
    for level in (
        dialect.MAV_SEVERITY_ERROR,
        dialect.MAV_SEVERITY_WARNING,
        dialect.MAV_SEVERITY_NOTICE,
        dialect.MAV_SEVERITY_INFO,
        dialect.MAV_SEVERITY_DEBUG,
    )
)


class EventTable(Grid):
    """The events that pass the filter, newest last."""

    def __init__(self, short: bool = False, **kwargs: Any) -> None:
        super().__init__("nothing has happened yet", follow=True, **kwargs)
        self.border_title = "Events"
        self._short = short
        self._seen = 0
        self._lines: list[Row] = []
        self._severity, self._system, self._kind, self._text = 7, 0, "", ""

    def set_filter(self, severity: int, system: int, kind: str, text: str) -> None:
        """Show only entries of at least a severity, of a vehicle and kind, that contain a text."""
        chosen = (severity, system, kind, text.casefold())
        if chosen != (self._severity, self._system, self._kind, self._text):
            self._severity, self._system, self._kind, self._text = chosen
            self._seen, self._lines = 0, []

    def show_view(self, view: FleetView) -> None:
        """Take in what is new."""
        event_log = view.source.event_log
        if event_log.count < self._seen:  # a log was wound back
            self._seen, self._lines = 0, []
        new = [_line(e, self._short) for e in event_log.since(self._seen) if self._passes(e)]
        self._seen = event_log.count
        if new or len(self.rows) != len(self._lines) or not self.columns:
            self._lines = (
                (self._lines + new)[-len(event_log.entries) :] if event_log.entries else []
            )
            self.show(_SHORT if self._short else _COLUMNS, self._lines)
        if not self._short:
            self.border_title = f"Events · {len(self._lines)} of {len(event_log.entries)}"

    def _passes(self, entry: Entry) -> bool:
        return (
            entry.severity <= self._severity
            and self._system in {0, entry.system}
            and self._kind in {"", entry.kind}
            and self._text in entry.text.casefold()
        )


class EventsPanel(Panel, Vertical):
    """The whole log with its filters."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("slash", "search", "search", tooltip="Show only lines that contain a text"),
        Binding("escape", "leave", "back to the log", show=False),
    ]

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._systems: tuple[int, ...] = ()  # that the filter offers

    def compose(self) -> ComposeResult:
        """Lay out filters and log."""
        with Horizontal(classes="filters"):
            yield Static("at least")
            yield Select(_SEVERITIES, value=7, id="severity", compact=True, allow_blank=False)
            yield Static("UAV")
            yield Select([("all", 0)], value=0, id="of", compact=True, allow_blank=False)
            yield Static("kind")
            kinds = [("all", ""), *((kind, kind) for kind in KINDS)]
            yield Select(kinds, value="", id="event-kind", compact=True, allow_blank=False)
            yield Input(placeholder="/ search", id="event-text", compact=True)
        yield EventTable(id="log", classes="panel")

    def show_view(self, view: FleetView) -> None:
        """Take in what is new."""
        if view.systems != self._systems:
            self._systems = view.systems
            of: Select[int] = self.query_one("#of", Select)
            chosen = of.value if of.value in view.systems else 0
            of.set_options([("all", 0), *((str(i), i) for i in view.systems)])
            of.value = chosen
        log = self.query_one(EventTable)
        log.attempt(log.show_view, view)

    def action_search(self) -> None:
        """Go to the search field."""
        self.query_one("#event-text").focus()

    def action_leave(self) -> None:
        """Go back to the log."""
        self.query_one(EventTable).focus()

    @on(Select.Changed)
    @on(Input.Changed)
    def _filter(self) -> None:
        names = ("severity", "of", "event-kind")
        chosen: list[Any] = [self.query_one(f"#{name}", Select).value for name in names]
        text = self.query_one("#event-text", Input).value
        self.query_one(EventTable).set_filter(chosen[0], chosen[1], chosen[2], text)
        self.post_message(Refresh())

    @on(Input.Submitted)
    def _done(self) -> None:
        self.action_leave()


def _line(entry: Entry, short: bool) -> Row:
    role = role_of(entry.severity)
    cells = (
        (clock(entry.at), "muted"),
        (seconds(entry.time_s), "muted"),
        (str(entry.system or "–"), "strong"),
        (entry.kind, "muted"),
        (severity_name(entry.severity), role),
        (entry.text, role),
    )
    return Row(entry.number, (*cells[:3], cells[5]) if short else cells)
