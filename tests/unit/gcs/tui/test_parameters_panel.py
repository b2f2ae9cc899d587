"""The parameters panel: search, set, compare with the defaults, save and load files by keys."""

from pathlib import Path

import pytest
from textual.pilot import Pilot
from textual.widgets import Input
from tui_bench import Station, at_screen, live
from waiting import answer, until, until_focused

from gcs.console.errors import CommandRefused
from gcs.station.param_file import read_param_file
from gcs.tui.app import Dashboard
from gcs.tui.dialogs import Question
from gcs.tui.grid import Grid
from mavlink_defs.services.param import Param

HELD = {"CTRL_LAW": 0.0, "STEP_US": 1000.0, "TRIG_B2_DEG": 1.0, "TRIG_B1_M_S": 0.5, "OWN": 3.0}


class FakeVehicle:
    """A vehicle that holds parameters, and refuses to set some."""

    def __init__(self, system: int, **held: float) -> None:
        self.system, self.held = system, HELD | held
        self.refused: set[str] = set()
        self.asked: list[str] = []

    async def list_params(self) -> tuple[Param, ...]:
        return tuple(Param(name, value, 9) for name, value in self.held.items())

    async def set_param(self, name: str, value: float) -> Param:
        self.asked.append(name)
        if name in self.refused or name not in self.held:
            raise CommandRefused(f"UAV {self.system} refused {name} = {value:g} (READ_ONLY)", 3)
        self.held[name] = value
        return Param(name, value, 9)


@pytest.fixture
def vehicles() -> dict[int, FakeVehicle]:
    return {1: FakeVehicle(1), 2: FakeVehicle(2, TRIG_B2_DEG=0.75)}


@pytest.fixture
def station(vehicles: dict[int, FakeVehicle]) -> Station:
    station = Station(*vehicles)
    station.vehicles.update(vehicles)
    return station


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def shown(app: Dashboard) -> str:
    """Return the screen as SVG, with its spaces."""
    return app.export_screenshot().replace("&#160;", " ")


def said(app: Dashboard) -> str:
    """Return all that actions have answered."""
    return "\n".join(e.text for e in app.view.source.event_log.entries if e.kind == "action")


async def parameters(app: Dashboard, pilot: Pilot[None]) -> Grid:
    """Go to the panel, and wait until the vehicle has sent its parameters."""
    await pilot.press("5")
    grid = app.query_one("#params", Grid)
    await until(pilot, lambda: len(grid.rows) == len(HELD), "parameters")
    return grid


async def write(pilot: Pilot[None], key: str, text: str) -> None:
    """Press a key that asks for something, and write it."""
    await until_focused(pilot, "params")
    await pilot.press(key)
    await until_focused(pilot, "param-value")
    await pilot.press(*text, "enter")


def question(app: Dashboard) -> str:
    """Return the question that is asked; "" if none is."""
    found = app.screen.query("#question") if isinstance(app.screen, Question) else ()
    return "\n".join(str(widget.render()) for widget in found)


def test_parameters_are_searched_and_set_after_a_question(
    station: Station, vehicles: dict[int, FakeVehicle]
) -> None:
    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        grid = await parameters(app, pilot)
        await pilot.press("slash")
        await until_focused(pilot, "param-search")
        await pilot.press(*"b2", "enter")
        await until(pilot, lambda: [row.key for row in grid.rows] == ["TRIG_B2_DEG"])
        await write(pilot, "enter", "0.5")
        await until(pilot, lambda: question(app).endswith("to 0.5?\nUAV 1 has 1"))
        await answer(pilot, "escape")
        assert not vehicles[1].asked
        await write(pilot, "enter", "0.5")
        await answer(pilot, "enter")
        await until(pilot, lambda: "TRIG_B2_DEG is 0.5" in said(app))
        await until(pilot, lambda: grid.text.split()[:3] == ["≠", "TRIG_B2_DEG", "0.5"])
        vehicles[1].refused = {"TRIG_B2_DEG"}
        await write(pilot, "enter", "7")
        await answer(pilot, "enter")
        await until(pilot, lambda: "UAV 1 refused TRIG_B2_DEG = 7 (READ_ONLY)" in said(app))
        await write(pilot, "enter", "x")
        await pilot.press("escape")
        await until_focused(pilot, "params")
        assert vehicles[1].held["TRIG_B2_DEG"] == 0.5
        assert vehicles[2].asked == []

    at_screen(live(station), work)


def test_a_parameter_of_the_marked_vehicles_is_set(
    station: Station, vehicles: dict[int, FakeVehicle]
) -> None:
    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        await pilot.press("asterisk")
        grid = await parameters(app, pilot)
        await pilot.press("down", "down")
        await until(pilot, lambda: grid.key == "TRIG_B2_DEG")
        await write(pilot, "enter", "2")
        await until(pilot, lambda: "Set TRIG_B2_DEG of UAV 1, 2 to 2?" in question(app))
        await answer(pilot, "enter")
        await until(pilot, lambda: said(app).count("TRIG_B2_DEG is 2") == 2)
        assert [vehicle.held["TRIG_B2_DEG"] for vehicle in vehicles.values()] == [2.0, 2.0]

    at_screen(live(station), work)


