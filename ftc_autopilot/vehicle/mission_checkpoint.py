"""The mission in the checkpoint of an autopilot, in a file of its own.

It is written when it changes, as a whole: a checksum, home and airspeed, and the payloads of
MISSION_ITEM_INT. A file that is not whole counts as none.
"""

import hashlib
import struct
from pathlib import Path
from typing import NamedTuple

from ftc_autopilot.guidance.mission_places import Home
from mavlink_defs.config.output_files import complete_file
from mavlink_defs.dialect import MAVLink_mission_item_int_message
from mavlink_defs.services.mission import MissionItem

_HEAD = struct.Struct("<4d")  # home: north, east, height [m]; airspeed [m/s]
_ITEM: struct.Struct = MAVLink_mission_item_int_message.unpacker
_DIGEST_SIZE = hashlib.sha256().digest_size


class MissionCheckpoint(NamedTuple):
    """A mission, and what else its path depends on.

    Attributes:
        items: All of it, home included; none without a mission.
        home: Home.
        airspeed: On ways that no mission sets one for [m/s].
    """

    items: tuple[MissionItem, ...]
    home: Home
    airspeed: float


def save_mission(path: Path, mission: MissionCheckpoint) -> None:
    """Write the file.

    Raises:
        OSError: It cannot be written; it is named.
    """
    home = mission.home
    content = _HEAD.pack(home.north_m, home.east_m, home.height_m, mission.airspeed)
    for item in mission.items:
        content += _ITEM.pack(*(getattr(item, name) for name in item.ordered_fieldnames))
    with complete_file(path) as file:
        file.write(hashlib.sha256(content).digest() + content)


def load_mission(path: Path) -> MissionCheckpoint | None:
    """Return what a file holds; None if there is none, or if it is not whole."""
    try:
        whole = path.read_bytes()
    except OSError:
        return None
    digest, content = whole[:_DIGEST_SIZE], whole[_DIGEST_SIZE:]
    if hashlib.sha256(content).digest() != digest:
        return None
    north, east, height, airspeed = _HEAD.unpack_from(content)
    orders = MAVLink_mission_item_int_message.orders
    items = (
        MAVLink_mission_item_int_message(*(fields[k] for k in orders))
        for fields in _ITEM.iter_unpack(content[_HEAD.size :])
    )
    return MissionCheckpoint(tuple(items), Home(north, east, height), airspeed)
