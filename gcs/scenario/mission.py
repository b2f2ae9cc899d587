"""The section `mission` of a scenario: a path in space, item by item.

Each entry becomes one item of the mission protocol, so that both count items from 1.
"""

import functools
import math
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, model_validator

from ftc_autopilot.common.geography import Origin, place_of
from ftc_autopilot.guidance.mission_places import home_item
from gcs.console.terminal import print_line
from mavlink_defs import dialect
from mavlink_defs.config.inherit import merged
from mavlink_defs.config.models import AtMost, ConfigError, Model, Problem, Problems, shown
from mavlink_defs.config.quantity import quantity, whole
from mavlink_defs.config.written import located, source_at, written_in
from mavlink_defs.constants import INT32_MAX, MAX_MISSION_ITEMS
from mavlink_defs.float32 import decimal_of_float32
from mavlink_defs.mission_files import MAX_NOT_FLOWN, mission_item, read_mission_file
from mavlink_defs.services.mission import MissionItem


class WaypointEntry(Model):
    """A place to fly by."""

    north_m: float = quantity("m", doc="North of the origin.")
    east_m: float = quantity("m", doc="East of the origin.")
    height_m: float = quantity("m", doc="Height above home.")
    within_m: float = quantity(
        "m", ge=0.0, default=0.0, doc="Greatest distance at which it is passed; 0: any."
    )

    def item(self, seq: int, origin: Origin) -> MissionItem:
        """Return the item of the protocol, with a number."""
        x, y, *_ = place_of(origin, self.north_m, self.east_m, 0.0)
        params = (0.0, self.within_m)
        return mission_item(seq, dialect.MAV_CMD_NAV_WAYPOINT, params, x, y, self.height_m)


class LoiterEntry(Model):
    """A circle."""

    north_m: float | None = quantity(
        "m", default=None, doc="North of the centre; none: a circle through the place before."
    )
    east_m: float | None = quantity("m", default=None, doc="East of the centre.")
    height_m: float = quantity("m", doc="Height above home.")
    radius_m: float = quantity(
        "m", default=0.0, doc="Radius, positive clockwise; 0: of a turn at 20 deg of bank."
    )
    turns: float | None = quantity("", gt=0.0, default=None, doc="Turns before it is left.")
    time_s: float | None = quantity("s", ge=0.0, default=None, doc="Time before it is left.")

    @model_validator(mode="after")
    def _keys_fit(self) -> "LoiterEntry":
        if (self.north_m is None) != (self.east_m is None):
            raise Problems([Problem((), "expected {0} and {1} or none of them", keys=_CENTRE)])
        if self.turns is not None and self.time_s is not None:
            raise Problems([Problem((), "expected {0} or {1}, got both", keys=_ENDS)])
        return self

    def item(self, seq: int, origin: Origin) -> MissionItem:
        """Return the item of the protocol, with a number."""
        command, first = dialect.MAV_CMD_NAV_LOITER_UNLIM, 0.0
        if self.turns is not None:
            command, first = dialect.MAV_CMD_NAV_LOITER_TURNS, self.turns
        elif self.time_s is not None:
            command, first = dialect.MAV_CMD_NAV_LOITER_TIME, self.time_s
        x = y = INT32_MAX
        if self.north_m is not None and self.east_m is not None:
            x, y, *_ = place_of(origin, self.north_m, self.east_m, 0.0)
        return mission_item(seq, command, (first, 0.0, self.radius_m), x, y, self.height_m)


_CENTRE, _ENDS = ("north_m", "east_m"), ("turns", "time_s")


class SpeedEntry(Model):
    """The airspeed from here on."""

    airspeed_m_s: float = quantity("m/s", gt=0.0, doc="Airspeed.")

    def item(self, seq: int, _: Origin) -> MissionItem:
        """Return the item of the protocol, with a number."""
        params = (0.0, self.airspeed_m_s, -1.0)
        return mission_item(seq, dialect.MAV_CMD_DO_CHANGE_SPEED, params)


class DelayEntry(Model):
    """Time before the entries up to the next place take effect."""

    time_s: float = quantity("s", ge=0.0, doc="Time.")

    def item(self, seq: int, _: Origin) -> MissionItem:
        """Return the item of the protocol, with a number."""
        return mission_item(seq, dialect.MAV_CMD_CONDITION_DELAY, (self.time_s,))


class JumpEntry(Model):
    """The mission continues with another item."""

    to_item: int = whole("", ge=1, doc="Item to continue with; the first one is 1.")
    times: int = whole("", ge=-1, default=-1, doc="How often; -1: always.")

    def item(self, seq: int, _: Origin) -> MissionItem:
        """Return the item of the protocol, with a number."""
        return mission_item(seq, dialect.MAV_CMD_DO_JUMP, (float(self.to_item), float(self.times)))


class HomeEntry(Model):
    """A new home."""

    north_m: float = quantity("m", doc="North of the origin.")
    east_m: float = quantity("m", doc="East of the origin.")
    height_m: float = quantity("m", default=0.0, doc="Height above the origin.")

    def item(self, seq: int, origin: Origin) -> MissionItem:
        """Return the item of the protocol, with a number."""
        x, y, *_ = place_of(origin, self.north_m, self.east_m, 0.0)
        altitude_m, frame = origin.altitude_m + self.height_m, dialect.MAV_FRAME_GLOBAL
        return mission_item(seq, dialect.MAV_CMD_DO_SET_HOME, (), x, y, altitude_m, frame)


