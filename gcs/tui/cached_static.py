"""A text that is only drawn again when it changes."""

from typing import Any

from textual.widgets import Static

from gcs.tui.guard import Guarded
from mavlink_defs.visible import visible_lines


class CachedStatic(Guarded, Static):
    """A Static for texts that are set often; its size is fixed unless `grow` is set."""

    def __init__(self, text: str = "", grow: bool = False, **kwargs: Any) -> None:
        super().__init__(text, **{"markup": False, **kwargs})
        self._grow = grow
        self.says = text

    def say(self, text: str) -> None:
        """Show this text."""
        if text != self.says:
            self.says = text
            self.update(visible_lines(text), layout=self._grow)
