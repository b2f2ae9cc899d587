"""The form for a fault of an actuator or a sensor."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from pydantic import ValidationError
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Grid as Cells
from textual.containers import Horizontal, Vertical
from textual.message import Message
from textual.widgets import Button, Input, Select, Static

from gcs.tui.guard import CachedStatic, Guarded, on
from mavlink_defs.config.files import problems_of
from mavlink_defs.constants import ACTUATORS
from mavlink_defs.faults import FAMILY_OF
from mavlink_defs.faults.actuators import ACTUATOR_FAULTS
from mavlink_defs.faults.fault import Fault
from mavlink_defs.faults.kinds import MAX_FREQUENCY_HZ, Family, Kind, Target
from mavlink_defs.faults.spec import SPECS

ALL, MARKED = 0, -1
"""Stand for every vehicle, and for the marked ones."""

_FIELDS = {
    "effectiveness": ("effectiveness", "0 … 1"),
    "instance": ("instance", "all"),
    "value": ("", "± the limit"),
    "frequency_hz": ("frequency Hz", f"0 … {MAX_FREQUENCY_HZ:g}, 0"),
    "axis": ("axis", "x, y, z; all"),
    "start_s": ("start s", "now"),
    "end_s": ("end s", "until cleared"),
}
"""Label and hint of each field; the label of the value depends on the kind."""

_OWN = {"effectiveness", "frequency_hz", "instance", "axis"}
"""Fields that only some families have."""


@dataclass(frozen=True)
class _Read:
    """The content of a form: a fault, or the problems with it."""

    fault: Fault | None
    problems: tuple[str, ...] = ()


def read_fault(part: str, kind_name: str, texts: dict[str, str]) -> _Read:
    """Read the fields of a form with the rules of a scenario's fault.

    Args:
        part: What fails.
        kind_name: In what way.
        texts: What the fields say, by name; empty for what is left out.
    """
    family, target, kind = _chosen(part, kind_name)
    value_key, value_label = kind.key(target), _label(kind, target)
    keys: dict[str, Any] = {family.key: part}
    if kind.failure:
        keys["failure"] = kind.failure
    problems = []
    for name in (name for name in _FIELDS if _takes(family, kind, name)):
        text = texts.get(name, "").strip().replace(",", ".")
        if not text:
            continue
        if name == "axis":
            keys[name] = text
            continue
        try:
            number = int(text) if name == "instance" else float(text)
            keys[value_key if name == "value" else name] = number
        except ValueError:
            label = value_label if name == "value" else name
            expected = "a whole number" if name == "instance" else "a number"
            problems.append(f"{label}: expected {expected}, got '{text}'")
    if kind.failure and kind.has_value and value_key not in keys:
        default = kind.default_of(target)
        if math.isnan(default):
            problems.append(f"{value_label}: expected a number, got nothing")
        keys[value_key] = default
    if problems:
        return _Read(None, tuple(problems))
    model = SPECS[family.key]
    try:
        return _Read(model.model_validate(keys).command())
    except ValidationError as error:
        found = problems_of(model, error)
        return _Read(None, tuple(problem.line({value_key: value_label}) for problem in found))


def _chosen(part: str, kind_name: str) -> tuple[Family, Target, Kind]:
    family = FAMILY_OF[part]
    target = family.named(part)
    return family, target, family.kinds_of(target)[kind_name]


def _takes(family: Family, kind: Kind, name: str) -> bool:
    """Return whether a fault has what a field says."""
    if name == "value":
        return kind.has_value
    return kind.partial if name == "effectiveness" else name not in _OWN or family.has(name)


def _label(kind: Kind, target: Target) -> str:
    """Return what the form calls the value."""
    unit = kind.unit_of(target).replace("deg", "°")
    return f"{kind.label or kind.name} {unit}".rstrip() if kind.has_value else "value"


def _hint(kind: Kind, target: Target) -> str:
    """Return what the field of the value says while it is empty."""
    if not kind.has_value:
        return "none"
    low, high = kind.bounds(target)
    default = kind.default_of(target)
    if not math.isfinite(high):
        return _FIELDS["value"][1]
    return f"{low:g} … {high:g}" if math.isnan(default) else f"{default:g}"


class FaultForm(Guarded, Vertical):
    """Vehicle, actuator or sensor, kind, value and window; says at once what does not fit."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("ctrl+s", "submit", "set fault", tooltip="Set the fault that the form describes"),
        Binding("escape", "leave", "list", tooltip="Leave the form for the list"),
    ]

    class Left(Message):
        """The operator leaves the form."""

    class Submitted(Message):
        """A fault is to be set."""

        def __init__(self, system: int, fault: Fault) -> None:
            super().__init__()
            self.system, self.fault = system, fault

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.border_title = "New fault"
        self._systems: tuple[int, ...] = ()
        self._marked: frozenset[int] = frozenset()
        self._choices = _choices(ACTUATORS[0])

    def compose(self) -> ComposeResult:
        """Lay out the fields."""
        with Cells(id="fields"):
            yield Static("vehicle")
            yield Select([("all", ALL)], value=ALL, id="vehicle", compact=True, allow_blank=False)
            yield Static("what fails")
            names = [(name, name) for name in FAMILY_OF]
            yield Select(names, value="rudder", id="actuator", compact=True, allow_blank=False)
            yield Static("kind")
            kinds = _choices(ACTUATORS[0])
            first = kinds[0][1]
            yield Select(kinds, value=first, id="fault-kind", compact=True, allow_blank=False)
            for name, (label, hint) in _FIELDS.items():
                for widget in (
                    CachedStatic(label, id=f"label-{name}"),
                    Input(placeholder=hint, id=name, compact=True),
                ):
                    widget.display = name not in _OWN or ACTUATOR_FAULTS.has(name)
                    yield widget
        yield CachedStatic(grow=True, id="form-says")
        with Horizontal(classes="buttons"):
            yield Button("Set fault", "primary", id="set", compact=True)

    def set_systems(self, systems: Sequence[int], selected: int | None, marked: set[int]) -> None:
        """Offer these vehicles; the marked ones are put in when the marks change."""
        field: Select[int] = self.query_one("#vehicle", Select)
        if tuple(systems) == self._systems and marked == self._marked:
            return
        before, changed = field.value, marked != self._marked
        self._systems, self._marked = tuple(systems), frozenset(marked)
        options = [*((f"UAV {i}", i) for i in systems), ("all", ALL)]
        if marked:
            options.insert(0, (f"{len(marked)} marked", MARKED))
        known = {value for _, value in options} - {ALL}
        chosen = before if before in known else selected or ALL
        with field.prevent(Select.Changed):
            field.set_options(options)
            field.value = MARKED if marked and changed else chosen

    def choose(self, system: int) -> None:
        """Put a vehicle in."""
        if system in self._systems:
            self.query_one("#vehicle", Select).value = system

    @property
    def read(self) -> _Read:
        """The present content of the form."""
        texts = {name: self.query_one(f"#{name}", Input).value for name in _FIELDS}
        return read_fault(self._part, self._kind, texts)

    def action_leave(self) -> None:
        """Leave the form."""
        self.post_message(self.Left())

    def action_submit(self) -> None:
        """Set the fault, or say what is wrong."""
        read = self.read
        if read.fault is not None:
            chosen: Any = self.query_one("#vehicle", Select).value
            self.post_message(self.Submitted(chosen, read.fault))
        self._check(complain=True)

    @on(Button.Pressed, "#set")
    @on(Input.Submitted)
    def _submit(self) -> None:
        self.action_submit()

    @on(Select.Changed, "#actuator")
    def _offer_kinds(self) -> None:
        """Offer the kinds and fields of what fails."""
        family, choices = FAMILY_OF[self._part], _choices(self._part)
        field: Select[str] = self.query_one("#fault-kind", Select)
        before = field.value
        if choices != self._choices:
            self._choices = choices
            names = [name for _, name in choices]
            with field.prevent(Select.Changed):
                field.set_options(choices)
                field.value = before if before in names else names[0]
        for name in _OWN:
            self.query_one(f"#label-{name}").display = family.has(name)
            self.query_one(f"#{name}").display = family.has(name)

    @on(Input.Changed)
    @on(Select.Changed)
    def _check(self, complain: bool = False) -> None:
        if self._kind not in (name for _, name in _choices(self._part)):
            return  # the kinds of what was chosen before
        family, target, kind = _chosen(self._part, self._kind)
        self.query_one("#label-value", CachedStatic).say(_label(kind, target))
        value = self.query_one("#value", Input)
        value.placeholder = _hint(kind, target)
        for name in ("value", "effectiveness"):
            self.query_one(f"#{name}", Input).disabled = not _takes(family, kind, name)
        read = self.read
        touched = any(self.query_one(f"#{name}", Input).value for name in _FIELDS)
        says = self.query_one("#form-says", CachedStatic)
        says.say("\n".join(read.problems) if touched or complain is True else "")
        self.query_one("#set", Button).disabled = read.fault is None

    @property
    def _part(self) -> str:
        return str(self.query_one("#actuator", Select).value)

    @property
    def _kind(self) -> str:
        return str(self.query_one("#fault-kind", Select).value)


def _choices(part: str) -> list[tuple[str, str]]:
    """Return text and name of each kind of fault of an actuator or a sensor."""
    family = FAMILY_OF[part]
    kinds = family.kinds_of(family.named(part))
    return [(kind.choice or name, name) for name, kind in kinds.items()]
