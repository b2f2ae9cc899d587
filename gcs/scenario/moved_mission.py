"""A mission of elsewhere, moved as a whole to where it is to be flown."""

import math
from collections.abc import Sequence

from ftc_autopilot.common.geography import Origin, place_of, position_of
from ftc_autopilot.guidance.mission_items import has_place
from ftc_autopilot.guidance.mission_places import ANYWHERE_M
from mavlink_defs import dialect
from mavlink_defs.float32 import decimal_of_float32
from mavlink_defs.mission_files import mission_item
from mavlink_defs.services.mission import MissionItem

_ABSOLUTE = {dialect.MAV_FRAME_GLOBAL, dialect.MAV_FRAME_GLOBAL_INT}


def moved_to(home: MissionItem, items: Sequence[MissionItem]) -> tuple[MissionItem, ...]:
    """Return a mission with another home: every place is where it was, seen from home.

    Without a home of its own, or with one that is near no place of it, as files keep from the
    flight before, it is moved from its first place. Altitudes above sea level keep their height
    above home; a home without altitude has 0 m.

    Args:
        home: What becomes item 0, with a place.
        items: Home included.
    """
    return moved_plan(home, items, ())[0]


def moved_plan(
    home: MissionItem, items: Sequence[MissionItem], others: Sequence[Sequence[MissionItem]]
) -> tuple[tuple[MissionItem, ...], ...]:
    """Return a mission as of `moved_to`, and lists that belong to it, without a home, moved alike.

    Args:
        home: As of `moved_to`.
        items: As of `moved_to`.
        others: Fence and rally points, say.
    """
    places = [item for part in (items[1:], *others) for item in part if _is_at_a_place(item)]
    if not places:
        return ((home, *items[1:]), *map(tuple, others))
    before, after = _origin_at(items[0]), _origin_at(home)
    away = min(math.hypot(*position_of(before, item.x, item.y)) for item in places)
    if not has_place(items[0]) or away > ANYWHERE_M:
        before = _origin_at(places[0])
    rise = after.altitude_m - _altitude(items[0])
    mission, *rest = (
        tuple(_moved(item, before, after, rise) for item in part) for part in (items[1:], *others)
    )
    return ((home, *mission), *rest)


def _moved(item: MissionItem, before: Origin, after: Origin, rise: float) -> MissionItem:
    if not _is_at_a_place(item):
        return item
    x, y, *_ = place_of(after, *position_of(before, item.x, item.y), 0.0)
    z = item.z + rise if item.frame in _ABSOLUTE else item.z
    params = (item.param1, item.param2, item.param3, item.param4)
    moved = mission_item(item.seq, item.command, params, x, y, decimal_of_float32(z), item.frame)
    moved.autocontinue = item.autocontinue
    return moved


def _is_at_a_place(item: MissionItem) -> bool:
    """Return whether x and y of an item are latitude and longitude, and given."""
    command = dialect.enums["MAV_CMD"].get(item.command)
    return command is not None and command.has_location and has_place(item)


def _origin_at(item: MissionItem) -> Origin:
    return Origin.model_construct(
        latitude_deg=item.x / 1e7, longitude_deg=item.y / 1e7, altitude_m=_altitude(item)
    )


def _altitude(home: MissionItem) -> float:
    return 0.0 if math.isnan(home.z) else decimal_of_float32(home.z)
