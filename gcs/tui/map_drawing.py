"""Maps, drawn with plotext, without a widget or an app: north is up, scales are equal."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gcs.station.mission import HAS_PLACE, Mission
from gcs.station.navigation import KnownHome, home_of, slot_place_of, wind_of
from gcs.station.vehicle_state import VehicleState
from gcs.tui.curves import DRAWABLE, Colour, Palette, arrow, arrow_to, latest
from gcs.tui.labels import MapMark, Place, draw_marks, sheet_of
from gcs.tui.map_areas import EXCLUSION, INCLUSION, MapAreas, circle, map_areas
from mavlink_defs import dialect

_MARGIN = 1.15  # of what is shown by what is there
_MIN_REACH_M = 30.0
_FORMATION_REACH_M = 20.0  # of the middle, at least
_TRAIL_S = 120.0
_FENCE, _RALLY = dialect.MAV_MISSION_TYPE_FENCE, dialect.MAV_MISSION_TYPE_RALLY
_FRAME = (8, 3)  # columns and lines of a plot that its axes take


@dataclass(frozen=True)
class Scene:
    """What there is to draw.

    Attributes:
        vehicles: System id, arrow, place, whether it is the selected one, and its track, shape
            (k, 2).
        slots: Places of slots.
        home: Place of the home.
        route: Places of the mission's items in order, with their numbers.
        circles: Centre and radius of circles [m].
        areas: Fence and rally points.
    """

    vehicles: Sequence[tuple[int, str, Place, bool, np.ndarray]] = ()
    slots: Sequence[Place] = ()
    home: Place | None = None
    route: Sequence[tuple[int, Place]] = ()
    circles: Sequence[tuple[Place, float]] = ()
    areas: MapAreas = MapAreas()  # noqa: RUF009 - immutable

    @property
    def places(self) -> np.ndarray:
        """Everything that a map of all shows, shape (k, 2)."""
        places = [place for _, _, place, _, _ in self.vehicles]
        places += [place for _, place in self.route]
        places += [] if self.home is None else [self.home]
        for (north, east), radius in self.circles:
            places += [(north - radius, east - radius), (north + radius, east + radius)]
        places += [corner for outline in self.areas.outlines for corner in outline.line.tolist()]
        places += self.areas.rally
        return np.array(places).reshape(-1, 2)


@dataclass
class MapWindow:
    """What the operator sees.

    Attributes:
        zoom: 1: all there is; 2: half as wide; and so on.
        shift: Of its middle from the middle of everything, north and east, in halves of its width.
        follows: Whether the selected vehicle stays in the middle.
    """

    zoom: float = 1.0
    shift: list[float] = field(default_factory=lambda: [0.0, 0.0])
    follows: bool = False

    def limits(self, scene: Scene, size: tuple[int, int]) -> tuple[Place, Place]:
        """Return the middle of what is shown, and its reach to north and east [m].

        Args:
            scene: What there is.
            size: Of the plot in characters, which are twice as high as wide.
        """
        places = scene.places
        low, high = (places.min(axis=0), places.max(axis=0)) if len(places) else (0.0, 0.0)
        middle, half = (np.zeros(2) + low + high) / 2.0, (np.zeros(2) + high - low) / 2.0
        width, height = (max(n - frame, 4) for n, frame in zip(size, _FRAME, strict=True))
        up = max(half[0], half[1] * 2.0 * height / width, _MIN_REACH_M) * _MARGIN / self.zoom
        reach = up, up * width / (2.0 * height)
        chosen = [place for _, _, place, selected, _ in scene.vehicles if selected]
        if self.follows and chosen:
            middle = np.array(chosen[0])
        north, east = middle + np.array(self.shift) * reach
        return (float(north), float(east)), reach


def scene_of(
    states: Iterable[VehicleState], selected: int | None, mission: Mission, points: int
) -> Scene:
    """Return what there is to draw.

    Args:
        states: The vehicles.
        selected: System id of the one that stands out.
        mission: The mission to show.
        points: Of a track, about.
    """
    states = list(states)
    vehicles = []
    for state in states:
        track = latest(state, _TRAIL_S, None, points)["position"][:, :2]
        track = track[np.isfinite(track).all(axis=1)]
        if len(track):
            vehicles.append(
                (state.system, arrow(state), _end_of(track), state.system == selected, track)
            )
    slots = [place for place in map(slot_place_of, states) if place and _is_drawable(*place)]
    homes = {state.system: home for state in states if (home := home_of(state)) is not None}
    homes = {i: home for i, home in homes.items() if _is_drawable(home.north_m, home.east_m)}
    home = homes.get(selected or 0) or next(iter(homes.values()), None)
    if home is None:
        return Scene(vehicles, slots)
    route, circles = route_of(mission, home)
    held = next((s.areas for s in states if s.system == selected), {})
    fence, rally = (held.get(kind, ()) for kind in (_FENCE, _RALLY))
    place = home.north_m, home.east_m
    return Scene(
        vehicles, slots, place, route, circles, map_areas(fence, rally, home.origin, place)
    )


def route_of(
    mission: Mission, home: KnownHome
) -> tuple[list[tuple[int, Place]], list[tuple[Place, float]]]:
    """Return the places of a mission's items, and its circles."""
    route: list[tuple[int, Place]] = []
    circles: list[tuple[Place, float]] = []
    for item in mission[1:]:
        place = home.place_of(item)
        if item.command == dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH:
            place = (home.north_m, home.east_m)
        if item.command == dialect.MAV_CMD_DO_JUMP:
            route += [(seq, there) for seq, there in route if seq == item.param1][:1]
        if place is None:
            continue
        route.append((item.seq, place))
        if item.command in HAS_PLACE and _is_drawable(item.param3) and item.param3 != 0.0:
            circles.append((place, abs(item.param3)))
    return route, circles


