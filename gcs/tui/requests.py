"""Messages of widgets to the app: redraw, or act on vehicles."""

from collections.abc import Awaitable, Callable, Iterable
from dataclasses import dataclass

from textual.message import Message

from gcs.station.vehicle import Vehicle


class Refresh(Message):
    """Something that the operator did requires the visible panel to be drawn again."""


@dataclass(frozen=True)
class Answer:
    """An answer to a question before something is done.

    Attributes:
        label: What the button says.
        value: What `VehicleAction.act` gets.
        variant: Of the button: "primary", "warning", "error" or "default".
    """

    label: str
    value: str
    variant: str = "primary"


@dataclass(frozen=True)
class ActionOutcome:
    """The outcome of an action on one vehicle."""

    system: int
    accepted: bool
    text: str


class VehicleAction(Message):
    """Something is to be done with vehicles, all at the same time.

    Attributes:
        what: What is to be done, in brief: "arm".
        systems: System ids of the vehicles.
        act: Does it with one vehicle and returns a text for the log, none for "accepted"; its
            second argument is the value of the operator's choice, "" if there was none.
        question: What the operator is asked first; "" for nothing.
        choices: The answers besides "cancel".
        on_done: Called with each outcome, before the visible panel is drawn again.
    """

    def __init__(
        self,
        what: str,
        systems: Iterable[int],
        act: Callable[[Vehicle, str], Awaitable[str | None]],
        *,
        question: str = "",
        choices: tuple[Answer, ...] = (),
        on_done: Callable[[ActionOutcome], None] | None = None,
    ) -> None:
        super().__init__()
        self.what, self.systems, self.act = what, tuple(systems), act
        self.question, self.choices, self.on_done = question, choices, on_done
