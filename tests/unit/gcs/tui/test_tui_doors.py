"""Texts of others on the screen: at none of its doors are they markup, or steer the terminal."""

import html
import unicodedata
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from textual.pilot import Pilot
from textual.widgets import Input
from tui_bench import Station, at_screen, live
from waiting import until, until_focused

from gcs.console.errors import CommandRefused
from gcs.tui.app import Dashboard
from gcs.tui.dialogs import Question
from gcs.tui.guard import Failed
from gcs.tui.parameters import ParametersPanel
from gcs.tui.profile_views import ProfileFiles
from gcs.tui.profiles import ProfilesPanel
from gcs.tui.requests import Answer, VehicleAction
from mavlink_defs.services.param import Param

FOREIGN = "[red]X[/] [/] \x1b]0;P\x07\x9b2J\u202e\u2028\r\n[@click=app.quit]q"
SEEN = r"[red]X[/] [/] \x1b]0;P\x07\x9b2J\u202e\u2028\r"
UNSEEN = {"Cc", "Cf", "Cs", "Zl", "Zp"}

NAME = FOREIGN.replace("/", "\u2215")

Door = Callable[[Dashboard, Pilot[None], Path], Any]


class Holder:
    """A vehicle with one parameter."""

    system = 1

    async def list_params(self) -> tuple[Param, ...]:
        return (Param("A", 1.0, 9),)


async def notice(app: Dashboard, pilot: Pilot[None], folder: Path) -> None:
    app.notify(FOREIGN)


async def question(app: Dashboard, pilot: Pilot[None], folder: Path) -> None:
    app.push_screen(Question(FOREIGN, [Answer(FOREIGN, "")]))


async def refusal(app: Dashboard, pilot: Pilot[None], folder: Path) -> None:
    async def act(vehicle: Any, choice: str) -> str:
        raise CommandRefused(FOREIGN, 1)

    app.post_message(VehicleAction("arm", [1], act))


async def answer_of_a_vehicle(app: Dashboard, pilot: Pilot[None], folder: Path) -> None:
    async def act(vehicle: Any, choice: str) -> str:
        return FOREIGN

    await pilot.press("6")
    app.post_message(VehicleAction("arm", [1], act))


async def what_is_going_on(app: Dashboard, pilot: Pilot[None], folder: Path) -> None:
    app.operations.going_on.append(FOREIGN)


async def title_of_the_connection(app: Dashboard, pilot: Pilot[None], folder: Path) -> None:
    app.view.source.title = FOREIGN


async def events(app: Dashboard, pilot: Pilot[None], folder: Path) -> None:
    await pilot.press("6")
    app.view.source.event_log.note(1.0, None, 1, "text", 4, FOREIGN)


async def parameters(app: Dashboard, pilot: Pilot[None], folder: Path) -> None:
    await pilot.press("5")
    app.query_one(ParametersPanel).params = {1: (Param(FOREIGN, 1.0, 9),)}
    app.refresh_view(force=True)
    await pilot.press("enter")


async def question_about_a_parameter(app: Dashboard, pilot: Pilot[None], folder: Path) -> None:
    await parameters(app, pilot, folder)
    await until_focused(pilot, "param-value")
    await pilot.press("2", "enter")
    await until(pilot, lambda: isinstance(app.screen, Question), "a question")


async def name_of_a_parameter_file(app: Dashboard, pilot: Pilot[None], folder: Path) -> None:
    (folder / NAME).write_text("A 2\n")
    await pilot.press("5", "o")
    await until_focused(pilot, "param-value")
    app.query_one("#param-value", Input).value = NAME
    await pilot.press("enter")
    await until(pilot, lambda: isinstance(app.screen, Question), "a question")


async def error_of_a_parameter_file(app: Dashboard, pilot: Pilot[None], folder: Path) -> None:
    (folder / "a.parm").write_text(f"{FOREIGN[:12]} 1\n")
    await pilot.press("5", "o")
    await until_focused(pilot, "param-value")
    await pilot.press(*"a.parm", "enter")


async def failure_of_a_widget(app: Dashboard, pilot: Pilot[None], folder: Path) -> None:
    def fail(view: Any) -> None:
        raise ValueError(FOREIGN)

    await pilot.press("5")
    panel: Any = app.query_one(ParametersPanel)
    panel.show_view = fail


async def defect(app: Dashboard, pilot: Pilot[None], folder: Path) -> None:
    await pilot.press("6")
    app.post_message(Failed("draw", ValueError(FOREIGN)))


async def name_of_a_profile(app: Dashboard, pilot: Pilot[None], folder: Path) -> None:
    (folder / "_hidden").mkdir()
    file = folder / "_hidden" / f"{NAME}.yaml"
    file.write_text(
        "profile: [{start_s: 0, airspeed_m_s: 40, roll_deg: 0, pitch_deg: 5, yaw_deg: 0}]"
    )
    await pilot.press("4")
    app.query_one(ProfilesPanel).load(file)


async def file_in_the_tree(app: Dashboard, pilot: Pilot[None], folder: Path) -> None:
    (folder / f"{NAME}.yaml").write_text("profile: []")
    await pilot.press("4")
    app.query_one(ProfileFiles).reload()


async def error_of_a_profile(app: Dashboard, pilot: Pilot[None], folder: Path) -> None:
    (folder / "_hidden").mkdir()
    file = folder / "_hidden" / f"{NAME}.yaml"
    file.write_text("profile: [{start_s: '[red]X[/] [/]'}]")
    await pilot.press("4")
    app.query_one(ProfilesPanel).load(file)


DOORS = (
    notice,
    question,
    refusal,
    answer_of_a_vehicle,
    what_is_going_on,
    title_of_the_connection,
    events,
    parameters,
    question_about_a_parameter,
    name_of_a_parameter_file,
    error_of_a_parameter_file,
    failure_of_a_widget,
    defect,
    name_of_a_profile,
    file_in_the_tree,
    error_of_a_profile,
)


@pytest.mark.parametrize("door", DOORS, ids=lambda door: door.__name__)
def test_what_comes_in_is_shown_as_it_is(
    door: Door, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    station = Station(1)
    station.vehicles[1] = Holder()
    is_name = door in {name_of_a_profile, file_in_the_tree, name_of_a_parameter_file}
    begin = SEEN[:9].replace("/", "\u2215") if is_name else SEEN[:9]

    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        def seen() -> bool:
            app.refresh_view(force=True)
            return begin in screen(app)

        await door(app, pilot, tmp_path)
        await until(pilot, seen, begin)
        picture = screen(app)
        assert not [c for c in picture if unicodedata.category(c) in UNSEEN and c != "\n"]
        assert app.is_running
        assert bool(app.failures) == (door in {failure_of_a_widget, defect})

    at_screen(live(station), work, (200, 50), notices=True)


def screen(app: Dashboard) -> str:
    """Return the texts on the screen as a picture has them."""
    return html.unescape(app.export_screenshot()).replace("\xa0", " ")
