"""Faults and missions reconstructed from the commands, missions and answers in a log.

A live station requests them from the vehicles. A log has them only if some station requested or
set them. No socket and no clock.
"""

from collections import defaultdict

from gcs.station.fleet_state import FleetState
from gcs.station.notifications import Notification
from gcs.station.vehicle_state import VehicleState
from mavlink_defs import dialect
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.faults import SETTING
from mavlink_defs.faults.actuators import ACTUATOR_FAULTS
from mavlink_defs.faults.command import InvalidParam, fault_from_params
from mavlink_defs.services.fault_list import FaultList

_ALL = -1.0
_Item = dialect.MAVLink_mission_item_int_message


class PassiveObserver:
    """Updates a fleet state from observed messages."""

    def __init__(self, fleet: FleetState) -> None:
        self._fleet = fleet
        self._commands: dict[tuple[int, int], MAVLink_message] = {}
        self._lists: defaultdict[int, FaultList] = defaultdict(FaultList)
        self._items: defaultdict[int, dict[int, _Item]] = defaultdict(dict)
        self._counts: dict[int, int] = {}

    def receive(self, message: MAVLink_message, now: float) -> list[Notification]:
        """Process any message, after the fleet state has processed it."""
        source = message.get_srcSystem()
        target = getattr(message, "target_system", 0)
        vehicles = self._fleet.vehicles
        system = source if source in vehicles else target
        state = vehicles.get(system)
        if state is None:
            return []
        match message:
            case dialect.MAVLink_command_long_message():
                self._commands[system, message.command] = message
            case dialect.MAVLink_command_ack_message():
                return self._acknowledged(state, message, now)
            case dialect.MAVLink_ftc_fault_message():
                return self._listed_one(state, message, now)
            case dialect.MAVLink_mission_count_message():
                self._items[system].clear()
                self._counts[system] = message.count
            case dialect.MAVLink_mission_item_int_message():
                self._items[system][message.seq] = message
                if source == system and len(self._items[system]) == self._counts.get(system):
                    return self._mission(state, now)  # the last one of a download
            case dialect.MAVLink_mission_ack_message():
                if source == system and message.type == dialect.MAV_MISSION_ACCEPTED:
                    return self._mission(state, now)
        return []

    def _acknowledged(
        self, state: VehicleState, ack: dialect.MAVLink_command_ack_message, now: float
    ) -> list[Notification]:
        command = self._commands.pop((state.system, ack.command), None)
        if command is None or ack.result != dialect.MAV_RESULT_ACCEPTED:
            return []
        known = state.faults or ()
        params = [getattr(command, f"param{i}") for i in range(1, 8)]
        if ack.command == dialect.MAV_CMD_FTC_CLEAR_FAULTS:
            actuator = ACTUATOR_FAULTS.target(params[0])
            left = [f for f in known if params[0] != _ALL and f.target != actuator]
            return state.learn_faults(tuple(left), now)
        family, time_s = SETTING.get(ack.command), state.time_s or 0.0
        if family is None:
            return []
        try:
            fault = fault_from_params(family, params).resolved(time_s)
        except InvalidParam:
            return []
        staying = [f for f in known if f.stays(fault, time_s)]
        return state.learn_faults((*staying, fault), now)

    def _listed_one(
        self, state: VehicleState, message: dialect.MAVLink_ftc_fault_message, now: float
    ) -> list[Notification]:
        listed = self._lists[state.system]
        listed.receive(message)
        if listed.complete is None:
            return []
        del self._lists[state.system]
        return state.learn_faults(listed.complete, now)

    def _mission(self, state: VehicleState, now: float) -> list[Notification]:
        found = self._items.pop(state.system, {})
        if len(found) != self._counts.get(state.system):
            return []
        return state.learn_mission(tuple(item for _, item in sorted(found.items())), now)
