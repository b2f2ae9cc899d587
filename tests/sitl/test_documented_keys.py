"""The steps of README and of the dashboard's page, played as they are written, at 80 × 24."""

from functools import partial
from pathlib import Path

import pytest
import yaml
from flying import hexagon_tree, scenario_tree
from operating import Operator, drive, operator
from station import up
from textual.command import CommandPalette
from textual.widgets import OptionList, TabbedContent

from gcs.station.mission import is_same
from gcs.tui.dialogs import Help
from gcs.tui.mission_list import MissionList
from gcs.tui.missions import MissionsPanel
from gcs.tui.profile_views import ProfileFiles
from gcs.tui.profiles import ProfilesPanel

pytestmark = pytest.mark.sitl

ROOT = Path(__file__).parents[2]
# the steps as they are written, by page
WRITTEN = {
    "README.md": (
        "`*` marks all vehicles, `s` starts their missions, `a` and Enter arm them",
        "`*` again, so that none is marked, `3`, then `n`",
        "type an effectiveness, Ctrl-S",
        "`r` gives",
        "`C` and Enter clear",
    ),
    "docs/how-to/dashboard.md": (
        "`*` marks all vehicles, `s` starts their missions, `a` and Enter arms them",
        "`*` again, so that none is marked, `3`, `n`",
        "type an effectiveness, Ctrl-S",
        "`r` gives",
        "`C` and Enter clear",
        "`4`: choose a YAML file, `u` uploads it to the marked vehicles, else to the selected one",
        "`7`: the map",
        "`i`, `e` and `d` insert, change and delete its items, `u` uploads it",
        "`?` lists all keys",
        "Ctrl-P finds actions by name",
        "`q` leaves",
    ),
}


def test_the_steps_of_the_documentation_do_what_they_say(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for page, steps in WRITTEN.items():
        text = " ".join((ROOT / page).read_text().split())
        at = [text.find(step) for step in steps]
        assert -1 not in at, (page, steps[at.index(-1)])
        assert at == sorted(at), page

    async def work() -> None:
        async with operator(fleet, size=(80, 24)) as someone:
            await _play(someone)

    working_folder = tmp_path / "working folder"
    working_folder.mkdir()
    tree = scenario_tree()
    tree["profile"][1]["airspeed_m_s"] = 44.0
    (working_folder / "own.yaml").write_text(yaml.safe_dump({"profile": tree["profile"]}))
    monkeypatch.chdir(working_folder)
    with up(tmp_path, tree=scenario_tree(faults=[])) as fleet:
        drive(work())


async def _play(someone: Operator) -> None:
    tabs = someone.app.query_one(TabbedContent)
    await someone.press("asterisk", "s")
    for system in (1, 2, 3):
        await someone.sees_event(f"{system} action", "start mission: accepted")
    await someone.press("a")
    await someone.answer("enter")
    await someone.sees(lambda: all(someone.state(i).armed for i in (1, 2, 3)), "armed")
    await someone.sees(lambda: (someone.state(1).time_s or 0.0) > 0.5, "time begins")
    await someone.press("2")
    await someone.sees(lambda: tabs.active == "plots", "plots")
    await someone.press("asterisk", "3", "n", "tab", "tab", *"0.5", "ctrl+s")
    await someone.sees_event("1 action", "set: rudder at 50 %")
    await someone.press("r")  # at once: the fault accepted is the last one
    await someone.sees(lambda: len(someone.state(2).active_faults) == 1, "repeated")
    assert someone.state(2).active_faults == someone.state(1).active_faults
    await someone.press("C")
    await someone.answer("enter")
    await someone.sees(lambda: not any(someone.state(i).faults for i in (1, 2, 3)), "cleared")
    await someone.press("4")
    await _choose_file(someone, "own.yaml")
    await someone.press("u")
    await someone.answer("enter")  # it flies: the question whether
    await someone.sees_event("1 action", "own.yaml, 3 segments uploaded")
    await someone.sees(lambda: _speed(someone, 1) == 44.0, "the profile of the selected vehicle")
    assert _speed(someone, 2) == 45.0
    for key, panel in (("4", "profiles"), ("5", "parameters"), ("6", "events"), ("7", "map")):
        await someone.press(key)
        await someone.sees(partial(_is_shown, tabs, panel), panel)
    await someone.press("question_mark")
    await someone.sees(lambda: isinstance(someone.app.screen, Help), "help")
    await someone.press("escape")
    await someone.sees(lambda: not isinstance(someone.app.screen, Help), "no help")
    await someone.press("ctrl+p")
    await someone.sees(lambda: isinstance(someone.app.screen, CommandPalette), "the palette")
    await someone.press(*"disarm")
    found = someone.app.screen.query_one(OptionList)
    await someone.sees(lambda: found.option_count == 1, "an action")
    await someone.press("enter")
    await someone.answer("escape")
    await someone.press("q")
    await someone.sees(lambda: not someone.app.is_running, "left")
    assert someone.state(1).armed  # the fleet flies on


async def _choose_file(someone: Operator, name: str) -> None:
    files = someone.app.query_one(ProfileFiles)
    await someone.sees(lambda: someone.app.focused is files, "files")
    await someone.press("home")
    for _ in range(9):
        if files.cursor_node is not None and str(files.cursor_node.label) == name:
            break
        await someone.press("down")
    await someone.press("enter")
    panel = someone.app.query_one(ProfilesPanel)
    await someone.sees(lambda: panel.segments is not None, name)


def _speed(someone: Operator, system: int) -> float:
    profile = someone.state(system).profile
    return profile[1].airspeed_m_s if profile else 0.0


def test_a_mission_is_changed_by_the_keys_of_the_documentation(tmp_path: Path) -> None:
    async def work() -> None:
        async with operator(fleet, size=(80, 24)) as someone:
            items, panel = someone.app.query_one(MissionList), someone.app.query_one(MissionsPanel)
            await someone.press("7")
            await someone.sees(lambda: len(items.rows) == 7, "the items")
            await someone.sees(lambda: someone.app.focused is items, "focus on the list")
            await someone.press("i", "enter")
            await someone.sees(lambda: len(items.rows) == 8, "one more")
            await someone.press("e", *"10", "space", *"20", "space", *"130", "enter")
            await someone.sees(lambda: "N 10 E 20 130" in items.text, "another place")
            await someone.press("end", "up", "d")
            await someone.sees(lambda: len(items.rows) == 7, "one less")
            expected = panel.draft
            assert expected is not None
            await someone.press("u")
            await someone.answer("enter")
            await someone.sees_event("1 action", "mission of 7 items uploaded")
            await someone.sees(lambda: panel.draft is None, "it is the vehicle's")
            assert is_same(someone.state(1).mission or (), expected)
            assert not is_same(someone.state(2).mission or (), expected)

    with up(tmp_path, tree=hexagon_tree()) as fleet:
        drive(work())


def _is_shown(tabs: TabbedContent, panel: str) -> bool:
    return tabs.active == panel
