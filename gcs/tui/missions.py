"""Missions: the map, and the items of a mission, which can be edited and uploaded."""

from typing import Any, ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical
from textual.widgets import Input
from textual_plotext import PlotextPlot

from gcs.station.mission import Mission, inserted, moved, removed, waypoint, with_place
from gcs.station.navigation import home_of
from gcs.station.vehicle import Vehicle
from gcs.station.vehicle_state import VehicleState
from gcs.tui.curves import palette_of
from gcs.tui.formatting import ids
from gcs.tui.guard import Guarded, on
from gcs.tui.map_drawing import MapWindow, draw_map, scene_of, wind_text
from gcs.tui.mission_list import MissionList, WrittenPlaceError, insertion_place, read_place
from gcs.tui.requests import ActionOutcome, Refresh, VehicleAction
from gcs.tui.view import FleetView, Panel

_DRAW_S = 0.5
_ZOOM = 1.5
_PAN = 0.4  # of half the width
_EDITING = {"insert", "edit", "delete", "shift", "upload"}


class MapView(Guarded, PlotextPlot):
    """The map. North is up.

    Attributes:
        window: What is shown of it.
    """

    can_focus = True
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("up", "pan(1, 0)", "north", show=False),
        Binding("down", "pan(-1, 0)", "south", show=False),
        Binding("right", "pan(0, 1)", "east", show=False),
        Binding("left", "pan(0, -1)", "west", show=False),
    ]

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.window = MapWindow()
        self._drawn: object = None

    def show_map(self, view: FleetView, mission: Mission) -> None:
        """Draw the vehicles and a mission, if that is due."""
        window = self.window
        shown = (window.zoom, *window.shift, window.follows, view.selected)
        due = view.paced_by_s // _DRAW_S
        areas = () if view.state is None else tuple(view.state.areas.values())
        token = (due, len(view.states), shown, self.size, self.app.theme, mission, areas)
        if token == self._drawn or not self.size:
            return
        self._drawn = None  # until it is
        scene = scene_of(view.states, view.selected, mission, 2 * self.size.width)
        self.plt.clear_figure()
        size = (self.size.width, self.size.height)
        draw_map(self.plt, scene, window, size, palette_of(self.app.theme_variables))
        follows = " · follows" if window.follows else ""
        self.border_title = f"Map, m (↑ north) · {wind_text(view.state)}{follows}"
        self._drawn = token
        self.refresh()

    def action_pan(self, north: int, east: int) -> None:
        """Move what is shown."""
        self.window.shift[0] += _PAN * north
        self.window.shift[1] += _PAN * east
        self.post_message(Refresh())

    def zoom(self, step: int) -> None:
        """Zoom in or out; the middle stays."""
        factor = _ZOOM**step
        self.window.zoom *= factor
        self.window.shift = [shift * factor for shift in self.window.shift]
        self.post_message(Refresh())

    def follow(self) -> None:
        """Keep the selected vehicle in the middle, or no longer."""
        self.window.follows = not self.window.follows
        self.window.shift = [0.0, 0.0]
        self.post_message(Refresh())

    def fit(self) -> None:
        """Show everything."""
        self.window = MapWindow()
        self.post_message(Refresh())


