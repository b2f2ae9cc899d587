"""The items of a mission as a list, and places that an operator types."""

import math
from typing import Any

from ftc_autopilot.guidance.mission_places import ANYWHERE_M
from gcs.station.mission import Mission, item_text
from gcs.station.navigation import KnownHome, current_item, distance_to_item
from gcs.station.vehicle_state import VehicleState
from gcs.tui.formatting import Cell, number
from gcs.tui.grid import Grid, GridColumn, Row

_COLUMNS = (
    GridColumn("", 1, "left"),
    GridColumn("#", 3),
    GridColumn("item", 0, "left"),
    GridColumn("m up", 5),
)
_NEW_WAYPOINT_M = 500.0  # ahead of an aircraft without a mission


class WrittenPlaceError(ValueError):
    """What was typed is no place."""


class MissionList(Grid):
    """The items of a mission; the current one is marked."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("no mission: i inserts a waypoint", **kwargs)
        self.border_title = "Mission"

    def show_mission(
        self, mission: Mission, state: VehicleState | None, home: KnownHome | None, edited: bool
    ) -> None:
        """Show a mission.

        Args:
            mission: Home included.
            state: The vehicle that holds it, or is to.
            home: Its home.
            edited: Whether it is not the vehicle's any more.
        """
        current = None if state is None or edited else current_item(state)
        self.show(_COLUMNS, [_row(item, home, current) for item in mission[1:]])
        of = "Mission" if state is None else f"UAV {state.system}"
        if state is not None and state.profile and not edited:
            self.border_title = f"{of} · a profile: panel 4"
            return
        if edited:
            self.border_title = f"{of} · edited, u uploads"
            return
        progress = ""
        if state is not None and current and mission:
            progress = f" · item {current} of {len(mission) - 1}"
            if (distance_m := distance_to_item(state)) is not None:
                progress += f", {distance_m:.0f} m"
        self.border_title = of + progress


def _row(item: Any, home: KnownHome | None, current: int | None) -> Row:
    is_current = item.seq == current
    place = None if home is None else home.place_of(item)
    height = None if home is None or place is None else home.height_of(item)
    label = item_text(item)
    if place is not None:
        label += f" N {place[0]:.0f} E {place[1]:.0f}"
    cells: tuple[Cell, ...] = (
        ("▸" if is_current else "", "accent"),
        (str(item.seq), "muted"),
        (label, "strong" if is_current else ""),
        ("" if height is None else number(height, 0), ""),
    )
    return Row(item.seq, cells)


def insertion_place(
    mission: Mission, at: int | None, home: KnownHome, state: VehicleState
) -> tuple[float, float, float]:
    """Return where a new waypoint is offered: between an item and the next, or beyond the last.

    Args:
        mission: Home included.
        at: Number of the item that it follows; None: there is none.
        home: The vehicle's home.
        state: The vehicle.

    Returns:
        North, east, height above home [m].
    """
    places = [(item, home.place_of(item)) for item in mission[1:]]
    before = [(i, p) for i, p in places if p is not None and i.seq <= (at or 0)]
    behind = [(i, p) for i, p in places if p is not None and i.seq > (at or 0)]
    if before and behind:
        (item, a), (_, b) = before[-1], behind[0]
        return (a[0] + b[0]) / 2.0, (a[1] + b[1]) / 2.0, home.height_of(item)
    if before:
        item, (north, east) = before[-1]
        return north + _NEW_WAYPOINT_M, east, home.height_of(item)
    north, east, down = state.position_m or (0.0, 0.0, 0.0)
    yaw = math.radians((state.attitude_deg or (0.0, 0.0, 0.0))[2])
    return (north + _NEW_WAYPOINT_M * math.cos(yaw), east + _NEW_WAYPOINT_M * math.sin(yaw), -down)


def read_place(text: str) -> tuple[float, float, float]:
    """Return north, east and height above home [m].

    Raises:
        PlaceError: The text is something else.
    """
    numbers = text.replace(",", " ").split()
    try:
        north, east, height = map(float, numbers)
    except ValueError:
        text = f"expected north, east and height above home in metres, got {text!r}"
        raise WrittenPlaceError(f"{text}; such as 800 -200 500") from None
    if not all(map(math.isfinite, (north, east, height))):
        raise WrittenPlaceError(f"expected finite numbers, got {text!r}")
    if not max(abs(north), abs(east), abs(height)) <= ANYWHERE_M:
        raise WrittenPlaceError(f"expected at most {ANYWHERE_M:g} m, got {text!r}")
    return north, east, height
