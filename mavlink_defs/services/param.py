"""The parameter microservice (https://mavlink.io/en/services/parameter.html), client side.

`ParamLister`, `ParamReader` and `ParamSetter` each do their operation once, with one vehicle.
Values travel C-cast, that is as the number itself in a float32, as ArduPilot does whatever the
type; an integer beyond 2^24 loses digits in transit.
"""

import copy
from abc import abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass

from mavlink_defs import dialect
from mavlink_defs.float32 import decimal_of_float32
from mavlink_defs.services.machine import SLOW_S, Machine, SystemId, is_for, sender_of
from mavlink_defs.visible import visible

MAX_NAME = 16
"""Most characters of a parameter's name."""

RESPONSE_TIMEOUT_S = 0.8
GAP_TIMEOUT_S = 0.4
"""Silence after which a list counts as ended, and missing parameters are requested [s]."""

MAX_RETRIES = 4
MAX_TOGETHER = 10
"""Most missing parameters that are requested at a time."""

NOT_LISTED = 65535
"""`param_index` of a value that is sent outside a list."""
_REALS = {dialect.MAV_PARAM_TYPE_REAL32, dialect.MAV_PARAM_TYPE_REAL64}


@dataclass(frozen=True)
class Param:
    """A parameter of a vehicle.

    Attributes:
        name: Its name, at most 16 characters.
        value: Its value; an int if its type is one of the integers.
        type: MAV_PARAM_TYPE.
    """

    name: str
    value: float
    type: int

    @property
    def is_integer(self) -> bool:
        """Whether it takes whole numbers only."""
        return self.type not in _REALS


@dataclass(frozen=True)
class ParamProgress:
    """Progress of a list: parameters received, and their total."""

    done: int
    total: int


@dataclass(frozen=True)
class ParamFinished:
    """An operation is over.

    Attributes:
        error: MAV_PARAM_ERROR, NO_ERROR on success; None when the vehicle did not answer.
        params: Parameters received, by index for a list; after a refusal the value in force, if
            reported.
    """

    error: int | None
    params: tuple[Param, ...] = ()


class _ParamClient(Machine[ParamProgress | ParamFinished]):
    """One operation with one vehicle: requests are repeated until they are answered."""

    def __init__(self, own: SystemId, vehicle: SystemId) -> None:
        super().__init__()
        self._own, self._vehicle = own, vehicle
        self._retries = 0
        self._deadline: float | None = None

    def start(self, now: float) -> None:
        """Begin the operation.

        Raises:
            RuntimeError: It was started already.
        """
        if self._deadline is not None:
            raise RuntimeError("the parameter operation was started already")
        self._retries = 0
        self._ask([self._request()], RESPONSE_TIMEOUT_S, now)

    def receive(self, message: dialect.MAVLink_message, now: float) -> None:
        """Take in a message of the vehicle."""
        if self._deadline is None or sender_of(message) != self._vehicle:
            return
        if isinstance(message, dialect.MAVLink_param_value_message):
            self._take(message, now)
        elif (
            isinstance(message, dialect.MAVLink_param_error_message)
            and is_for(message, self._own)
            and self._concerns(message)
        ):
            self._finish(message.error)

    def handle_timer(self, now: float) -> None:
        """Repeat the request, or give up."""
        if self._deadline is None or now < self._deadline:
            return
        if self._retries >= MAX_RETRIES and not self._is_worth_waiting(now):
            self._finish(None)
        else:
            self._retries += 1
            self._repeat(now)
            if self._retries > MAX_RETRIES:
                self._deadline = now + SLOW_S

    def deadline(self) -> float | None:
        """Return the time of the next repetition [s]."""
        return self._deadline

    def _repeat(self, now: float) -> None:
        self._ask([self._request()], RESPONSE_TIMEOUT_S, now)

    def _ask(
        self, requests: Iterable[dialect.MAVLink_message], timeout_s: float, now: float
    ) -> None:
        self._outbox += map(copy.copy, requests)
        self._deadline = now + timeout_s

    def _finish(self, error: int | None, params: Iterable[Param] = ()) -> None:
        self._deadline = None
        self._happened.append(ParamFinished(error, tuple(params)))

    @abstractmethod
    def _request(self) -> dialect.MAVLink_message: ...

    @abstractmethod
    def _take(self, message: dialect.MAVLink_param_value_message, now: float) -> None: ...

    @abstractmethod
    def _concerns(self, message: dialect.MAVLink_param_error_message) -> bool: ...


