"""Mission, fence and rally points in the checkpoint of an autopilot, in a file of their own.

It is written when they change, as a whole: a checksum, home and airspeed, the states of fence and
rally points, and the payloads of MISSION_ITEM_INT. A file that is not whole counts as none.
"""

import hashlib
import struct
from pathlib import Path
from typing import NamedTuple

from ftc_autopilot.guidance.mission_places import Home
from mavlink_defs.config.output_files import complete_file
from mavlink_defs.dialect import MAVLink_mission_item_int_message
from mavlink_defs.services.mission import MissionItem

_HEAD = struct.Struct("<4d2H")  # home: north, east, height [m]; airspeed [m/s]; sizes of states
_ITEM: struct.Struct = MAVLink_mission_item_int_message.unpacker
_DIGEST_SIZE = hashlib.sha256().digest_size


class MissionCheckpoint(NamedTuple):
    """A mission, and what else its path depends on.

    Attributes:
        items: All of all MAV_MISSION_TYPEs; home included if there is a mission.
        home: Home.
        airspeed: On ways that no mission sets one for [m/s].
        states: Parameters and more of fence and rally points.
    """

    items: tuple[MissionItem, ...]
    home: Home
    airspeed: float
    states: tuple[bytes, bytes] = (b"", b"")


def save_mission(path: Path, mission: MissionCheckpoint) -> None:
    """Write the file.

    Raises:
        OSError: It cannot be written; it is named.
    """
    home, states = mission.home, mission.states
    sizes = map(len, states)
    content = _HEAD.pack(home.north_m, home.east_m, home.height_m, mission.airspeed, *sizes)
    content += b"".join(states)
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
    north, east, height, airspeed, fence_size, rally_size = _HEAD.unpack_from(content)
    rally_at = _HEAD.size + fence_size
    items_at = rally_at + rally_size
    states = content[_HEAD.size : rally_at], content[rally_at:items_at]
    orders = MAVLink_mission_item_int_message.orders
    items = (
        MAVLink_mission_item_int_message(*(fields[k] for k in orders))
        for fields in _ITEM.iter_unpack(content[items_at:])
    )
    return MissionCheckpoint(tuple(items), Home(north, east, height), airspeed, states)
