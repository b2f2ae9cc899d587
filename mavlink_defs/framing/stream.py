"""MAVLink 2 frames in a stream of bytes, such as TCP's.

What is damaged is passed over, one byte after another, until a whole frame of the dialect with the
right checksum begins. A header that promises more than has come holds nothing up: whole frames
behind it are taken, and what is before them was none.
"""

from mavlink_defs import dialect
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.frames import frame_size
from mavlink_defs.framing.header import HEADER_SIZE, MAX_FRAME_SIZE, MESSAGE_ID, V2_MAGIC

_MAGIC = bytes((V2_MAGIC,))


class FrameStream:
    """One end of a stream.

    Attributes:
        dropped: Bytes that were part of no frame.
    """

    def __init__(self) -> None:
        self._rest = b""
        self.dropped = 0

    def feed(self, data: bytes) -> list[bytes]:
        """Take the bytes that have come, and return the frames that they complete, in order."""
        waiting = self._rest + data
        frames: list[bytes] = []
        taken = 0  # all before it is used, or of no use
        at = waiting.find(_MAGIC)
        while at >= 0:
            size, _ = frame_size(waiting[at : at + MAX_FRAME_SIZE])
            if size:
                frames.append(waiting[at : at + size])
                self.dropped += at - taken
                taken = at + size
                at = waiting.find(_MAGIC, taken)
            else:
                at = waiting.find(_MAGIC, at + 1)
        first = _first_unfinished(waiting, taken)
        self.dropped += first - taken
        self._rest = waiting[first:]
        return frames


def _first_unfinished(waiting: bytes, begin: int) -> int:
    """Return where the first frame begins of which more may come; the end if there is none."""
    at = waiting.find(_MAGIC, begin)
    while at >= 0:
        data = waiting[at : at + MAX_FRAME_SIZE]
        if frame_size(data)[1] is DropReason.TRUNCATED and _is_of_the_dialect(data):
            return at
        at = waiting.find(_MAGIC, at + 1)
    return len(waiting)


def _is_of_the_dialect(data: bytes) -> bool:
    """Return whether the bytes of a header that have come may begin a message we know."""
    if len(data) < HEADER_SIZE:
        return True
    return int.from_bytes(data[MESSAGE_ID:HEADER_SIZE], "little") in dialect.mavlink_map
