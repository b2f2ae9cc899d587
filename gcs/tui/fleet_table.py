"""The fleet: one row per vehicle, as many groups of columns as the width allows."""

import math
from collections.abc import Sequence
from typing import Any, ClassVar

from textual.binding import Binding, BindingType

from gcs.station.navigation import current_item, is_on_path, nearest_of, slot_error_of
from gcs.station.vehicle_state import VehicleState
from gcs.tui.formatting import Cell, number, seconds
from gcs.tui.grid import Grid, GridColumn, Row
from gcs.tui.requests import Refresh
from gcs.tui.view import FleetView
from mavlink_defs.config.models import counted
from mavlink_defs.constants import ACTUATORS, OLD_STATE_S

_GROUPS = ("value", "error", "reference", "synchronisation error", "path")
_PATH = 4
_QUANTITIES = (("V m/s", 6, 2), ("roll°", 6, 1), ("pitch°", 6, 1), ("yaw°", 6, 1))
_ON_PATH = (("slot m", 6, 1), ("up m", 6, 1), ("sep m", 6, 1), ("item", 6, 0))
_STATE = (
    GridColumn("", 2, "left"),
    GridColumn("UAV", 3),
    GridColumn("link", 9, "left"),
    GridColumn("armed", 5, "left"),
    GridColumn("mode", 6, "left"),
    GridColumn("time s", 8),
)
_REST = (GridColumn("faults", 6), GridColumn("msg/s", 5))
_DIAGNOSIS = GridColumn("diagnosis", 16, "left")
_MIN_FAULTS = 16
_PHASE_ROLES = ("muted", "warn", "bad")  # by FTC_PHASE
_GROUP_WIDTH = sum(width + 1 for _, width, _ in _QUANTITIES)
_FIXED_WIDTH = sum(column.width + 1 for column in _STATE + _REST)
_NOTABLE_ERROR = (1.0, 5.0, 5.0, 5.0)  # m/s, deg: shown in colour
_NOTABLE_ON_PATH = (5.0, 5.0, math.inf, math.inf)  # m


