"""The mission of one vehicle: items of the mission protocol are the profile or path it flies."""

import math
from collections.abc import Callable, Iterable, Sequence

from ftc_autopilot.guidance.mission_items import is_path
from ftc_autopilot.vehicle.flight_path import VehicleHome
from ftc_autopilot.vehicle.message import message
from ftc_autopilot.vehicle.modes import Modes, Say
from mavlink_defs import dialect
from mavlink_defs.constants import AUTO, MAX_MISSION_ITEMS
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.services.machine import SystemId
from mavlink_defs.services.mission import MissionItem
from mavlink_defs.services.mission_server import (
    MissionAccepted,
    MissionRefused,
    MissionServer,
)

_IN_MISSION_MODE, _SUSPENDED = 1, 2
"""MISSION_CURRENT.mission_mode."""
_ACCEPTED, _FAILED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_FAILED


class Mission:
    """Connects the mission protocol with the flight modes."""

    def __init__(
        self,
        own: SystemId,
        modes: Modes,
        home: VehicleHome,
        guide: Callable[[MissionItem], int],
        say: Say,
    ) -> None:
        """Hold no mission.

        Args:
            own: SystemId of the vehicle.
            modes: Its modes.
            home: Its home.
            guide: Flies to an item that is sent on its own, and returns MAV_MISSION_RESULT.
            say: Announces a text.
        """
        self._modes, self._say = modes, say
        self.server = MissionServer(
            own, modes.check_mission, MAX_MISSION_ITEMS + 1, home.item, guide, modes.jump_to
        )
        self._reached: list[MAVLink_message] = []
        self._follows = False  # whether the current item is one that was flown
        self._landed = False
        self._passed_leg = (0, 0)  # number of a path, and the leg of it that was flown last
        self._note_state()

    def receive(self, message: MAVLink_message, now: float, station: int) -> None:
        """Take in a message of a ground station, which has a number."""
        self.server.receive(message, now, station)
        self._handle_events()

    def handle_timer(self, now: float) -> None:
        """Do what is due, and follow the modes."""
        self.server.handle_timer(now)
        self._follow()
        self._handle_events()

    def deadline(self) -> float | None:
        """Return when `handle_timer` is to be called [s]; None if no timer runs."""
        return self.server.deadline()

    def messages_to_send(self) -> list[tuple[MAVLink_message, int | None]]:
        """Hand over what is to be sent, and the number of the station; None: to all."""
        messages, self._reached = self._reached + self.server.messages_to_send(), []
        asking = self.server.asking
        return [(m, asking if hasattr(m, "target_system") else None) for m in messages]

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
        self._handle_events()

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
        self._follows = self._modes.flies_mission
        self._note_state()

    # commands

    def start(self, params: Sequence[float]) -> int:
        """Execute MAV_CMD_MISSION_START: begin with the current item, or again."""
        if any(param != 0.0 and not math.isnan(param) for param in params[:2]):
            text = "Mission start: params 1 and 2 must be 0, a part cannot be flown"
            self._say(dialect.MAV_SEVERITY_WARNING, text)
            return dialect.MAV_RESULT_DENIED
        return self.start_at(1 if self._modes.started else self.server.current)

    def start_at(self, seq: int) -> int:
        """Fly the mission in AUTO from an item on, started or not; return MAV_RESULT."""
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

    # inside

    def _handle_events(self) -> None:
        for event in self.server.events():
            match event:
                case MissionAccepted(items):
                    self._follows = False
                    self._modes.take_mission(items)
                case MissionRefused(_, text) if text:
                    self._say(dialect.MAV_SEVERITY_WARNING, text)
        self._note_state()

    def _follow(self) -> None:
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

    def _passed(self) -> list[int]:
        """Return the items of the path that were reached since the last call."""
        path = self._modes.path
        (number, before), now = self._passed_leg, (path.number, path.point().leg)
        self._passed_leg = now
        if number != now[0] or before == now[1]:
            return []
        return path.items_between(before, now[1])

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
