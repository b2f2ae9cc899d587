"""The first line: vehicles, time, savings, rate, connection and operations in progress."""

from rich.cells import cell_len
from rich.text import Text
from textual.reactive import reactive
from textual.widget import Widget

from gcs.tui.formatting import percent, seconds
from gcs.tui.guard import Guarded
from gcs.tui.view import FleetView
from mavlink_defs.config.models import counted
from mavlink_defs.visible import visible


class StatusBar(Guarded, Widget):
    """One line about everything."""

    line: reactive[tuple[tuple[str, str], ...]] = reactive(())
    aside: reactive[str] = reactive("")

    def show_view(self, view: FleetView, going_on: list[str]) -> None:
        """Show vehicles, time, savings, rate and connection."""
        colours = self.app.theme_variables
        silent = [state.system for state in view.states if view.is_silent(state)]
        armed = sum(state.armed for state in view.states)
        time_s = max((s.time_s for s in view.states if s.time_s is not None), default=None)
        rate = sum(state.rate_hz(view.now) for state in view.states)
        parts = [(counted(len(view.states), "UAV"), "bold" if view.states else colours["muted"])]
        if silent:
            parts.append((f"{len(silent)} SILENT", f"bold {colours['error']}"))
        parts += [
            (f"{armed} armed", f"bold {colours['accent']}" if armed else ""),
            (f"t {seconds(time_s)} s", "bold"),
            (f"{percent(view.source.fleet.saving)} saved", colours["success"]),
            (f"{rate:.0f} msg/s", ""),
        ]
        if going_on:
            parts.append((f"⧗ {going_on[-1]}", f"bold {colours['warning']}"))
        self.line = tuple(parts)
        self.aside = view.source.title

    def render(self) -> Text:
        """Draw the line."""
        text = Text(no_wrap=True, overflow="ellipsis")
        text.append(" ftc-sitl ", style="bold reverse")
        for i, (part, style) in enumerate(self.line):
            text.append("  " if i == 0 else " · ", style="dim")
            text.append(visible(part), style=style)
        aside = visible(self.aside)
        space = self.size.width - text.cell_len - cell_len(aside) - 1
        if space >= 2:
            text.append(" " * space + aside, style="dim")
        return text
