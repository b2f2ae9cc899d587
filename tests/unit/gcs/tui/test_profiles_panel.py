"""The profiles panel: which files can be opened."""

from pathlib import Path

import pytest
from textual.pilot import Pilot
from tui_bench import at_screen, playback

from gcs.scenario.profile_file import load_profile
from gcs.tui.app import Dashboard
from gcs.tui.profiles import ProfilesPanel


def test_a_bundled_profile_is_opened_by_its_name_from_any_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)

    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        await pilot.press("4", "o", *"profiles/ramps", "enter")
        panel = app.query_one(ProfilesPanel)
        for _ in range(200):
            if panel.segments is not None:
                break
            await pilot.pause(0.01)
        assert panel.segments == load_profile("profiles/ramps")

    at_screen(playback(), work)
