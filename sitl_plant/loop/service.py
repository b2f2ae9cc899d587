"""The simulator component of one aircraft: arming state and fault commands.

No socket and no clock: messages and the time go in, messages to send come out.
"""

from mavlink_defs import dialect
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.faults import SETTING
from mavlink_defs.faults.aircraft import AircraftFaults
from mavlink_defs.faults.command import InvalidParam
from mavlink_defs.framing.frames import text_chunks
from mavlink_defs.services.command import CommandMessage, command_params
from mavlink_defs.services.command_server import CommandServer
from mavlink_defs.services.machine import SystemId


class AircraftService:
    """The simulator component of one aircraft.

    Attributes:
        armed: Whether its autopilot's last HEARTBEAT reported it armed. An autopilot that is
            armed in its first HEARTBEAT was armed for another plant's flight: it counts as
            armed only after it has been disarmed once.
    """

    def __init__(self, system: int, component: int, faults: AircraftFaults) -> None:
        self.armed = False
        self._disarmed_before = False
        self._faults = faults
        self._commands = CommandServer(SystemId(system, component))
        self._outbox: list[MAVLink_message] = []
        self._texts = 0

    def receive(self, message: MAVLink_message, time_s: float, now: float) -> None:
        """Take in a message of the aircraft's autopilot.

        Args:
            message: Any message; irrelevant ones are ignored.
            time_s: Simulation time [s].
            now: Wall-clock time [s].
        """
        if isinstance(message, dialect.MAVLink_heartbeat_message):
            armed = bool(message.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED)
            self._disarmed_before |= not armed
            self.armed = armed and self._disarmed_before
        self._commands.receive(message, now)
        for command in self._commands.events():
            result = self._execute(command.message, time_s)
            self._commands.finish(command.token, result, now=now)

    def messages_to_send(self) -> list[MAVLink_message]:
        """Hand over what is to be sent to the autopilot."""
        messages, self._outbox = self._outbox + self._commands.messages_to_send(), []
        return messages

    def _execute(self, message: CommandMessage, time_s: float) -> int:
        params, family = command_params(message), SETTING.get(message.command)
        try:
            if family is not None:
                self._faults.set(family, params, time_s)
                return dialect.MAV_RESULT_ACCEPTED
            match message.command:
                case dialect.MAV_CMD_FTC_CLEAR_FAULTS:
                    self._faults.clear(params[0])
                case dialect.MAV_CMD_INJECT_FAILURE:
                    return self._faults.inject(params, time_s)
                case dialect.MAV_CMD_REQUEST_MESSAGE:
                    self._list_faults(time_s)
                case _:
                    return dialect.MAV_RESULT_UNSUPPORTED
        except (InvalidParam, OverflowError) as problem:
            self._say(str(problem))
            return dialect.MAV_RESULT_DENIED
        return dialect.MAV_RESULT_ACCEPTED

    def _list_faults(self, time_s: float) -> None:
        listed = [fault.message(time_s) for fault in self._faults.listed()]
        for i, message in enumerate(listed):
            message.index, message.count = i, len(listed)
        self._outbox += listed or [dialect.MAVLink_ftc_fault_message(0, 0, 0, 0, 0, 0, 0, 0, 0)]

    def _say(self, text: str) -> None:
        self._texts += 1
        self._outbox += text_chunks(dialect.MAV_SEVERITY_WARNING, text, self._texts)
