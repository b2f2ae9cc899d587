"""Missions, messages and a vehicle for the tests of the mission service."""

import struct
from collections.abc import Sequence
from typing import Any

from lossy_network import GCS, VEHICLE, over_the_wire

from mavlink_defs import dialect
from mavlink_defs.dialect import (
    MAVLink_message,
    MAVLink_mission_clear_all_message,
    MAVLink_mission_count_message,
    MAVLink_mission_request_int_message,
)
from mavlink_defs.profile import (
    AirspeedLimits,
    Segment,
    check_mission,
    segments_to_items,
)
from mavlink_defs.services.machine import SystemId
from mavlink_defs.services.mission import MissionItem, MissionUploader
from mavlink_defs.services.mission_server import MissionServer
from mavlink_defs.services.mission_types import MissionTypes

ACCEPTED = dialect.MAV_MISSION_ACCEPTED
CANCELLED = dialect.MAV_MISSION_OPERATION_CANCELLED
MISSION = dialect.MAV_MISSION_TYPE_MISSION
FENCE = dialect.MAV_MISSION_TYPE_FENCE
RALLY = dialect.MAV_MISSION_TYPE_RALLY
ALL = dialect.MAV_MISSION_TYPE_ALL


class MissionClearer(MissionUploader):
    """Clears the mission of a vehicle as other stations do: by one message, not an empty upload."""

    def __init__(self, own: SystemId, vehicle: SystemId, mission_type: int = 0) -> None:
        super().__init__(own, vehicle, [], mission_type)

    def _first_request(self) -> MAVLink_message:
        return MAVLink_mission_clear_all_message(*self._vehicle, self._mission_type)


def mission(segments: int, airspeed: float = 30.0) -> list[MissionItem]:
    return segments_to_items(
        [Segment(float(i), airspeed, 0.5 * i, 0.9, -0.1, ramp=False) for i in range(segments)],
        *VEHICLE,
    )


def contents(items: Sequence[MissionItem]) -> list[bytes]:
    return [
        struct.pack(
            "<4f2if2H", i.param1, i.param2, i.param3, i.param4, i.x, i.y, i.z, i.seq, i.command
        )
        for i in items
    ]


def validate(items: Sequence[MissionItem]) -> None:
    check_mission(items, AirspeedLimits(15.0, 45.0))


def item(seq: int, source: Sequence[MissionItem] | None = None) -> MissionItem:
    return (mission(9) if source is None else source)[seq]


def count(n: int, mission_type: int = 0) -> MAVLink_mission_count_message:
    return MAVLink_mission_count_message(*VEHICLE, n, mission_type)


def request(seq: int, mission_type: int = 0) -> MAVLink_mission_request_int_message:
    return MAVLink_mission_request_int_message(*VEHICLE, seq, mission_type)


class Servers(MissionTypes):
    """The servers of all types, of which a mission alone must be a profile."""

    def __init__(self) -> None:
        def take(items: Sequence[MissionItem]) -> None:
            pass

        self.servers = {
            kind: MissionServer(VEHICLE, take if kind else validate, mission_type=kind)
            for kind in (MISSION, FENCE, RALLY)
        }
        super().__init__(VEHICLE, self.servers)

    def messages_to_send(self) -> Any:
        return [message for message, _ in super().messages_to_send()]

    def events(self) -> list[Any]:
        return [event for server in self.servers.values() for event in server.events()]


class Vehicle:
    """A server that is talked to one message at a time."""

    def __init__(self, segments: int = 0) -> None:
        self.servers = Servers()
        self.server = self.servers.servers[MISSION]
        self._frames = 0
        if segments:
            self.upload(mission(segments))
            self.server.events()

    def answers(
        self,
        message: MAVLink_message,
        source: SystemId = GCS,
        now: float = 0.0,
        seq: int | None = None,
    ) -> list[tuple[str, int]]:
        """Type of each answer, and what it says; `seq`: a frame's number, if not the next one."""
        self._frames += 1
        number = self._frames % 256 if seq is None else seq
        self.servers.receive(over_the_wire(message, source, number), now)
        return self.sent(source)

    def sent(self, to: SystemId = GCS) -> list[tuple[str, int]]:
        found = []
        message: Any
        for message in self.servers.messages_to_send():
            if hasattr(message, "target_system"):
                assert (message.target_system, message.target_component) == to
            said = next(n for n in ("type", "count", "seq") if hasattr(message, n))
            found.append((message.get_type(), getattr(message, said)))
        return found

    def upload(
        self, items: Sequence[MissionItem], source: SystemId = GCS, mission_type: int = 0
    ) -> int:
        (answer,) = self.answers(count(len(items), mission_type), source)
        for i in range(len(items)):
            assert answer == ("MISSION_REQUEST_INT", i)
            items[i].mission_type = mission_type
            (answer,) = self.answers(items[i], source)
        assert answer[0] == "MISSION_ACK"
        return answer[1]


def ack(result: int) -> list[tuple[str, int]]:
    return [("MISSION_ACK", result)]
