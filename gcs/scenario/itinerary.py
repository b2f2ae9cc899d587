"""What a mission amounts to before it is flown: lengths, turns and times, item by item."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import numpy as np

from ftc_autopilot.guidance.fence import FenceWatch, decode_fence, decode_rally
from ftc_autopilot.guidance.fence_parameters import (
    FenceParameters,
    RallyParameters,
    fence_records,
)
from ftc_autopilot.guidance.mission_items import is_path
from ftc_autopilot.guidance.mission_places import Home
from ftc_autopilot.guidance.path import NO_LOOP, commands_between, point_at
from gcs.scenario.bundled import find_scenario
from gcs.scenario.fence import Areas
from gcs.scenario.model import Scenario, read_scenario
from mavlink_defs.config.models import ConfigError, Problem, counted
from mavlink_defs.mission_files import is_mission_file, items_of, read_mission_file
from mavlink_defs.profile import ItemError
from mavlink_defs.services.mission import MissionItem

_ARC_POINT_RAD = math.radians(5.0)
_FINAL_M = 2000.0  # of a path that goes on without an end


@dataclass(frozen=True)
class Stage:
    """The way to one item, as it is flown the first time.

    Attributes:
        item: Number of the item.
        north_m: Where the path is nearest to it [m].
        east_m: The same.
        height_m: Above the origin, there [m].
        airspeed_m_s: On the way [m/s].
        length_m: Of the way up to there [m].
        time_s: Of the way at that airspeed in still air [s].
        turn_radius_m: Of the turn or circle at the item [m]; None without one.
    """

    item: int
    north_m: float
    east_m: float
    height_m: float
    airspeed_m_s: float
    length_m: float
    time_s: float
    turn_radius_m: float | None


@dataclass(frozen=True)
class Passing:
    """Where a command that changes nothing of the path is passed first.

    Attributes:
        item: Number of the item.
        north_m: [m].
        east_m: [m].
        height_m: Above the origin [m].
        way_m: From the begin of the path [m].
    """

    item: int
    north_m: float
    east_m: float
    height_m: float
    way_m: float


@dataclass(frozen=True)
class Itinerary:
    """A mission item by item, in the order of flight.

    Attributes:
        stages: The ways to the items; what comes after a jump back is in `repeats`.
        length_m: Of the whole path up to where it repeats or has no end [m].
        time_s: The same, in still air [s].
        repeats: Number of the item from which on all repeats for ever; None: it does not.
        passed: The commands that are passed, in order.
        profile: Way from the begin and height above the origin [m]; heights change evenly between.
        lands: Whether it ends with a landing.
    """

    stages: tuple[Stage, ...]
    length_m: float
    time_s: float
    repeats: int | None
    passed: tuple[Passing, ...]
    profile: tuple[tuple[float, float], ...]
    lands: bool = False


def load_mission(name: Path | str) -> tuple[tuple[MissionItem, ...], tuple[str, ...]]:
    """Read a mission, home included: of a mission file, or of a scenario, bundled or not.

    A scenario's profile is a mission of reference segments. Beside the items, what else is in the
    file and no vehicle takes is returned, part by part.

    Raises:
        ConfigError: The file cannot be used.
    """
    if is_mission_file(Path(name)):
        held = read_mission_file(Path(name))
        return held.items, held.not_flown
    scenario = read_scenario(find_scenario(name))
    left_out = () if scenario.mission is None else scenario.mission.not_flown
    return scenario.mission_items(), left_out


def load_areas(name: Path | str) -> Areas:
    """Read fence and rally points, of a plan or a scenario, bundled or not; it may have none.

    Raises:
        ConfigError: The file cannot be used.
    """
    if is_mission_file(Path(name)):
        held = read_mission_file(Path(name))
        return Areas(items_of(held.fence), items_of(held.rally))
    return read_scenario(find_scenario(name)).areas()


def dry_run(name: Path | str, items: Sequence[MissionItem], fleet: Scenario) -> Itinerary:
    """Check a mission as the vehicles of a scenario do, and return what it amounts to.

    Args:
        name: Where the items are from, for the error.
        items: Home included.
        fleet: Gives aircraft, guidance, formation and origin.

    Raises:
        ConfigError: They would refuse it; the item and the reason are named.
    """
    if len(items) < 2:
        raise ConfigError(name, [Problem((), "expected a waypoint or a circle, got no item")])
    if not is_path(items):
        raise ConfigError(name, [Problem((), "a profile, not a path; see gcs profile")])
    try:
        path = fleet.planner().path(items)
    except ItemError as error:
        raise ConfigError(name, [Problem((), str(error))]) from error
    stages = tuple(_stages(path))
    loop, lands = int(path["loop"]), bool(path["landing"] > 0.0)
    return Itinerary(
        stages,
        sum(stage.length_m for stage in stages),
        sum(stage.time_s for stage in stages),
        None if loop == NO_LOOP or lands else int(path["item"][loop]),
        tuple(_passed(path)),
        tuple(_profile(path)),
        lands,
    )


def dry_run_areas(
    name: Path | str, areas: Areas, items: Sequence[MissionItem], fleet: Scenario
) -> Iterator[str]:
    """Check fence and rally points as the vehicles of a scenario do, and say what they are.

    Args:
        name: Where they are from, for the error.
        areas: What to check.
        items: A mission that can be flown, home included.
        fleet: Gives aircraft, guidance, formation and origin.

    Raises:
        ConfigError: Vehicles would refuse them; the item and the reason are named.
    """
    planner = fleet.planner()
    for kind, decode in (
        ("fence", lambda: decode_fence(areas.fence, fleet.origin, Home())),
        ("rally", lambda: decode_rally(areas.rally, fleet.origin, Home(), planner.limits)),
    ):
        try:
            decode()
        except ItemError as error:
            raise ConfigError(name, [Problem((kind,), str(error))]) from error
    fence = decode_fence(areas.fence, fleet.origin)
    if fence.areas:
        yield f"fence: {', '.join(area.text for area in fence.areas)}"
    areas_alone = fence_records(FenceParameters(), RallyParameters()).fence[0]
    left = FenceWatch(fence, areas_alone).left_by(planner.path(items))
    if left is not None:
        yield f"the mission leaves the fence on the way to item {left}"
    if areas.rally:
        yield f"R: {counted(len(areas.rally), 'rally point')}"


def outline(path: np.void) -> list[tuple[float, float, float]]:
    """Return corners of a path, near enough to each other for a map: north, east, height [m]."""
    points = []
    for k in range(int(path["count"])):
        begin, end = (float(s) for s in path["start"][k : k + 2])
        curvature = abs(float(path["curvature"][k]))
        if math.isinf(end):
            end = begin + (2.0 * math.pi / curvature if curvature else _FINAL_M)
        count = 1 + math.ceil((end - begin) * curvature / _ARC_POINT_RAD)
        points += [point_at(path, s) for s in np.linspace(begin, end, count, endpoint=False)]
        if k == path["count"] - 1:
            points.append(point_at(path, math.nextafter(end, begin)))
    return [(point.north, point.east, point.height) for point in points]


def _flown(path: np.void) -> int:
    """Return the number of legs; of a landing those up to touchdown, not the way around again."""
    count = int(path["count"])
    if path["landing"] > 0.0:
        return int(np.searchsorted(path["start"][:count], path["landing"]))
    return count


def _passed(path: np.void) -> Iterator[Passing]:
    last = math.inf if path["loop"] == NO_LOOP else math.nextafter(_end(path), 0.0)
    for at, item in commands_between(path, -1.0, last):
        point = point_at(path, at)
        yield Passing(item, point.north, point.east, point.height, at)


def _profile(path: np.void) -> Iterator[tuple[float, float]]:
    """Yield the ends of legs whose climb differs."""
    climbs = path["climb"][: _flown(path)]
    yield 0.0, float(path["height"][0])
    for k in np.flatnonzero(np.diff(climbs)) + 1:
        yield float(path["start"][k]), float(path["height"][k])
    end = _end(path)
    yield end, point_at(path, math.nextafter(end, 0.0)).height


def _end(path: np.void) -> float:
    """Return the end of a path, or the begin of its last leg if that has none [m]."""
    count = _flown(path)
    end = float(path["start"][count])
    return end if math.isfinite(end) else float(path["start"][count - 1])


def _stages(path: np.void) -> Iterator[Stage]:
    flown = range(_flown(path))
    for item, group in groupby(flown, key=lambda k: int(path["item"][k])):
        legs = list(group)
        lengths = np.diff(path["start"])[legs]
        finite = np.isfinite(lengths)
        curvature = float(path["curvature"][legs[-1]])
        end = point_at(path, float(path["start"][legs[-1] + bool(finite[-1])]))
        times = lengths[finite] / path["airspeed"][legs][finite]
        yield Stage(
            item=item,
            north_m=end.north,
            east_m=end.east,
            height_m=end.height,
            airspeed_m_s=float(path["airspeed"][legs[0]]),
            length_m=float(lengths[finite].sum()),
            time_s=float(times.sum()),
            turn_radius_m=1.0 / abs(curvature) if curvature else None,
        )
