"""Waiting for a condition instead of for a time."""

import time
from collections.abc import Callable

from textual.pilot import Pilot

_TIMEOUT_S = 60.0


async def until(pilot: Pilot[None], condition: Callable[[], bool]) -> None:
    """Let an app work until a condition holds."""
    end = time.monotonic() + _TIMEOUT_S
    while not condition():
        assert time.monotonic() < end, f"not within {_TIMEOUT_S:g} s"
        await pilot.pause(0.01)
