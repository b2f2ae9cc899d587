"""The form for a fault of an actuator or a sensor."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, TypeAlias, cast

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
from mavlink_defs.sensor_fault_kinds import SENSOR_FAULT_KINDS, SENSOR_UNITS, SensorFaultKind
from mavlink_defs.sensor_fault_spec import SensorFaultSpec
from mavlink_defs.sensor_faults import AnyFault

ALL, MARKED = 0, -1
"""Stand for every vehicle, and for the marked ones."""

AnyKind: TypeAlias = FaultKind | SensorFaultKind

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

_OF_ACTUATORS = {"effectiveness", "frequency_hz"}
_OF_SENSORS = {"instance", "axis"}


@dataclass(frozen=True)
class _Read:
    """The content of a form: a fault, or the problems with it."""

    fault: AnyFault | None
    problems: tuple[str, ...] = ()


def kinds_of(part: str) -> dict[str, AnyKind]:
    """Return the kinds of fault of an actuator or a sensor, by name."""
    if part not in SENSOR_UNITS:
        return dict(FAULT_KINDS)
    return {name: k for name, k in SENSOR_FAULT_KINDS.items() if k.fits(SENSOR_UNITS[part])}


def read_fault(part: str, kind: AnyKind, texts: dict[str, str]) -> _Read:
    """Read the fields of a form with the rules of a scenario's fault.

    Args:
        part: The actuator or sensor.
        kind: The kind.
        texts: What the fields say, by name; empty for what is left out.
    """
    value_key, value_label = _key(kind, part), _label(kind, part)
    of_sensor = isinstance(kind, SensorFaultKind)
    left_out = _OF_ACTUATORS if isinstance(kind, SensorFaultKind) else _OF_SENSORS
    keys: dict[str, Any] = {"sensor" if of_sensor else "actuator": part}
    if isinstance(kind, SensorFaultKind):
        keys["failure"] = kind.failure
    problems = []
    for name in (name for name in _FIELDS if name not in left_out):
        text = texts.get(name, "").strip().replace(",", ".")
        if not text or (name in {"effectiveness", "value"} and not _takes(kind, name)):
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
    if isinstance(kind, SensorFaultKind) and kind.has_value and value_key not in keys:
        if (default := _default(kind, part)) is None:
            problems.append(f"{value_label}: expected a number, got nothing")
        keys[value_key] = default
    if problems:
        return _Read(None, tuple(problems))
    model: type[FaultSpec | SensorFaultSpec] = SensorFaultSpec if of_sensor else FaultSpec
    try:
        return _Read(model.model_validate(keys).command())
    except ValidationError as error:
        found = problems_of(model, error)
        return _Read(None, tuple(problem.line({value_key: value_label}) for problem in found))


def _takes(kind: AnyKind, name: str) -> bool:
    """Return whether a kind has an effectiveness, or a value."""
    if isinstance(kind, SensorFaultKind):
        return name == "value" and kind.has_value
    return name == "value" or not kind.replaces


def _default(kind: SensorFaultKind, part: str) -> float | None:
    """Return the value of a kind of which none is given; None: one must be."""
    by_kind = dict([SENSOR_UNITS[part].wrong])
    value = by_kind.get(kind.name, kind.default)
    return None if math.isnan(value) else value


def _key(kind: AnyKind, part: str) -> str:
    """Return the key of the value in a scenario."""
    if isinstance(kind, SensorFaultKind):
        return kind.key(SENSOR_UNITS[part])
    return kind.key(cast(Actuator, part))


def _label(kind: AnyKind, part: str) -> str:
    """Return what the form calls the value."""
    if isinstance(kind, SensorFaultKind):
        unit = kind.unit_of(SENSOR_UNITS[part]).replace("deg", "°")
        return f"{kind.name} {unit}".rstrip() if kind.has_value else "value"
    return f"{kind.label} {kind.unit(cast(Actuator, part)).replace('deg', '°')}"


def _hint(kind: AnyKind, part: str) -> str:
    """Return what the field of the value says while it is empty."""
    if not isinstance(kind, SensorFaultKind):
        return _FIELDS["value"][1]
    if not kind.has_value:
        return "none"
    low, high = kind.bounds(SENSOR_UNITS[part])
    default = _default(kind, part)
    return f"{low:g} … {high:g}" if default is None else f"{default:g}"


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

        def __init__(self, system: int, fault: AnyFault) -> None:
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
            names = [(name, name) for name in (*ACTUATORS, *SENSOR_UNITS)]
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
                    widget.display = name not in _OF_SENSORS
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
        of_sensor, choices = self._part in SENSOR_UNITS, _choices(self._part)
        field: Select[str] = self.query_one("#fault-kind", Select)
        before = field.value
        if choices != self._choices:
            self._choices = choices
            names = [name for _, name in choices]
            with field.prevent(Select.Changed):
                field.set_options(choices)
                field.value = before if before in names else names[0]
        for name in _OF_SENSORS | _OF_ACTUATORS:
            shown = (name in _OF_SENSORS) == of_sensor
            self.query_one(f"#label-{name}").display = shown
            self.query_one(f"#{name}").display = shown

    @on(Input.Changed)
    @on(Select.Changed)
    def _check(self, complain: bool = False) -> None:
        if self._kind_name not in kinds_of(self._part):
            return  # the kinds of what was chosen before
        self.query_one("#label-value", CachedStatic).say(_label(self._kind, self._part))
        value = self.query_one("#value", Input)
        value.placeholder = _hint(self._kind, self._part)
        value.disabled = not _takes(self._kind, "value")
        self.query_one("#effectiveness", Input).disabled = not _takes(self._kind, "effectiveness")
        read = self.read
        touched = any(self.query_one(f"#{name}", Input).value for name in _FIELDS)
        says = self.query_one("#form-says", CachedStatic)
        says.say("\n".join(read.problems) if touched or complain is True else "")
        self.query_one("#set", Button).disabled = read.fault is None

    @property
    def _part(self) -> str:
        return str(self.query_one("#actuator", Select).value)

    @property
    def _kind_name(self) -> str:
        return str(self.query_one("#fault-kind", Select).value)

    @property
    def _kind(self) -> AnyKind:
        return kinds_of(self._part)[self._kind_name]


def _choices(part: str) -> list[tuple[str, str]]:
    """Return text and name of each kind of fault of an actuator or a sensor."""
    return [
        (name if isinstance(kind, SensorFaultKind) else kind.choice, name)
        for name, kind in kinds_of(part).items()
    ]
