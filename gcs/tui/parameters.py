"""Parameters: search, look, set; as far as the vehicles offer them."""

import math
from typing import Any, ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical
from textual.widgets import Input

from gcs.station.param_metadata import known_quantity, permitted
from gcs.station.vehicle import Vehicle
from gcs.tui.cached_static import CachedStatic
from gcs.tui.formatting import Cell, ids
from gcs.tui.grid import Column, Grid, Row
from gcs.tui.guard import on
from gcs.tui.requests import Outcome, Refresh, VehicleAction
from gcs.tui.view import FleetView, Panel
from mavlink_defs.services.param import Param

__all__ = ["ParametersPanel"]

_COLUMNS = (
    Column("name", 16, "left"),
    Column("value", 12),
    Column("unit", 8, "left"),
    Column("range", 18, "left"),
    Column("meaning", 0, "left"),
)


class ParametersPanel(Panel, Vertical):
    """The parameters of the selected vehicle."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("g", "fetch", "get all", tooltip="Ask the selected UAV for its parameters"),
        Binding("slash", "search", "search", tooltip="Show only names with some letters"),
        Binding("escape", "leave", "back to the list", show=False),
    ]

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.params: dict[int, tuple[Param, ...]] = {}
        self._said: dict[int, str] = {}
        self._asked: set[int] = set()
        self._view: FleetView | None = None

    def compose(self) -> ComposeResult:
        """Lay out search, list and field."""
        with Horizontal(classes="filters"):
            yield CachedStatic(grow=True, id="param-about")
            yield Input(placeholder="/ search", id="param-search", compact=True)
        yield Grid(id="params", classes="panel")
        with Horizontal(classes="filters", id="param-edit"):
            yield CachedStatic(grow=True, id="param-name")
            yield Input(
                placeholder="enter on a line, then the new value", id="param-value", compact=True
            )

    def show_view(self, view: FleetView) -> None:
        """Show the parameters of the selected vehicle; ask for them the first time."""
        self._view, system = view, view.selected
        self.query_one("#param-about", CachedStatic).say(
            "no vehicle yet" if system is None else f"UAV {system}"
        )
        if system is not None and view.source.can_act and system not in self._asked:
            self.action_fetch()
        grid = self.query_one("#params", Grid)
        words = self.query_one("#param-search", Input).value.casefold()
        params = self.params.get(system or 0, ())
        shown = [param for param in params if words in param.name.casefold()]
        grid.empty = self._why_empty(system)
        grid.border_title = f"Parameters · {len(shown)} of {len(params)}"
        grid.attempt(lambda: grid.show(_COLUMNS, [_row(param) for param in shown]))
        grid.refresh()

    def _why_empty(self, system: int | None) -> str:
        if self._view is not None and not self._view.source.can_act:
            return "a log can be asked for nothing"
        if self.params.get(system or 0):
            return "no name has these letters"
        return self._said.get(system or 0, "asking …")

    def action_fetch(self) -> None:
        """Ask for all parameters."""
        system = self._view.selected if self._view else None
        if system is None:
            return
        self._asked.add(system)
        self._said.pop(system, None)

        async def act(vehicle: Vehicle, _: str) -> str:
            self.params[vehicle.system] = await vehicle.list_params()
            return f"{len(self.params[vehicle.system])} parameters"

        self.post_message(VehicleAction("get parameters", [system], act, on_done=self._done))

    def _done(self, outcome: Outcome) -> None:
        if not outcome.accepted:
            self._said[outcome.system] = outcome.words + " (g asks again)"
        self.post_message(Refresh())

    def action_search(self) -> None:
        """Go to the search field."""
        self.query_one("#param-search").focus()

    def action_leave(self) -> None:
        """Go back to the list."""
        self.query_one("#params").focus()

    @on(Input.Changed, "#param-search")
    def _searched(self) -> None:
        self.post_message(Refresh())

    @on(Input.Submitted, "#param-search")
    def _found(self) -> None:
        self.action_leave()

    @on(Grid.Activated)
    def _edit(self, event: Grid.Activated) -> None:
        self.query_one("#param-name", CachedStatic).say(f"{event.key} =")
        self.query_one("#param-value").focus()

    @on(Input.Submitted, "#param-value")
    def _submitted(self, event: Input.Submitted) -> None:
        grid, view = self.query_one("#params", Grid), self._view
        if view is None or view.selected is None or grid.key is None:
            return
        name, system = str(grid.key), view.selected
        try:
            value = float(event.value)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            self.app.notify(
                f"expected a number, got '{event.value}'", severity="error", markup=False
            )
            return
        before = next(param.value for param in self.params[system] if param.name == name)
        question = f"Set {name} of {ids([system])} from {before:g} to {value:g}?"

        async def act(vehicle: Vehicle, _: str) -> str:
            now = await vehicle.set_param(name, value)
            held = self.params[vehicle.system]
            self.params[vehicle.system] = tuple(now if p.name == name else p for p in held)
            return f"{name} is {now.value:g}"

        action = VehicleAction(f"set {name}", [system], act, question=question, on_done=self._done)
        self.post_message(action)
        event.input.clear()
        self.action_leave()


def _row(param: Param) -> Row:
    known = known_quantity(param.name)
    unit, doc = (known.unit, known.doc) if known else ("", "")
    cells: tuple[Cell, ...] = (
        (param.name, "strong"),
        (f"{param.value:g}", ""),
        (unit, "muted"),
        (permitted(param.name), "muted"),
        (doc, "muted"),
    )
    return Row(param.name, cells)
