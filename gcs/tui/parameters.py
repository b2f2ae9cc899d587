"""Parameters: search, view, compare with the defaults, set; save and load files."""

import functools
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical
from textual.widgets import Input

from gcs.console.errors import BadInput
from gcs.station.param_file import difference_lines, differing, read_settable, set_values, text_of
from gcs.station.param_metadata import Defaults, defaults_of, differs, known_quantity, permitted
from gcs.station.vehicle import Vehicle
from gcs.tui.formatting import Cell, ids
from gcs.tui.grid import Grid, GridColumn, Row
from gcs.tui.guard import CachedStatic, on
from gcs.tui.requests import ActionOutcome, Answer, Refresh, VehicleAction
from gcs.tui.view import FleetView, Panel
from mavlink_defs.config.models import ConfigError, counted
from mavlink_defs.config.output_files import write_text
from mavlink_defs.services.param import Param

_COLUMNS = (
    GridColumn("", 1),
    GridColumn("name", 16, "left"),
    GridColumn("value", 12),
    GridColumn("default", 12),
    GridColumn("unit", 7, "left"),
    GridColumn("range", 14, "left"),
    GridColumn("meaning", 0, "left"),
)
_LISTED = 8  # most lines below a question
_HINT = "enter on a line, then the new value"


class ParametersPanel(Panel, Vertical):
    """The parameters of the selected vehicle.

    Attributes:
        params: The parameters of each vehicle that was asked.
    """

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("g", "fetch", "get all", tooltip="Ask the selected UAV for its parameters"),
        Binding("slash", "search", "search", tooltip="Show only names with some letters"),
        Binding("d", "differing", "differing", tooltip="Show only what differs from its default"),
        Binding("w", "save", "save", tooltip="Save the parameters of the selected UAV in a file"),
        Binding(
            "o", "load", "load", tooltip="Set what differs from a file in the marked UAVs; asks"
        ),
        Binding("escape", "leave", "back to the list", show=False),
    ]

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.params: dict[int, tuple[Param, ...]] = {}
        self._said: dict[int, str] = {}
        self._asked: set[int] = set()
        self._view: FleetView | None = None
        self._only_differing = False
        self._take: Callable[[str], None] | None = None  # what the field is for

    def compose(self) -> ComposeResult:
        """Lay out search, list and field."""
        with Horizontal(classes="filters"):
            yield CachedStatic(grow=True, id="param-about")
            yield Input(placeholder="/ search", id="param-search", compact=True)
        yield Grid(id="params", classes="panel")
        yield CachedStatic(id="param-meaning", classes="about")
        with Horizontal(classes="filters", id="param-edit"):
            yield CachedStatic(grow=True, id="param-name")
            yield Input(placeholder=_HINT, id="param-value", compact=True)

    def show_view(self, view: FleetView) -> None:
        """Show the parameters of the selected vehicle; ask for them the first time."""
        self._view, system = view, view.selected
        self.query_one("#param-about", CachedStatic).say(
            "no vehicle yet" if system is None else f"UAV {system}"
        )
        if system is not None and not view.source.read_only and system not in self._asked:
            self.action_fetch()
        grid = self.query_one("#params", Grid)
        search = self.query_one("#param-search", Input).value.casefold()
        params = self.params.get(system or 0, ())
        defaults = defaults_of(params)
        shown = [
            param
            for param in params
            if search in param.name.casefold()
            and (differs(param, defaults) or not self._only_differing)
        ]
        grid.empty = self._why_empty(system, defaults)
        which = " that differ from their defaults" if self._only_differing else ""
        grid.border_title = f"Parameters{which} · {len(shown)} of {len(params)}"
        grid.attempt(lambda: grid.show(_COLUMNS, [_row(param, defaults) for param in shown]))
        grid.refresh()
        self._tell_meaning()

    def _why_empty(self, system: int | None, defaults: Defaults) -> str:
        if self._view is not None and (reason := self._view.source.read_only):
            return f"{reason}: nothing can be asked"
        if self.params.get(system or 0):
            if not self._only_differing:
                return "no name has these letters"
            return "none differs from its default" if defaults else "no default is known"
        return self._said.get(system or 0, "asking …")

    @on(Grid.Moved)
    def _tell_meaning(self) -> None:
        """Say in full what the table has no room for."""
        name = self.query_one("#params", Grid).key
        known = None if name is None else known_quantity(str(name))
        text = f"{name}: {known.doc}" if known is not None else ""
        self.query_one("#param-meaning", CachedStatic).say(text)

    def action_differing(self) -> None:
        """Show only what differs from its default, or everything."""
        self._only_differing = not self._only_differing
        self.post_message(Refresh())

    # asking

    def action_fetch(self) -> None:
        """Ask for all parameters."""
        system = self._view.selected if self._view else None
        if system is None:
            return
        self._asked.add(system)
        self._said.pop(system, None)

        async def act(vehicle: Vehicle, _: str) -> str:
            return counted(len(await self._list(vehicle)), "parameter")

        self.post_message(VehicleAction("get parameters", [system], act, on_done=self._done))

    async def _list(self, vehicle: Vehicle) -> tuple[Param, ...]:
        held = self.params[vehicle.system] = await vehicle.list_params()
        self._asked.add(vehicle.system)
        return held

    def _done(self, outcome: ActionOutcome) -> None:
        if not outcome.accepted:
            self._said[outcome.system] = outcome.text + " (g asks again)"

    # the fields

    def action_search(self) -> None:
        """Go to the search field."""
        self.query_one("#param-search").focus()

    def action_leave(self) -> None:
        """Go back to the list."""
        self._ask("", _HINT, None)
        self.query_one("#params").focus()

    @on(Input.Changed, "#param-search")
    def _searched(self) -> None:
        self.post_message(Refresh())

    @on(Input.Submitted, "#param-search")
    def _found(self) -> None:
        self.action_leave()

    def _ask(self, label: str, hint: str, take: Callable[[str], None] | None) -> None:
        """Let the field be for something, and go there; None: for nothing."""
        self._take = take
        self.query_one("#param-name", CachedStatic).say(label)
        field = self.query_one("#param-value", Input)
        field.placeholder, field.value = hint, ""
        if take is not None:
            field.focus()

    @on(Input.Submitted, "#param-value")
    def _submitted(self, event: Input.Submitted) -> None:
        if self._take is None:
            return
        try:
            self._take(event.value.strip())
        except (BadInput, ConfigError) as problem:
            self.app.notify(str(problem), severity="error")
        else:
            self.action_leave()

    # setting

    @on(Grid.Activated)
    def _edit(self, event: Grid.Activated) -> None:
        take = functools.partial(self._set, str(event.key))
        self._ask(f"{event.key} =", "the new value", take)

    def _set(self, name: str, text: str) -> None:
        view = self._view
        if view is None or view.selected is None:
            return
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise BadInput(f"{name}: expected a number, got '{text}'")
        held = [
            f"UAV {system} has {param.value:.9g}"
            for system in view.targets
            for param in self.params.get(system, ())
            if param.name == name
        ]
        question = f"Set {name} of {ids(view.targets)} to {value:.9g}?"

        async def act(vehicle: Vehicle, _: str) -> str:
            now = await vehicle.set_param(name, value)
            held = self.params.get(vehicle.system, ())
            self.params[vehicle.system] = tuple(now if p.name == name else p for p in held)
            return f"{name} is {now.value:.9g}"

        self.post_message(
            VehicleAction(
                f"set {name}",
                view.targets,
                act,
                question=_with_list(question, held),
            )
        )

    # files

    def action_save(self) -> None:
        """Ask for the file to save the parameters of the selected vehicle in."""
        if self._may_act() and self._view is not None and self._view.selected is not None:
            system = self._view.selected
            take = functools.partial(self._save, system)
            self._ask(f"save UAV {system} as", f"a new file, such as uav{system}.parm", take)

    def _may_act(self) -> bool:
        """Return whether vehicles can be asked; say why not, before any file is looked at."""
        reason = "" if self._view is None else self._view.source.read_only
        if reason:
            self.app.notify(f"{reason}: nothing can be done", severity="warning")
        return not reason

    def _save(self, system: int, text: str) -> None:
        file = _path(text)
        if file.exists():
            raise BadInput(f"{file} already exists: choose another name")

        async def act(vehicle: Vehicle, _: str) -> str:
            held = await self._list(vehicle)
            try:
                write_text(file, text_of(held, f"Parameters of UAV {system}"))
            except OSError as problem:
                raise BadInput(f"cannot write {file}: {problem.strerror}") from problem
            return f"{counted(len(held), 'parameter')} in {file}"

        self.post_message(VehicleAction("save parameters", [system], act))

    def action_load(self) -> None:
        """Ask for the file to load."""
        if self._may_act() and self._view is not None and self._view.targets:
            targets = self._view.targets
            take = functools.partial(self._compare, targets)
            self._ask(f"load into {ids(targets)}", "a file of NAME VALUE lines", take)

    def _compare(self, targets: tuple[int, ...], text: str) -> None:
        """Compare a file with what the vehicles hold; ask when the last one has answered."""
        file = _path(text)
        values = read_settable(file)
        different: dict[int, dict[str, float | None]] = {}
        waiting = set(targets)

        async def act(vehicle: Vehicle, _: str) -> str:
            found = different[vehicle.system] = differing(await self._list(vehicle), values)
            return f"{counted(len(found), 'parameter')} not as in {file.name}"

        def compared(outcome: ActionOutcome) -> None:
            waiting.discard(outcome.system)
            if not waiting:
                self._ask_to_load(file, values, different)

        self.post_message(VehicleAction("compare parameters", targets, act, on_done=compared))

    def _ask_to_load(
        self, file: Path, values: dict[str, float], different: dict[int, dict[str, float | None]]
    ) -> None:
        systems = [system for system in sorted(different) if different[system]]
        if not systems:
            if different:
                self.app.notify(f"{ids(sorted(different))}: all as in {file.name}")
            return
        lines = [line for i in systems for line in difference_lines(i, different[i], values)]
        number = sum(held is not None for i in systems for held in different[i].values())
        head = f"Set {counted(number, 'parameter')} of {ids(systems)} as in {file.name}?"

        async def act(vehicle: Vehicle, _: str) -> str:
            try:
                return await set_values(vehicle, values, different[vehicle.system])
            finally:
                self._asked.discard(vehicle.system)  # what it holds now is asked for when shown

        self.post_message(
            VehicleAction(
                "load parameters",
                systems,
                act,
                question=_with_list(head, lines),
                choices=(Answer("Set", "set"),),
            )
        )


def _path(text: str) -> Path:
    """Return a path that was typed.

    Raises:
        BadInput: Nothing was.
    """
    if not text:
        raise BadInput("expected the name of a file")
    return Path(text).expanduser()


def _with_list(question: str, lines: list[str]) -> str:
    more = [f"… and {len(lines) - _LISTED} more"] if len(lines) > _LISTED else []
    return "\n".join([question, *lines[:_LISTED], *more])


def _row(param: Param, defaults: Defaults) -> Row:
    known = known_quantity(param.name)
    unit, doc = (known.unit, known.doc) if known else ("", "")
    changed = differs(param, defaults)
    role = "warn" if changed else ""
    cells: tuple[Cell, ...] = (
        ("≠" if changed else "", role),
        (param.name, "strong"),
        (f"{param.value:.9g}", role),
        (", ".join(f"{value:.9g}" for value in defaults.get(param.name, ())), "muted"),
        (unit, "muted"),
        (permitted(param.name), "muted"),
        (doc, "muted"),
    )
    return Row(param.name, cells)
