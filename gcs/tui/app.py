"""The dashboard: panels in tabs, one timer that refreshes the visible one."""

import os
from collections.abc import Iterable, Mapping
from functools import partial
from typing import Any, ClassVar

from textual.actions import ActionParseResult
from textual.app import App, ComposeResult, SystemCommand
from textual.binding import Binding, BindingType
from textual.dom import DOMNode
from textual.events import Resize
from textual.screen import Screen
from textual.widgets import TabbedContent, TabPane

from gcs.station.notifications import ERROR
from gcs.tui.actions import arm, change_mode, disarm, start_mission
from gcs.tui.dialogs import Help, Question
from gcs.tui.events import EventsPanel
from gcs.tui.faults import FaultsPanel, clear_all, repeat
from gcs.tui.fleet_table import FleetTable
from gcs.tui.grid import Grid
from gcs.tui.guard import CachedStatic, Failed, guarded, on, one_line
from gcs.tui.key_bar import KeyBar
from gcs.tui.keys import ACTING, KEYS, REPLAYING
from gcs.tui.missions import MissionsPanel
from gcs.tui.operations import Operations
from gcs.tui.overview import Overview
from gcs.tui.parameters import ParametersPanel
from gcs.tui.playback import Playback
from gcs.tui.plots import PlotsPanel
from gcs.tui.profile_views import ProfileFiles
from gcs.tui.profiles import ProfilesPanel
from gcs.tui.replay_bar import ReplayBar
from gcs.tui.requests import Answer, Refresh, VehicleAction
from gcs.tui.status_bar import StatusBar
from gcs.tui.themes import DARK, LIGHT
from gcs.tui.view import DataSource, FleetView, Panel
from mavlink_defs.visible import visible_lines

REFRESH_S = 0.2
"""Period of refreshing the visible panel."""

MIN_SIZE = (80, 24)


