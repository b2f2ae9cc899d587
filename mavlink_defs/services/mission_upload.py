"""Uploads to a vehicle: who uploads, and what has come."""

import struct
from dataclasses import dataclass, field
from typing import NamedTuple

from mavlink_defs.dialect import MAVLink_mission_item_message
from mavlink_defs.services.machine import SystemId
from mavlink_defs.services.mission import MissionItem, item_as_int


class UploadClient(NamedTuple):
    """A client: its address, and the station over which its messages arrive."""

    address: SystemId
    station: int


@dataclass
class Upload:
    """An upload, in progress (`result` None) or over: then only its last item is stored."""

    sender: UploadClient
    mission_type: int
    count: int
    sequence: int = -1  # number of the frame of its MISSION_COUNT
    begun_s: float = 0.0  # when that came
    items: list[MissionItem] = field(default_factory=list)
    retries: int = 0  # repeated requests since the last item
    ignored: int = 0  # after which the client was heard, but no item came
    heard_s: float = 0.0  # when the client was heard
    asked_s: float = 0.0  # when the awaited item was requested
    result: int | None = None

    def differs(self, item: MissionItem | MAVLink_mission_item_message, index: int) -> bool:
        """Return whether an item differs from the stored one of the same number."""
        return bool(self.items) and content_of(item_as_int(item)) != content_of(self.items[index])


def content_of(item: MissionItem) -> bytes:
    """Return all that makes an item, as bytes: NaN is equal to itself there."""
    i = item
    numbers = (i.param1, i.param2, i.param3, i.param4, i.z, i.x, i.y, i.seq, i.command, i.frame)
    return struct.pack("<5f2i3H", *numbers)
