"""Screens against stored pictures.

A telemetry log of scenario 1 stands still at one moment, so that the same is shown on every
machine. After an intended change:
``UPDATE_SCREENS=1 pytest tests/unit/gcs/tui/test_tui_screens.py``, then look at what has
changed in ``tests/data/dashboard/*.svg``.
"""

import asyncio
import functools
import os
import re
import shutil
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from textual.pilot import Pilot

from gcs.tui.app import Dashboard
from gcs.tui.playback import Playback
from gcs.tui.plots import Chart
from gcs.tui.profiles import ProfilesPanel
from mavlink_defs.capture.tlog import read_frames

pytestmark = pytest.mark.slow

DATA = Path(__file__).parents[3] / "data" / "dashboard"
SCENARIO_1 = Path(__file__).parents[4] / "scenarios" / "paper" / "scenario1.yaml"
_FONTS = re.compile(r"@font-face \{.*?\}\s*", re.DOTALL)  # links to a font on the internet
FAULT_S = 20.8  # simulated time: the fault of UAV 3 acts
_PATIENCE_S = 20.0  # with a screen that is not as stored


@pytest.fixture(autouse=True)
def _same_everywhere(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[None]:
    files = tmp_path / "files"
    files.mkdir()
    shutil.copy(SCENARIO_1, files / "scenario1.yaml")
    monkeypatch.chdir(files)
    monkeypatch.setenv("TZ", "UTC")
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


@functools.cache
def standing() -> Playback:
    """The log, paused; no screen changes it."""
    playback = Playback("flight.tlog", list(read_frames(DATA / "flight.tlog")), lambda: 0.0)
    playback.playing = False
    playback.seek(FAULT_S)
    while not playback.advance():
        pass
    return playback


async def settle(app: Dashboard, pilot: Pilot[None]) -> str:
    """Return a picture after everything that is due was drawn."""
    app.refresh_view(force=True)
    await pilot.pause(0.05)
    for chart in app.query(Chart):
        chart.draw(app.view, 10.0 if chart.id else 30.0, None)
    app.clear_notifications()
    await pilot.pause(0.05)
    return _FONTS.sub("", app.export_screenshot())


def compare(
    size: tuple[int, int],
    keys: dict[str, list[str]],
    suffix: str,
    folder: Path,
    theme: str = "dark",
) -> None:
    """Assert that the screens become the stored pictures after these keys, by name.

    Layout and drawing take their time; each screen is looked at until it is the stored one.
    """
    differing = []

    async def show() -> None:
        app = Dashboard(standing(), theme)
        async with app.run_test(size=size) as pilot:
            await pilot.pause()
            app.query_one(ProfilesPanel).load(Path("scenario1.yaml"))
            for name, pressed in keys.items():
                await pilot.press(*pressed)
                stored = DATA / f"{name}-{suffix}.svg"
                expected = stored.read_text() if stored.exists() else None
                picture, end = "", time.monotonic() + _PATIENCE_S
                while picture != expected and time.monotonic() < end:
                    picture = await settle(app, pilot)
                if picture == expected:
                    continue
                new = stored if os.environ.get("UPDATE_SCREENS") else folder / stored.name
                new.write_text(picture)
                differing.append(f"{new} differs from {stored}")

    asyncio.run(show())
    assert not differing or os.environ.get("UPDATE_SCREENS"), "\n".join(differing)


ALL = {
    "fleet": ["down", "down"],
    "plots": ["2"],
    "faults": ["3"],
    "profiles": ["4"],
    "parameters": ["5"],
    "events": ["6"],
    "map": ["7"],
    "help": ["question_mark"],
}


@pytest.mark.parametrize("size", [(80, 24), (120, 40)], ids=lambda size: f"{size[0]}x{size[1]}")
def test_all_screens(size: tuple[int, int], tmp_path: Path) -> None:
    compare(size, ALL, f"{size[0]}x{size[1]}", tmp_path)


def test_light_screen(tmp_path: Path) -> None:
    compare((120, 40), {"fleet": ["down"]}, "light", tmp_path, "light")


def test_wide_screen(tmp_path: Path) -> None:
    compare((200, 50), {"fleet": ["down"]}, "200x50", tmp_path)


def test_a_small_terminal_is_reported(tmp_path: Path) -> None:
    compare((60, 15), {"small": []}, "60x15", tmp_path)
