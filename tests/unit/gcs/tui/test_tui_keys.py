"""Keys pressed at the dashboard, without a fleet."""

import asyncio

from plain_faults import actuator_fault
from textual.pilot import Pilot
from textual.widgets import Input, Select
from tui_bench import Station, at_screen, live, playback
from waiting import answer, until, until_focused

from gcs.console.errors import CommandRefused, NoAnswer
from gcs.tui.app import Dashboard
from gcs.tui.grid import Grid, GridColumn, Row
from gcs.tui.view import LiveSource
from mavlink_defs.faults.fault import Fault


def shown(app: Dashboard) -> str:
    """Return the screen as SVG, with its spaces."""
    return app.export_screenshot().replace("&#160;", " ")


def test_an_empty_fleet_says_what_to_do() -> None:
    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        await until(pilot, lambda: "gcs up" in shown(app))
        for key in (*"1234567", "r", "C", "enter", "a", "s"):
            await pilot.press(key)
        await pilot.pause()
        assert app.defect is None

    at_screen(live(Station()), work)


class DeafVehicle:
    """A vehicle that does not answer."""

    async def arm(self) -> None:
        raise NoAnswer("UAV 1 did not answer MAV_CMD_COMPONENT_ARM_DISARM")


def test_every_failure_is_reported() -> None:
    station = Station(1, 2)
    station.vehicles[1] = DeafVehicle()

    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        entries = app.view.source.event_log.entries
        await pilot.press("asterisk", "a")
        await answer(pilot, "enter")

        def texts() -> dict[int, str]:
            return {entry.system: entry.text for entry in entries if entry.kind == "action"}

        await until(pilot, lambda: texts().keys() >= {1, 2})
        assert "did not answer" in texts()[1]
        assert "has not been heard of" in texts()[2]

    at_screen(live(station), work)


def test_the_palette_and_the_help_know_the_actions() -> None:
    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        titles = {command.title for command in app.get_system_commands(app.screen)}
        assert {"Arm", "Disarm", "Repeat fault", "Clear all faults", "Quit"} <= titles
        await pilot.press("question_mark")
        await until(pilot, lambda: "Arm the marked UAVs" in shown(app))
        await pilot.press("escape")
        await until(pilot, lambda: len(app.screen_stack) == 1)
        await pilot.press("t")
        await until(pilot, lambda: app.theme == "ftc-light")

    at_screen(live(Station(1)), work, (120, 60))


def test_in_a_log_nothing_can_be_done() -> None:
    player = playback()

    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        for key in ("a", "s", "x", "m", "r", "C"):
            await pilot.press(key)
            assert len(app.screen_stack) == 1
        titles = {command.title for command in app.get_system_commands(app.screen)}
        assert "Arm" not in titles
        await pilot.press("k", "l", "greater_than_sign")
        await until(pilot, lambda: (player.speed, player.playing) == (2.0, False))

    at_screen(player, work)


def test_a_grid_keeps_its_cursor_on_what_it_stands_for() -> None:
    columns = (GridColumn("name", 8, "left"), GridColumn("value", 0))

    def rows(*names: str) -> list[Row]:
        return [Row(name, ((name, ""), ("1", "good"))) for name in names]

    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        grid = Grid()
        await app.screen.mount(grid)
        grid.show(columns, rows("a", "b", "c"))
        grid.focus()
        await until(pilot, lambda: app.focused is grid)
        await pilot.press("down")
        await until(pilot, lambda: grid.key == "b")
        grid.show(columns, rows("0", "a", "b", "c"))
        assert grid.key == "b"
        grid.show(columns, rows("a"))
        assert grid.key == "a"
        grid.show(columns, [])
        assert grid.key is None
        grid.show(columns, rows(*map(str, range(100))))
        await pilot.press("end")
        await until(pilot, lambda: grid.key == "99")
        await pilot.press("pageup", "home", "up")
        await until(pilot, lambda: grid.key == "0")

    at_screen(live(Station()), work)


