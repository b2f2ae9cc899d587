"""The section `mission` of a scenario: a path in space, item by item.

Each entry becomes one item of the mission protocol, so that both count items from 1.
"""

import functools
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from ftc_autopilot.common.geography import Origin, place_of
from ftc_autopilot.guidance.mission_places import home_item
from gcs.console.lines import print_line
from gcs.scenario.moved_mission import moved_to
from mavlink_defs import dialect
from mavlink_defs.config.inherit import merged
from mavlink_defs.config.models import AtMost, ConfigError, Model, Problem, Problems, shown
from mavlink_defs.config.quantity import quantity, whole
from mavlink_defs.config.written import located, source_at, written_in
from mavlink_defs.constants import INT32_MAX, MAX_MISSION_ITEMS
from mavlink_defs.mission_files import MAX_NOT_FLOWN, MissionFile, mission_item, read_mission_file
from mavlink_defs.services.mission import MissionItem


class WaypointEntry(Model):
    """A place to fly by.

    Attributes:
        north_m: North of the origin.
        east_m: East of the origin.
        height_m: Height above home.
        within_m: Greatest distance at which it is passed; 0: any.
    """

    north_m: float = quantity("m")
    east_m: float = quantity("m")
    height_m: float = quantity("m")
    within_m: float = quantity("m", default=0.0, ge=0.0)

    def item(self, seq: int, origin: Origin) -> MissionItem:
        """Return the item of the protocol, with a number."""
        x, y, *_ = place_of(origin, self.north_m, self.east_m, 0.0)
        params = (0.0, self.within_m)
        return mission_item(seq, dialect.MAV_CMD_NAV_WAYPOINT, params, x, y, self.height_m)


class TakeOffEntry(Model):
    """The take-off, along the nose of an aircraft that stands; one in the air is past it.

    Attributes:
        height_m: Height above home that it climbs to.
    """

    height_m: float = quantity("m")

    def item(self, seq: int, _: Origin) -> MissionItem:
        """Return the item of the protocol, with a number."""
        return mission_item(seq, dialect.MAV_CMD_NAV_TAKEOFF, altitude_m=self.height_m)


class LandEntry(Model):
    """A landing, along the line from the place before.

    Attributes:
        north_m: Touchdown, north of the origin.
        east_m: Touchdown, east of the origin.
        height_m: Height of the runway above home.
    """

    north_m: float = quantity("m")
    east_m: float = quantity("m")
    height_m: float = quantity("m", default=0.0)

    def item(self, seq: int, origin: Origin) -> MissionItem:
        """Return the item of the protocol, with a number."""
        x, y, *_ = place_of(origin, self.north_m, self.east_m, 0.0)
        return mission_item(seq, dialect.MAV_CMD_NAV_LAND, (), x, y, self.height_m)


class LoiterEntry(Model):
    """A circle.

    Attributes:
        north_m: North of the centre; none: a circle through the place before.
        east_m: East of the centre.
        height_m: Height above home.
        radius_m: Radius, positive clockwise; 0: of a turn at 20 deg of bank.
        turns: Turns before it is left.
        time_s: Time before it is left.
    """

    north_m: float | None = quantity("m", default=None)
    east_m: float | None = quantity("m", default=None)
    height_m: float = quantity("m")
    radius_m: float = quantity("m", default=0.0)
    turns: float | None = quantity("", default=None, gt=0.0)
    time_s: float | None = quantity("s", default=None, ge=0.0)

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
    """The airspeed from here on.

    Attributes:
        airspeed_m_s: Airspeed.
    """

    airspeed_m_s: float = quantity("m/s", gt=0.0)

    def item(self, seq: int, _: Origin) -> MissionItem:
        """Return the item of the protocol, with a number."""
        params = (0.0, self.airspeed_m_s, -1.0)
        return mission_item(seq, dialect.MAV_CMD_DO_CHANGE_SPEED, params)


