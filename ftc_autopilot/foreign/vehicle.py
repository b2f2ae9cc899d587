"""The MAVLink of a foreign autopilot, as its bridge passes it on; no socket and no clock.

What the autopilot sends goes to the ground stations, and theirs to it. Commands on faults of
actuators go to the plant, those on faults of sensors are executed by the bridge, which makes these:
the autopilot does not hear of them, as ours does not. A slot is ordered of the bridge, too.
"""

from collections import deque
from collections.abc import Callable
from functools import partial
from pathlib import Path

from ftc_autopilot.foreign.datagrams import frames_in
from ftc_autopilot.foreign.resumption import GivenAgain
from ftc_autopilot.foreign.sensor_faults import SensorFaults
from ftc_autopilot.vehicle.commands import Commands, Handler
from ftc_autopilot.vehicle.formation_messages import slot_ordered
from ftc_autopilot.vehicle.telemetry import DEFAULT_INTERVALS_US
from mavlink_defs import dialect
from mavlink_defs.constants import SIMULATOR_COMPONENT
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.faults import COMMANDS as FAULT_COMMANDS
from mavlink_defs.faults.command import InvalidParam
from mavlink_defs.framing.frames import FramePacker, parse, text_chunks
from mavlink_defs.framing.header import HEADER_SIZE, MESSAGE_ID
from mavlink_defs.origin import Origin
from mavlink_defs.services.command import CommandMessage, command_params
from mavlink_defs.services.machine import SystemId, is_for, sender_of
from sitl_plant.vec3 import Vec3

_FIRST_PRIVATE = 53_000
_EXECUTED = {*FAULT_COMMANDS, dialect.MAV_CMD_FTC_SET_SLOT}
_OWN_REQUESTS = {dialect.MAVLINK_MSG_ID_FTC_FAULT, dialect.MAVLINK_MSG_ID_FTC_EVENTS}
_ASKED_OF_IT = [n for n in DEFAULT_INTERVALS_US if n < _FIRST_PRIVATE]
_READ = {
    dialect.MAVLINK_MSG_ID_HEARTBEAT,
    dialect.MAVLINK_MSG_ID_SYS_STATUS,
    dialect.MAVLINK_MSG_ID_COMMAND_ACK,
    dialect.MAVLINK_MSG_ID_MISSION_ACK,
    dialect.MAVLINK_MSG_ID_MISSION_CURRENT,
    dialect.MAVLINK_MSG_ID_MISSION_REQUEST,
    dialect.MAVLINK_MSG_ID_MISSION_REQUEST_INT,
    dialect.MAVLINK_MSG_ID_PARAM_VALUE,
}
"""What the bridge itself reads of what it sends."""
_ANSWER_S = 0.1
"""How long it takes to answer a message, by its clock: its loop has 50 Hz, its link 100 Hz."""
_SHOWS_S = 1.2
"""The same of a command whose effect is in its next HEARTBEAT."""
_LISTS_S = 20.0
"""The same of the list of its parameters."""
_MOST_WAITING = 2000
"""Messages of stations that wait for it, and commands whose answers are kept. What comes beyond is
lost, as in the buffer of a socket: nobody fills the memory, or holds it before it is armed."""
_SILENT_S = 1.0
_REPETITIONS = range(1, 6)
"""COMMAND_LONG.confirmation of what is taken for repeated; a later one may have been lost."""
_BESIDE = (dialect.MAVLINK_MSG_ID_SYS_STATUS, dialect.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT)


