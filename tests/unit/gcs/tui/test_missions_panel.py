"""The map and the mission list, without a fleet."""

import math
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import plotext  # type: ignore[import-untyped]  # has no annotations
import pytest
from hypothesis import given
from hypothesis import strategies as st
from textual.pilot import Pilot
from textual.widgets import Input
from tui_bench import Station, at_screen, live, sent
from waiting import answer, until, until_focused

from ftc_autopilot.common.geography import Origin, place_of
from gcs.console.errors import CommandRefused
from gcs.station.mission import Mission, is_same
from gcs.station.navigation import KnownHome, home_of
from gcs.tui.app import Dashboard
from gcs.tui.curves import Palette
from gcs.tui.map_areas import EXCLUSION, INCLUSION, map_areas
from gcs.tui.map_drawing import MapWindow, Scene, draw_map, scene_of, wind_text
from gcs.tui.mission_list import MissionList, WrittenPlaceError, read_place
from gcs.tui.missions import MapView, MissionsPanel
from mavlink_defs import dialect
from mavlink_defs.constants import INT32_MAX
from mavlink_defs.mission_files import mission_item
from mavlink_defs.services.mission import MissionItem

ORIGIN = Origin()
HOME = KnownHome(ORIGIN, 0.0, 0.0)


def at(seq: int, north: float, east: float, height: float = 300.0) -> MissionItem:
    place = place_of(ORIGIN, north, east, 0.0)
    return mission_item(seq, dialect.MAV_CMD_NAV_WAYPOINT, (), *place[:2], height)


def triangle() -> Mission:
    jump = mission_item(4, dialect.MAV_CMD_DO_JUMP, (1.0, -1.0))
    return (HOME.item(), at(1, 800.0, 0.0), at(2, 800.0, 600.0), at(3, 0.0, 600.0), jump)