class DelayEntry(Model):
    """Time before the entries up to the next place take effect.

    Attributes:
        time_s: Time.
    """

    time_s: float = quantity("s", ge=0.0)

    def item(self, seq: int, _: Origin) -> MissionItem:
        """Return the item of the protocol, with a number."""
        return mission_item(seq, dialect.MAV_CMD_CONDITION_DELAY, (self.time_s,))


class JumpEntry(Model):
    """The mission continues with another item.

    Attributes:
        to_item: Item to continue with; the first one is 1.
        times: How often; -1: always.
    """

    to_item: int = whole("", ge=1)
    times: int = whole("", default=-1, ge=-1)

    def item(self, seq: int, _: Origin) -> MissionItem:
        """Return the item of the protocol, with a number."""
        return mission_item(seq, dialect.MAV_CMD_DO_JUMP, (float(self.to_item), float(self.times)))


class HomeEntry(Model):
    """A new home.

    Attributes:
        north_m: North of the origin.
        east_m: East of the origin.
        height_m: Height above the origin.
    """

    north_m: float = quantity("m")
    east_m: float = quantity("m")
    height_m: float = quantity("m", default=0.0)

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
    """An item as the mission protocol has it.

    Attributes:
        command: MAV_CMD.
        frame: MAV_FRAME.
        params: Parameters 1 to 4; null is NaN.
        x: Latitude in degE7, mostly.
        y: Longitude in degE7, mostly.
        z: Altitude in m, mostly; null is NaN.
    """

    command: int = whole("", ge=0, le=0xFFFF)
    frame: int = whole("", default=3, ge=0, le=0xFF)
    params: Annotated[tuple[float | None, ...], AtMost(4)] = ()
    x: int = whole("", default=0, ge=-INT32_MAX, le=INT32_MAX)
    y: int = whole("", default=0, ge=-INT32_MAX, le=INT32_MAX)
    z: float | None = quantity("", default=0.0)

    def item(self, seq: int, _: Origin) -> MissionItem:
        """Return the item of the protocol, with a number."""
        return mission_item(seq, self.command, self.params, self.x, self.y, self.z, self.frame)


class OneKey(Model):
    """A mapping with exactly one of its keys."""

    @model_validator(mode="after")
    def _one_key(self) -> Self:
        given = [key for key in type(self).model_fields if getattr(self, key) is not None]
        if len(given) != 1:
            keys = ", ".join(type(self).model_fields)
            got = " and ".join(given) or "none"
            raise Problems([((), f"expected one of the keys {keys}, got {got}")])
        return self

    @property
    def entry(self) -> Any:
        """What that key holds."""
        found = (getattr(self, key) for key in type(self).model_fields)
        return next(value for value in found if value is not None)


class MissionEntry(OneKey):
    """One item; exactly one of the keys.

    Attributes:
        waypoint: A place to fly by.
        loiter: A circle.
        take_off: The take-off.
        land: A landing.
        speed: The airspeed from here on.
        delay: Time before entries up to the next place take effect.
        jump: Go on with another item.
        home: A new home.
        return_to_launch: The circle around home: `{}`.
        item: Any item as the mission protocol has it.
    """

    waypoint: WaypointEntry | None = None
    loiter: LoiterEntry | None = None
    take_off: TakeOffEntry | None = None
    land: LandEntry | None = None
    speed: SpeedEntry | None = None
    delay: DelayEntry | None = None
    jump: JumpEntry | None = None
    home: HomeEntry | None = None
    return_to_launch: ReturnEntry | None = None
    item: ProtocolEntry | None = None

    def mission_item(self, seq: int, origin: Origin) -> MissionItem:
        """Return the item of the protocol, with a number."""
        item: MissionItem = self.entry.item(seq, origin)
        return item


