"""Assembly of STATUSTEXTs: a text longer than one message holds comes in chunks.

No socket and no clock. Chunks may be lost, duplicated and out of order; lost ones show as "…".
"""

from dataclasses import dataclass, field

from mavlink_defs.constants import STATUSTEXT_SIZE
from mavlink_defs.dialect import MAVLink_statustext_message
from mavlink_defs.visible import visible

CHUNK_TIMEOUT_S = 1.0
"""Time to wait for missing chunks [s]."""


@dataclass(frozen=True)
class Text:
    """A complete text, without control characters, and its MAV_SEVERITY."""

    severity: int
    text: str


@dataclass
class _Pieces:
    severity: int
    deadline: float
    chunks: dict[int, str] = field(default_factory=dict)

    def is_complete(self) -> bool:
        last = max(self.chunks)
        return len(self.chunks) == last + 1 and len(self.chunks[last]) < STATUSTEXT_SIZE

    def text(self) -> Text:
        parts: list[str] = []
        for i in range(max(self.chunks) + 1):
            parts.append(self.chunks.get(i, "…"))
        if len(parts[-1]) == STATUSTEXT_SIZE:
            parts.append("…")
        return Text(self.severity, visible("".join(parts)))


class TextAssembler:
    """Assembles the STATUSTEXTs of one component."""

    def __init__(self) -> None:
        self._open: dict[int, _Pieces] = {}  # by the id of the text

    def receive(self, message: MAVLink_statustext_message, now: float) -> list[Text]:
        """Take in a message; the text that it completes, if it does."""
        chunk = str(message.text)
        if message.id == 0:
            return [Text(message.severity, visible(chunk))]
        pieces = self._open.setdefault(message.id, _Pieces(message.severity, 0.0))
        pieces.deadline = now + CHUNK_TIMEOUT_S
        pieces.chunks[message.chunk_seq] = chunk
        return [self._open.pop(message.id).text()] if pieces.is_complete() else []

    def handle_timer(self, now: float) -> list[Text]:
        """Return the texts whose missing chunks are overdue at `now` [s]."""
        late = [number for number, pieces in self._open.items() if now >= pieces.deadline]
        return [self._open.pop(number).text() for number in late]
