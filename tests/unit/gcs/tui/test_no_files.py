"""Who may only look at vehicles, in a browser perhaps, sees no file of this machine either."""

from pathlib import Path

import pytest
from textual.pilot import Pilot
from textual.widgets import DirectoryTree, Input
from tui_bench import Station, at_screen, live
from waiting import until

from gcs.tui.app import Dashboard

REFUSAL = "read-only: nothing can be done"


def shown(app: Dashboard) -> str:
    return app.export_screenshot().replace("&#160;", " ")


def test_profiles_have_neither_tree_nor_path() -> None:
    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        await pilot.press("4", "o")
        assert not app.query(DirectoryTree)
        assert not app.query("#profile-path")
        assert not app.failures

    at_screen(live(Station(1, 2), "read-only"), work)


@pytest.mark.parametrize("key", ["o", "w"])
def test_no_file_is_read_for_parameters(
    key: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "own.parm").write_text("secret")
    monkeypatch.chdir(tmp_path)

    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        await pilot.press("5", key)
        await until(pilot, lambda: REFUSAL in shown(app), "refusal")
        app.query_one("#param-value", Input).focus()  # as the mouse could
        await pilot.press(*"own.parm", "enter")
        await pilot.pause()
        assert "secret" not in shown(app)
        assert "exists" not in shown(app)

    at_screen(live(Station(1, 2), "read-only"), work, notices=True)
