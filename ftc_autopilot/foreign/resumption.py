"""A foreign autopilot that is started again in flight: what it had been given, given again.

It has no checkpoint of its own. Its bridge keeps what stations have given it, and where it was, in
a file of MAVLink frames: plans, parameters, and commands for its mode and the item of its mission.
No clock: times are by the autopilot's own.
"""

import contextlib
from collections import deque
from collections.abc import Sequence
from pathlib import Path

from ftc_autopilot.foreign.datagrams import frames_in
from mavlink_defs import dialect
from mavlink_defs.config.output_files import complete_file
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.framing.frames import FramePacker, parse
from mavlink_defs.services.command import CommandClient, CommandFinished, CommandMessage
from mavlink_defs.services.machine import SystemId
from mavlink_defs.services.mission import MissionFinished, MissionItem, MissionUploader

_MOST_PENDING = 100
"""Parameters that it has not confirmed; with more, the first one is forgotten."""
_PX4_MAIN, _PX4_SUB = 16, 24  # bits of custom_mode below its main mode, and below its sub-mode


class GivenAgain:
    """What a foreign autopilot has been given, and what it is given once more.

    Attributes:
        resumes: Whether it is still to be given.
        refusal: What it has refused, and how; None: nothing.
    """

    def __init__(self, own: SystemId, bridge: SystemId, file: Path | None) -> None:
        """Read what the bridge of an autopilot before this one has kept, if there is one.

        Args:
            own: Of the autopilot.
            bridge: As which the bridge talks to it.
            file: Where it is kept; None: nowhere.
        """
        self._own, self._bridge, self._file = own, bridge, file
        self._plans: dict[int, list[MissionItem]] = {}
        self._coming: dict[int, dict[int, MissionItem]] = {}
        self._params: dict[str, MAVLink_message] = {}
        self._pending: dict[str, MAVLink_message] = {}
        self._mode: CommandMessage | None = None
        self._item: CommandMessage | None = None
        self.refusal: str | None = None
        kept = file.read_bytes() if file is not None and file.exists() else b""
        for frame in frames_in(kept):
            if (message := parse(frame)) is not None:
                self._restore(message)
        self.resumes = bool(kept)
        self._uploads = deque(
            MissionUploader(bridge, own, items, kind) for kind, items in self._plans.items()
        )
        arm = self._command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
        self._commands = deque(one for one in (self._mode, self._item, arm) if one is not None)
        self._client = CommandClient(bridge)
        self._began = False

    def _restore(self, message: MAVLink_message) -> None:
        if isinstance(message, dialect.MAVLink_mission_item_int_message):
            self._plans.setdefault(message.mission_type, []).append(message)
        elif isinstance(message, dialect.MAVLink_param_set_message):
            self._params[message.param_id] = message
        elif isinstance(message, dialect.MAVLink_command_long_message):
            if message.command == dialect.MAV_CMD_DO_SET_MODE:
                self._mode = message
            else:
                self._item = message

    # while it flies

    def note_station(self, message: MAVLink_message) -> None:
        """Note what a station tells it."""
        if isinstance(message, dialect.MAVLink_mission_count_message):
            self._coming[message.mission_type] = {}
        elif isinstance(message, dialect.MAVLink_mission_item_int_message):
            self._coming.setdefault(message.mission_type, {})[message.seq] = message
        elif isinstance(message, dialect.MAVLink_param_set_message):
            self._pending[message.param_id] = message
            if len(self._pending) > _MOST_PENDING:
                self._pending.pop(next(iter(self._pending)))

    def note(self, message: MAVLink_message) -> None:
        """Note what it says itself."""
        if isinstance(message, dialect.MAVLink_mission_ack_message):
            items = self._coming.pop(message.mission_type, None)
            if items is not None and message.type == dialect.MAV_MISSION_ACCEPTED:
                self._plans[message.mission_type] = [one for _, one in sorted(items.items())]
                self._keep()
        elif isinstance(message, dialect.MAVLink_param_value_message):
            if (confirmed := self._pending.pop(message.param_id, None)) is not None:
                self._params[message.param_id] = confirmed
                self._keep()
        elif isinstance(message, dialect.MAVLink_mission_current_message):
            command = self._command(dialect.MAV_CMD_DO_SET_MISSION_CURRENT, message.seq)
            if message.seq > 0 and (self._item is None or self._item.param1 != message.seq):
                self._item = command
                self._keep()
        elif isinstance(message, dialect.MAVLink_heartbeat_message):
            self._note_mode(message)

    @property
    def mission(self) -> Sequence[MissionItem]:
        """Its mission, home included; empty: none."""
        return self._plans.get(dialect.MAV_MISSION_TYPE_MISSION, ())

    def _note_mode(self, message: dialect.MAVLink_heartbeat_message) -> None:
        if not message.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED:
            return
        self.resumes &= bool(self._commands)
        number = message.custom_mode
        modes = (number, 0)
        if message.autopilot == dialect.MAV_AUTOPILOT_PX4:
            modes = (number >> _PX4_MAIN & 0xFF, number >> _PX4_SUB)
        custom = dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        command = self._command(dialect.MAV_CMD_DO_SET_MODE, custom, *modes)
        if self._mode is None or (self._mode.param2, self._mode.param3) != modes:
            self._mode = command
            self._keep()

    def _command(self, number: int, *params: float) -> dialect.MAVLink_command_long_message:
        seven = (*params, *[0.0] * 7)[:7]
        return dialect.MAVLink_command_long_message(*self._own, number, 0, *seven)

    def _keep(self) -> None:
        if self._file is None or self.resumes or self._mode is None:  # it was not armed yet
            return
        packer = FramePacker(*self._bridge)
        parts = (
            *(item for items in self._plans.values() for item in items),
            *self._params.values(),
            *(one for one in (self._mode, self._item) if one is not None),
        )
        with contextlib.suppress(OSError), complete_file(self._file) as kept:  # a full disk
            kept.write(b"".join(map(packer.pack, parts)))

    # when it has been started again

    def receive(self, message: MAVLink_message, time_s: float) -> None:
        """Take in its answer to the bridge, at a time of its clock."""
        if self._uploads:
            upload = self._uploads[0]
            upload.receive(message, time_s)
            for event in upload.events():
                if isinstance(event, MissionFinished):
                    self._uploads.popleft()
                    self._note_result("its plan", event.result, dialect.MAV_MISSION_ACCEPTED)
            return
        self._client.receive(message, time_s)
        for done in self._client.events():
            if isinstance(done, CommandFinished):
                self._commands.popleft()
                what = "to be armed" if not self._commands else f"command {done.command}"
                self._note_result(what, done.result, dialect.MAV_RESULT_ACCEPTED)

    def _note_result(self, what: str, result: int | None, accepted: int) -> None:
        if result != accepted:
            self.refusal = f"started again, it refuses {what} ({result})"

    def turn(self, time_s: float) -> list[MAVLink_message]:
        """Return what it is to be given now."""
        sent: list[MAVLink_message] = []
        if not self._began:
            self._began = True
            sent += self._params.values()
        if self._uploads:
            upload = self._uploads[0]
            if not upload.busy:
                upload.start(time_s)
            upload.handle_timer(time_s)
            return sent + upload.messages_to_send()
        if self._commands and not self._client.busy:
            self._client.send(self._commands[0], time_s)
        self._client.handle_timer(time_s)
        return sent + self._client.messages_to_send()
