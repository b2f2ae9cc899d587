"""The command microservice (https://mavlink.io/en/services/command.html), both sides.

The dialect has neither COMMAND_CANCEL nor MAV_RESULT_CANCELLED (both are work in progress in
common.xml), so that a client can only stop waiting for a command, not recall it.
"""

import copy
import math
import struct
from dataclasses import dataclass, field
from typing import TypeAlias

from mavlink_defs import dialect
from mavlink_defs.dialect import (
    MAVLink_command_ack_message,
    MAVLink_command_int_message,
    MAVLink_command_long_message,
    MAVLink_message,
)
from mavlink_defs.services.machine import Machine, SystemId, is_for, sender_of

__all__ = [
    "ACK_TIMEOUT_S",
    "CONFIRMED_WINDOW_S",
    "LATE_S",
    "MAX_PENDING",
    "MAX_SENDS",
    "PENDING_TIMEOUT_S",
    "PROGRESS_TIMEOUT_S",
    "CommandClient",
    "CommandFinished",
    "CommandMessage",
    "CommandProgress",
    "CommandReceived",
    "CommandServer",
    "command_params",
]

CommandMessage: TypeAlias = MAVLink_command_long_message | MAVLink_command_int_message

ACK_TIMEOUT_S = 0.5
MAX_SENDS = 8
PROGRESS_TIMEOUT_S = 3.0
"""When a client asks again after MAV_RESULT_IN_PROGRESS."""

CONFIRMED_WINDOW_S = PROGRESS_TIMEOUT_S + MAX_SENDS * ACK_TIMEOUT_S + 1.0
"""How long after its answer a command may come again (confirmation > 0) because that got lost."""

LATE_S = 0.1
"""How long the network may hold a datagram back, or its duplicate; nobody repeats sooner."""

PENDING_TIMEOUT_S = 10.0
"""How long an executor may take before the vehicle answers FAILED for it."""

MAX_PENDING = 32
_MAX_RECORDS = 2 * MAX_PENDING

_PROGRESS_UNKNOWN = 255
_INT32_MAX = 2**31 - 1

_QUESTIONS = {
    dialect.MAV_CMD_REQUEST_MESSAGE,
    dialect.MAV_CMD_GET_HOME_POSITION,
    dialect.MAV_CMD_GET_MESSAGE_INTERVAL,
    dialect.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES,
}
"""Commands that change nothing."""
_FLIGHT, _FAULTS, _STREAMS = "flight", "faults", "streams"
_CHANGED_BY_COMMAND = {
    dialect.MAV_CMD_FTC_SET_FAULT: _FAULTS,
    dialect.MAV_CMD_FTC_CLEAR_FAULTS: _FAULTS,
    dialect.MAV_CMD_INJECT_FAILURE: _FAULTS,
    dialect.MAV_CMD_SET_MESSAGE_INTERVAL: _STREAMS,
}
"""What a command changes; _FLIGHT if it is not here, nothing if it is one of the _QUESTIONS."""
_CHANGED_BY_MESSAGE = {
    dialect.MAVLINK_MSG_ID_SET_MODE: _FLIGHT,
    dialect.MAVLINK_MSG_ID_MISSION_COUNT: _FLIGHT,
    dialect.MAVLINK_MSG_ID_MISSION_ITEM: _FLIGHT,
    dialect.MAVLINK_MSG_ID_MISSION_ITEM_INT: _FLIGHT,
    dialect.MAVLINK_MSG_ID_MISSION_CLEAR_ALL: _FLIGHT,
    dialect.MAVLINK_MSG_ID_MISSION_SET_CURRENT: _FLIGHT,
    dialect.MAVLINK_MSG_ID_REQUEST_DATA_STREAM: _STREAMS,
}
"""What other messages change. Parameters are missing: no command changes them, too."""


@dataclass(frozen=True)
class CommandProgress:
    """The vehicle is at work on a command; `percent` is None when it does not say how far."""

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


@dataclass(frozen=True)
class CommandReceived:
    """A command to be executed, once; answer with `CommandServer.finish(token, ...)`."""

    token: int
    message: CommandMessage
    sender: SystemId


def command_params(message: CommandMessage) -> tuple[float, ...]:
    """Return parameters 1 to 7 of a command in either form.

    In COMMAND_INT parameters 5 and 6 are integers and given as they are; INT32_MAX there
    stands for NaN.
    """
    m = message
    if isinstance(m, MAVLink_command_long_message):
        return (m.param1, m.param2, m.param3, m.param4, m.param5, m.param6, m.param7)
    x, y = (math.nan if value == _INT32_MAX else float(value) for value in (m.x, m.y))
    return (m.param1, m.param2, m.param3, m.param4, x, y, m.z)


