"""The line of keys."""

from textual.app import ComposeResult
from textual.widgets import Footer

__all__ = ["KeyBar"]

_FIRST = {"help", "quit"}


class KeyBar(Footer):
    """Help and the way out come first, where no width of the terminal cuts them off."""

    def compose(self) -> ComposeResult:
        """Lay out the keys."""
        keys = list(super().compose())
        always = [key for key in keys if getattr(key, "action", "") in _FIRST]
        yield from always
        yield from (key for key in keys if key not in always)