def _is_drawable(*values: float) -> bool:
    return all(abs(value) <= DRAWABLE for value in values)


def wind_text(state: VehicleState | None) -> str:
    """Return the wind at a vehicle: an arrow to where it blows, and its speed."""
    wind = None if state is None else wind_of(state)
    if wind is None:
        return "wind –"
    speed = math.hypot(*wind)
    if speed < 0.05:
        return "no wind"
    return f"wind {arrow_to(math.degrees(math.atan2(wind[1], wind[0])))} {speed:.1f} m/s"


def draw_map(
    plt: Any, scene: Scene, window: MapWindow, size: tuple[int, int], palette: Palette
) -> None:
    """Draw a scene.

    Args:
        plt: Where to.
        scene: What there is.
        window: What is shown of it.
        size: Width and height of the plot in characters.
        palette: Colours.
    """
    middle, reach = window.limits(scene, size)
    steps = 2 * max(size)
    route = [place for _, place in scene.route]
    kinds = {INCLUSION: palette.text, EXCLUSION: palette.fault}
    for track, colour in (
        *((outline.line, kinds[outline.kind]) for outline in scene.areas.outlines),
        *((track, palette.reference) for *_, chosen, track in scene.vehicles if not chosen),
        (np.array(route).reshape(-1, 2), palette.route),
        *((circle(*one), palette.route) for one in scene.circles),
        *((track, palette.actual) for *_, chosen, track in scene.vehicles if chosen),
    ):
        for run in _visible(_dense(track, reach[0] / steps), middle, reach):
            _line(plt, run, colour)
    sheet = sheet_of(plt, size, middle, reach)
    marks = (
        MapMark(system, arrow, place, here) for system, arrow, place, here, _ in scene.vehicles
    )
    draw_marks(sheet, marks, palette)
    if scene.home is not None:
        sheet.write_sign("H", scene.home, palette.text)
    for place in scene.areas.rally:
        sheet.write_sign("R", place, palette.text)
    for number, place in dict(scene.route).items():  # once, whatever leads back there
        sheet.write_number(number, place, palette.route)
    for place in scene.slots:
        sheet.write_sign("○", place, palette.text)


def draw_formation(
    plt: Any,
    states: Sequence[VehicleState],
    selected: int | None,
    trails: Sequence[np.ndarray],
    size: tuple[int, int],
    palette: Palette,
) -> None:
    """Draw north over east around the middle of the formation, in metres.

    Args:
        plt: Where to.
        states: The vehicles.
        selected: System id of the one that stands out.
        trails: Positions (n, 3) of each; rows that are not finite are left out.
        size: Width and height of the plot in characters, for equal scales.
        palette: Colours.
    """
    tracks = [trail[np.isfinite(trail).all(axis=1)] for trail in trails]
    there = [(s, t) for s, t in zip(states, tracks, strict=True) if len(t)]
    if not there:
        return
    now = np.array([trail[-1, :2] for _, trail in there])
    middle = now.mean(axis=0)
    reach = max(1.5 * float(np.abs(now - middle).max()), _FORMATION_REACH_M)
    width, height = (max(n - frame, 4) for n, frame in zip(size, _FRAME, strict=True))
    across, up = reach * max(1.0, width / (2 * height)), reach * max(1.0, 2 * height / width)
    for state, trail in there:
        chosen = state.system == selected
        colour = palette.actual if chosen else palette.reference
        north, east = (trail[:, :2] - middle).T
        inside = (np.abs(east) <= across) & (np.abs(north) <= up)
        _line(plt, np.column_stack([north, east])[inside], colour)
    sheet = sheet_of(plt, size, (0.0, 0.0), (up, across))
    marks = [
        MapMark(s.system, arrow(s), _end_of(trail[:, :2] - middle), s.system == selected)
        for s, trail in there
    ]
    draw_marks(sheet, marks, palette)


def _end_of(track: np.ndarray) -> Place:
    return float(track[-1, 0]), float(track[-1, 1])


def _dense(line: np.ndarray, apart_m: float) -> np.ndarray:
    """Return a line with points so dense that its visible part can be found from them."""
    if len(line) < 2:
        return line
    lengths = np.hypot(*np.diff(line, axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    count = int(min(along[-1] / max(apart_m, 1e-6) + 2, 5000))
    at = np.unique(np.concatenate([np.linspace(0.0, along[-1], count), along]))
    return np.column_stack([np.interp(at, along, line[:, k]) for k in range(2)])


def _visible(line: np.ndarray, middle: Place, reach: Place) -> Iterator[np.ndarray]:
    """Yield the parts of a line that are within the window."""
    if not len(line):
        return
    inside = (np.abs(line - np.array(middle)) <= np.array(reach)).all(axis=1)
    edges = np.flatnonzero(np.diff(inside)) + 1
    for part, shown in zip(np.split(line, edges), np.split(inside, edges), strict=True):
        if shown[0]:
            yield part


def _line(plt: Any, line: np.ndarray, colour: Colour) -> None:
    plt.plot(line[:, 1].tolist(), line[:, 0].tolist(), marker="braille", color=colour)
