"""Waiting for a condition instead of for a time."""

import time
from collections.abc import Callable

from textual.pilot import Pilot

from gcs.tui.dialogs import Question

_TIMEOUT_S = 600.0


async def until(pilot: Pilot[None], condition: Callable[[], bool], what: str = "") -> None:
    """Let an app work until a condition holds."""
    end = time.monotonic() + _TIMEOUT_S
    while not condition():
        assert time.monotonic() < end, f"not within {_TIMEOUT_S:g} s: {what}"
        await pilot.pause(0.01)


async def until_focused(pilot: Pilot[None], name: str) -> None:
    """Wait until the widget with this id has the focus."""

    def focused() -> bool:
        return pilot.app.focused is not None and pilot.app.focused.id == name

    await until(pilot, focused, f"focus on {name}")


async def answer(pilot: Pilot[None], *keys: str) -> None:
    """Wait until a question takes keys, press them, and wait until it is gone."""
    app = pilot.app

    def asked() -> bool:
        return isinstance(app.screen, Question) and app.focused is not None

    await until(pilot, asked, "a question")
    await pilot.press(*keys)
    await until(pilot, lambda: not isinstance(app.screen, Question), "the question is gone")
