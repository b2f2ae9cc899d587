"""The mission microservice (https://mavlink.io/en/services/mission.html), client side.

`MissionUploader` and `MissionDownloader` each do their operation once, with one vehicle and one
mission type; the vehicle's side is `mavlink_defs.services.mission_server`.
Times and retries are those that the protocol recommends, but for `ITEM_TIMEOUT_S`, which leaves
a busy machine more than 250 ms.
"""

import copy
import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

from mavlink_defs import dialect
from mavlink_defs.constants import INT32_MAX
from mavlink_defs.dialect import (
    MAVLink_message,
    MAVLink_mission_ack_message,
    MAVLink_mission_count_message,
    MAVLink_mission_item_int_message,
    MAVLink_mission_item_message,
    MAVLink_mission_request_int_message,
    MAVLink_mission_request_list_message,
    MAVLink_mission_request_message,
)
from mavlink_defs.float32 import decimal_of_float32
from mavlink_defs.services.machine import SLOW_S, Machine, SystemId, is_for, sender_of

MissionItem: TypeAlias = MAVLink_mission_item_int_message

RESPONSE_TIMEOUT_S = 1.5
ITEM_TIMEOUT_S = 0.5
MAX_RETRIES = 5
MAX_REPEATS = 100
"""Requests of items that were sent before, since the last new one: autopilots give up earlier."""


@dataclass(frozen=True)
class MissionProgress:
    """Progress of a transfer: items that have crossed the link, and their total."""

    done: int
    total: int


@dataclass(frozen=True)
class MissionFinished:
    """An operation is over.

    Attributes:
        result: MAV_MISSION_RESULT; None when the vehicle did not answer.
        items: The mission, after a download that succeeded.
    """

    result: int | None
    items: tuple[MissionItem, ...] = ()


def item_as_int(item: MissionItem | MAVLink_mission_item_message) -> MissionItem:
    """Convert a legacy MISSION_ITEM, whose x and y are degrees; other items are only copied.

    What no int32 can hold becomes INT32_MAX, which MAVLink reads as "no value".
    """
    if isinstance(item, MAVLink_mission_item_int_message):
        return copy.copy(item)
    fields = [getattr(item, name) for name in MAVLink_mission_item_message.fieldnames]
    for index in (11, 12):
        fields[index] = _deg_e7(fields[index])
    return MAVLink_mission_item_int_message(*fields)


def _deg_e7(degrees: float) -> int:
    scaled = decimal_of_float32(degrees) * 1e7
    return round(scaled) if abs(scaled) < INT32_MAX else INT32_MAX  # NaN, too


class _MissionClient(Machine[MissionProgress | MissionFinished]):
    """One operation with one vehicle: a request is repeated until it is answered."""

    def __init__(
        self, own: SystemId, vehicle: SystemId, mission_type: int = dialect.MAV_MISSION_TYPE_MISSION
    ) -> None:
        super().__init__()
        self._own, self._vehicle, self._mission_type = own, vehicle, mission_type
        self._request: MAVLink_message | None = None
        self._timeout_s = math.inf
        self._retries = 0
        self._deadline: float | None = None

    @property
    def busy(self) -> bool:
        """Whether the operation is in progress."""
        return self._request is not None

    def start(self, now: float) -> None:
        """Begin the operation.

        Raises:
            RuntimeError: It is in progress already.
        """
        if self.busy:
            raise RuntimeError("the mission operation has begun already")
        self._ask(self._first_request(), RESPONSE_TIMEOUT_S, now)

    def cancel(self) -> None:
        """Cancel the operation, and notify the vehicle."""
        if self.busy:
            self._acknowledge(dialect.MAV_MISSION_OPERATION_CANCELLED)
            self._finish(dialect.MAV_MISSION_OPERATION_CANCELLED)

    def receive(self, message: MAVLink_message, now: float) -> None:
        """Take in a message of the vehicle."""
        if (
            self.busy
            and sender_of(message) == self._vehicle
            and is_for(message, self._own)
            and getattr(message, "mission_type", None) == self._mission_type
        ):
            self._answer(message, now)

    def handle_timer(self, now: float) -> None:
        """Send the last request again, or give up."""
        if self._request is None or self._deadline is None or now < self._deadline:
            return
        if self._retries >= MAX_RETRIES and not self._is_worth_waiting(now):
            self._finish(None)
        else:
            slow_s = SLOW_S if self._retries >= MAX_RETRIES else 0.0
            self._retries += 1
            self._outbox.append(copy.copy(self._request))
            self._deadline = now + max(self._timeout_s, slow_s)

    def deadline(self) -> float | None:
        """Return the time of the next repetition [s]."""
        return self._deadline

    @abstractmethod
    def _first_request(self) -> MAVLink_message: ...

    @abstractmethod
    def _answer(self, message: MAVLink_message, now: float) -> None: ...

    def _ask(self, request: MAVLink_message, timeout_s: float, now: float) -> None:
        self._request, self._timeout_s, self._retries = request, timeout_s, 0
        self._outbox.append(copy.copy(request))
        self._deadline = now + timeout_s

    def _acknowledge(self, result: int) -> None:
        ack = MAVLink_mission_ack_message(*self._vehicle, result, self._mission_type)
        self._outbox.append(ack)

    def _finish(self, result: int | None, items: Sequence[MissionItem] = ()) -> None:
        self._request = self._deadline = None
        self._happened.append(MissionFinished(result, tuple(items)))