class FleetTable(Grid):
    """All vehicles; the row of the cursor is the one whose details are shown elsewhere."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("space", "mark", "mark", tooltip="Mark the vehicle: actions go to marked ones"),
        Binding("c", "cycle", "columns", tooltip="Show the next group of columns"),
    ]

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("waiting for vehicles: start a fleet with `gcs up SCENARIO`", **kwargs)
        self.border_title = "Fleet"
        self._first_group = 0

    def show_view(self, view: FleetView) -> None:
        """Show the vehicles."""
        texts = {state.system: _active_text(state) for state in view.states}
        longest = max(map(len, texts.values()), default=0)
        text = max(longest, _MIN_FAULTS) + 1 if longest else 0
        diagnoses = any(state.diagnosis is not None for state in view.states)
        diagnosis = _DIAGNOSIS.width + 1 if diagnoses else 0
        on_path = any(is_on_path(state) for state in view.states)
        groups = self._groups_shown(on_path, text, diagnosis)
        columns = [*_STATE, *_quantity_columns(groups), *_REST]
        left = self.room - sum(column.width + 1 for column in columns)
        has_diagnosis = diagnoses and diagnosis + text <= left + 1
        if has_diagnosis:
            columns.append(_DIAGNOSIS)
            left -= diagnosis
        wide = left >= _MIN_FAULTS
        if wide:
            columns.append(GridColumn("active faults", 0, "left"))
        rows = [
            _row(view, state, groups, has_diagnosis, texts[state.system] if wide else None)
            for state in view.states
        ]
        self.show(columns, rows)
        if self.key != view.selected:
            self.move_to(view.selected)
        marked = f" · {len(view.marked)} marked" if view.marked else ""
        self.border_title = f"Fleet · {counted(len(rows), 'UAV')}{marked}"

    def action_cycle(self) -> None:
        """Show the next group of columns."""
        self._first_group += 1
        self.post_message(Refresh())

    def _groups_shown(self, on_path: bool, text: int, diagnosis: int) -> list[int]:
        """Return the groups that fit.

        Args:
            on_path: Whether there is a group of columns for the path.
            text: Width of the active faults, which come before further groups; 0 without any.
            diagnosis: Width of the diagnosis, which comes before a third group; 0 without any.
        """
        left = self.room + 1 - _FIXED_WIDTH
        beside_both = (left - text - diagnosis) // _GROUP_WIDTH
        beside_text = (left - text) // _GROUP_WIDTH
        fit = beside_both if beside_both > 1 else beside_text
        if fit <= 0:  # no room for the text anyway
            fit = min(max(left // _GROUP_WIDTH, 1), 2)
        order = (0, _PATH, 1, 2, 3) if on_path else (0, 1, 2, 3)
        n = len(order)
        return [order[(self._first_group + i) % n] for i in range(min(fit, n))]


def _quantity_columns(groups: list[int]) -> list[GridColumn]:
    return [
        GridColumn(title, width, "right", _GROUPS[group])
        for group in groups
        for title, width, _ in (_ON_PATH if group == _PATH else _QUANTITIES)
    ]


def _active_text(state: VehicleState) -> str:
    return " · ".join(fault.describe() for fault in state.active_faults)


def _row(
    view: FleetView, state: VehicleState, groups: list[int], has_diagnosis: bool, active: str | None
) -> Row:
    silent = view.is_silent(state)
    mark = "●" if state.system in view.marked else " "
    pointer = "▸" if state.system == view.selected else " "
    cells: list[Cell] = [
        (pointer + mark, "accent"),
        (str(state.system), "muted" if silent else "strong"),
        _link(view, state),
        _armed(state),
        (state.mode, ""),
        (seconds(state.time_s), ""),
    ]
    for group in groups:
        cells += _group_cells(state, group)
    if silent:
        cells[3:] = [(text, "muted") for text, _ in cells[3:]]
    cells += [_faults(state), (f"{state.rate_hz(view.now):.0f}", "muted")]
    if has_diagnosis:
        cells.append(_diagnosis(state))
    if active is not None:
        cells.append((active, "bad"))
    return Row(state.system, tuple(cells))


def _path_cells(state: VehicleState) -> list[Cell]:
    """Return how a vehicle keeps its slot, how near its nearest neighbour is, and its item."""
    error, nearest = slot_error_of(state), nearest_of(state)
    aside = None if error is None else math.hypot(*error[:2])
    values = (aside, None if error is None else error[2], nearest, current_item(state))
    cells: list[Cell] = []
    for value, (_, _, digits), notable in zip(values, _ON_PATH, _NOTABLE_ON_PATH, strict=True):
        off = value is not None and abs(value) >= notable
        cells.append((number(value, digits), "warn" if off else ""))
    return cells


def _group_cells(state: VehicleState, group: int) -> list[Cell]:
    if group == _PATH:
        return _path_cells(state)
    attitude = state.attitude_deg
    actual = (state.airspeed_m_s, *(attitude or (None, None, None)))
    nothing = (None,) * 4
    values = (actual, state.error, state.reference, state.sync_error)[group] or nothing
    cells: list[Cell] = []
    for value, (_, _, digits), notable in zip(values, _QUANTITIES, _NOTABLE_ERROR, strict=True):
        off = group in {1, 3} and value is not None and abs(value) >= notable
        cells.append((number(value, digits), "warn" if off else "muted" if group == 2 else ""))
    return cells


def _link(view: FleetView, state: VehicleState) -> Cell:
    age = state.age_s(view.now)
    if not view.is_silent(state) and (old_s := state.counts.oldest_state_s) > OLD_STATE_S:
        return (f"old {old_s:.1f}s" if old_s < 100.0 else "old", "warn")
    if not view.is_silent(state):
        return (f"● {age:.1f} s", "good" if age < 1.0 else "warn")
    word = "LOST" if state.lost else "SILENT"
    return (f"{word} {age:.0f}s" if age < 1000.0 else word, "bad")


def _armed(state: VehicleState) -> Cell:
    if state.armed:
        return ("ARMED", "accent")
    return ("ready", "") if state.is_ready else ("boot", "muted")


def _faults(state: VehicleState) -> Cell:
    if state.faults is None:
        return ("?", "muted")
    if not state.faults:
        return ("0", "muted")
    active = len(state.active_faults)
    return (f"{active}/{len(state.faults)}", "bad" if active else "warn")


def _diagnosis(state: VehicleState) -> Cell:
    """Return what the vehicle itself makes of its actuators, beside the injected truth."""
    if state.diagnosis is None:
        return ("-", "muted")
    text, worst = diagnosis_text(state.diagnosis)
    return (text, _PHASE_ROLES[worst])


def diagnosis_text(phases: Sequence[float]) -> tuple[str, int]:
    """Return the diagnosis of the actuators as a text, and the worst FTC_PHASE of them."""
    worst = int(max(phases))
    names = " ".join(name for name, phase in zip(ACTUATORS, phases, strict=True) if phase == worst)
    return ("healthy", f"{names}?", f"{names} lost")[worst], worst
