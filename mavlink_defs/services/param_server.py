"""The parameter microservice (https://mavlink.io/en/services/parameter.html), vehicle side.

Values are numbers of type INT32 or REAL32. They travel C-cast, as ArduPilot does it: the number
itself in a float32 whatever its type, so that `param_type` of PARAM_SET means nothing; or
bytewise, where an integer's four bytes stand in for a float32.
"""

import math
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TypeAlias

from mavlink_defs import dialect
from mavlink_defs.constants import INT32_MAX
from mavlink_defs.float32 import decimal_of_float32, float32s
from mavlink_defs.services.machine import Machine, SystemId, is_for, sender_of
from mavlink_defs.services.param import MAX_NAME, NOT_LISTED, raw_name

INT32, REAL32 = dialect.MAV_PARAM_TYPE_INT32, dialect.MAV_PARAM_TYPE_REAL32

BURST = 5
"""Parameters of a list that are sent at a time."""

BURST_PERIOD_S = 0.02


class ParamValueError(ValueError):
    """A value that a parameter cannot take.

    Attributes:
        error: MAV_PARAM_ERROR to answer with.
        text: The problem, as a text that follows the parameter's name: "must be > 0 s".
    """

    def __init__(self, text: str, error: int = dialect.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE) -> None:
        super().__init__(text)
        self.error, self.text = error, text


@dataclass(frozen=True)
class Parameter:
    """One parameter of a vehicle.

    Attributes:
        name: Its name, 1 to `param.MAX_NAME` ASCII characters.
        type: INT32 or REAL32.
        get: Gives its value.
        set: Puts a value in force, or raises ParamValueError; None if it is read-only.
    """

    name: str
    type: int
    get: Callable[[], float]
    set: Callable[[float], None] | None = None


@dataclass(frozen=True)
class ParamChanged:
    """A parameter has another value than before."""

    name: str
    value: float


@dataclass(frozen=True)
class ParamRefused:
    """A value was refused; `text` says why, short enough for a STATUSTEXT."""

    name: str
    text: str


@dataclass(frozen=True)
class ParamRenamed:
    """A parameter was asked for by its name of before, for the first time."""

    before: str
    name: str


ParamEvent: TypeAlias = ParamChanged | ParamRefused | ParamRenamed


