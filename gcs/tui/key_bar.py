"""The line of keys."""

from collections.abc import Iterable, Iterator

from rich.cells import cell_len
from textual import events
from textual.app import ComposeResult
from textual.widget import Widget
from textual.widgets import Footer

from gcs.tui.guard import guarded

_FIRST = {"help", "quit"}
_PALETTE = 13  # columns of the key of the command palette, which is at the right


class KeyBar(Footer):
    """Help and the way out come first; a key that does not fit as a whole is left to the help."""

    def compose(self) -> ComposeResult:
        """Lay out the keys."""
        keys = list(super().compose())
        always = [key for key in keys if getattr(key, "action", "") in _FIRST]
        others = [key for key in keys if key not in always]
        yield from _fitting([*always, *others], self.app.size.width)

    @guarded
    def on_resize(self, event: events.Resize) -> None:
        """Lay out what fits now."""
        self.call_after_refresh(self.recompose)


def _fitting(keys: Iterable[Widget], width: int) -> Iterator[Widget]:
    room = width - _PALETTE
    for key in keys:
        if key.has_class("-command-palette"):
            yield key
            continue
        label = f"{getattr(key, 'key_display', '')} {getattr(key, 'description', '')} "
        room -= cell_len(label)
        if room >= 0:
            yield key
