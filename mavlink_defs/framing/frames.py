"""Frames of all messages that are not hot.

pymavlink decodes them; they are packed here, to the same bytes in half the time.
"""

import functools
import itertools
import struct
from collections.abc import Callable

from fastcrc.crc16 import mcrf4xx

from mavlink_defs import dialect
from mavlink_defs.constants import STATUSTEXT_SIZE
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.header import (
    CRC_SIZE,
    HEADER_SIZE,
    MAGIC,
    MESSAGE_ID,
    PAYLOAD_SIZE,
    V2_MAGIC,
    whole_size,
)
from mavlink_defs.visible import visible

_HEADER = struct.Struct("<BBHBBB3s")  # both kinds of flags in one field
_V1_HEADER_SIZE: int = dialect.HEADER_LEN_V1


class FramePacker:
    """Packs messages of one system and component.

    Sequence numbers must be contiguous per component and link. A component whose hot messages
    are packed elsewhere shares their counter by `next_sequence`.
    """

    def __init__(
        self, system: int, component: int, next_sequence: Callable[[], int] | None = None
    ) -> None:
        self._system, self._component = system, component
        self._next_sequence = next_sequence or itertools.count().__next__

    def pack(self, message: dialect.MAVLink_message) -> bytes:
        """Return the frame of a message and count it as sent."""
        return self.pack_payload(message.get_msgId(), _payload(message))

    def pack_payload(self, message_id: int, payload: bytes) -> bytes:
        """Return the frame of a payload in wire order, as a record has it, and count it as sent."""
        payload = payload.rstrip(b"\0") or payload[:1]
        header = _HEADER.pack(
            V2_MAGIC,
            len(payload),
            0,
            self._next_sequence() & 0xFF,
            self._system,
            self._component,
            message_id.to_bytes(3, "little"),
        )
        frame = header + payload
        crc = mcrf4xx(frame[1:] + bytes((dialect.mavlink_map[message_id].crc_extra,)))
        return frame + crc.to_bytes(CRC_SIZE, "little")


def _payload(message: dialect.MAVLink_message) -> bytes:
    """Return the fields in wire order."""
    numbers: list[float | bytes] = []
    for name, is_array in _wire_fields(message.get_msgId()):
        if is_array:
            numbers += getattr(message, name)
        else:
            numbers.append(getattr(message, name))
    payload: bytes = message.unpacker.pack(*numbers)
    return payload


@functools.cache
def _wire_fields(message_id: int) -> list[tuple[str, bool]]:
    """Return the attributes of a message in wire order, and whether each is an array.

    Characters are in one attribute as they are sent, beside the text that they make.
    """
    kind = dialect.mavlink_map[message_id]
    return [
        (f"_{name}_raw" if code == "c" else name, length > 1)
        for name, length, code in zip(
            kind.ordered_fieldnames,
            kind.lengths,
            kind.native_format.decode().lstrip("<"),
            strict=True,
        )
    ]


_decoder = dialect.MAVLink(None)


def parse(datagram: bytes) -> dialect.MAVLink_message | None:
    """Decode a datagram that holds one MAVLink 2 frame of the dialect; None if it does not."""
    if frame_size(datagram)[0] != len(datagram) or not datagram:
        return None  # pymavlink would take MAVLink 1, unknown messages and unknown flags, too
    try:
        return _decoder.decode(bytearray(datagram))
    except Exception:  # pymavlink raises struct.error, IndexError, … besides its MAVError
        return None


def of_mavlink1(datagram: bytes) -> bytes | None:
    """Return the MAVLink 2 frame that says what a MAVLink 1 frame of the dialect says.

    None if the datagram is no such frame, or its checksum is wrong.
    """
    if len(datagram) < _V1_HEADER_SIZE + CRC_SIZE or datagram[MAGIC] != dialect.PROTOCOL_MARKER_V1:
        return None
    end = _V1_HEADER_SIZE + datagram[PAYLOAD_SIZE]
    message = dialect.mavlink_map.get(datagram[_V1_HEADER_SIZE - 1])
    if message is None or len(datagram) != end + CRC_SIZE:
        return None
    extra = bytes((message.crc_extra,))
    if mcrf4xx(datagram[1:end] + extra).to_bytes(CRC_SIZE, "little") != datagram[end:]:
        return None
    size, sequence, system, component, message_id = datagram[PAYLOAD_SIZE:_V1_HEADER_SIZE]
    number = message_id.to_bytes(3, "little")
    header = _HEADER.pack(V2_MAGIC, size, 0, sequence, system, component, number)
    frame = header + datagram[_V1_HEADER_SIZE:end]
    return frame + mcrf4xx(frame[1:] + extra).to_bytes(CRC_SIZE, "little")


def drop_reason(datagram: bytes) -> DropReason:
    """Return why `parse` refuses a datagram."""
    size, wrong = frame_size(datagram)
    if wrong is not None:
        return wrong
    return DropReason.BAD_LENGTH if size != len(datagram) else DropReason.OUT_OF_RANGE


def frame_size(data: bytes) -> tuple[int, DropReason | None]:
    """Return the size of the MAVLink 2 frame of the dialect that `data` begins with.

    Returns:
        The size [bytes] and None; or 0 and what is wrong. Signatures are not verified.
    """
    size = whole_size(data, len(data))
    if isinstance(size, DropReason):
        return 0, size
    message = dialect.mavlink_map.get(int.from_bytes(data[MESSAGE_ID:HEADER_SIZE], "little"))
    if message is None:
        return 0, DropReason.UNEXPECTED
    end = HEADER_SIZE + data[PAYLOAD_SIZE]
    crc = mcrf4xx(data[1:end] + bytes([message.crc_extra]))
    if crc != int.from_bytes(data[end : end + CRC_SIZE], "little"):
        return 0, DropReason.BAD_CRC
    return size, None


def text_chunks(severity: int, text: str, identity: int) -> list[dialect.MAVLink_message]:
    """Return the STATUSTEXT messages of a text, in chunks if it is longer than one holds.

    Args:
        severity: MAV_SEVERITY.
        text: The text; control characters become escapes, others outside ASCII are replaced.
        identity: Number that distinguishes this text from others while its chunks arrive; 0 is
            raised to 1, since 0 means a text of one chunk.
    """
    raw = visible(text).encode("ascii", "replace")
    chunks = [raw[i : i + STATUSTEXT_SIZE] for i in range(0, len(raw), STATUSTEXT_SIZE)] or [b""]
    if len(chunks) == 1:
        return [dialect.MAVLink_statustext_message(severity, chunks[0])]
    if len(chunks[-1]) == STATUSTEXT_SIZE:
        chunks.append(b"")  # a chunk without a zero byte announces another one
    number = identity % 65535 + 1
    return [
        dialect.MAVLink_statustext_message(severity, chunk, number, k)
        for k, chunk in enumerate(chunks)
    ]
