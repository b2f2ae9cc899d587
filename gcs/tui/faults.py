"""Faults: a form, and all that were seen with who acknowledged what and when."""

from collections.abc import Callable
from contextlib import suppress
from typing import Any, ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical

from gcs.console.errors import CommandRefused, NoAnswer
from gcs.station.vehicle import Vehicle
from gcs.tui.fault_form import ALL, MARKED, FaultForm
from gcs.tui.fault_history import FaultRecord
from gcs.tui.formatting import Cell, clock, ids
from gcs.tui.grid import Grid, GridColumn, Row
from gcs.tui.guard import CachedStatic, on
from gcs.tui.requests import ActionOutcome, VehicleAction
from gcs.tui.view import FleetView, Panel
from mavlink_defs.faults.actuators import ACTUATOR_FAULTS
from mavlink_defs.faults.fault import Fault

_ROLES = {
    "active": "bad",
    "waiting": "warn",
    "over": "",
    "cleared": "muted",
    "replaced": "muted",
    "restarted": "muted",
}
_COLUMNS = (GridColumn("UAV", 3), GridColumn("state", 9, "left"), GridColumn("fault", 0, "left"))
_WIDE_FROM = 92
_MIN_FAULT, _MIN_HISTORY = 42, 30


class FaultTimeline(Grid):
    """Active, waiting and past faults, the latest first."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("no faults seen; the vehicles are asked for theirs", **kwargs)
        self.border_title = "Faults"
        self.records: list[FaultRecord] = []

    def show_view(self, view: FleetView) -> None:
        """Show the records."""
        times = {state.system: state.time_s for state in view.states}
        fault_history = view.source.fault_history
        self.records = list(reversed(fault_history.records))
        wide = self.room >= _WIDE_FROM
        count = len(fault_history.records)
        rows = []
        for i, record in enumerate(self.records):
            phase = record.phase(times.get(record.system))
            role = _ROLES[phase]
            cells: list[Cell] = [
                (str(record.system), "strong"),
                (phase, role),
                (record.fault.describe(), role),
            ]
            if wide:
                cells.append((_history(record), "muted"))
            rows.append(Row(count - i, tuple(cells)))
        new = len(rows) > len(self.rows)
        self.show(_wide(rows, self.room) if wide else _COLUMNS, rows)
        if new:
            self.cursor = 0
        active = sum(len(state.active_faults) for state in view.states)
        self.border_title = f"Faults · {active} active, {len(rows)} seen"

    @property
    def chosen(self) -> FaultRecord | None:
        """The record of the cursor."""
        return self.records[self.cursor] if self.cursor < len(self.records) else None


def _wide(rows: list[Row], room: int) -> tuple[GridColumn, ...]:
    """Return columns, of which the faults' is as wide as its texts, if there is room."""
    longest = max((len(row.cells[2][0]) for row in rows), default=0)
    left = room - sum(column.width + 1 for column in _COLUMNS[:2]) - 1 - _MIN_HISTORY
    width = max(min(longest, left), _MIN_FAULT)
    return (*_COLUMNS[:2], GridColumn("fault", width, "left"), GridColumn("history", 0, "left"))


