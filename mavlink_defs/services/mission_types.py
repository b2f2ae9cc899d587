"""The mission microservice of a vehicle that has more than missions: fences, rally points.

Each type has a server of its own (`mission_server.MissionServer`), so that uploads of different
types do not disturb each other. Here messages are handed to the server of their type, and what
concerns all types is answered once.
"""

from collections.abc import Iterator, Mapping

from mavlink_defs import dialect
from mavlink_defs.services.machine import SystemId, is_for, sender_of
from mavlink_defs.services.mission_server import MissionServer
from mavlink_defs.services.mission_upload import UploadClient

_MISSION, _ALL = dialect.MAV_MISSION_TYPE_MISSION, dialect.MAV_MISSION_TYPE_ALL


class MissionTypes:
    """The servers of one vehicle, by MAV_MISSION_TYPE; the one of missions is among them."""

    def __init__(self, own: SystemId, servers: Mapping[int, MissionServer]) -> None:
        self._own, self._servers = own, servers
        self._answers: list[tuple[dialect.MAVLink_message, int]] = []

    def receive(self, message: dialect.MAVLink_message, now: float, station: int = 0) -> None:
        """Take in any message; arguments as of `MissionServer.receive`."""
        mission_type = getattr(message, "mission_type", None)
        if mission_type == _ALL and isinstance(message, dialect.MAVLink_mission_clear_all_message):
            if is_for(message, self._own):
                self._clear_all(UploadClient(sender_of(message), station))
        elif mission_type is not None:
            unknown = self._servers[_MISSION]  # refuses it
            self._servers.get(mission_type, unknown).receive(message, now, station)
        else:  # whoever uploads is heard
            for server in self._servers.values():
                server.receive(message, now, station)

    def handle_timer(self, now: float) -> None:
        """Do what is due; harmless when nothing is."""
        for server in self._servers.values():
            server.handle_timer(now)

    def deadline(self) -> float | None:
        """Return the time of the next `handle_timer()` [s]; None when nothing is awaited."""
        timers = (server.deadline() for server in self._servers.values())
        return min((at for at in timers if at is not None), default=None)

    def messages_to_send(self) -> Iterator[tuple[dialect.MAVLink_message, int | None]]:
        """Hand over what is to be sent, and the number of the station; None: to all."""
        yield from self._answers
        self._answers.clear()
        for server in self._servers.values():
            asking = server.asking
            for message in server.messages_to_send():
                yield message, asking if hasattr(message, "target_system") else None

    def _clear_all(self, sender: UploadClient) -> None:
        """Clear all types, or none if another client uploads one of them."""
        servers = self._servers.values()
        result = dialect.MAV_MISSION_ACCEPTED
        if any(server.busy_for(sender) for server in servers):
            result = dialect.MAV_MISSION_DENIED
        else:
            for server in servers:
                server.clear()
        ack = dialect.MAVLink_mission_ack_message(*sender.address, result, _ALL)
        self._answers.append((ack, sender.station))