class Dashboard(App[None]):
    """The operator's terminal.

    Attributes:
        failures: What widgets could not do, in one line each, and why.
    """

    TITLE = "ftc-sitl"
    CSS_PATH = "style.tcss"
    HORIZONTAL_BREAKPOINTS = [(0, "-narrow"), (110, "-medium"), (150, "-wide")]  # noqa: RUF012 - as in Textual
    VERTICAL_BREAKPOINTS = [(0, "-short"), (34, "-tall")]  # noqa: RUF012 - as in Textual
    BINDINGS: ClassVar[list[BindingType]] = list(KEYS)

    def __init__(self, source: DataSource, theme: str = "dark") -> None:
        """Prepare the dashboard.

        Args:
            source: Where the data come from.
            theme: "dark" or "light".
        """
        super().__init__()
        self.view = FleetView(source)
        self.playback = source if isinstance(source, Playback) else None
        self.operations = Operations(self.view, self._announce)
        self.failures: dict[str, Exception] = {}
        for known in (DARK, LIGHT):
            self.register_theme(known)
        self.theme = LIGHT.name if theme == "light" else DARK.name

    def compose(self) -> ComposeResult:
        """Lay out the screen."""
        yield StatusBar()
        with TabbedContent(initial="fleet"):
            with TabPane("1 Fleet", id="fleet"):
                yield Overview()
            with TabPane("2 Plots", id="plots"):
                yield PlotsPanel(classes="with-keys")
            with TabPane("3 Faults", id="faults"):
                yield FaultsPanel(classes="with-keys")
            with TabPane("4 Profiles", id="profiles"):
                yield ProfilesPanel(self.view.source.offers_files, classes="with-keys")
            with TabPane("5 Parameters", id="parameters"):
                yield ParametersPanel(classes="with-keys")
            with TabPane("6 Events", id="events"):
                yield EventsPanel(classes="with-keys")
            with TabPane("7 Map", id="map"):
                yield MissionsPanel(classes="with-keys")
        if self.playback is not None:
            yield ReplayBar()
        yield KeyBar(compact=True)
        yield CachedStatic(id="too-small")

    def on_mount(self) -> None:
        """Start the timer."""
        self.set_interval(REFRESH_S, self.refresh_view)
        self.query_one(FleetTable).focus()
        self.refresh_view(force=True)

    @guarded
    def on_resize(self, event: Resize) -> None:
        """Show a notice if the terminal is too small."""
        width, height = event.size
        small = width < MIN_SIZE[0] or height < MIN_SIZE[1]
        self.screen.set_class(small, "-too-small")
        text = f"this terminal has {width}×{height} characters,\nthe dashboard needs 80×24"
        self.query_one("#too-small", CachedStatic).say(text)
        self.call_after_refresh(self.refresh_view, force=True)

    # data

    @guarded
    def refresh_view(self, force: bool = False) -> None:
        """Update the data; draw the changes on the visible panel."""
        if not self.is_running:  # the timer outlives the widgets by a moment
            return
        if self.playback is not None:
            self.playback.advance()
            bar = self.query_one(ReplayBar)
            bar.attempt(bar.show_playback, self.playback)
        if self.view.update() or force or self.operations.going_on:
            status = self.query_one(StatusBar)
            status.attempt(status.show_view, self.view, self.operations.going_on)
            if (panel := self.panel) is not None:
                panel.attempt(panel.show_view, self.view)

    @property
    def panel(self) -> Panel | None:
        """The panel that is shown."""
        pane = self.query_one(TabbedContent).active_pane
        widgets = () if pane is None else pane.children
        return next((widget for widget in widgets if isinstance(widget, Panel)), None)

    @on(Refresh)
    @on(TabbedContent.TabActivated)
    def _draw_again(self) -> None:
        self.refresh_view(force=True)

    # choosing

    @on(FleetTable.Moved, "#fleet-table")
    def _selected(self, event: Grid.Moved) -> None:
        self.view.select(event.key)
        self.refresh_view()

    @on(Grid.Marked)
    def _marked(self, event: Grid.Marked) -> None:
        if self.playback is not None:  # nothing is done with marked vehicles
            self.action_play()
        else:
            self.view.marked ^= {event.system}
        self.refresh_view()

    def action_tab(self, name: str) -> None:
        """Show a panel, and put the focus into it."""
        tabs = self.query_one(TabbedContent)
        tabs.active = name
        inside = tabs.get_pane(name).query("*")
        tables = (w for w in inside if isinstance(w, Grid | ProfileFiles | PlotsPanel))
        self.set_focus(next(tables, None))  # no field: there, keys would be text

    def action_select(self, step: int) -> None:
        """Select another vehicle."""
        self.view.select_next(step)
        self.refresh_view()

    def action_mark_all(self) -> None:
        """Mark all vehicles, or none if all are."""
        systems = set(self.view.systems)
        self.view.marked = set() if self.view.marked == systems else systems
        self.refresh_view()

    def action_theme(self) -> None:
        """Change between dark and light."""
        self.theme = LIGHT.name if self.theme == DARK.name else DARK.name

    def action_help(self) -> None:
        """Show all keys."""
        sections: list[tuple[str, list[BindingType]]] = [("Everywhere", self.BINDINGS)]
        for widget in self.query(".with-keys"):
            title = type(widget).__name__.removesuffix("Panel").removesuffix("Table")
            sections.append((title, type(widget).BINDINGS))
        usable = [(title, [b for b in some if self._is_usable(b)]) for title, some in sections]
        self.push_screen(Help(usable))

    def _is_usable(self, binding: BindingType) -> bool:
        name = binding.action.partition("(")[0] if isinstance(binding, Binding) else ""
        return bool(self.check_action(name, ()))

    def get_system_commands(self, screen: Screen[object]) -> Iterable[SystemCommand]:
        """Return the commands of the palette."""
        yield from super().get_system_commands(screen)
        for binding in self.BINDINGS:
            if isinstance(binding, Binding) and self._is_usable(binding):
                help_text = binding.tooltip or binding.description
                run = partial(self.run_action, binding.action)
                yield SystemCommand(binding.description.capitalize(), help_text, run)

    # a log

    def action_play(self) -> None:
        """Play or pause; at the end play again from the beginning."""
        if self.playback is not None:
            if not self.playback.playing and self.playback.target_s >= self.playback.end_s:
                self.playback.seek(self.playback.begin_s)
            self.playback.playing = not self.playback.playing
            self.refresh_view()

    def action_seek(self, step_s: float) -> None:
        """Seek forward or back."""
        if self.playback is not None:
            self.playback.seek(self.playback.target_s + step_s)
            self.refresh_view(force=True)

    def action_speed(self, step: int) -> None:
        """Play faster or slower."""
        if self.playback is not None:
            self.playback.change_speed(step)
            self.refresh_view()

    @on(ReplayBar.Sought)
    def _sought(self, event: ReplayBar.Sought) -> None:
        if self.playback is not None:
            begin_s, end_s = self.playback.begin_s, self.playback.end_s
            self.playback.seek(begin_s + event.share * (end_s - begin_s))
            self.refresh_view(force=True)

    # acting

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Return whether an action is possible: a log, or who may only look, takes none."""
        if action in REPLAYING:
            return self.playback is not None
        return not (action in ACTING and self.view.source.read_only)

    @on(VehicleAction)
    def _asked_for(self, action: VehicleAction) -> None:
        if reason := self.view.source.read_only:
            self._announce(f"{reason}: nothing can be done", "warning")
        elif not action.systems:
            self._announce(f"{action.what}: no vehicle has been heard", "warning")
        elif action.question:
            choices = action.choices or (Answer(action.what[:1].upper() + action.what[1:], "yes"),)

            def answered(choice: str | None) -> None:
                if choice is None:
                    self._announce(f"{action.what}: cancelled", "information")
                else:
                    self._carry_out(action, choice)

            self.push_screen(Question(action.question, choices), answered)
        else:
            self._carry_out(action, "")

    def _carry_out(self, action: VehicleAction, choice: str) -> None:
        async def work() -> None:
            try:
                await self.operations.carry_out(action, choice)
            except Exception as error:
                self.post_message(Failed(f"finish '{action.what}'", error))

        self.run_worker(work(), group="operations")
        self.refresh_view()

    def notify(self, message: str, **options: Any) -> None:
        """Show a notice, as it is: text of others is no markup, and steers no terminal."""
        super().notify(visible_lines(message), **options | {"markup": False})

    def _announce(self, text: str, severity: str) -> None:
        timeout = 10.0 if severity == "error" else 4.0
        self.notify(text, severity=severity, timeout=timeout)
        self.refresh_view(force=True)

    def action_arm(self) -> None:
        """Arm."""
        self.post_message(arm(self.view.targets))

    def action_start(self) -> None:
        """Start the mission."""
        self.post_message(start_mission(self.view.targets))

    def action_disarm(self) -> None:
        """Disarm."""
        self.post_message(disarm(self.view.targets))

    def action_mode(self) -> None:
        """Change the mode."""
        self.post_message(change_mode(self.view.targets))

    def action_repeat(self) -> None:
        """Repeat the last fault."""
        action, problem = repeat(self.view)
        if action is None:
            self._announce(problem, "warning")
        else:
            self.post_message(action)

    def action_clear_all(self) -> None:
        """Clear all faults."""
        self.post_message(clear_all(self.view))

    # failures

    async def run_action(
        self,
        action: "str | ActionParseResult",  # an alias that is a text itself
        default_namespace: DOMNode | None = None,
        namespaces: Mapping[str, DOMNode] | None = None,
    ) -> bool:
        """Run an action of any widget; a failure is reported and ends nothing."""
        try:
            return await super().run_action(action, default_namespace, namespaces)
        except Exception as error:
            self.post_message(Failed(f"do '{action}'", error))
            return True

    @on(Failed)
    def _note_failure(self, failed: Failed) -> None:
        """Put a failure into the event log, once."""
        text = f"the dashboard cannot {failed.what}: {one_line(failed.error)}"
        if text not in self.failures:
            self.failures[text] = failed.error
            source = self.view.source
            at = source.since_1970(source.now())
            source.event_log.note(at, None, 0, "station", ERROR, text)

    # the end

    def _fatal_error(self) -> None:
        """Leave the report of a defect to the command line."""
        if os.environ.get("FTC_SITL_DEBUG"):
            super()._fatal_error()
        else:
            self._close_messages_no_wait()

    @property
    def defect(self) -> Exception | None:
        """The exception that ended the dashboard; None if the operator did."""
        return self._exception
