"""The commands of one vehicle: those executed here, and those passed to the simulator.

Faults are passed to the simulator component of the own aircraft unread, and its answer is
passed back: the controller must not learn of a fault. Unknown commands are
answered UNSUPPORTED.
"""

from collections import deque
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TypeAlias

from mavlink_defs import dialect
from mavlink_defs.constants import SIMULATOR_COMPONENT
from mavlink_defs.dialect import MAVLink_command_long_message, MAVLink_message
from mavlink_defs.faults import COMMANDS as FAULT_COMMANDS
from mavlink_defs.services.command import (
    CommandClient,
    CommandFinished,
    CommandMessage,
    command_params,
)
from mavlink_defs.services.command_server import CommandReceived, CommandServer
from mavlink_defs.services.machine import SystemId

Handler: TypeAlias = Callable[[tuple[float, ...]], int]
"""Executes a command at once: its seven parameters in, MAV_RESULT out."""

FaultHandler: TypeAlias = Callable[[tuple[float, ...]], int | None]
"""The same of a command on faults; None: it is (also) for the simulator."""

PlaceHandler: TypeAlias = Callable[[CommandMessage], int]
"""The same for a command with a place, which its two forms give in different units."""


class Commands:
    """Receives commands from ground stations, has them executed and answers them."""

    def __init__(
        self,
        own: SystemId,
        handlers: Mapping[int, Handler],
        place_handlers: Mapping[int, PlaceHandler],
        fault_handlers: Mapping[int, FaultHandler] = MappingProxyType({}),
    ) -> None:
        """Start without pending commands.

        Args:
            own: SystemId of the vehicle.
            handlers: What carries out each MAV_CMD.
            place_handlers: What carries out those that have a place.
            fault_handlers: What carries out commands of faults, if not the simulator.
        """
        self._own, self._handlers, self._place_handlers = own, handlers, place_handlers
        self._fault_handlers = fault_handlers
        self._server = CommandServer(own)
        self._simulator = CommandClient(own)
        # for the simulator, each with the station that gave it; the first one is there
        self._waiting: deque[tuple[CommandReceived, int]] = deque()

    @property
    def asking(self) -> int:
        """Number of the ground station whose command is with the simulator; 0 if none is."""
        return self._waiting[0][1] if self._waiting else 0

    def receive(self, message: MAVLink_message, now: float, station: int) -> None:
        """Take in a message of a ground station, which has a number."""
        self._server.receive(message, now)
        for command in self._server.events():
            self._execute(command, now, station)
        self._pass_on(now)

    def receive_from_simulator(self, message: MAVLink_message, now: float) -> None:
        """Take in a message of the own aircraft's simulator component."""
        self._simulator.receive(message, now)
        self._pass_on(now)

    def handle_timer(self, now: float) -> None:
        """Do what is due."""
        self._server.handle_timer(now)
        self._simulator.handle_timer(now)
        self._pass_on(now)

    def deadline(self) -> float | None:
        """Return when `handle_timer` is to be called [s]; None if no timer runs."""
        timers = (self._server.deadline(), self._simulator.deadline())
        return min((at for at in timers if at is not None), default=None)

    def gcs_messages(self) -> list[MAVLink_message]:
        """Hand over what is to be sent to the ground stations."""
        return self._server.messages_to_send()

    def simulator_messages(self) -> list[MAVLink_message]:
        """Hand over what is to be sent to the simulator component."""
        return self._simulator.messages_to_send()

    def _pass_on(self, now: float) -> None:
        for done in self._simulator.events():
            if isinstance(done, CommandFinished):
                command, _ = self._waiting.popleft()
                result = dialect.MAV_RESULT_FAILED if done.result is None else done.result
                self._server.finish(command.token, result, now=now)
        if self._waiting and not self._simulator.busy:
            command, _ = self._waiting[0]
            self._simulator.send(_readdressed(command.message, self._own), now)

    def _execute(self, command: CommandReceived, now: float, station: int) -> None:
        number, params = command.message.command, command_params(command.message)
        is_fault_list = (
            number == dialect.MAV_CMD_REQUEST_MESSAGE
            and params[0] == dialect.MAVLINK_MSG_ID_FTC_FAULT
        )
        fault_handler = self._fault_handlers.get(number)
        done = None if fault_handler is None else fault_handler(params)
        if done is None and (number in FAULT_COMMANDS or is_fault_list):
            self._waiting.append((command, station))
            return
        result = dialect.MAV_RESULT_UNSUPPORTED if done is None else done
        if (handler := self._handlers.get(number)) is not None:
            result = handler(params)
        elif (place_handler := self._place_handlers.get(number)) is not None:
            result = place_handler(command.message)
        self._server.finish(command.token, result, now=now)


def _readdressed(message: CommandMessage, own: SystemId) -> MAVLink_command_long_message:
    """Return the same command for the own simulator component, as COMMAND_LONG.

    Unlike COMMAND_INT, that form marks repetitions.
    """
    target = (own.system, SIMULATOR_COMPONENT)
    return MAVLink_command_long_message(*target, message.command, 0, *command_params(message))