class FaultyVehicle:
    """A vehicle that takes faults, and lists them when it is asked."""

    def __init__(self, source: LiveSource, system: int) -> None:
        self.system, self.refuses = system, False
        self.held: list[Fault] = []
        self._source = source

    async def set_fault(self, fault: Fault) -> None:
        if self.refuses:
            raise CommandRefused(f"UAV {self.system} refused", 1)
        self.held.append(fault)

    async def faults(self) -> None:
        await asyncio.sleep(0.2)
        state = self._source.fleet.vehicles[self.system]
        for notification in state.learn_faults(tuple(self.held), self._source.now()):
            self._source.receive(notification)


def test_the_fault_form_is_left_after_an_accepted_fault_of_the_marked_vehicles() -> None:
    station = Station(1, 2, 3)
    source = live(station)
    for system in (1, 2, 3):
        station.vehicles[system] = FaultyVehicle(source, system)

    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        await pilot.press("space", "down", "space", "3")
        await until_focused(pilot, "fault-list")
        app.refresh_view(force=True)
        await pilot.press("n")
        await until_focused(pilot, "actuator")
        await pilot.press("tab", "tab", *"0.5")
        for system in (1, 2, 3):
            station.vehicles[system].refuses = True
        await pilot.press("ctrl+s")
        await until(pilot, lambda: len(app.view.source.event_log.entries) == 2)
        assert app.focused is app.query_one("#effectiveness")  # to be put right
        for system in (1, 2, 3):
            station.vehicles[system].refuses = False
        await pilot.press("ctrl+s")
        await until_focused(pilot, "fault-list")
        counts = [len(station.vehicles[system].held) for system in (1, 2, 3)]
        assert counts == [1, 1, 0]
        await pilot.press("n")
        await until_focused(pilot, "actuator")
        await until(pilot, lambda: "esc" in shown(app))
        await pilot.press("escape")
        await until_focused(pilot, "fault-list")
        await pilot.press("C")  # is a key again
        await until(pilot, lambda: "Clear all faults of UAV 1, 2" in shown(app))

    at_screen(source, work, (80, 24))


def test_the_fault_repeated_is_the_one_just_accepted() -> None:
    station = Station(1, 2, 3)
    source = live(station)
    for system in (1, 2, 3):
        station.vehicles[system] = FaultyVehicle(source, system)
    station.vehicles[3].held.append(actuator_fault(2, 0.9, 0.0, 0.0, 19.0, 22.0))

    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        await station.vehicles[3].faults()
        await pilot.press("3", "n")
        await until_focused(pilot, "actuator")
        await pilot.press("tab", "tab", *"0.5", "ctrl+s")
        await until_focused(pilot, "fault-list")  # accepted
        await pilot.press("r")
        faults = [station.vehicles[system].held for system in (1, 2, 3)]
        await until(pilot, lambda: sum(map(len, faults)) == 3)
        assert faults[0] == faults[1] != []

    at_screen(source, work, (80, 24))


def test_the_fault_form_offers_what_a_sensor_has() -> None:
    station = Station(1, 2, 3)
    source = live(station)
    for system in (1, 2, 3):
        station.vehicles[system] = FaultyVehicle(source, system)

    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        await pilot.press("3", "n")
        await until_focused(pilot, "actuator")
        app.query_one("#actuator", Select).value = "gyro"
        await until(pilot, lambda: app.query_one("#axis").display)
        assert not app.query_one("#effectiveness").display
        app.query_one("#fault-kind", Select).value = "bias"
        await until(pilot, lambda: "bias °/s" in shown(app))
        app.query_one("#axis", Input).value = "w"
        await until(pilot, lambda: "axis: expected" in shown(app))
        app.query_one("#axis", Input).value = "x"
        await pilot.press("ctrl+s")
        await until_focused(pilot, "fault-list")
        await until(pilot, lambda: "gyro x +3 deg/s" in shown(app))
        await pilot.press("d")
        await until(pilot, lambda: "Clear the faults of the gyro of UAV 1" in shown(app))
        await pilot.press("escape", "n")
        app.query_one("#actuator", Select).value = "rudder"
        await until(pilot, lambda: app.query_one("#effectiveness").display)
        assert not app.query_one("#axis").display

    at_screen(source, work, (100, 30))