class ForeignVehicle:
    """One foreign autopilot's MAVLink.

    Attributes:
        is_armed: Whether it is armed, by its last HEARTBEAT.
        resumption: What it has been given, for one that is started again.
    """

    def __init__(
        self,
        system: int,
        origin: Origin,
        counts: Callable[[], MAVLink_message],
        faults: SensorFaults,
        checkpoint: Path | None = None,
        order_slot: Callable[[Vec3 | None], None] | None = None,
    ) -> None:
        """Begin before it is heard.

        Args:
            system: System id of the UAV.
            origin: Its home: it would be where it is held.
            counts: Returns FTC_EVENTS.
            faults: Of the sensors that its bridge makes.
            checkpoint: Where what it has been given is kept; None: nowhere.
            order_slot: Orders another slot, None: the planned one; None: it keeps none.
        """
        self._order_slot = order_slot
        self._counts = counts
        self._system, self._origin = system, origin
        self._has_home = False
        self._own = SystemId(system, dialect.MAV_COMP_ID_AUTOPILOT1)
        self._bridge = SystemId(system, SIMULATOR_COMPONENT)  # its own commands come from there
        self.is_armed = self._is_checked = self._is_heard = False
        self.resumption = GivenAgain(self._own, self._bridge, checkpoint)
        self._from_stations: deque[tuple[bytes, float]] = deque()  # each with how long it takes
        self._asked: dict[tuple[SystemId, int], tuple[tuple[float, ...], bytes | None]] = {}
        self._beat: MAVLink_message | None = None  # its last HEARTBEAT
        self._is_fresh, self._beat_due_s = False, 0.0
        self._faults = faults
        fault_handlers = {n: partial(self._execute, n) for n in FAULT_COMMANDS}
        self._commands = Commands(self._own, self._handlers(), {}, fault_handlers)
        self._packers: dict[tuple[int, int], FramePacker] = {}
        self._to_autopilot: list[bytes] = []
        self._to_stations: list[bytes] = []
        self._texts = 0

    # from the autopilot

    @property
    def is_shown(self) -> bool:
        """Whether its checks before arming have passed, and it has its home: stations see it."""
        return self._is_checked and self._has_home

    def receive(self, datagram: bytes, time_s: float = 0.0) -> None:
        """Take in a datagram of the autopilot, of one frame or several, at a time of its clock."""
        for frame in frames_in(datagram):
            number = int.from_bytes(frame[MESSAGE_ID:HEADER_SIZE], "little")
            message = parse(frame) if number in _READ else None
            if message is not None and message.get_srcSystem() == self._system:
                if self._is_mine(message, time_s):
                    continue
                self._note_answer(message, frame)
                self._note(message)
                if number == dialect.MAVLINK_MSG_ID_HEARTBEAT and not self.is_shown:
                    continue
            self._to_stations.append(frame)

    def _note(self, message: MAVLink_message) -> None:
        self.resumption.note(message)
        if isinstance(message, dialect.MAVLink_sys_status_message):
            checks = message.onboard_control_sensors_health
            self._is_checked |= bool(checks & dialect.MAV_SYS_STATUS_PREARM_CHECK)
        if not isinstance(message, dialect.MAVLink_heartbeat_message):
            return
        self._beat, self._is_fresh = message, True
        self.is_armed = bool(message.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED)
        if self._is_checked and not self._has_home:
            self._set_home()
        if not self._is_heard:  # it streams what ours do, so that displays have it
            for number in (*_ASKED_OF_IT, *_BESIDE):
                interval_us = DEFAULT_INTERVALS_US.get(number, 500_000)
                self._tell(dialect.MAV_CMD_SET_MESSAGE_INTERVAL, number, interval_us)
        self._is_heard = True

    def _tell(self, command: int, *params: float) -> None:
        seven = (*params, *[0.0] * 7)[:7]
        message = dialect.MAVLink_command_long_message(*self._own, command, 0, *seven)
        self._to_autopilot.append(self._packed(message, self._bridge))

    def _set_home(self) -> None:
        """Tell it where its home is, until it has acknowledged that."""
        at = self._origin
        message = dialect.MAVLink_command_int_message(
            *self._own,
            dialect.MAV_FRAME_GLOBAL,
            dialect.MAV_CMD_DO_SET_HOME,
            0,
            0,
            *(0.0, 0.0, 0.0, 0.0),
            round(at.latitude_deg * 1e7),
            round(at.longitude_deg * 1e7),
            at.altitude_m,
        )
        self._to_autopilot.append(self._packed(message, self._bridge))

    def _is_mine(self, message: MAVLink_message, time_s: float) -> bool:
        """Return whether a message answers the bridge itself."""
        target = getattr(message, "target_system", 0), getattr(message, "target_component", 0)
        if target != self._bridge:
            return False
        if isinstance(message, dialect.MAVLink_command_ack_message):
            is_accepted = message.result == dialect.MAV_RESULT_ACCEPTED
            self._has_home |= is_accepted and message.command == dialect.MAV_CMD_DO_SET_HOME
        if self.resumption.resumes:
            self.resumption.receive(message, time_s)
        return True

    # from ground stations

    def receive_from_station(self, message: MAVLink_message, now: float, station: int) -> None:
        """Take in a message of a ground station, which has a number."""
        if self._is_of_plant(message):
            self._commands.receive(message, now, station)
            return
        if getattr(message, "target_system", 0) not in {0, self._system}:
            return
        frame = self._packed(message, sender_of(message))
        if isinstance(message, dialect.MAVLink_heartbeat_message):  # which nobody answers
            self._to_autopilot.append(frame)
            return
        if len(self._from_stations) >= _MOST_WAITING:
            return
        if isinstance(message, dialect.MAVLink_command_long_message) and self._is_again(message):
            return
        self.resumption.note_station(message)
        self._from_stations.append((frame, _answered_in_s(message)))

    def _is_again(self, message: dialect.MAVLink_command_long_message) -> bool:
        """Return whether a command has been given already; show its answer again if there is one.

        A station that waits repeats it by the wall clock, which is not to move the autopilot's.
        """
        key, params = (sender_of(message), message.command), command_params(message)
        asked = self._asked.get(key)
        if asked is None or asked[0] != params or message.confirmation not in _REPETITIONS:
            self._asked[key] = params, None
            if len(self._asked) > _MOST_WAITING:
                self._asked.pop(next(iter(self._asked)))
            return False
        if asked[1] is not None:
            self._to_stations.append(asked[1])
        return True

    def _note_answer(self, message: MAVLink_message, frame: bytes) -> None:
        """Keep the answer to a command of a station."""
        if isinstance(message, dialect.MAVLink_command_ack_message):
            key = SystemId(message.target_system, message.target_component), message.command
            if (asked := self._asked.get(key)) is not None:
                self._asked[key] = asked[0], frame

    def release(self) -> float:
        """Let one message of a station through to the autopilot.

        Returns:
            How long it takes to answer, by its clock [s]; 0 if none waits.
        """
        if not self._from_stations:
            return 0.0
        frame, takes_s = self._from_stations.popleft()
        self._to_autopilot.append(frame)
        return takes_s

    def _is_of_plant(self, message: MAVLink_message) -> bool:
        """Return whether a message is a command that the bridge executes, or hands to the plant."""
        if not isinstance(message, CommandMessage) or not is_for(message, self._own):
            return False
        number, first = message.command, command_params(message)[0]
        asks = number == dialect.MAV_CMD_REQUEST_MESSAGE and first in _OWN_REQUESTS
        streams = number == dialect.MAV_CMD_SET_MESSAGE_INTERVAL and first >= _FIRST_PRIVATE
        return number in _EXECUTED or asks or streams

    def _handlers(self) -> dict[int, Handler]:
        def request(_: tuple[float, ...]) -> int:
            self.count()
            return dialect.MAV_RESULT_ACCEPTED

        def stream(params: tuple[float, ...]) -> int:
            has = params[0] == dialect.MAVLINK_MSG_ID_FTC_EVENTS
            return dialect.MAV_RESULT_ACCEPTED if has else dialect.MAV_RESULT_UNSUPPORTED

        return {
            dialect.MAV_CMD_REQUEST_MESSAGE: request,
            dialect.MAV_CMD_SET_MESSAGE_INTERVAL: stream,
            dialect.MAV_CMD_FTC_SET_SLOT: self._set_slot,
        }

    def _set_slot(self, params: tuple[float, ...]) -> int:
        """Execute MAV_CMD_FTC_SET_SLOT, as ours do."""
        try:
            slot, text = slot_ordered(params, self._order_slot is not None)
        except InvalidParam as problem:
            self.say(dialect.MAV_SEVERITY_WARNING, str(problem))
            return dialect.MAV_RESULT_DENIED
        if self._order_slot is not None:
            self._order_slot(slot)
        self.say(dialect.MAV_SEVERITY_INFO, text)
        return dialect.MAV_RESULT_ACCEPTED

    def _execute(self, number: int, params: tuple[float, ...]) -> int | None:
        """Execute a command on faults of sensors; return its result, None: it is the plant's."""
        try:
            return self._faults.execute(number, params)
        except (InvalidParam, OverflowError) as problem:
            self.say(dialect.MAV_SEVERITY_WARNING, str(problem))
            return dialect.MAV_RESULT_DENIED

    # from the plant

    def receive_from_plant(self, message: MAVLink_message, now: float) -> None:
        """Take in a message of the aircraft's simulator component."""
        if isinstance(message, dialect.MAVLink_ftc_fault_message):
            for one in self._faults.beside(message):
                self._show(one)
        elif isinstance(message, dialect.MAVLink_statustext_message):
            self._show(message)
        self._commands.receive_from_simulator(message, now)

    # out

    def handle_timer(self, now: float) -> None:
        """Do what is due; call it often.

        One that waits to be armed lives, though its clock may stand still.
        """
        self._commands.handle_timer(now)
        is_silent = self.is_shown and not self.is_armed and now >= self._beat_due_s
        if self._beat is not None and is_silent and not self._is_fresh:
            self._show(self._beat)
        if is_silent or self._is_fresh:
            self._is_fresh, self._beat_due_s = False, now + _SILENT_S

    def count(self) -> None:
        """Show stations the events so far."""
        self._show(self._counts())

    def say(self, severity: int, text: str) -> None:
        """Send stations a STATUSTEXT."""
        self._texts += 1
        for message in text_chunks(severity, text, self._texts):
            self._show(message)

    def to_plant(self) -> list[MAVLink_message]:
        """Hand over what the plant is to be sent."""
        return self._commands.simulator_messages()

    def to_autopilot(self, time_s: float = 0.0) -> list[bytes]:
        """Hand over what the autopilot is to be sent, at a time of its clock."""
        if self.resumption.resumes and self.is_shown:
            again = self.resumption.turn(time_s)
            self._to_autopilot += [self._packed(message, self._bridge) for message in again]
        frames, self._to_autopilot = self._to_autopilot, []
        return frames

    def packed(self, message: MAVLink_message) -> bytes:
        """Return the frame of a message of the bridge's own to the autopilot."""
        return self._packed(message, self._bridge)

    def to_stations(self) -> list[bytes]:
        """Hand over what every ground station is to be sent."""
        for message in self._commands.gcs_messages():
            self._show(message)
        frames, self._to_stations = self._to_stations, []
        return frames

    def _show(self, message: MAVLink_message) -> None:
        self._to_stations.append(self._packed(message, self._own))

    def _packed(self, message: MAVLink_message, sender: SystemId) -> bytes:
        """Return the unsigned frame of a message of a sender, as its own sequence numbers it."""
        if sender not in self._packers:
            self._packers[sender] = FramePacker(*sender)
        return self._packers[sender].pack(message)


def _answered_in_s(message: MAVLink_message) -> float:
    """Return how long an autopilot takes to answer a message of a station, by its clock [s]."""
    if isinstance(message, dialect.MAVLink_param_request_list_message):
        return _LISTS_S
    asks = {dialect.MAV_CMD_SET_MESSAGE_INTERVAL, dialect.MAV_CMD_REQUEST_MESSAGE}
    acts = isinstance(message, CommandMessage) and message.command not in asks
    return _SHOWS_S if acts else _ANSWER_S