class ParamServer(Machine[ParamEvent]):
    """Answers requests for parameters.

    PARAM_VALUE is broadcast, so that every ground station receives every change. A list is paced;
    a request for it that comes while one is being sent makes it go round once more from there.
    A refusal is answered with PARAM_ERROR, and for clients without that message also with the
    value that stays in force. Who asks by a name of before is answered by that name, outside the
    list, as clients wait for the name that they sent; a change is broadcast by the present one too.
    """

    def __init__(
        self,
        own: SystemId,
        parameters: Sequence[Parameter],
        *,
        bytewise: bool = False,
        renamed: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        """Offer parameters.

        Args:
            own: SystemId of the vehicle.
            parameters: What there is, in the order of their indices.
            bytewise: Encode integers bytewise instead of C-cast.
            renamed: Names by names of before; what names no parameter does not count.

        Raises:
            ValueError: A name is too long, empty, not ASCII, or given twice.
        """
        super().__init__()
        self._own, self._bytewise = own, bytewise
        self._parameters = tuple(parameters)
        self._indices = {p.name: i for i, p in enumerate(self._parameters)}
        if len(self._indices) != len(self._parameters):
            raise ValueError("two parameters have the same name")
        for name in self._indices:
            raw_name(name)
        self._renamed = {
            before: name
            for before, name in renamed.items()
            if name in self._indices and before not in self._indices
        }
        self._warned: set[str] = set()  # names of before that were used
        self._next = 0  # of the list
        self._remaining = 0
        self._deadline = -math.inf  # of the next burst; stays after the last one

    def receive(self, message: dialect.MAVLink_message, now: float) -> None:
        """Take in any message; the parameter protocol for us is answered."""
        if not is_for(message, self._own):
            return
        match message:
            case dialect.MAVLink_param_request_list_message():
                self._remaining = len(self._parameters)
                self.handle_timer(now)
            case dialect.MAVLink_param_request_read_message():
                self._on_read(message)
            case dialect.MAVLink_param_set_message():
                self._on_set(message)

    def handle_timer(self, now: float) -> None:
        """Send the next few parameters of a list."""
        if self._remaining == 0 or now < self._deadline:
            return
        self._deadline = now + BURST_PERIOD_S
        for _ in range(min(BURST, self._remaining)):
            self._send_value(self._next)
            self._next = (self._next + 1) % len(self._parameters)
            self._remaining -= 1

    def deadline(self) -> float | None:
        """Return the time of the next burst [s]."""
        return self._deadline if self._remaining else None

    def _on_read(self, message: dialect.MAVLink_param_request_read_message) -> None:
        by_name = message.param_index < 0
        index = self._index_of(message.param_id) if by_name else message.param_index
        if 0 <= index < len(self._parameters):
            self._send_value(index, message.param_id if by_name else "")
        else:
            name = message.param_id if by_name else ""
            error = dialect.MAV_PARAM_ERROR_DOES_NOT_EXIST
            self._send_error(sender_of(message), name, message.param_index, error)

    def _on_set(self, message: dialect.MAVLink_param_set_message) -> None:
        name, sender = message.param_id, sender_of(message)
        index = self._index_of(name)
        if index < 0:
            self._refuse(sender, name, -1, dialect.MAV_PARAM_ERROR_DOES_NOT_EXIST, "is not known")
            return
        parameter = self._parameters[index]
        before = parameter.get()
        try:
            if parameter.set is None:
                raise ParamValueError("is read-only", dialect.MAV_PARAM_ERROR_READ_ONLY)
            parameter.set(self._decoded(message, parameter))
        except ParamValueError as problem:
            self._refuse(sender, name, index, problem.error, problem.text)
        else:
            if parameter.get() != before:
                self._happened.append(ParamChanged(parameter.name, parameter.get()))
        self._send_value(index)
        if name in self._renamed:
            self._send_value(index, name)

    def _index_of(self, name: str) -> int:
        """Return the index of a parameter by its name, present or of before; -1: there is none."""
        now = self._renamed.get(name, name)
        if now != name and name not in self._warned:
            self._warned.add(name)
            self._happened.append(ParamRenamed(name, now))
        return self._indices.get(now, -1)

    def _decoded(self, message: dialect.MAVLink_param_set_message, parameter: Parameter) -> float:
        """Return the value in a PARAM_SET.

        Raises:
            ParamValueError: No parameter of this type can have it.
        """
        value = float(message.param_value)
        if self._bytewise and message.param_type == INT32:
            value = float(struct.unpack("<i", struct.pack("<f", value))[0])
        if not math.isfinite(value):
            raise ParamValueError(f"is {value:g}, must be a number")
        if parameter.type == REAL32:
            return decimal_of_float32(value)
        if value != round(value) or abs(value) > INT32_MAX:
            raise ParamValueError(f"is {value:g}, must be a whole number")
        return value

    def _refuse(self, sender: SystemId, name: str, index: int, error: int, text: str) -> None:
        self._happened.append(ParamRefused(name, f"{name} {text}"))
        self._send_error(sender, name, index, error)

    def _send_value(self, index: int, asked: str = "") -> None:
        """Send a parameter's value, by the name of before if it was asked for by that."""
        parameter = self._parameters[index]
        value = parameter.get()
        if self._bytewise and parameter.type == INT32:
            (value,) = struct.unpack("<f", struct.pack("<i", int(value)))
        (value,) = float32s((value,))
        name, place = (asked, NOT_LISTED) if asked in self._renamed else (parameter.name, index)
        count = len(self._parameters)
        message = dialect.MAVLink_param_value_message(
            name.encode(), value, parameter.type, count, place
        )
        self._outbox.append(message)

    def _send_error(self, sender: SystemId, name: str, index: int, error: int) -> None:
        raw = name.encode("ascii", "replace")[:MAX_NAME]
        self._outbox.append(dialect.MAVLink_param_error_message(*sender, raw, index, error))