class MissionsPanel(Panel, Horizontal):
    """The map beside the mission of the selected vehicle.

    Attributes:
        draft: The mission as edited; None: the vehicle's is shown.
    """

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("plus,equals_sign", "zoom(1)", "zoom in", show=False),
        Binding("minus", "zoom(-1)", "zoom out", show=False),
        Binding("shift+up", "pan(1, 0)", show=False),
        Binding("shift+down", "pan(-1, 0)", show=False),
        Binding("shift+right", "pan(0, 1)", show=False),
        Binding("shift+left", "pan(0, -1)", "pan (or arrows on the map)", show=False),
        Binding("f", "follow", "follow", tooltip="Keep the selected UAV in the middle"),
        Binding("0", "fit", "show all", show=False),
        Binding("i", "insert", "insert", tooltip="Insert a waypoint after the item"),
        Binding("e", "edit", "edit", tooltip="Change place and height of the item"),
        Binding("d", "delete", "delete", tooltip="Delete the item"),
        Binding("comma", "shift(-1)", "item before the one before", show=False),
        Binding("full_stop", "shift(1)", "item behind the next one", show=False),
        Binding("u", "upload", "upload", tooltip="Upload the mission to the marked UAVs"),
        Binding("g", "download", "get", tooltip="Get the UAV's mission; drops what was edited"),
        Binding("escape", "leave", "back to the list", show=False),
    ]

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.draft: Mission | None = None
        self._view: FleetView | None = None
        self._inserts = False

    def compose(self) -> ComposeResult:
        """Lay out the panel."""
        yield MapView(id="map-view", classes="panel")
        with Vertical(id="mission-side"):
            yield MissionList(id="mission-list", classes="panel")
            yield Input(placeholder="i, e: north east height, m", id="item-place", compact=True)

    @property
    def mission(self) -> Mission:
        """What is shown: the draft, else the mission of the selected vehicle."""
        if self.draft is not None:
            return self.draft
        state = self._state
        return () if state is None or state.mission is None else state.mission

    @property
    def _state(self) -> VehicleState | None:
        return None if self._view is None else self._view.state

    def show_view(self, view: FleetView) -> None:
        """Show vehicles and mission."""
        before, self._view = self._is_profile, view
        if self._is_profile != before:
            self.refresh_bindings()
        home = None if view.state is None else home_of(view.state)
        edited = self.draft is not None
        items, drawn = self.query_one(MissionList), self.query_one(MapView)
        items.attempt(items.show_mission, self.mission, view.state, home, edited)
        drawn.attempt(drawn.show_map, view, self.mission)

    # the map

    def action_zoom(self, step: int) -> None:
        """Zoom in or out."""
        self.query_one(MapView).zoom(step)

    def action_pan(self, north: int, east: int) -> None:
        """Move what the map shows."""
        self.query_one(MapView).action_pan(north, east)

    def action_follow(self) -> None:
        """Keep the selected vehicle in the middle of the map."""
        self.query_one(MapView).follow()

    def action_fit(self) -> None:
        """Show everything on the map."""
        self.query_one(MapView).fit()

    # the mission

    @property
    def _is_profile(self) -> bool:
        """Whether the vehicle flies a profile, which panel 4 shows and uploads."""
        return self.draft is None and bool(self._state and self._state.profile)

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Return whether an action is possible: a profile is not edited here."""
        return not (action in _EDITING and self._is_profile)

    @property
    def _at(self) -> int | None:
        """Number of the item of the cursor."""
        key = self.query_one(MissionList).key
        return None if key is None else int(key)

    def _edited(self, mission: Mission, at: int) -> None:
        self.draft = mission
        if self._view is not None:
            self.show_view(self._view)
        self.query_one(MissionList).move_to(at)
        self.post_message(Refresh())

    def action_delete(self) -> None:
        """Delete the item of the cursor."""
        if (at := self._at) is not None:
            self._edited(removed(self.mission, at), min(at, len(self.mission) - 2))

    def action_shift(self, step: int) -> None:
        """Move the item of the cursor up or down in the list."""
        if (at := self._at) is not None and 1 <= at + step < len(self.mission):
            self._edited(moved(self.mission, at, at + step), at + step)

    def action_insert(self) -> None:
        """Ask for the place of a new waypoint."""
        self._ask_for_place(inserts=True)

    def action_edit(self) -> None:
        """Ask for another place of the item of the cursor."""
        self._ask_for_place(inserts=False)

    def _ask_for_place(self, inserts: bool) -> None:
        state, at = self._state, self._at
        home = None if state is None else home_of(state)
        if state is None or home is None:
            self.app.notify("the UAV has not reported its home yet", severity="warning")
            return
        if inserts:
            place = insertion_place(self.mission, at, home, state)
        elif at is None or (found := home.place_of(self.mission[at])) is None:
            self.app.notify("this item has no place: delete it, or insert", severity="warning")
            return
        else:
            place = (*found, home.height_of(self.mission[at]))
        self._inserts = inserts
        field = self.query_one("#item-place", Input)
        field.value = " ".join(f"{value:.0f}" for value in place)
        field.focus()

    @on(Input.Submitted, "#item-place")
    def _place_typed(self, event: Input.Submitted) -> None:
        state, at = self._state, self._at
        home = None if state is None else home_of(state)
        if home is None:
            return
        try:
            north, east, height = read_place(event.value)
        except WrittenPlaceError as problem:
            self.app.notify(str(problem), severity="error")
            return
        x, y = home.degrees_of(north, east)
        mission = self.mission or (home.item(),)
        if self._inserts:
            like, after = mission[at or 0], 1 if at is None else at + 1
            new = waypoint(like, x, y, 0.0)
            new.z = home.altitude_of(new, height)
            self._edited(inserted(mission, after, new), after)
        elif at is not None:
            altitude = home.altitude_of(mission[at], height)
            self._edited(with_place(mission, at, x, y, altitude), at)
        self.action_leave()

    def action_leave(self) -> None:
        """Go back to the list."""
        self.query_one("#item-place", Input).value = ""
        self.query_one(MissionList).focus()

    def action_upload(self) -> None:
        """Upload the mission to the marked vehicles, or the selected one, after a question."""
        mission, view = self.mission, self._view
        if view is None or len(mission) < 2:
            self.app.notify("there is no mission to upload", severity="warning")
            return

        async def act(vehicle: Vehicle, _: str) -> str:
            await vehicle.upload_mission(mission)
            await vehicle.download_mission()
            return f"mission of {len(mission) - 1} items uploaded"

        flying = [s.system for s in view.states if s.system in view.targets and s.armed]
        question = f"Upload a mission of {len(mission) - 1} items to {ids(view.targets)}?" + (
            f"\n{ids(flying)} in flight: it is in force at once." if flying else ""
        )
        self.post_message(
            VehicleAction(
                "upload mission", view.targets, act, question=question, on_done=self._uploaded
            )
        )

    def _uploaded(self, outcome: ActionOutcome) -> None:
        if outcome.accepted:
            self.draft = None

    def action_download(self) -> None:
        """Get the mission of the selected vehicle, and drop what was edited."""

        async def act(vehicle: Vehicle, _: str) -> str:
            mission = await vehicle.download_mission()
            self.draft = None
            return f"holds a mission of {max(len(mission) - 1, 0)} items"

        state = self._state
        systems = () if state is None else (state.system,)
        self.post_message(VehicleAction("get mission", systems, act))
