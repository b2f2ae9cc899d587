"""The bar below a log: position and speed of the playback."""

from typing import Any

from rich.text import Text
from textual import events
from textual.message import Message
from textual.reactive import reactive
from textual.widget import Widget

from gcs.tui.guard import Guarded, guarded
from gcs.tui.playback import Playback


class ReplayBar(Guarded, Widget):
    """One line: state, place, length, speed, and a bar that takes clicks."""

    line: reactive[tuple[str, float]] = reactive(("", 0.0))

    class Sought(Message):
        """The operator clicked at this share of the log."""

        def __init__(self, share: float) -> None:
            super().__init__()
            self.share = share

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._bar = range(0)

    def show_playback(self, playback: Playback) -> None:
        """Show position and speed."""
        sign = "⧗" if playback.is_seeking else "▶" if playback.playing else "‖"
        begin_s, end_s = playback.begin_s, playback.end_s
        place = f"{playback.clock.name} {_time(playback.position_s)} / {_time(end_s)}"
        share = (playback.position_s - begin_s) / (end_s - begin_s) if end_s > begin_s else 1.0
        self.line = (f" {sign} {place}  ×{playback.speed:g} ", share)

    def render(self) -> Text:
        """Draw the line."""
        label, share = self.line
        colours = self.app.theme_variables
        keys = " k play · j l seek · < > speed "
        text = Text(label, style="bold", no_wrap=True)
        width = max(self.size.width - text.cell_len - len(keys), 4)
        self._bar = range(text.cell_len, text.cell_len + width)
        done = round(share * (width - 1))
        text.append("━" * done, style=colours["primary"])
        text.append("●", style=colours["primary"])
        text.append("─" * (width - 1 - done), style=colours["muted"])
        return text.append(keys, style=colours["muted"])

    @guarded
    def on_click(self, event: events.Click) -> None:
        """Seek."""
        if event.x in self._bar:
            self.post_message(self.Sought((event.x - self._bar.start) / max(len(self._bar) - 1, 1)))


def _time(time_s: float) -> str:
    minutes, seconds = divmod(time_s, 60.0)
    return f"{int(minutes)}:{seconds:04.1f}"
