"""The sections `fence` and `rally` of a scenario: areas, and points that RTL may lead to.

Each entry becomes one or more items of the mission protocol. A plan of a ground station, which
`file` names, gives the entries instead.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from pydantic import Field

from ftc_autopilot.common.geography import Origin, place_of
from ftc_autopilot.guidance.fence import FenceWatch, decode_fence, decode_rally
from ftc_autopilot.guidance.fence_parameters import (
    FenceParameters,
    RallyParameters,
    fence_records,
)
from ftc_autopilot.guidance.mission_places import Home
from ftc_autopilot.guidance.planner import Planner
from gcs.scenario.mission import OneKey, ProtocolEntry
from gcs.scenario.sections import Found, ScenarioUav
from mavlink_defs import dialect
from mavlink_defs.config.inherit import merged
from mavlink_defs.config.models import AtMost, ConfigError, Model, Problem, shown
from mavlink_defs.config.problems import counted
from mavlink_defs.config.quantity import quantity
from mavlink_defs.config.written import located, source_at, written_in
from mavlink_defs.constants import MAX_MISSION_ITEMS
from mavlink_defs.mission_files import MissionFile, mission_item, read_mission_file
from mavlink_defs.plan_fence import CIRCLES, POLYGONS, RALLY_POINT, RETURN_POINT
from mavlink_defs.profile import ItemError
from mavlink_defs.services.mission import MissionItem

_INSIDE = Field(default=True, description="Whether to stay inside; else outside.")


def _command(commands: dict[int, bool], inclusion: bool) -> int:
    return next(command for command, stay_in in commands.items() if stay_in == inclusion)


class FencePlaceEntry(Model):
    """A place, without a height.

    Attributes:
        north_m: North of the origin.
        east_m: East of the origin.
    """

    north_m: float = quantity("m")
    east_m: float = quantity("m")

    def item(self, command: int, origin: Origin, param: float = 0.0) -> MissionItem:
        """Return an item of a command here, without a number."""
        x, y, *_ = place_of(origin, self.north_m, self.east_m, 0.0)
        return mission_item(0, command, (param,), x, y, 0.0, dialect.MAV_FRAME_GLOBAL)

    def items(self, origin: Origin) -> list[MissionItem]:
        """Return the item of a return point."""
        return [self.item(RETURN_POINT, origin)]


class FencePolygonEntry(Model):
    """An area within corners.

    Attributes:
        corners: The corners in order; edges may not cross.
    """

    corners: Annotated[tuple[FencePlaceEntry, ...], AtMost(MAX_MISSION_ITEMS)] = Field(min_length=3)
    inclusion: bool = _INSIDE

    def items(self, origin: Origin) -> list[MissionItem]:
        """Return an item for each corner."""
        command, count = _command(POLYGONS, self.inclusion), float(len(self.corners))
        return [corner.item(command, origin, count) for corner in self.corners]


class FenceCircleEntry(FencePlaceEntry):
    """An area within a circle.

    Attributes:
        radius_m: Radius.
    """

    radius_m: float = quantity("m", gt=0.0)
    inclusion: bool = _INSIDE

    def items(self, origin: Origin) -> list[MissionItem]:
        """Return its item."""
        return [self.item(_command(CIRCLES, self.inclusion), origin, self.radius_m)]


class RallyPointEntry(FencePlaceEntry):
    """A place to circle at.

    Attributes:
        height_m: Height above home.
    """

    height_m: float = quantity("m")

    def items(self, origin: Origin) -> list[MissionItem]:
        """Return its item."""
        item = self.item(RALLY_POINT, origin)
        item.frame, item.z = dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT, self.height_m
        return [item]


class AnyFenceItem(ProtocolEntry):
    """An item as the mission protocol has it."""

    def items(self, origin: Origin) -> list[MissionItem]:
        """Return it."""
        return [self.item(0, origin)]


class FenceEntry(OneKey):
    """A part of a fence; exactly one of the keys.

    Attributes:
        polygon: An area within corners.
        circle: An area within a circle.
        return_point: Where the action `guided` leads; none: home.
        item: Any item as the mission protocol has it.
    """

    polygon: FencePolygonEntry | None = None
    circle: FenceCircleEntry | None = None
    return_point: FencePlaceEntry | None = None
    item: AnyFenceItem | None = None


class RallyEntry(OneKey):
    """A rally point; exactly one of the keys.

    Attributes:
        point: A place to circle at.
        item: Any item as the mission protocol has it.
    """

    point: RallyPointEntry | None = None
    item: AnyFenceItem | None = None


class FenceSection(FenceParameters):
    """Areas to stay in or out of; in a file, `file` may name a plan that has them instead.

    Attributes:
        enable: Whether the fence is watched from the start.
        items: The parts of the fence.
    """

    enable: bool = True
    items: Annotated[tuple[FenceEntry, ...], AtMost(MAX_MISSION_ITEMS)] = ()

    def watch(self, origin: Origin) -> FenceWatch:
        """Return what a vehicle watches of it, with home at the origin."""
        fence = decode_fence(numbered(self.items, origin), origin)
        return FenceWatch(fence, fence_records(self, RallyParameters()).fence[0])


class RallySection(RallyParameters):
    """Points that RTL leads to in place of home; in a file, `file` may name a plan with them.

    Attributes:
        items: The points.
    """

    items: Annotated[tuple[RallyEntry, ...], AtMost(MAX_MISSION_ITEMS)] = ()


class Areas(NamedTuple):
    """Fence and rally points as they are uploaded."""

    fence: tuple[MissionItem, ...] = ()
    rally: tuple[MissionItem, ...] = ()


def numbered(keys: Iterable[OneKey], origin: Origin) -> tuple[MissionItem, ...]:
    """Return the items of a section's list, numbered from 0."""
    found: list[MissionItem] = [item for key in keys for item in key.entry.items(origin)]
    for seq, item in enumerate(found):
        item.seq = seq
    return tuple(found)


