"""Faults by MAVLink in a flight by ArduPilot: as `gcs fault` sets them in a fleet of ours.

ArduPilot itself knows nothing of them. So the plant shows each aircraft as a vehicle that takes no
commands but those on faults, on a port of its own. No socket and no clock.
"""

import itertools

from gcs.fleet.ardupilot.flight import ArduPilotFlight
from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.framing.frames import FramePacker, parse
from mavlink_defs.services.command import command_params
from sitl_plant.ardupilot.peer import Address
from sitl_plant.loop.fault_commands import faults_of
from sitl_plant.loop.service import AircraftService

_HEARTBEAT_S = 1.0
_GONE_S = 10.0  # silence after which a ground station gets no HEARTBEAT any more
_NO_INTERVAL = 2**32 - 1
_COMPONENT = dialect.MAV_COMP_ID_AUTOPILOT1  # the one that ground stations command


class FaultStation:
    """The vehicles that ground stations see, and the ground stations."""

    def __init__(self, scenario: Scenario, flight: ArduPilotFlight) -> None:
        self._scenario, self._flight = scenario, flight
        self._systems = [uav.id for uav in scenario.uavs]
        self._packers = [FramePacker(system, _COMPONENT) for system in self._systems]
        self._stations: dict[Address, float] = {}  # when each was heard last [s]
        self._due_s = 0.0
        self._begin_with_fleet()

    def _begin_with_fleet(self) -> None:
        """Serve the fleet that flies now: a restarted flight has another one."""
        self._fleet = self._flight.fleet
        self._services = [
            AircraftService(
                system,
                _COMPONENT,
                faults_of(self._fleet, i, self._scenario.aircraft_of(system).fault_limits),
            )
            for i, system in enumerate(self._systems)
        ]

    def receive(self, datagram: bytes, address: Address, now: float) -> list[bytes]:
        """Take in a datagram of a ground station; return what is to be sent back.

        Args:
            datagram: As it came.
            address: Where it came from.
            now: Wall-clock time [s].
        """
        message = parse(datagram)
        if message is None:
            return []
        if self._fleet is not self._flight.fleet:
            self._begin_with_fleet()
        is_new = address not in self._stations
        self._stations[address] = now
        frames = [self._heartbeat(i) for i in range(len(self._systems))] if is_new else []
        time_s = self._flight.step * self._scenario.step_us / 1e6
        for i, service in enumerate(self._services):
            service.receive(message, time_s, now)
            if _asks_for_events(message, self._systems[i]):
                frames.append(self._packers[i].pack(self._events(i, time_s)))
            frames += map(self._packers[i].pack, service.messages_to_send())
        return frames

    def due(self, now: float) -> list[tuple[bytes, Address]]:
        """Return the HEARTBEATs that are due, and where to; now is the wall-clock time [s]."""
        if now < self._due_s:
            return []
        self._due_s = now + _HEARTBEAT_S
        self._stations = {to: at for to, at in self._stations.items() if now - at < _GONE_S}
        every = [self._heartbeat(i) for i in range(len(self._systems))] if self._stations else []
        return list(itertools.product(every, self._stations))

    def _heartbeat(self, i: int) -> bytes:
        armed = dialect.MAV_MODE_FLAG_SAFETY_ARMED if self._flight.is_flying else 0
        status = dialect.MAV_STATE_ACTIVE if armed else dialect.MAV_STATE_STANDBY
        kind, autopilot = dialect.MAV_TYPE_FIXED_WING, dialect.MAV_AUTOPILOT_GENERIC
        return self._packers[i].pack(
            dialect.MAVLink_heartbeat_message(kind, autopilot, armed, 0, status, 3)
        )

    def _events(self, i: int, time_s: float) -> dialect.MAVLink_ftc_events_message:
        return dialect.MAVLink_ftc_events_message(
            time_boot_ms=round(time_s * 1e3) & 0xFFFFFFFF,
            steps=self._flight.step,
            events=self._flight.events[i].tolist(),
            min_interval_us=[_NO_INTERVAL] * 4,
            messages=int(self._flight.messages[i]),
            repeats=[0] * 4,
            edge_changes=0,
        )


def _asks_for_events(message: dialect.MAVLink_message, system: int) -> bool:
    """Return whether a message requests FTC_EVENTS, which have the simulated time, of a system."""
    if not isinstance(
        message, dialect.MAVLink_command_long_message | dialect.MAVLink_command_int_message
    ):
        return False
    asks = message.command == dialect.MAV_CMD_REQUEST_MESSAGE and message.target_system == system
    return asks and command_params(message)[0] == dialect.MAVLINK_MSG_ID_FTC_EVENTS