@dataclass(frozen=True)
class _Last:
    """The command before; `only_answer` is None when more of its answers may come."""

    command: int
    doubted_until: float
    only_answer: MAVLink_command_ack_message | None


class CommandClient(Machine[CommandProgress | CommandFinished]):
    """Sends one command at a time and repeats it until it is answered.

    An answer names only the MAV_CMD, so a late second answer could pass for that of the next
    command. For one timeout after a command, answers for the same MAV_CMD are therefore
    believed only if they were sent later than the one that ended it, and not at all if it was
    repeated, as then more may be on their way; the next command is then sent once more.
    """

    def __init__(self, own: SystemId) -> None:
        super().__init__()
        self._own = own
        self._command: CommandMessage | None = None
        self._sends = 0  # since the vehicle was last heard
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
        self._command = message
        self._sends = self._confirmation = 0
        self._transmit(now)

    def cancel(self, now: float) -> None:
        """Stop waiting. The vehicle is not told: it may still execute the command."""
        if self._command is not None:
            self._finish(CommandFinished(self._command.command, None, cancelled=True), now)

    def receive(self, message: MAVLink_message, now: float) -> None:
        """Take in a COMMAND_ACK."""
        if not isinstance(message, MAVLink_command_ack_message) or not self._answers(message, now):
            return  # late or foreign: normal on a lossy link
        if message.result == dialect.MAV_RESULT_IN_PROGRESS:
            percent = None if message.progress == _PROGRESS_UNKNOWN else message.progress
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
        if self._sends >= MAX_SENDS:
            self._finish(CommandFinished(self._command.command, None), now)
        else:
            self._transmit(now)

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
        return last.only_answer is not None and not _sent_before(ack, last.only_answer)

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
        self._last = _Last(event.command, now + ACK_TIMEOUT_S, only_answer)
        self._command = self._deadline = None
        self._happened.append(event)


@dataclass
class _Record:
    """A command that was received, and its answer when there is one."""

    token: int
    sender: SystemId
    message: CommandMessage
    content: bytes
    received: float
    answered: float = math.inf
    ack: MAVLink_command_ack_message | None = None
    progress: int = _PROGRESS_UNKNOWN
    deadline: float = field(default=math.inf)  # finite while it is pending


@dataclass(frozen=True)
class _Change:
    """The last message that changed something; it came after all commands of lower tokens."""

    token: int
    message: MAVLink_message
    received: float

    def is_late(self, message: MAVLink_message, now: float) -> bool:
        """Whether a message that arrives now may have been sent before this one was executed."""
        from_others = sender_of(message) != sender_of(self.message)
        return now <= self.received + LATE_S and (
            from_others or _sent_before(message, self.message)
        )