def parameters_in(fence: FenceSection | None, rally: RallySection | None) -> dict[str, Any]:
    """Return the parameters of an autopilot's configuration that the sections give."""
    found: dict[str, Any] = {}
    if fence is not None:
        names = FenceParameters.model_fields
        found["fence"] = FenceParameters(**{name: getattr(fence, name) for name in names})
    if rally is not None:
        names = RallyParameters.model_fields
        found["rally"] = RallyParameters(**{name: getattr(rally, name) for name in names})
    return found


def fence_problems(
    fence: FenceSection | None,
    rally: RallySection | None,
    uavs: Sequence[ScenarioUav],
    planner: Callable[[], Planner],
    origin: Origin,
) -> Found:
    """Yield what a vehicle would refuse of fence and rally points, and arming outside."""
    if fence is not None:
        try:
            decode_fence(numbered(fence.items, origin), origin, Home())
        except ItemError as error:
            yield ("fence", "items", _entry_of(fence.items, error.seq, origin)), error.reason
        else:
            yield from _outside_problems(fence, uavs, origin)
    if rally is not None:
        try:
            decode_rally(numbered(rally.items, origin), origin, Home(), planner().limits)
        except ItemError as error:
            yield ("rally", "items", error.seq), error.reason


def _outside_problems(fence: FenceSection, uavs: Sequence[ScenarioUav], origin: Origin) -> Found:
    """Yield which UAVs a fence that is watched would not let arm."""
    if not fence.enable:
        return
    watch = fence.watch(origin)
    if watch.is_empty:
        yield ("fence",), "expected an area, or a type that watches heights, as it is enabled"
    for i, uav in enumerate(uavs):
        place = uav.initial.north_m, uav.initial.east_m, uav.initial.altitude_m
        if (why := watch.objection(place, stands=uav.initial.on_ground)) is not None:
            yield ("uavs", i, "initial"), why


def _entry_of(entries: Sequence[FenceEntry], seq: int, origin: Origin) -> int:
    """Return the index of the entry that has an item."""
    for k, entry in enumerate(entries):
        seq -= len(entry.entry.items(origin))
        if seq < 0:
            return k
    return len(entries) - 1


def left_out(held: MissionFile, tree: dict[Any, Any]) -> Iterator[str]:
    """Yield what of a plan that a scenario's mission names the scenario does not take."""
    if held.fence and "fence" not in tree:
        yield "a fence (the key fence takes it)"
    if held.rally and "rally" not in tree:
        yield f"{counted(len(held.rally), 'rally point')} (the key rally takes them)"


def with_plan_files(path: Path | str, tree: dict[Any, Any]) -> dict[Any, Any]:
    """Return the tree of a scenario with the fence and rally points of the plans that it names.

    Args:
        path: The file that the tree is of; the plans lie beside it.
        tree: Plain data read from it.

    Raises:
        ConfigError: A plan cannot be used.
    """
    for key, noun in (("fence", "a fence"), ("rally", "rally points")):
        section = tree.get(key)
        if not isinstance(section, dict) or "file" not in section:
            continue
        name = section["file"]
        if not isinstance(name, str) or "items" in section:
            got = shown(name) + (" and items" if "items" in section else "")
            text = f"expected the name of a plan, and no items beside it, got {got}"
            raise ConfigError(path, located(tree, [Problem((key, "file"), text)]))
        try:
            entries = getattr(read_mission_file(Path(path).parent / name), key)
        except ConfigError as error:
            problems = [Problem((key, "file"), line) for line in error.lines]
            raise ConfigError(path, located(tree, problems)) from error
        if not entries:
            text = f"expected a plan with {noun}, got {shown(name)}, which has none"
            raise ConfigError(path, located(tree, [Problem((key, "file"), text)]))
        written = written_in([{"item": one} for one in entries], source_at(tree, (key, "file")))
        tree = merged(tree, {key: {"file": None, "items": written}})
    return tree
