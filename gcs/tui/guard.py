"""Guards: what goes wrong in one widget stays there, and the operator's station keeps running.

A widget that cannot draw says so in its place, and draws again with the next data that it can draw.
Every failure is reported to the app as a `Failed`.
"""

import functools
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from rich.segment import Segment
from textual import on as textual_on
from textual.geometry import Region
from textual.message import Message
from textual.message_pump import MessagePump
from textual.strip import Strip
from textual.widget import Widget
from textual.widgets import Static

from mavlink_defs.visible import visible, visible_lines

if TYPE_CHECKING:  # Textual takes style sheets from the first base that is a widget: this is none
    _Widget = Widget
else:
    _Widget = object

_P = ParamSpec("_P")
_T = TypeVar("_T")


class Failed(Message):
    """Something in the dashboard failed.

    Attributes:
        what: What it could not do: "draw the fleet table".
        error: Why.
    """

    def __init__(self, what: str, error: Exception) -> None:
        super().__init__()
        self.what, self.error = what, error


class Guarded(_Widget):
    """A widget whose failures to draw stay its own; mixed in before another widget class.

    Attributes:
        failure: Why it cannot draw, in one line; "" if it can.
    """

    failure = ""
    _shows = True  # what was last to be shown could be taken in

    def attempt(self, show: Callable[_P, _T], *args: _P.args, **kwargs: _P.kwargs) -> _T | None:
        """Call what gives this widget something to show; None if that fails."""
        try:
            result = show(*args, **kwargs)
        except Exception as error:
            self._shows = False
            self._fail(error)
            return None
        self._shows = True
        if self.failure:
            self._set_failure("")  # render_lines finds out whether that holds
        return result

    def render_lines(self, crop: Region) -> list[Strip]:
        """Draw a part of the widget, or say why that cannot be done."""
        if self._shows:
            try:
                strips = super().render_lines(crop)
            except Exception as error:
                self._fail(error)
            else:
                if self.failure:
                    self._set_failure("")
                return strips
        text = Segment(self.failure, self.rich_style)
        first = Strip([text]).adjust_cell_length(crop.right, self.rich_style).crop(crop.x)
        blank = Strip.blank(crop.width, self.rich_style)
        return [first if y == 0 else blank for y in crop.line_range]

    def _fail(self, error: Exception) -> None:
        what = f"draw the {_name(self)}"
        text = f"cannot {what}: {one_line(error)}"
        if text != self.failure:
            self.app.post_message(Failed(what, error))
            self._set_failure(text)

    def _set_failure(self, text: str) -> None:
        self.failure = text
        self.set_class(bool(text), "-failed")  # its children would cover the text
        self.refresh()


class CachedStatic(Guarded, Static):
    """A text that is only drawn again when it changes; its size is fixed unless `grow` is set."""

    def __init__(self, text: str = "", grow: bool = False, **kwargs: Any) -> None:
        super().__init__(text, **{"markup": False, **kwargs})
        self._grow = grow
        self.says = text

    def say(self, text: str) -> None:
        """Show this text."""
        if text != self.says:
            self.says = text
            self.update(visible_lines(text), layout=self._grow)


def guarded(method: Callable[..., Any]) -> Any:
    """Guard a method that Textual calls: a failure is reported and ends nothing."""

    @functools.wraps(method)
    def safely(self: MessagePump, *args: Any, **options: Any) -> Any:
        try:
            return method(self, *args, **options)
        except Exception as error:
            self.app.post_message(Failed(f"handle what was done in the {_name(self)}", error))
            return None

    return safely


def on(message: type[Message], selector: str | None = None) -> Callable[..., Any]:
    """Declare a handler as `textual.on` does, and guard it."""

    def declare(method: Callable[..., Any]) -> Any:
        return textual_on(message, selector)(guarded(method))

    return declare


def one_line(error: Exception) -> str:
    """Return an exception in one line."""
    return visible(" ".join(f"{type(error).__name__}: {error}".split()))


def _name(widget: MessagePump) -> str:
    """Return what an operator calls a widget: its name, else its id or class."""
    names = (getattr(widget, "name", None), getattr(widget, "id", None), type(widget).__name__)
    return next(name for name in names if name).replace("-", " ")
