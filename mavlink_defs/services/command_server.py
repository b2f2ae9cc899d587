"""The command microservice (https://mavlink.io/en/services/command.html), vehicle side."""

import copy
import math
import struct
from dataclasses import dataclass, field

from mavlink_defs import dialect
from mavlink_defs.dialect import (
    MAVLink_command_ack_message,
    MAVLink_command_int_message,
    MAVLink_command_long_message,
    MAVLink_message,
)
from mavlink_defs.services.command import (
    ACK_TIMEOUT_S,
    MAX_SENDS,
    PROGRESS_TIMEOUT_S,
    PROGRESS_UNKNOWN,
    CommandMessage,
    command_params,
)
from mavlink_defs.services.machine import Machine, SystemId, is_for, sender_of, sent_before

CONFIRMED_WINDOW_S = PROGRESS_TIMEOUT_S + MAX_SENDS * ACK_TIMEOUT_S + 1.0
"""Time after its answer within which a command may be repeated (confirmation > 0) [s]."""

LATE_S = 0.1
"""Longest delay of a datagram or its duplicate in the network [s]; no client repeats sooner."""

PENDING_TIMEOUT_S = 10.0
"""Time that an executor may take before the vehicle answers FAILED [s]."""

MAX_PENDING = 32
_MAX_RECORDS = 2 * MAX_PENDING

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
    dialect.MAV_CMD_FTC_SET_SENSOR_FAULT: _FAULTS,
    dialect.MAV_CMD_FTC_CLEAR_FAULTS: _FAULTS,
    dialect.MAV_CMD_INJECT_FAILURE: _FAULTS,
    dialect.MAV_CMD_SET_MESSAGE_INTERVAL: _STREAMS,
}
"""Subject that a command changes: _FLIGHT if it is not listed, none if in _QUESTIONS."""
_CHANGED_BY_MESSAGE = {
    dialect.MAVLINK_MSG_ID_SET_MODE: _FLIGHT,
    dialect.MAVLINK_MSG_ID_MISSION_COUNT: _FLIGHT,
    dialect.MAVLINK_MSG_ID_MISSION_ITEM: _FLIGHT,
    dialect.MAVLINK_MSG_ID_MISSION_ITEM_INT: _FLIGHT,
    dialect.MAVLINK_MSG_ID_MISSION_CLEAR_ALL: _FLIGHT,
    dialect.MAVLINK_MSG_ID_MISSION_SET_CURRENT: _FLIGHT,
    dialect.MAVLINK_MSG_ID_REQUEST_DATA_STREAM: _STREAMS,
}
"""Subject that another message changes. Parameters are left out: no command changes them."""


@dataclass(frozen=True)
class CommandReceived:
    """A command to be executed, once; answer with `CommandServer.finish(token, ...)`."""

    token: int
    message: CommandMessage
    sender: SystemId


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
    progress: int = PROGRESS_UNKNOWN
    deadline: float = field(default=math.inf)  # finite while it is pending


@dataclass(frozen=True)
class _Change:
    """The last message that changed something; it came after all commands of lower tokens."""

    token: int
    message: MAVLink_message
    received: float

    def is_late(self, message: MAVLink_message, now: float) -> bool:
        """Return whether a message that arrives now may have been sent before this execution."""
        from_others = sender_of(message) != sender_of(self.message)
        return now <= self.received + LATE_S and (from_others or sent_before(message, self.message))


class CommandServer(Machine[CommandReceived]):
    """Passes commands on to be executed, and answers them.

    Every command that arrives is executed, since all commands here are idempotent, except:

    - one that is still pending: it is answered with IN_PROGRESS;
    - a repetition (confirmation > 0) of an executed one: it gets the same answer again, unless
      something that the command acts on was changed since (it may be a new command, whose
      first datagram was lost) or it is a question (its sender wants a new answer);
    - a datagram that the network duplicated or held back for up to `LATE_S`. It is dropped, so
      that it cannot undo later commands: the same sequence number and content, or a repetition just
      after such a change. A client that still wants it repeats it.

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
        """Answer a command; no effect on one that has already timed out.

        Args:
            token: The token of its `CommandReceived`.
            result: MAV_RESULT; IN_PROGRESS leaves the command pending and restarts its timeout.
            now: Time [s].
            progress: Percent for IN_PROGRESS (None: not known), else result_param1.
            result_param2: More detail of the result.
        """
        record = next((r for r in self._records if r.token == token and r.ack is None), None)
        if record is None:
            return
        if result == dialect.MAV_RESULT_IN_PROGRESS:
            record.progress = PROGRESS_UNKNOWN if progress is None else progress
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
        """Return the time at which the first pending command times out [s]."""
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
        else:  # COMMAND_INT marks no repetition; it is one if sent before the answer could arrive
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
