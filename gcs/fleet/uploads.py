"""Which ground station uploads to which vehicle, where several have one address.

A vehicle knows its clients by system and component: to it, stations that have the same address are
one. The hub knows their sockets. So an upload belongs to the socket whose MISSION_COUNT was passed
on last: nothing of another socket reaches that upload, and only its socket hears what is requested
and accepted. Vehicles answer in order and within `HOLD_S`. No socket and no clock.
"""

from dataclasses import dataclass
from typing import Any, TypeAlias

from mavlink_defs import dialect
from mavlink_defs.services.machine import SystemId, is_for, sender_of
from mavlink_defs.services.mission import RESPONSE_TIMEOUT_S
from mavlink_defs.services.mission_server import ON_ITS_OWN

Peer: TypeAlias = tuple[str, int]

HOLD_S = 2.0 * RESPONSE_TIMEOUT_S
"""Silence of a station after which another one with its address may begin an upload."""
ANSWERS = frozenset(
    {
        dialect.MAVLINK_MSG_ID_MISSION_REQUEST,
        dialect.MAVLINK_MSG_ID_MISSION_REQUEST_INT,
        dialect.MAVLINK_MSG_ID_MISSION_ACK,
    }
)
"""What a vehicle says to the station that uploads."""
_FORGET_S = 60.0  # a vehicle gives an upload up after 30 s of silence
_ITEMS = (dialect.MAVLink_mission_item_int_message, dialect.MAVLink_mission_item_message)


@dataclass
class _Upload:
    """An upload of one address to one vehicle; clearing, and an item on its own, are others."""

    peer: Peer
    heard_s: float
    last: int = -1  # number of its last item
    owed: int = 0  # acknowledgements that the vehicle still has to send
    over: bool = False


class Uploads:
    """The uploads to the vehicles of a hub, each type apart."""

    def __init__(self, most: int) -> None:
        """Start without any.

        Args:
            most: Uploads that are remembered at the same time; further ones are refused.
        """
        self._most = most
        self._held: dict[tuple[int, SystemId, int], _Upload] = {}

    def passes(self, message: Any, system: int, peer: Peer, now: float) -> bool:
        """Return whether a station's message is passed on to a vehicle, and note that it is.

        Args:
            message: Any message.
            system: System id of the vehicle.
            peer: Address of the station's socket.
            now: Time [s].
        """
        is_count = isinstance(message, dialect.MAVLink_mission_count_message)
        is_item = isinstance(message, _ITEMS)
        is_alone = isinstance(message, dialect.MAVLink_mission_clear_all_message) or (
            is_item and message.current in ON_ITS_OWN
        )
        is_cancel = (
            isinstance(message, dialect.MAVLink_mission_ack_message)
            and message.type != dialect.MAV_MISSION_ACCEPTED  # ends a download
        )
        vehicle = SystemId(system, dialect.MAV_COMP_ID_AUTOPILOT1)
        if not (is_count or is_item or is_cancel or is_alone) or not is_for(message, vehicle):
            return True
        key = (system, sender_of(message), message.mission_type)
        upload = self._held.get(key)
        if upload is not None and upload.peer != peer:
            if is_item and not is_alone:
                return False
            if not upload.over and now - upload.heard_s <= HOLD_S:
                return False
            upload = None
        if upload is None:
            if not (is_count or is_alone):
                return True  # of no upload: the vehicle says so
            if not self._has_room(now):
                return False
            upload = self._held[key] = _Upload(peer, now)
        upload.heard_s = now
        if is_count:
            upload.last, upload.over = message.count - 1, False
        upload.over |= is_cancel
        upload.owed += (
            is_alone or (is_count and not message.count) or (is_item and message.seq == upload.last)
        )
        return True

    def hearers(self, message: Any, stations: list[Peer]) -> list[Peer]:
        """Return who hears one of `ANSWERS` of a vehicle, of the stations that there are."""
        client = SystemId(message.target_system, message.target_component)
        upload = self._held.get((message.get_srcSystem(), client, message.mission_type))
        if upload is None:
            return stations
        if isinstance(message, dialect.MAVLink_mission_ack_message):
            owed, upload.owed = upload.owed, max(upload.owed - 1, 0)
            upload.over = True
            if message.type != dialect.MAV_MISSION_ACCEPTED:
                return stations
            if not owed:
                return []  # of the upload of another one before
        return [peer for peer in stations if peer == upload.peer]

    def _has_room(self, now: float) -> bool:
        if len(self._held) >= self._most:
            held = self._held.items()
            self._held = {k: upload for k, upload in held if now - upload.heard_s <= _FORGET_S}
        return len(self._held) < self._most


def refusal(message: Any) -> dialect.MAVLink_mission_ack_message | None:
    """Return what a message that is not passed on is answered with; None: nothing.

    What begins an upload is denied, as a vehicle denies it to a second client; an item belongs
    to an upload that is no more.
    """
    if isinstance(message, dialect.MAVLink_mission_ack_message):
        return None
    is_item = isinstance(message, _ITEMS) and message.current not in ON_ITS_OWN
    cancelled, denied = dialect.MAV_MISSION_OPERATION_CANCELLED, dialect.MAV_MISSION_DENIED
    return dialect.MAVLink_mission_ack_message(
        *sender_of(message), cancelled if is_item else denied, message.mission_type
    )
