"""The mission that an autopilot keeps for the case that its process dies, in a file of its own.

It is written when it changes, as a whole, and begins with a checksum: what is not whole is not
taken for a mission.
"""

import hashlib
import struct
from pathlib import Path
from typing import NamedTuple

from ftc_autopilot.guidance.mission_places import Home
from mavlink_defs.mission_files import mission_item
from mavlink_defs.runtime.files import complete_file
from mavlink_defs.services.mission import MissionItem

_HEAD = struct.Struct("<4d")  # home: north, east, height [m]; airspeed [m/s]
_ITEM = struct.Struct("<5d4i")
_DIGEST_SIZE = hashlib.sha256().digest_size


class KeptMission(NamedTuple):
    """A mission, and what else its path depends on.

    Attributes:
        items: All of it, home included; none without a mission.
        home: Home.
        airspeed: On ways that no mission sets one for [m/s].
    """

    items: tuple[MissionItem, ...]
    home: Home
    airspeed: float


def write_kept_mission(path: Path, mission: KeptMission) -> None:
    """Write the file.

    Raises:
        OSError: It cannot be written; it is named.
    """
    home = mission.home
    content = _HEAD.pack(home.north_m, home.east_m, home.height_m, mission.airspeed)
    for i in mission.items:
        floats = (i.param1, i.param2, i.param3, i.param4, i.z)
        content += _ITEM.pack(*floats, i.x, i.y, i.command, i.frame)
    with complete_file(path) as file:
        file.write(hashlib.sha256(content).digest() + content)


def read_kept_mission(path: Path) -> KeptMission | None:
    """Return what a file holds; None if there is none, or if it is not whole."""
    try:
        whole = path.read_bytes()
    except OSError:
        return None
    digest, content = whole[:_DIGEST_SIZE], whole[_DIGEST_SIZE:]
    if hashlib.sha256(content).digest() != digest:
        return None
    north, east, height, airspeed = _HEAD.unpack_from(content)
    items = []
    for seq, fields in enumerate(_ITEM.iter_unpack(content[_HEAD.size :])):
        p1, p2, p3, p4, z, x, y, command, frame = fields
        items.append(mission_item(seq, command, (p1, p2, p3, p4), x, y, z, frame))
    return KeptMission(tuple(items), Home(north, east, height), airspeed)
