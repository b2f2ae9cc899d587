"""The first panel: fleet, wire, and the latest events."""

from textual.app import ComposeResult
from textual.containers import Horizontal, Vertical
from textual.geometry import Size

from gcs.tui.events import EventTable
from gcs.tui.fleet_table import FleetTable
from gcs.tui.plots import Chart
from gcs.tui.view import FleetView, Panel
from gcs.tui.wire_panel import WirePanel

_TRAIL_S = 10.0
_WIRE_S = 0.5
_FORMATION_S = 1.0


class Overview(Panel, Vertical):
    """The first panel: fleet, formation, transmissions and events."""

    def __init__(self) -> None:
        super().__init__()
        self._shown: dict[str, object] = {}

    def compose(self) -> ComposeResult:
        """Lay out the panels."""
        yield FleetTable(id="fleet-table", classes="panel with-keys")
        with Horizontal(id="overview-middle"):
            yield WirePanel(id="wire", classes="panel")
            yield Chart("formation", id="overview-formation", classes="panel chart")
        yield EventTable(short=True, id="overview-events", classes="panel")

    def show_view(self, view: FleetView) -> None:
        """Show the present state; formation and transmissions less often."""
        fleet, events = self.query_one(FleetTable), self.query_one(EventTable)
        fleet.attempt(fleet.show_view, view)
        events.attempt(events.show_view, view)
        wire, formation = self.query_one(WirePanel), self.query_one(Chart)
        if self._is_due("wire", _WIRE_S, view, wire.size):
            wire.attempt(wire.show_view, view)
        if formation.display and self._is_due("formation", _FORMATION_S, view, formation.size):
            formation.attempt(formation.draw, view, _TRAIL_S, None)

    def _is_due(self, what: str, period_s: float, view: FleetView, size: Size) -> bool:
        choice = view.selected if view.source.read_only else None  # a log may stand still
        token = (view.paced_by_s // period_s, len(view.states), choice, size, self.app.theme)
        due, self._shown[what] = self._shown.get(what) != token, token
        return due