class FaultsPanel(Panel, Horizontal):
    """The form beside the list."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("n", "new", "new", tooltip="Go to the form for a new fault"),
        Binding(
            "delete,d", "clear", "clear", tooltip="Clear the faults of what has the chosen one"
        ),
    ]

    def compose(self) -> ComposeResult:
        """Lay out form, list and details."""
        yield FaultForm(id="fault-form", classes="panel")
        with Vertical():
            yield FaultTimeline(id="fault-list", classes="panel")
            yield CachedStatic(id="fault-details", classes="panel")

    def show_view(self, view: FleetView) -> None:
        """Show vehicles and faults."""
        form = self.query_one(FaultForm)
        form.attempt(form.set_systems, view.systems, view.selected, view.marked)
        form.disabled = bool(view.source.read_only)
        faults = self.query_one(FaultTimeline)
        self._systems, self._marked = view.systems, tuple(sorted(view.marked))
        faults.attempt(faults.show_view, view)
        self._show_details()

    def action_new(self) -> None:
        """Go to the form."""
        self.query_one("#actuator").focus()

    @on(FaultForm.Left)
    def _to_list(self) -> None:
        self.query_one(FaultTimeline).focus()

    def _done(self, outcome: ActionOutcome) -> None:
        """Leave the form after an accepted fault, so that keys are no text any more."""
        form = self.query_one(FaultForm)
        if outcome.accepted and form.has_focus_within:
            form.action_leave()

    def action_clear(self) -> None:
        """Clear the chosen fault."""
        record = self.query_one(FaultTimeline).chosen
        if record is None or record.gone_at is not None:
            self.app.notify("choose a fault that a vehicle still has", severity="warning")
            return
        fault, name = record.fault, record.fault.whose

        async def act(vehicle: Vehicle, _: str) -> str:
            if fault.family is ACTUATOR_FAULTS:
                await vehicle.clear_faults(fault.number)
            else:
                await vehicle.clear_sensor_faults(fault.target.name, fault.instance)
            return f"faults of the {name} cleared"

        question = f"Clear the faults of the {name} of UAV {record.system}, past ones too?"
        self.post_message(VehicleAction(f"clear {name}", [record.system], act, question=question))

    @on(FaultForm.Submitted)
    def _set(self, event: FaultForm.Submitted) -> None:
        groups = {ALL: self._systems, MARKED: self._marked}
        systems = groups.get(event.system, (event.system,))
        self.post_message(set_fault(systems, event.fault, self._done))

    @on(Grid.Moved)
    def _show_details(self) -> None:
        record = self.query_one(FaultTimeline).chosen
        details = self.query_one("#fault-details", CachedStatic)
        details.border_title = "Details"
        details.attempt(lambda: details.say(_details(record) if record else ""))


def set_fault(
    systems: tuple[int, ...], fault: Fault, on_done: Callable[[ActionOutcome], None] | None = None
) -> VehicleAction:
    """The action to set a fault."""

    async def act(vehicle: Vehicle, _: str) -> str:
        await vehicle.set_fault(fault)
        with suppress(CommandRefused, NoAnswer):
            await vehicle.faults()  # "accepted" is shown when the list has it, for `repeat`
        return f"set: {fault.describe()}"

    what = f"set {fault.whose} fault"
    return VehicleAction(what, systems, act, on_done=on_done)


def clear_all(view: FleetView) -> VehicleAction:
    """The action to clear all faults of the marked vehicles, or of all if none is marked."""

    async def act(vehicle: Vehicle, _: str) -> str:
        await vehicle.clear_faults()
        return "all faults cleared"

    systems = tuple(sorted(view.marked)) or view.systems
    question = f"Clear all faults of {ids(systems)}: active, waiting and past ones?"
    return VehicleAction("clear all faults", systems, act, question=question)


def repeat(view: FleetView) -> tuple[VehicleAction | None, str]:
    """Return the action that gives the last fault to the first vehicle that does not have it.

    The search begins at the selected one. Without such a vehicle, or without a fault, the
    second value says so.
    """
    last = view.source.fault_history.last
    if last is None:
        return None, "there is no fault yet to be repeated"
    there = [r for r in view.source.fault_history.records if r.gone_at is None]
    having = {r.system for r in there if _alike(r.fault, last.fault)} | {last.system}
    system = view.first(lambda state: state.system not in having and not view.is_silent(state))
    if system is None:
        return None, "every vehicle has the last fault already"
    return set_fault((system,), last.fault), ""


def _alike(a: Fault, b: Fault) -> bool:
    return a._replace(start_s=0.0) == b._replace(start_s=0.0)


def _history(record: FaultRecord) -> str:
    parts = []
    if record.acknowledged is not None:
        ack = record.acknowledged
        parts.append(f"acknowledged at {clock(ack.at)}, asked by {ack.asked_by}")
    else:
        parts.append("set before this station listened")
    if record.gone_at is not None:
        by = f", asked by {record.cleared.asked_by}" if record.cleared else ""
        parts.append(f"{record.gone} at {clock(record.gone_at)}{by}")
    return "; ".join(parts)


def _details(record: FaultRecord) -> str:
    return f"UAV {record.system}: {record.fault.describe()}\n{_history(record)}"