class ReturnEntry(Model):
    """The circle around home."""

    def item(self, seq: int, _: Origin) -> MissionItem:
        """Return the item of the protocol, with a number."""
        return mission_item(seq, dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH)


class ProtocolEntry(Model):
    """An item as the mission protocol has it."""

    command: int = whole("", ge=0, le=0xFFFF, doc="MAV_CMD.")
    frame: int = whole("", ge=0, le=0xFF, default=3, doc="MAV_FRAME.")
    params: Annotated[tuple[float | None, ...], AtMost(4)] = Field(
        default=(), description="Parameters 1 to 4; null is NaN."
    )
    x: int = whole("", ge=-INT32_MAX, le=INT32_MAX, default=0, doc="Latitude in degE7, mostly.")
    y: int = whole("", ge=-INT32_MAX, le=INT32_MAX, default=0, doc="Longitude in degE7, mostly.")
    z: float = quantity("", default=0.0, doc="Altitude in m, mostly.")

    def item(self, seq: int, _: Origin) -> MissionItem:
        """Return the item of the protocol, with a number."""
        params = [math.nan if value is None else value for value in self.params]
        return mission_item(seq, self.command, params, self.x, self.y, self.z, self.frame)


class MissionEntry(Model):
    """One item; exactly one of the keys."""

    waypoint: WaypointEntry | None = Field(default=None, description="A place to fly by.")
    loiter: LoiterEntry | None = Field(default=None, description="A circle.")
    speed: SpeedEntry | None = Field(default=None, description="The airspeed from here on.")
    delay: DelayEntry | None = Field(
        default=None, description="Time before entries up to the next place take effect."
    )
    jump: JumpEntry | None = Field(default=None, description="Go on with another item.")
    home: HomeEntry | None = Field(default=None, description="A new home.")
    return_to_launch: ReturnEntry | None = Field(
        default=None, description="The circle around home: `{}`."
    )
    item: ProtocolEntry | None = Field(
        default=None, description="Any item as the mission protocol has it."
    )

    @model_validator(mode="after")
    def _one_key(self) -> "MissionEntry":
        given = [key for key in type(self).model_fields if getattr(self, key) is not None]
        if len(given) != 1:
            keys = ", ".join(type(self).model_fields)
            got = " and ".join(given) or "none"
            raise Problems([((), f"expected one of the keys {keys}, got {got}")])
        return self

    def mission_item(self, seq: int, origin: Origin) -> MissionItem:
        """Return the item of the protocol, with a number."""
        (entry,) = (v for key in type(self).model_fields if (v := getattr(self, key)) is not None)
        item: MissionItem = entry.item(seq, origin)
        return item


class MissionSection(Model):
    """A path in space; in a file, `file` may name a mission file instead."""

    items: Annotated[tuple[MissionEntry, ...], AtMost(MAX_MISSION_ITEMS)] = Field(
        min_length=1, description="The items, in order."
    )
    not_flown: Annotated[tuple[str, ...], AtMost(MAX_NOT_FLOWN)] = Field(
        default=(), exclude=True, description="Set by `file`: what else is in it."
    )

    def mission_items(self, origin: Origin) -> tuple[MissionItem, ...]:
        """Return the mission as it is uploaded; item 0 is home."""
        items = (entry.mission_item(seq, origin) for seq, entry in enumerate(self.items, start=1))
        return home_item(origin), *items


def _entry_of(item: MissionItem) -> dict[str, Any]:
    """Return an item as plain data of a file."""
    params = (item.param1, item.param2, item.param3, item.param4)
    numbers = [None if math.isnan(value) else decimal_of_float32(value) for value in params]
    place = {"x": item.x, "y": item.y, "z": decimal_of_float32(item.z)}
    return {"item": {"command": item.command, "frame": item.frame, "params": numbers} | place}


@functools.cache  # a scenario is read several times in one command
def tell_not_flown(name: Path | str, not_flown: tuple[str, ...]) -> None:
    """Tell once what is in a mission file that no vehicle takes, if there is anything."""
    if not_flown:
        text = f"{name}: not flown: {', '.join(not_flown)}. Vehicles take the items alone"
        print_line(text, stderr=True)


def with_mission_file(path: Path | str, tree: dict[Any, Any]) -> dict[Any, Any]:
    """Return the tree of a scenario with the items of the mission file that it names.

    Args:
        path: The file that the tree is of; the mission file lies beside it.
        tree: Plain data read from it.

    Raises:
        ConfigError: The mission file cannot be used.
    """
    mission = tree.get("mission")
    if not isinstance(mission, dict) or "file" not in mission:
        return tree
    name, *others = (mission["file"], *(key for key in mission if key != "file"))
    if not isinstance(name, str) or others:
        got = " and ".join([shown(name), *map(str, others)])
        text = f"expected the name of a mission file, and no key beside it, got {got}"
        raise ConfigError(path, located(tree, [Problem(("mission", "file"), text)]))
    try:
        held = read_mission_file(Path(path).parent / name)
    except ConfigError as error:
        problems = [Problem(("mission", "file"), line) for line in error.lines]
        raise ConfigError(path, located(tree, problems)) from error
    tell_not_flown(Path(path).parent / name, held.not_flown)
    entries = written_in(
        [_entry_of(item) for item in held.items[1:]], source_at(tree, ("mission", "file"))
    )
    mission = {"file": None, "items": entries, "not_flown": list(held.not_flown) or None}
    changed: dict[Any, Any] = merged(tree, {"mission": mission})
    return changed