def tell(station: Station, system: int, north: float, east: float) -> None:
    """A vehicle tells where it is, where its home is, and how it keeps its slot."""
    home, place = place_of(ORIGIN, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    messages: list[Any] = [
        dialect.MAVLink_home_position_message(*home[:3], *place, [1.0, 0.0, 0.0, 0.0], *place, 1),
        dialect.MAVLink_mission_current_message(2, 4),
        dialect.MAVLink_attitude_message(1000, 0.0, 0.0, math.pi / 2.0, 0.0, 0.0, 0.0),
        dialect.MAVLink_wind_cov_message(1, 3.0, 4.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        dialect.MAVLink_nav_controller_output_message(0.0, 0.0, 90, 90, 417, 0.0, 0.0, 0.4),
        dialect.MAVLink_ftc_formation_message(
            1000, 7, 100.0, 40.0, [0.0] * 3, [3.0, 4.0, 0.5], 28.3, 2, 0, 0, 0, [0] * 64
        ),
    ]
    for k in range(10):
        t = 1000 + 100 * k
        messages.append(
            dialect.MAVLink_local_position_ned_message(
                t, north, east - 40.0 + 4.0 * k, -300.0, 0.0, 40.0, 0.0
            )
        )
        messages.append(dialect.MAVLink_ftc_tracking_message(t, [40.0, 0, 0, 0], [0] * 4, [0] * 4))
    for message in messages:
        station.fleet.receive(sent(message, system), station.time_s)


class MissionVehicle:
    """A vehicle that holds missions."""

    def __init__(self, station: Station, system: int) -> None:
        self.system, self.refuses = system, ""
        self.held: Mission = ()
        self._station = station

    async def upload_mission(self, mission: Mission) -> None:
        if self.refuses:
            raise CommandRefused(f"UAV {self.system} refused the upload: {self.refuses}", 1)
        self.held = mission

    async def download_mission(self) -> Mission:
        state = self._station.fleet.vehicles[self.system]
        state.learn_mission(self.held, self._station.time_s)
        return self.held


def fleet() -> Station:
    station = Station(1, 2)
    for system, east in ((1, 200.0), (2, 180.0)):
        tell(station, system, 800.0, east)
        station.vehicles[system] = vehicle = MissionVehicle(station, system)
        vehicle.held = triangle()
        station.fleet.vehicles[system].learn_mission(triangle(), station.time_s)
    return station


def drive(work: Callable[[Dashboard, Pilot[None]], Any], station: Station) -> None:
    async def begun(app: Dashboard, pilot: Pilot[None]) -> None:
        await pilot.press("7")
        await until_focused(pilot, "mission-list")
        app.refresh_view(force=True)
        await work(app, pilot)

    at_screen(live(station), begun, (120, 40))


def test_the_map_shows_fence_and_rally_points() -> None:
    fence = (
        mission_item(0, dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, (500.0,), *place(100.0, 0.0)),
        mission_item(1, dialect.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION, (50.0,), *place(0.0, 300.0)),
    )
    rally = (mission_item(0, dialect.MAV_CMD_NAV_RALLY_POINT, (), *place(-200.0, 100.0)),)
    shown = map_areas(fence, rally, ORIGIN, (1000.0, 0.0))
    assert [outline.kind for outline in shown.outlines] == [INCLUSION, EXCLUSION]
    assert shown.outlines[0].line.max(axis=0) == pytest.approx((1600.0, 500.0), abs=2.0)
    assert shown.rally[0] == pytest.approx((800.0, 100.0), abs=0.1)
    scene = Scene(home=(1000.0, 0.0), areas=shown)
    assert scene.places.max() == pytest.approx(1600.0, abs=2.0)
    drawn = drawing(scene)
    assert "R" in drawn
    assert "H" in drawn
    assert "⠁" in drawn or "⡇" in drawn
    assert map_areas(fence[:1] * 2, (), ORIGIN).outlines
    assert map_areas((mission_item(0, 16),), (), ORIGIN).outlines == ()


def place(north: float, east: float) -> tuple[int, int]:
    return place_of(ORIGIN, north, east, 0.0)[:2]


def drawing(scene: Scene) -> str:
    colour = (0, 0, 0)
    palette = Palette(colour, colour, colour, (colour,) * 4, colour, colour)
    plotext.clear_figure()
    plotext.plotsize(60, 20)
    draw_map(plotext, scene, MapWindow(), (60, 20), palette)
    return str(plotext.uncolorize(plotext.build()))


def test_the_list_shows_items_and_progress() -> None:
    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        items = app.query_one(MissionList)
        await until(pilot, lambda: len(items.rows) == 4)
        assert items.text.splitlines() == [
            " 1 waypoint N 800 E 0 300",
            "▸ 2 waypoint N 800 E 600 300",
            " 3 waypoint N 0 E 600 300",
            " 4 jump to 1, always ",
        ]
        assert items.border_title == "UAV 1 · item 2 of 4, 417 m"
        drawn = app.query_one(MapView)
        await until(pilot, lambda: "wind ↗ 5.0 m/s" in str(drawn.border_title))

    drive(work, fleet())


def test_a_mission_is_edited_and_uploaded_after_a_question() -> None:
    station = fleet()

    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        panel, items = app.query_one(MissionsPanel), app.query_one(MissionList)
        field = app.query_one("#item-place", Input)
        await until(pilot, lambda: len(items.rows) == 4)
        await pilot.press("down", "i")  # after item 2
        await until_focused(pilot, "item-place")
        assert field.value == "400 600 300"
        field.value = "400 900 320"
        await pilot.press("enter")
        await until_focused(pilot, "mission-list")
        assert "3 waypoint N 400 E 900 320" in items.text
        assert "edited" in str(items.border_title)
        await pilot.press("home", "comma", "full_stop")  # cannot go up; then down
        assert items.text.splitlines()[-1].split()[1:4] == ["jump", "to", "2,"]
        await pilot.press("e")
        await until_focused(pilot, "item-place")
        assert field.value == "800 0 300"
        field.value = "here"
        await pilot.press("enter")
        assert app.focused is field
        field.value = "810, 5, 310"
        await pilot.press("enter")
        await until_focused(pilot, "mission-list")
        await pilot.press("end", "d")
        edited = panel.draft
        assert edited is not None
        assert [one.seq for one in edited] == [0, 1, 2, 3, 4]
        assert HOME.place_of(edited[2]) == pytest.approx((810.0, 5.0), abs=0.02)
        vehicle = station.vehicles[1]
        vehicle.refuses = "Item 3: turn too tight"
        await pilot.press("u")
        await answer(pilot, "enter")
        entries = app.view.source.event_log.entries
        await until(pilot, lambda: "turn too tight" in entries[-1].text)
        assert panel.draft is edited
        vehicle.refuses = ""
        await pilot.press("u")
        await answer(pilot, "escape")
        assert is_same(vehicle.held, triangle())
        await pilot.press("u")
        await answer(pilot, "enter")
        await until(pilot, lambda: is_same(vehicle.held, edited))
        await until(pilot, lambda: panel.draft is None)
        assert is_same(station.vehicles[2].held, triangle())
        await pilot.press("d", "g")
        await until(pilot, lambda: panel.draft is None)
        assert len(items.rows) == 4

    drive(work, station)


def test_a_mission_begins_from_nothing() -> None:
    station = fleet()
    station.vehicles[1].held = ()
    station.fleet.vehicles[1].learn_mission((), station.time_s)

    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        panel, items = app.query_one(MissionsPanel), app.query_one(MissionList)
        await pilot.press("u", "d", "e", "comma", "i")
        await until_focused(pilot, "item-place")
        await pilot.press("enter")
        await until_focused(pilot, "mission-list")
        assert panel.draft is not None
        assert len(panel.draft) == 2
        assert "N 800 E 696" in items.text  # ahead of the aircraft, which flies east

    drive(work, station)


def test_the_map_zooms_pans_and_follows() -> None:
    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        drawn = app.query_one(MapView)
        await pilot.press("plus", "shift+up", "f")
        assert drawn.window.follows
        assert drawn.window.zoom == pytest.approx(1.5)
        drawn.focus()
        await pilot.press("left", "left", "minus")
        assert drawn.window.shift[1] < 0.0
        await pilot.press("0")
        assert drawn.window == MapWindow()

    drive(work, fleet())


def test_the_scene_has_all_that_was_reported() -> None:
    station = fleet()
    states = [station.fleet.vehicles[i] for i in (1, 2)]
    scene = scene_of(states, 1, triangle(), 100)
    assert [(system, sign, chosen) for system, sign, _, chosen, _ in scene.vehicles] == [
        (1, "→", True),
        (2, "→", False),
    ]
    assert scene.vehicles[0][2] == pytest.approx((800.0, 196.0))
    assert scene.slots[0] == pytest.approx((804.0, 193.0))  # 3 m behind, 4 m to the left of it
    assert scene.home == (0.0, 0.0)
    assert [seq for seq, _ in scene.route] == [1, 2, 3, 1]  # and back by the jump
    assert scene_of([], None, triangle(), 100) == Scene([], [])
    assert wind_text(None) == "wind –"
    passed_by = at(1, 800.0, 0.0)
    passed_by.param3 = -300.0
    ((centre, radius),) = scene_of(states, 1, (HOME.item(), passed_by), 100).circles
    assert (*centre, radius) == pytest.approx((800.0, 0.0, 300.0), abs=0.1)


def test_an_item_that_is_jumped_to_has_its_number_once_on_the_map() -> None:
    route = scene_of([fleet().fleet.vehicles[1]], 1, triangle(), 100).route
    plotext.clear_figure()
    plotext.limit_size(False, False)
    plotext.plotsize(60, 20)
    grey = (9, 9, 9)
    palette = Palette(grey, grey, grey, (grey, grey, grey, grey), grey, grey)
    draw_map(plotext, Scene(route=route), MapWindow(), (60, 20), palette)
    lines = plotext.uncolorize(plotext.build()).splitlines()[1:-2]
    text = " ".join(re.split("[┤│]", line, maxsplit=1)[1] for line in lines)
    assert re.findall(r"\d", text) == ["1", "2", "3"]


@given(
    st.floats(0.1, 50.0),
    st.integers(30, 200),
    st.integers(10, 60),
    st.lists(st.tuples(st.floats(-5e3, 5e3), st.floats(-5e3, 5e3)), min_size=1, max_size=5),
)
def test_a_map_shows_everything_at_equal_scales(
    zoom: float, width: int, height: int, places: list[tuple[float, float]]
) -> None:
    scene = Scene(route=list(enumerate(places)))
    middle, reach = MapWindow().limits(scene, (width, height))
    assert (np.abs(np.array(places) - middle) <= np.array(reach)).all()
    assert reach[1] / (width - 8) == pytest.approx(reach[0] / (2 * (height - 3)))
    nearer = MapWindow(zoom).limits(scene, (width, height))[1]
    assert nearer == pytest.approx((reach[0] / zoom, reach[1] / zoom))


@given(st.floats(-5e4, 5e4), st.floats(-5e4, 5e4), st.floats(-100.0, 3e3))
def test_places_come_back(north: float, east: float, height: float) -> None:
    home = KnownHome(ORIGIN, 12.0, -7.0)
    item = at(1, 100.0, 100.0)
    item.x, item.y = home.degrees_of(north, east)
    item.z = home.altitude_of(item, height)
    assert home.place_of(item) == pytest.approx((north, east), abs=0.02)
    item.frame = dialect.MAV_FRAME_GLOBAL_INT
    item.z = home.altitude_of(item, height)
    assert home.height_of(item) == pytest.approx(height)


def test_items_without_a_place() -> None:
    item = at(1, 100.0, 100.0)
    item.x = item.y = INT32_MAX
    assert HOME.place_of(item) is None
    item.x = item.y = 0
    assert HOME.place_of(item) is None
    assert HOME.place_of(triangle()[4]) is None
    state = Station(1).fleet.vehicles[1]
    assert home_of(state) is None


@pytest.mark.parametrize("text", ["", "1 2", "1 2 3 4", "a b c", "1 nan 2", "1e999 0 0", "2e5 0 0"])
def test_what_is_no_place(text: str) -> None:
    with pytest.raises(WrittenPlaceError):
        read_place(text)