class ParamLister(_ParamClient):
    """Fetches all parameters; those lost in transit are requested by index."""

    def __init__(self, own: SystemId, vehicle: SystemId) -> None:
        super().__init__(own, vehicle)
        self._count: int | None = None
        self._params: dict[int, Param] = {}

    def _request(self) -> dialect.MAVLink_message:
        return dialect.MAVLink_param_request_list_message(*self._vehicle)

    def _repeat(self, now: float) -> None:
        if self._count is None:
            super()._repeat(now)
            return
        missing = [i for i in range(self._count) if i not in self._params][:MAX_TOGETHER]
        requests = [
            dialect.MAVLink_param_request_read_message(*self._vehicle, b"", index)
            for index in missing
        ]
        self._ask(requests, RESPONSE_TIMEOUT_S, now)

    def _take(self, message: dialect.MAVLink_param_value_message, now: float) -> None:
        if message.param_index == NOT_LISTED or message.param_index >= message.param_count:
            return
        if message.param_count != self._count:
            self._params.clear()  # the vehicle's list has changed, and with it the indices
            self._count = message.param_count
        is_new = message.param_index not in self._params
        self._params[message.param_index] = _param(message)
        if not is_new:
            return
        self._retries = 0
        self._deadline = now + GAP_TIMEOUT_S
        self._happened.append(ParamProgress(len(self._params), message.param_count))
        if len(self._params) == self._count:
            params = (param for _, param in sorted(self._params.items()))
            self._finish(dialect.MAV_PARAM_ERROR_NO_ERROR, params)

    def _concerns(self, message: dialect.MAVLink_param_error_message) -> bool:
        return not message.param_id


class ParamReader(_ParamClient):
    """Fetches one parameter by its name."""

    def __init__(self, own: SystemId, vehicle: SystemId, name: str) -> None:
        """Prepare the operation.

        Raises:
            ValueError: No parameter can have this name.
        """
        super().__init__(own, vehicle)
        self._name = name
        self._raw = raw_name(name)

    def _request(self) -> dialect.MAVLink_message:
        return dialect.MAVLink_param_request_read_message(*self._vehicle, self._raw, -1)

    def _take(self, message: dialect.MAVLink_param_value_message, now: float) -> None:
        if message.param_id == self._name:
            self._finish(dialect.MAV_PARAM_ERROR_NO_ERROR, [_param(message)])

    def _concerns(self, message: dialect.MAVLink_param_error_message) -> bool:
        return bool(message.param_id == self._name)


class ParamSetter(_ParamClient):
    """Sets one parameter.

    The vehicle answers with the value that is in force, or with PARAM_ERROR. A value other
    than the one sent may be a delayed report or an implicit refusal (by a vehicle without
    PARAM_ERROR); it counts as a refusal when it comes again after the value was sent
    again.
    """

    def __init__(self, own: SystemId, vehicle: SystemId, param: Param) -> None:
        """Prepare the operation.

        Args:
            own: SystemId of this end.
            vehicle: SystemId of the vehicle.
            param: What to set: name, value and the type that the vehicle has given it.

        Raises:
            ValueError: No parameter can have this name.
        """
        super().__init__(own, vehicle)
        self._requested = param
        self._raw = raw_name(param.name)
        self._mismatches: set[int] = set()  # retries after which another value has come

    def _request(self) -> dialect.MAVLink_message:
        return dialect.MAVLink_param_set_message(
            *self._vehicle, self._raw, float(self._requested.value), self._requested.type
        )

    def _take(self, message: dialect.MAVLink_param_value_message, now: float) -> None:
        if message.param_id != self._requested.name:
            return
        held = _param(message)
        if decimal_of_float32(held.value) == decimal_of_float32(self._requested.value):
            self._finish(dialect.MAV_PARAM_ERROR_NO_ERROR, [held])
            return
        self._mismatches.add(self._retries)
        if len(self._mismatches) > 1:
            self._finish(dialect.MAV_PARAM_ERROR_PERMISSION_DENIED, [held])

    def _concerns(self, message: dialect.MAVLink_param_error_message) -> bool:
        return bool(message.param_id == self._requested.name)


def raw_name(name: str) -> bytes:
    """Return a parameter's name as messages carry it.

    Raises:
        ValueError: No parameter can have this name.
    """
    raw = name.encode("ascii", "replace")
    if not 0 < len(raw) <= MAX_NAME or not name.isascii():
        raise ValueError(f"expected a name of 1 to {MAX_NAME} ASCII characters, got '{name}'")
    return raw


def _param(message: dialect.MAVLink_param_value_message) -> Param:
    value: float = decimal_of_float32(message.param_value)
    if message.param_type not in _REALS and abs(value) < float("inf"):
        value = int(value)
    return Param(visible(str(message.param_id)), value, message.param_type)