class PlannedHome(Model):
    """Where home was when the items were planned; 0 for none.

    Attributes:
        x: Latitude in degE7.
        y: Longitude in degE7.
        altitude_m: Altitude above mean sea level.
    """

    x: int = whole("", default=0, ge=-INT32_MAX, le=INT32_MAX)
    y: int = whole("", default=0, ge=-INT32_MAX, le=INT32_MAX)
    altitude_m: float = quantity("m", default=0.0)

    def item(self) -> MissionItem:
        """Return item 0 of the protocol."""
        command, frame = dialect.MAV_CMD_NAV_WAYPOINT, dialect.MAV_FRAME_GLOBAL
        return mission_item(0, command, (), self.x, self.y, self.altitude_m, frame)


class MissionSection(Model):
    """A path in space; in a file, `file` may name a mission file instead, `here: true` move it.

    Attributes:
        items: The items, in order.
        planned_home: Home that the items were planned for: they are moved from there to the origin.
            Set by `file` with `here: true`; none: they lie where they say.
        not_flown: Set by `file`: what else is in it.
    """

    items: Annotated[tuple[MissionEntry, ...], AtMost(MAX_MISSION_ITEMS)] = Field(min_length=1)
    planned_home: PlannedHome | None = None
    not_flown: Annotated[tuple[str, ...], AtMost(MAX_NOT_FLOWN)] = Field(default=(), exclude=True)

    def mission_items(self, origin: Origin) -> tuple[MissionItem, ...]:
        """Return the mission as it is uploaded; item 0 is home."""
        home = home_item(origin)
        items = (entry.mission_item(seq, origin) for seq, entry in enumerate(self.items, start=1))
        if self.planned_home is None:
            return home, *items
        return moved_to(home, [self.planned_home.item(), *items])


@functools.cache  # a scenario is read several times in one command
def tell_not_flown(name: Path | str, not_flown: tuple[str, ...]) -> None:
    """Tell once what is in a mission file that no vehicle takes, if there is anything."""
    if not_flown:
        text = f"{name}: not flown: {', '.join(not_flown)}"
        print_line(text, stderr=True)


def with_mission_file(
    path: Path | str,
    tree: dict[Any, Any],
    left_out: Callable[[MissionFile, dict[Any, Any]], Iterable[str]],
) -> dict[Any, Any]:
    """Return the tree of a scenario with the items of the mission file that it names.

    Args:
        path: The file that the tree is of; the mission file lies beside it.
        tree: Plain data read from it.
        left_out: Returns what else of the mission file the tree does not take.

    Raises:
        ConfigError: The mission file cannot be used.
    """
    mission = tree.get("mission")
    if not isinstance(mission, dict) or "file" not in mission:
        return tree
    name, here = mission["file"], mission.get("here", False)
    others = [key for key in mission if key not in {"file", "here"}]
    if not isinstance(name, str) or not isinstance(here, bool) or others:
        got = " and ".join([shown(name), *map(str, others)])
        text = "expected the name of a mission file, and no key beside it but here: true or false"
        raise ConfigError(path, located(tree, [Problem(("mission", "file"), f"{text}, got {got}")]))
    try:
        held = read_mission_file(Path(path).parent / name)
    except ConfigError as error:
        problems = [Problem(("mission", "file"), line) for line in error.lines]
        raise ConfigError(path, located(tree, problems)) from error
    not_flown = (*left_out(held, tree), *held.not_flown)[:MAX_NOT_FLOWN]
    tell_not_flown(Path(path).parent / name, not_flown)
    entries = written_in(
        [{"item": entry} for entry in held.entries[1:]], source_at(tree, ("mission", "file"))
    )
    home = {
        key: held.entries[0][name] for key, name in (("x", "x"), ("y", "y"), ("altitude_m", "z"))
    }
    mission = {
        "file": None,
        "here": None,
        "items": entries,
        "planned_home": home if here else None,
        "not_flown": list(not_flown) or None,
    }
    changed: dict[Any, Any] = merged(tree, {"mission": mission})
    return changed