class MissionUploader(_MissionClient):
    """Uploads a mission to a vehicle; without items it clears the mission.

    The vehicle requests each item. While it does not answer, the last message is repeated: a
    MISSION_COUNT begins the upload again, a last item makes the vehicle repeat its MISSION_ACK.
    One that asks for what it has been sent `MAX_REPEATS` times is not waited for any longer: the
    result is MAV_MISSION_INVALID_SEQUENCE.
    """

    def __init__(
        self,
        own: SystemId,
        vehicle: SystemId,
        items: Sequence[MissionItem],
        mission_type: int = dialect.MAV_MISSION_TYPE_MISSION,
    ) -> None:
        super().__init__(own, vehicle, mission_type)
        if [item.seq for item in items] != list(range(len(items))):
            raise ValueError("the items of a mission must be numbered from 0")
        self._items = [copy.copy(item) for item in items]
        for item in self._items:
            item.target_system, item.target_component = vehicle
            item.mission_type = mission_type
        self._sent = 0  # items requested so far, in order
        self._repeats = 0  # requests of earlier ones since the last of these

    def _first_request(self) -> MAVLink_message:
        self._sent = 0
        return MAVLink_mission_count_message(*self._vehicle, len(self._items), self._mission_type)

    def _answer(self, message: MAVLink_message, now: float) -> None:
        if isinstance(
            message, MAVLink_mission_request_int_message | MAVLink_mission_request_message
        ):
            self._send_item(message.seq, now)
        elif isinstance(message, MAVLink_mission_ack_message) and (
            # An acceptance before the last item is sent belongs to an earlier upload.
            message.type != dialect.MAV_MISSION_ACCEPTED or self._sent == len(self._items)
        ):
            self._finish(message.type)

    def _send_item(self, seq: int, now: float) -> None:
        if seq > self._sent or seq >= len(self._items):
            return  # requested for an earlier upload: this one's requests come in order, from 0
        if seq == self._sent:
            self._sent += 1
            self._repeats = 0
            self._happened.append(MissionProgress(self._sent, len(self._items)))
        else:
            self._repeats += 1
            if self._repeats > MAX_REPEATS:
                self._acknowledge(dialect.MAV_MISSION_OPERATION_CANCELLED)
                self._finish(dialect.MAV_MISSION_INVALID_SEQUENCE)
                return
        self._ask(self._items[seq], RESPONSE_TIMEOUT_S, now)


class MissionDownloader(_MissionClient):
    """Fetches the mission of a vehicle, item by item."""

    _count: int | None
    _items: list[MissionItem]

    def _first_request(self) -> MAVLink_message:
        self._count, self._items = None, []
        return MAVLink_mission_request_list_message(*self._vehicle, self._mission_type)

    def _answer(self, message: MAVLink_message, now: float) -> None:
        if isinstance(message, MAVLink_mission_count_message) and self._count is None:
            self._count = message.count
            self._ask_next(now)
        elif isinstance(message, MAVLink_mission_item_int_message | MAVLink_mission_item_message):
            if self._count is not None and message.seq == len(self._items):
                self._items.append(item_as_int(message))
                self._happened.append(MissionProgress(len(self._items), self._count))
                self._ask_next(now)
        elif (
            isinstance(message, MAVLink_mission_ack_message)
            and message.type != dialect.MAV_MISSION_ACCEPTED
        ):
            self._finish(message.type)

    def _ask_next(self, now: float) -> None:
        seq = len(self._items)
        if seq == self._count:
            self._acknowledge(dialect.MAV_MISSION_ACCEPTED)
            self._finish(dialect.MAV_MISSION_ACCEPTED, self._items)
        else:
            request = MAVLink_mission_request_int_message(*self._vehicle, seq, self._mission_type)
            self._ask(request, ITEM_TIMEOUT_S, now)
