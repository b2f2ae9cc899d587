"""The steps of README and of the dashboard's page, played as they are written, at 80 × 24."""

from functools import partial
from pathlib import Path

import pytest
from flying import scenario_tree
from operating import Operator, drive, operator
from station import up
from textual.widgets import TabbedContent

from gcs.tui.dialogs import Help

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
    ),
}


def test_the_steps_of_the_documentation_do_what_they_say(tmp_path: Path) -> None:
    for page, steps in WRITTEN.items():
        text = " ".join((ROOT / page).read_text().split())
        at = [text.find(step) for step in steps]
        assert -1 not in at, (page, steps[at.index(-1)])
        assert at == sorted(at), page

    async def work() -> None:
        async with operator(fleet, size=(80, 24)) as someone:
            await _play(someone)

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
    await someone.sees(lambda: len(someone.state(1).active_faults) == 1, "the fault")
    await someone.sees_event("1 action", "set: rudder at 50 %")
    await someone.press("r")
    await someone.sees(lambda: len(someone.state(2).active_faults) == 1, "repeated")
    await someone.press("C")
    await someone.answer("enter")
    await someone.sees(lambda: not any(someone.state(i).faults for i in (1, 2, 3)), "cleared")
    for key, panel in (("4", "profiles"), ("5", "parameters"), ("6", "events"), ("7", "map")):
        await someone.press(key)
        await someone.sees(partial(_is_shown, tabs, panel), panel)
    await someone.press("question_mark")
    await someone.sees(lambda: isinstance(someone.app.screen, Help), "help")
    await someone.press("escape", "q")
    await someone.sees(lambda: not someone.app.is_running, "left")
    assert someone.state(1).armed  # the fleet flies on


def _is_shown(tabs: TabbedContent, panel: str) -> bool:
    return tabs.active == panel
