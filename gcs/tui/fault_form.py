"""The form for an actuator fault."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, cast

from pydantic import ValidationError
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Grid as Cells
from textual.containers import Horizontal, Vertical
from textual.message import Message
from textual.widgets import Button, Input, Select, Static

from gcs.tui.guard import CachedStatic, Guarded, on
from mavlink_defs.config.files import problems_of
from mavlink_defs.constants import ACTUATORS, Actuator
from mavlink_defs.fault_kinds import FAULT_KINDS, MAX_FREQUENCY_HZ, FaultKind
from mavlink_defs.fault_spec import FaultSpec
from mavlink_defs.faults import Fault

ALL, MARKED = 0, -1
"""Stand for every vehicle, and for the marked ones."""

_FIELDS = {
    "effectiveness": ("effectiveness", "0 … 1"),
    "value": ("", "± the limit"),
    "frequency_hz": ("frequency Hz", f"0 … {MAX_FREQUENCY_HZ:g}, 0"),
    "start_s": ("start s", "now"),
    "end_s": ("end s", "until cleared"),
}
"""Label and hint of each field; the label of the value depends on the kind."""


@dataclass(frozen=True)
class _Read:
    """The content of a form: a fault, or the problems with it."""

    fault: Fault | None
    problems: tuple[str, ...] = ()


def read_fault(actuator: Actuator, kind: FaultKind, texts: dict[str, str]) -> _Read:
    """Read the fields of a form with the rules of a scenario's fault.

    Args:
        actuator: The actuator.
        kind: The kind.
        texts: What the fields say, by name; empty for what is left out.
    """
    value_key, value_label = kind.key(actuator), _label(kind, actuator)
    keys: dict[str, str | float] = {"actuator": actuator}
    problems = []
    for name in _FIELDS:
        text = texts.get(name, "").strip().replace(",", ".")
        if not text or (name == "effectiveness" and kind.replaces):
            continue
        try:
            keys[value_key if name == "value" else name] = float(text)
        except ValueError:
            label = value_label if name == "value" else name
            problems.append(f"{label}: expected a number, got '{text}'")
    if problems:
        return _Read(None, tuple(problems))
    try:
        return _Read(FaultSpec.model_validate(keys).command())
    except ValidationError as error:
        found = problems_of(FaultSpec, error)
        return _Read(None, tuple(problem.line({value_key: value_label}) for problem in found))


def _label(kind: FaultKind, actuator: Actuator) -> str:
    """Return what the form calls the value."""
    return f"{kind.label} {kind.unit(actuator).replace('deg', '°')}"


class FaultForm(Guarded, Vertical):
    """Vehicle, actuator, effectiveness, value, start and end; says at once what does not fit."""

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

    def compose(self) -> ComposeResult:
        """Lay out the fields."""
        with Cells(id="fields"):
            yield Static("vehicle")
            yield Select([("all", ALL)], value=ALL, id="vehicle", compact=True, allow_blank=False)
            yield Static("actuator")
            names = [(name, name) for name in ACTUATORS]
            yield Select(names, value="rudder", id="actuator", compact=True, allow_blank=False)
            yield Static("kind")
            kinds = [(kind.choice, name) for name, kind in FAULT_KINDS.items()]
            first = kinds[0][1]
            yield Select(kinds, value=first, id="fault-kind", compact=True, allow_blank=False)
            for name, (label, hint) in _FIELDS.items():
                yield CachedStatic(label, id=f"label-{name}")
                yield Input(placeholder=hint, id=name, compact=True)
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
        return read_fault(self._actuator, self._kind, texts)

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

    @on(Input.Changed)
    @on(Select.Changed)
    def _check(self, complain: bool = False) -> None:
        label = _label(self._kind, self._actuator)
        self.query_one("#label-value", CachedStatic).say(label)
        self.query_one("#effectiveness", Input).disabled = self._kind.replaces
        read = self.read
        touched = any(self.query_one(f"#{name}", Input).value for name in _FIELDS)
        says = self.query_one("#form-says", CachedStatic)
        says.say("\n".join(read.problems) if touched or complain is True else "")
        self.query_one("#set", Button).disabled = read.fault is None

    @property
    def _actuator(self) -> Actuator:
        return cast(Actuator, self.query_one("#actuator", Select).value)

    @property
    def _kind(self) -> FaultKind:
        return FAULT_KINDS[str(self.query_one("#fault-kind", Select).value)]
