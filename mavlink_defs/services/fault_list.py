"""Listing the faults of a vehicle: MAV_CMD_REQUEST_MESSAGE of FTC_FAULT, client side.

The vehicle sends one FTC_FAULT for each fault before it acknowledges. What was lost is
requested again.
"""

from collections.abc import Callable
from dataclasses import dataclass

from mavlink_defs import dialect
from mavlink_defs.dialect import MAVLink_ftc_fault_message, MAVLink_message
from mavlink_defs.faults.fault import Fault
from mavlink_defs.services.command import CommandClient, CommandFinished
from mavlink_defs.services.machine import Machine, SystemId

MAX_REQUESTS = 8
_GAP_TIMEOUT_S = 0.2  # after the acknowledgement nothing should be in transit


@dataclass(frozen=True)
class FaultsListed:
    """The list is complete, or unavailable.

    Attributes:
        result: MAV_RESULT; None when the vehicle did not answer.
        faults: The faults; `end_s` is infinite for those that last until cleared.
    """

    result: int | None
    faults: tuple[Fault, ...] = ()


class FaultList:
    """Collects the FTC_FAULT messages of a vehicle, in whatever order and however often."""

    def __init__(self) -> None:
        self._count: int | None = None
        self._faults: dict[int, Fault] = {}

    def receive(self, message: MAVLink_ftc_fault_message) -> None:
        """Take in one of the messages; one of an unknown actuator, sensor or kind is ignored."""
        if (fault := Fault.from_message(message)) is None:
            return
        if message.count != self._count or self._faults.get(message.index, fault) != fault:
            self._faults.clear()  # the list has changed in between
            self._count = message.count
        if message.count > 0:
            self._faults[message.index] = fault

    @property
    def complete(self) -> tuple[Fault, ...] | None:
        """All faults in their order; None while some are missing."""
        if len(self._faults) != self._count:
            return None
        return tuple(fault for _, fault in sorted(self._faults.items()))


class FaultLister(Machine[FaultsListed]):
    """Fetches the list of faults once."""

    def __init__(self, own: SystemId, vehicle: SystemId) -> None:
        super().__init__()
        self._vehicle = vehicle
        self._command = CommandClient(own)
        self._requests = 0
        self._list = FaultList()
        self._deadline: float | None = None

    def wait_while(self, is_worth_waiting: Callable[[float], bool]) -> None:
        """Wait for acknowledgements as `Machine` says."""
        self._command.wait_while(is_worth_waiting)

    def start(self, now: float) -> None:
        """Request the list."""
        self._requests += 1
        self._deadline = None
        params = (dialect.MAVLINK_MSG_ID_FTC_FAULT, *[0] * 6)
        message = dialect.MAVLink_command_long_message(
            *self._vehicle, dialect.MAV_CMD_REQUEST_MESSAGE, 0, *params
        )
        self._command.send(message, now)
        self._pass_on()

    def receive(self, message: MAVLink_message, now: float) -> None:
        """Take in an FTC_FAULT or the acknowledgement."""
        if isinstance(message, MAVLink_ftc_fault_message):
            if message.get_srcSystem() == self._vehicle.system:
                self._list.receive(message)
        else:
            self._command.receive(message, now)
        for done in self._command.events():
            if not isinstance(done, CommandFinished):
                continue
            if done.result != dialect.MAV_RESULT_ACCEPTED:
                self._happened.append(FaultsListed(done.result))
            elif self._list.complete is not None:
                self._finish(self._list.complete)
            elif self._requests >= MAX_REQUESTS:
                self._happened.append(FaultsListed(None))
            else:
                self._deadline = now + _GAP_TIMEOUT_S
        if self._deadline is not None and self._list.complete is not None:
            self._finish(self._list.complete)
        self._pass_on()

    def handle_timer(self, now: float) -> None:
        """Repeat the request if it is unanswered or faults are missing."""
        self._command.handle_timer(now)
        for done in self._command.events():
            if isinstance(done, CommandFinished):
                self._happened.append(FaultsListed(done.result))
        if self._deadline is not None and now >= self._deadline:
            self.start(now)
        self._pass_on()

    def deadline(self) -> float | None:
        """Return the time of the next request [s]."""
        return self._command.deadline() if self._deadline is None else self._deadline

    def _finish(self, faults: tuple[Fault, ...]) -> None:
        self._deadline = None
        self._happened.append(FaultsListed(dialect.MAV_RESULT_ACCEPTED, faults))

    def _pass_on(self) -> None:
        self._outbox += self._command.messages_to_send()
