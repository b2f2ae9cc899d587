"""The command microservice (https://mavlink.io/en/services/command.html), client side.

The dialect has neither COMMAND_CANCEL nor MAV_RESULT_CANCELLED (both are work in progress in
common.xml), so that a client can only stop waiting for a command, not recall it.
"""

import copy
import math
from dataclasses import dataclass
from typing import TypeAlias

from mavlink_defs import dialect
from mavlink_defs.constants import INT32_MAX
from mavlink_defs.dialect import (
    MAVLink_command_ack_message,
    MAVLink_command_int_message,
    MAVLink_command_long_message,
    MAVLink_message,
)
from mavlink_defs.services.machine import SLOW_S, Machine, SystemId, is_for, sent_before

CommandMessage: TypeAlias = MAVLink_command_long_message | MAVLink_command_int_message

ACK_TIMEOUT_S = 0.5
MAX_SENDS = 8
_MAX_DOUBTED_S = 2.0  # less than a command is repeated for: some of its answers count
PROGRESS_TIMEOUT_S = 3.0
"""Time after MAV_RESULT_IN_PROGRESS at which a client sends the command again [s]."""

PROGRESS_UNKNOWN = 255
"""COMMAND_ACK.progress of a vehicle that does not report how far it is."""


@dataclass(frozen=True)
class CommandProgress:
    """The vehicle is executing a command; `percent` is None if it is not reported."""

    command: int
    percent: int | None


@dataclass(frozen=True)
class CommandFinished:
    """A command is over.

    Attributes:
        command: The MAV_CMD.
        result: Its MAV_RESULT; None when the vehicle did not answer or `cancel` was called.
        result_param1: Detail of the result, as the command defines it.
        result_param2: More of it.
        cancelled: Whether `cancel` was called.
    """

    command: int
    result: int | None
    result_param1: int = 0
    result_param2: int = 0
    cancelled: bool = False


def command_params(message: CommandMessage) -> tuple[float, ...]:
    """Return parameters 1 to 7 of a command in either form.

    In COMMAND_INT parameters 5 and 6 are integers and given as they are; INT32_MAX there
    stands for NaN.
    """
    m = message
    if isinstance(m, MAVLink_command_long_message):
        return (m.param1, m.param2, m.param3, m.param4, m.param5, m.param6, m.param7)
    x, y = (math.nan if value == INT32_MAX else float(value) for value in (m.x, m.y))
    return (m.param1, m.param2, m.param3, m.param4, x, y, m.z)


@dataclass(frozen=True)
class _Last:
    """The command before; `only_answer` is None when more of its answers may come."""

    command: int
    doubted_until: float
    only_answer: MAVLink_command_ack_message | None


class CommandClient(Machine[CommandProgress | CommandFinished]):
    """Sends one command at a time and repeats it until it is answered.

    An answer names only the MAV_CMD, so a delayed second answer could be taken for the one of the
    next command. For one timeout after a command, or as long as its answer took (at most 2 s),
    answers for the same MAV_CMD are therefore accepted only if they were sent later than the one
    that ended it, and not at all if it was repeated, as then more may be on their way; the next
    command is then sent once more.
    """

    def __init__(self, own: SystemId) -> None:
        super().__init__()
        self._own = own
        self._command: CommandMessage | None = None
        self._begun_s = 0.0
        self._sends = 0  # since the vehicle's last answer
        self._confirmation = 0
        self._deadline: float | None = None
        self._last: _Last | None = None

    @property
    def busy(self) -> bool:
        """Whether a command is in flight."""
        return self._command is not None

    def send(self, message: CommandMessage, now: float) -> None:
        """Send a command; its target fields name the vehicle.

        Raises:
            RuntimeError: A command is still in flight.
        """
        if self._command is not None:
            raise RuntimeError(f"command {self._command.command} is still in flight")
        self._command, self._begun_s = message, now
        self._sends = self._confirmation = 0
        self._transmit(now)

    def cancel(self, now: float) -> None:
        """Stop waiting. The vehicle is not notified: it may still execute the command."""
        if self._command is not None:
            self._finish(CommandFinished(self._command.command, None, cancelled=True), now)

    def receive(self, message: MAVLink_message, now: float) -> None:
        """Take in a COMMAND_ACK."""
        if not isinstance(message, MAVLink_command_ack_message) or not self._answers(message, now):
            return  # delayed or for another client: normal on a lossy link
        if message.result == dialect.MAV_RESULT_IN_PROGRESS:
            percent = None if message.progress == PROGRESS_UNKNOWN else message.progress
            self._happened.append(CommandProgress(message.command, percent))
            self._sends = 0
            self._deadline = now + PROGRESS_TIMEOUT_S
        else:
            finished = CommandFinished(
                message.command, message.result, message.progress, message.result_param2
            )
            self._finish(finished, now, message if self._confirmation == 1 else None)

    def handle_timer(self, now: float) -> None:
        """Send the command again, or give it up."""
        if self._command is None or self._deadline is None or now < self._deadline:
            return
        if self._sends < MAX_SENDS:
            self._transmit(now)
        elif self._is_worth_waiting(now):
            self._transmit(now)
            self._deadline = now + SLOW_S
        else:
            self._finish(CommandFinished(self._command.command, None), now)

    def deadline(self) -> float | None:
        """Return the time of the next repetition [s]."""
        return self._deadline

    def _answers(self, ack: MAVLink_command_ack_message, now: float) -> bool:
        sent = self._command
        if sent is None or ack.command != sent.command or not is_for(ack, self._own):
            return False
        if sent.target_system not in {0, ack.get_srcSystem()}:
            return False
        if sent.target_component not in {0, ack.get_srcComponent()}:
            return False
        last = self._last
        if last is None or last.command != ack.command or now >= last.doubted_until:
            return True
        return last.only_answer is not None and not sent_before(ack, last.only_answer)

    def _transmit(self, now: float) -> None:
        message = copy.copy(self._command)
        if isinstance(message, MAVLink_command_long_message):
            message.confirmation = min(self._confirmation, 255)  # counts repetitions
        if message is not None:
            self._outbox.append(message)
        self._sends += 1
        self._confirmation += 1
        self._deadline = now + ACK_TIMEOUT_S

    def _finish(
        self,
        event: CommandFinished,
        now: float,
        only_answer: MAVLink_command_ack_message | None = None,
    ) -> None:
        took_s = 0.0 if event.result is None else now - self._begun_s
        doubted_until = now + min(max(ACK_TIMEOUT_S, took_s), _MAX_DOUBTED_S)
        self._last = _Last(event.command, doubted_until, only_answer)
        self._command = self._deadline = None
        self._happened.append(event)
