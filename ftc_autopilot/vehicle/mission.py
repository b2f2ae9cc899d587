"""The mission of one vehicle: items of the mission protocol are the profile or path it flies."""

import math
from collections.abc import Callable, Iterable, Sequence

from ftc_autopilot.guidance.mission_commands import command_text
from ftc_autopilot.guidance.mission_items import is_path
from ftc_autopilot.vehicle.flight_path import VehicleHome
from ftc_autopilot.vehicle.message import message
from ftc_autopilot.vehicle.modes import Modes, Say
from mavlink_defs import dialect
from mavlink_defs.constants import AUTO, MAX_MISSION_ITEMS
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.services.machine import SystemId
from mavlink_defs.services.mission import MissionItem
from mavlink_defs.services.mission_server import MissionAccepted, MissionRefused, MissionServer

_IN_MISSION_MODE, _SUSPENDED = 1, 2
"""MISSION_CURRENT.mission_mode."""
_BEFORE_M = 1e-6
"""Before the begin of a path, so that what is passed there counts [m]."""
_ACCEPTED, _FAILED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_FAILED


class Mission:
    """Connects the mission protocol with the flight modes."""

    def __init__(
        self,
        own: SystemId,
        modes: Modes,
        home: VehicleHome,
        guide: Callable[[MissionItem], int],
        enable_fence: Callable[[Sequence[float]], int],
        say: Say,
    ) -> None:
        """Hold no mission.

        Args:
            own: SystemId of the vehicle.
            modes: Its modes.
            home: Its home.
            guide: Flies to an item that is sent on its own, and returns MAV_MISSION_RESULT.
            enable_fence: Executes MAV_CMD_DO_FENCE_ENABLE with its first params.
            say: Announces a text.
        """
        self._modes, self._say, self._enable_fence = modes, say, enable_fence
        self.server = MissionServer(
            own, modes.check_mission, MAX_MISSION_ITEMS + 1, home.item, guide, modes.jump_to
        )
        self._reached: list[MAVLink_message] = []
        self._follows = False  # whether the current item is one that was flown
        self._landed = False
        self._passed_leg = (0, 0)  # number of a path, and the leg of it that was flown last
        self._passed_to = (0, 0.0)  # number of a path, and how far its commands were announced [m]
        self._note_state()

    def reached(self) -> list[tuple[MAVLink_message, None]]:
        """Hand over what is to be sent to all stations on items that were reached."""
        reached, self._reached = self._reached, []
        return [(message, None) for message in reached]

    @message(
        dialect.MAVLink_mission_current_message,
        every_s=1.0,
        stream=dialect.MAV_DATA_STREAM_EXTENDED_STATUS,
    )
    def current(self) -> MAVLink_message:
        """Return MISSION_CURRENT."""
        return self.server.mission_current()

    def restart(self) -> None:
        """Return to the state after the upload of the mission, for another flight."""
        self._follows = False
        self.server.set_current(0)
        self.handle_events()

    def resume(self, items: Sequence[MissionItem], item: int) -> None:
        """Restore the mission from a checkpoint.

        Args:
            items: Its items, home included; none if there was no mission.
            item: The current one.
        """
        self.server.restore(tuple(items), item)
        if is_path(items):
            self._modes.path.items = tuple(items)
        self._modes.note_item(item)
        self._passed_to = (self._modes.path.number, self._modes.path.position)
        self._follows = self._modes.flies_mission
        self._note_state()

    # commands

    def start(self, params: Sequence[float]) -> int:
        """Execute MAV_CMD_MISSION_START: begin with the current item, or again."""
        if any(param != 0.0 and not math.isnan(param) for param in params[:2]):
            text = "Mission start: params 1 and 2 must be 0, a part cannot be flown"
            self._say(dialect.MAV_SEVERITY_WARNING, text)
            return dialect.MAV_RESULT_DENIED
        seq = 1 if self._modes.started else self.server.current
        result = self._modes.start_mission(seq)
        self._follows = self._follows or result == _ACCEPTED
        self._note_state()
        return result

    def set_current(self, params: Sequence[float]) -> int:
        """Execute MAV_CMD_DO_SET_MISSION_CURRENT: param 1 is the item, -1 the present one."""
        seq = self.server.current if params[0] == -1.0 else params[0]
        if seq not in range(len(self.server.items)):
            text = f"Mission has no item {params[0]:g} to go to"
            self._say(dialect.MAV_SEVERITY_WARNING, text)
            return _FAILED
        return _ACCEPTED if self.server.go_to(int(seq)) else _FAILED

    def handle_events(self) -> bool:
        """Put in force what was uploaded; return whether the mission has changed."""
        changes = False
        for event in self.server.events():
            match event:
                case MissionAccepted(items):
                    self._follows, changes = False, True
                    self._modes.take_mission(items)
                case MissionRefused(_, text) if text:
                    self._say(dialect.MAV_SEVERITY_WARNING, text)
        self._note_state()
        return changes

    def follow(self) -> None:
        """Let MISSION_CURRENT and MISSION_ITEM_REACHED follow the profile.

        Items that ended before the profile was uploaded or while another mode was flown were
        not reached.
        """
        self._note_state()
        if not self._modes.flies_mission:
            self._follows = False
            return
        current, before = self._modes.current_item(), self.server.current
        reached: Iterable[int] = ()
        if not self._modes.has_profile:
            self._modes.note_item(current)
            reached = self._passed()
            self._announce()
            if self._modes.path.landed and not self._landed:
                reached.append(current)
            self._landed = self._modes.path.landed
        elif current != before:
            reached = range(max(before, 1), current)
        if self._follows:
            self._reached += map(dialect.MAVLink_mission_item_reached_message, reached)
        if current != before:
            self.server.set_current(current)
        self._follows = True

    # inside

    def _passed(self) -> list[int]:
        """Return the items of the path that were reached since the last call."""
        path = self._modes.path
        (number, before), now = self._passed_leg, (path.number, path.point().leg)
        self._passed_leg = now
        if number != now[0] or before == now[1]:
            return []
        return path.items_between(before, now[1])

    def _announce(self) -> None:
        """Pass the commands on the path since the last call."""
        path, (number, before) = self._modes.path, self._passed_to
        if number != path.number:
            before = path.begun_at - _BEFORE_M
        now = max(path.position, before)
        self._passed_to = (path.number, now)
        for seq in path.commands_between(before, now):
            self._pass(self.server.items[seq])

    def _pass(self, item: MissionItem) -> None:
        """Announce a command on the path, and do it if it is the fence's."""
        self._say(dialect.MAV_SEVERITY_INFO, f"item {item.seq}: {command_text(item)}")
        if item.command == dialect.MAV_CMD_DO_FENCE_ENABLE:
            self._enable_fence((item.param1, item.param2))

    def _note_state(self) -> None:
        """Update the fields of MISSION_CURRENT besides the item."""
        modes, server = self._modes, self.server
        server.mission_mode = _IN_MISSION_MODE if modes.mode == AUTO else _SUSPENDED
        if not modes.has_mission:
            server.mission_state = dialect.MISSION_STATE_NO_MISSION
        elif not modes.started:
            server.mission_state = dialect.MISSION_STATE_NOT_STARTED
        elif modes.is_over():
            server.mission_state = dialect.MISSION_STATE_COMPLETE
        elif modes.mode == AUTO:
            server.mission_state = dialect.MISSION_STATE_ACTIVE
        else:
            server.mission_state = dialect.MISSION_STATE_PAUSED