def test_what_differs_from_its_default_is_marked_and_found(
    station: Station, vehicles: dict[int, FakeVehicle]
) -> None:
    vehicles[1].held["TRIG_B1_M_S"] = 0.25

    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        grid = await parameters(app, pilot)
        marked = {row.key for row in grid.rows if row.cells[0][0]}
        await pilot.press("d")
        await until(pilot, lambda: {row.key for row in grid.rows} == marked)
        assert "differ from their defaults" in str(grid.border_title)
        await pilot.press("right_square_bracket")  # the next vehicle
        await until(pilot, lambda: "TRIG_B2_DEG" in grid.text)
        await pilot.press("d")
        await until(pilot, lambda: len(grid.rows) == len(HELD))

    at_screen(live(station), work)


def test_nobody_knows_the_defaults_of_a_foreign_vehicle(
    station: Station, vehicles: dict[int, FakeVehicle]
) -> None:
    vehicles[1].held["CTRL_LAW"] = -1.0

    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        grid = await parameters(app, pilot)
        await pilot.press("d")
        await until(pilot, lambda: not grid.rows)
        assert grid.empty == "no default is known"

    at_screen(live(station), work)


def test_parameters_are_saved_in_a_new_file(
    station: Station, vehicles: dict[int, FakeVehicle], folder: Path
) -> None:
    (folder / "there.parm").write_text("A 1\n")

    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        await parameters(app, pilot)
        await write(pilot, "w", "")
        await until(pilot, lambda: "expected the name of a file" in shown(app))
        app.clear_notifications()
        await pilot.press("escape")
        await write(pilot, "w", "there.parm")
        await until(pilot, lambda: "there.parm already exists" in shown(app))
        await pilot.press("escape")
        await write(pilot, "w", "none/a.parm")
        await until(pilot, lambda: "cannot write none/a.parm: No such file" in said(app))
        await write(pilot, "w", "a.parm")
        await until(pilot, lambda: f"{len(HELD)} parameters in a.parm" in said(app))
        assert app.focused is app.query_one("#params")

    at_screen(live(station), work, notices=True)
    assert read_param_file(folder / "a.parm") == HELD
    assert (folder / "there.parm").read_text() == "A 1\n"


def test_a_file_is_compared_and_loaded_after_a_question(
    station: Station, vehicles: dict[int, FakeVehicle], folder: Path
) -> None:
    (folder / "a.parm").write_text("STEP_US 500\nTRIG_B2_DEG 1\nTRIG_B1_M_S 0.25\nNONE 4\n")

    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        await pilot.press("asterisk")
        await parameters(app, pilot)
        expected = [
            "Set 3 parameters of UAV 1, 2 as in a.parm?",
            "UAV 1: TRIG_B1_M_S = 0.5, file 0.25",
            "UAV 1: 1 unknown name (NONE)",
            "UAV 2: TRIG_B2_DEG = 0.75, file 1",
            "UAV 2: TRIG_B1_M_S = 0.5, file 0.25",
            "UAV 2: 1 unknown name (NONE)",
        ]
        await write(pilot, "o", "a.parm")
        await until(pilot, lambda: question(app).splitlines() == expected)
        await answer(pilot, "escape")
        assert [vehicle.asked for vehicle in vehicles.values()] == [[], []]
        await write(pilot, "o", "a.parm")
        await answer(pilot, "enter")
        await until(pilot, lambda: "UAV 2: 2 of 3 set, 1 unknown name (NONE)" in said(app))
        assert "UAV 1: 1 of 2 set, 1 unknown name (NONE)" in said(app)
        assert "refused" not in said(app)
        grid = app.query_one("#params", Grid)
        await until(pilot, lambda: "TRIG_B1_M_S 0.25" in " ".join(grid.text.split()))
        assert vehicles[1].asked == ["TRIG_B1_M_S"]

    at_screen(live(station), work)
    for vehicle in vehicles.values():
        assert vehicle.held == HELD | {"TRIG_B1_M_S": 0.25}


def test_a_file_that_every_vehicle_holds_is_said_to_be_so(
    station: Station, vehicles: dict[int, FakeVehicle], folder: Path
) -> None:
    (folder / "a.parm").write_text("STEP_US 500\nTRIG_B1_M_S 0.5\n")

    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        await pilot.press("asterisk")
        await parameters(app, pilot)
        await write(pilot, "o", "a.parm")
        await until(pilot, lambda: "UAV 1, 2: all as in a.parm" in shown(app))
        assert not question(app)
        assert [vehicle.asked for vehicle in vehicles.values()] == [[], []]

    at_screen(live(station), work, notices=True)


@pytest.mark.parametrize("text", ["missing.parm", "bad.parm", "."])
def test_a_file_that_cannot_be_used_is_reported_and_the_field_stays(
    station: Station, vehicles: dict[int, FakeVehicle], folder: Path, text: str
) -> None:
    (folder / "bad.parm").write_text("TRIG_B2_DEG one\n")

    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        await parameters(app, pilot)
        await write(pilot, "o", text)

        def errors() -> list[str]:
            return [one.message for one in app._notifications if one.severity == "error"]

        await until(pilot, lambda: len(errors()) == 1)
        assert text in errors()[0]
        field = app.query_one("#param-value", Input)
        assert (app.focused, field.value) == (field, text)
        assert not vehicles[1].asked
        assert not app.failures

    at_screen(live(station), work)