class CommandServer(Machine[CommandReceived]):
    """Passes commands on to be executed, and answers them.

    Every command that arrives is executed, as all of ours leave the vehicle in the same state
    when given twice, but for:

    - one that is still pending: its sender is told so;
    - a repetition (confirmation > 0) of an executed one: it gets the same answer again, unless
      something that the command acts on was changed since (it may be a new command, whose
      first datagram was lost) or it only asks (its sender wants to know anew);
    - a datagram that the network duplicated or held back for up to `LATE_S`. It is dropped, so
      that it cannot undo what was commanded meanwhile: the same sequence number and content, or
      a repetition just after such a change. Who still means it says it again.

    Besides commands, it must be given all messages that change what commands act on.
    """

    def __init__(self, own: SystemId) -> None:
        super().__init__()
        self._own = own
        self._records: list[_Record] = []  # oldest first
        self._changes: dict[str, _Change] = {}
        self._next_token = 1

    def receive(self, message: MAVLink_message, now: float) -> None:
        """Take in any message; commands are answered."""
        if not is_for(message, self._own):
            return
        if isinstance(message, MAVLink_command_long_message | MAVLink_command_int_message):
            self._on_command(message, now)
        elif message.get_msgId() in _CHANGED_BY_MESSAGE:
            self._note_change(_CHANGED_BY_MESSAGE[message.get_msgId()], message, now)

    def finish(
        self,
        token: int,
        result: int,
        *,
        now: float,
        progress: int | None = None,
        result_param2: int = 0,
    ) -> None:
        """Answer a command; one that is already answered (for lack of time) stays so.

        Args:
            token: The token of its `CommandReceived`.
            result: MAV_RESULT; IN_PROGRESS leaves the command pending, with new patience.
            now: Time [s].
            progress: Percent for IN_PROGRESS (None: not known), else result_param1.
            result_param2: More detail of the result.
        """
        record = next((r for r in self._records if r.token == token and r.ack is None), None)
        if record is None:
            return
        if result == dialect.MAV_RESULT_IN_PROGRESS:
            record.progress = _PROGRESS_UNKNOWN if progress is None else progress
            record.deadline = now + PENDING_TIMEOUT_S
            self._outbox.append(_ack(record, result, record.progress, result_param2))
        else:
            record.deadline, record.answered = math.inf, now
            record.ack = _ack(record, result, progress or 0, result_param2)
            self._outbox.append(copy.copy(record.ack))

    def handle_timer(self, now: float) -> None:
        """Answer FAILED for commands that have been pending too long."""
        for record in self._records:
            if record.deadline <= now:
                self.finish(record.token, dialect.MAV_RESULT_FAILED, now=now)

    def deadline(self) -> float | None:
        """Return the time at which the patience with a pending command ends [s]."""
        earliest = min((r.deadline for r in self._records), default=math.inf)
        return None if earliest == math.inf else earliest

    def _on_command(self, message: CommandMessage, now: float) -> None:
        sender, content = sender_of(message), _content(message)
        record = next(
            (r for r in reversed(self._records) if (r.sender, r.content) == (sender, content)), None
        )
        if record is None or now > record.answered + CONFIRMED_WINDOW_S:
            self._accept(message, sender, content, now)
            return
        if message.get_seq() == record.message.get_seq() and now <= record.received + LATE_S:
            return  # the network has duplicated it
        subject = _changed_by(message)
        change = self._changes[subject] if subject is not None else None
        if isinstance(message, MAVLink_command_long_message):
            may_repeat = repeats = message.confirmation > 0
        else:  # does not say; it does if it was sent before its sender can have had the answer
            may_repeat, repeats = True, now <= record.answered + 2.0 * LATE_S
        if change is not None and change.token > record.token:
            if not (may_repeat and change.is_late(message, now)):
                self._accept(message, sender, content, now)
        elif record.ack is None:
            in_progress = dialect.MAV_RESULT_IN_PROGRESS
            self._outbox.append(_ack(record, in_progress, record.progress, 0))
        elif change is not None and repeats:
            self._outbox.append(copy.copy(record.ack))
        else:
            self._accept(message, sender, content, now)

    def _accept(
        self, message: CommandMessage, sender: SystemId, content: bytes, now: float
    ) -> None:
        record = _Record(self._next_token, sender, message, content, received=now)
        if sum(r.ack is None for r in self._records) >= MAX_PENDING:
            result = dialect.MAV_RESULT_TEMPORARILY_REJECTED
            self._outbox.append(_ack(record, result, 0, 0))
            return
        record.deadline = now + PENDING_TIMEOUT_S
        self._records.append(record)
        if len(self._records) > _MAX_RECORDS:
            self._records.remove(next(r for r in self._records if r.ack is not None))
        self._note_change(_changed_by(message), message, now)
        self._happened.append(CommandReceived(record.token, message, sender))

    def _note_change(self, subject: str | None, message: MAVLink_message, now: float) -> None:
        if subject is not None:
            self._changes[subject] = _Change(self._next_token, message, now)
        self._next_token += 1


def _changed_by(command: CommandMessage) -> str | None:
    if command.command in _QUESTIONS:
        return None
    return _CHANGED_BY_COMMAND.get(command.command, _FLIGHT)


def _sent_before(message: MAVLink_message, other: MAVLink_message) -> bool:
    return (other.get_seq() - message.get_seq()) % 256 < 128


def _content(message: CommandMessage) -> bytes:
    """Return all that makes a command, as bytes: NaN is equal to itself there."""
    form = [message.get_msgId(), message.command, message.target_system, message.target_component]
    if isinstance(message, MAVLink_command_int_message):
        form += [message.frame, message.current, message.autocontinue]
    return struct.pack(f"<{len(form)}I7d", *form, *command_params(message))


def _ack(
    record: _Record, result: int, progress: int, result_param2: int
) -> MAVLink_command_ack_message:
    return MAVLink_command_ack_message(
        record.message.command,
        result,
        progress,
        result_param2,
        target_system=record.sender.system,
        target_component=record.sender.component,
    )
