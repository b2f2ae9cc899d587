"""The first panel: fleet, wire, and the latest events."""

from textual.app import ComposeResult
from textual.containers import Horizontal, Vertical

from gcs.tui.events import EventLog
from gcs.tui.fleet_table import FleetTable
from gcs.tui.plots import Chart
from gcs.tui.view import FleetView
from gcs.tui.wire_panel import WirePanel

__all__ = ["Overview"]

_TRAIL_S = 10.0


class Overview(Vertical):
    """What an operator looks at most of the time."""

    def compose(self) -> ComposeResult:
        """Lay out the panels."""
        yield FleetTable(id="fleet-table", classes="panel with-keys")
        with Horizontal(id="overview-middle"):
            yield WirePanel(id="wire", classes="panel")
            yield Chart("formation", id="overview-formation", classes="panel chart")
        yield EventLog(short=True, id="overview-events", classes="panel")

    def show_view(self, view: FleetView) -> None:
        """Show what is known now."""
        self.query_one(FleetTable).show_view(view)
        self.query_one(WirePanel).show_view(view)
        self.query_one(EventLog).show_view(view)
        formation = self.query_one(Chart)
        if formation.display:
            formation.draw(view, _TRAIL_S, None)
