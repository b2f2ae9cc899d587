"""Screens over the dashboard: a question with answers, and the keys."""

from collections.abc import Iterable, Sequence
from typing import Any, ClassVar

from rich.table import Table
from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.content import Content
from textual.screen import ModalScreen
from textual.widgets import Button, Static

from gcs.tui.guard import on
from gcs.tui.requests import Answer
from mavlink_defs.visible import visible, visible_lines

_NAMES = {
    "left_square_bracket": "[",
    "right_square_bracket": "]",
    "question_mark": "?",
    "slash": "/",
    "asterisk": "*",
    "comma": ",",
    "full_stop": ".",
    "less_than_sign": "<",
    "plus": "+",
    "equals_sign": "=",
    "greater_than_sign": ">",
    "minus": "-",
    "up": "↑",
    "down": "↓",
    "left": "←",
    "right": "→",
}


class Question(ModalScreen[str | None]):
    """A question; gives the value of the chosen answer, None for "cancel"."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape", "cancel", "cancel"),
        Binding("left,up", "app.focus_previous", show=False),
        Binding("right,down", "app.focus_next", show=False),
    ]

    def __init__(self, question: str, choices: Sequence[Answer]) -> None:
        super().__init__()
        self._question, self._choices = question, tuple(choices)

    def compose(self) -> ComposeResult:
        """Lay out the question and its answers."""
        with Vertical(classes="dialog"):
            yield Static(visible_lines(self._question), markup=False, id="question")
            with Horizontal(classes="buttons"):
                for i, choice in enumerate(self._choices):
                    variant: Any = choice.variant
                    label = Content(visible(choice.label))  # a text would be markup
                    yield Button(label, variant, id=f"choice-{i}", compact=True)
                yield Button("Cancel", id="cancel", compact=True)

    @on(Button.Pressed)
    def _answered(self, event: Button.Pressed) -> None:
        name = event.button.id or ""
        chosen = name.startswith("choice-")
        self.dismiss(self._choices[int(name.removeprefix("choice-"))].value if chosen else None)

    def action_cancel(self) -> None:
        """Answer "cancel"."""
        self.dismiss(None)


class Help(ModalScreen[None]):
    """All keys, by where they work."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape,q,question_mark,f1", "app.pop_screen", "close")
    ]

    def __init__(self, sections: Iterable[tuple[str, Iterable[BindingType]]]) -> None:
        super().__init__()
        self._sections = [(title, list(bindings)) for title, bindings in sections]

    def compose(self) -> ComposeResult:
        """Lay out the keys."""
        with VerticalScroll(classes="dialog help") as scroll:
            scroll.border_title = "Keys"
            scroll.border_subtitle = "escape closes"
            yield Static(self._table())

    def _table(self) -> Table:
        table = Table(box=None, padding=(0, 1), show_header=False, expand=True)
        table.add_column(no_wrap=True)
        table.add_column()
        for title, bindings in self._sections:
            table.add_row("", Text(title, style="bold underline"))
            for binding in bindings:
                if isinstance(binding, Binding) and binding.description:
                    help_text = binding.tooltip or binding.description
                    table.add_row(Text(key_name(binding.key), style="bold"), Text(help_text))
            table.add_row("", "")
        return table


def key_name(keys: str) -> str:
    """Keys as an operator knows them."""
    return " ".join(_NAMES.get(key, key) for key in keys.split(","))
