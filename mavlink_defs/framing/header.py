"""Header of a MAVLink 2 frame: offsets of its fields, and the length of the frame.

https://mavlink.io/en/guide/serialization.html. The offsets serve compiled code, too.
"""

from typing import Any, NamedTuple, Self

from mavlink_defs import dialect
from mavlink_defs.framing.drop_reason import DropReason

MAGIC, PAYLOAD_SIZE, FLAGS, SEQUENCE, SYSTEM, COMPONENT, MESSAGE_ID = 0, 1, 2, 4, 5, 6, 7
"""Offsets [bytes]; all fields are one byte, but the message id is three, little endian."""

V2_MAGIC: int = dialect.PROTOCOL_MARKER_V2
SIGNED_FLAG: int = dialect.MAVLINK_IFLAG_SIGNED
HEADER_SIZE: int = dialect.HEADER_LEN_V2
CRC_SIZE = 2
SIGNATURE_SIZE: int = dialect.MAVLINK_SIGNATURE_BLOCK_LEN
MAX_FRAME_SIZE = HEADER_SIZE + 255 + CRC_SIZE + SIGNATURE_SIZE
"""Size of the longest MAVLink 2 frame: 280 [bytes]."""


class FrameHeader(NamedTuple):
    """The header of a MAVLink 2 frame."""

    payload_size: int
    flags: int
    system: int = 0
    component: int = 0
    message_id: int = 0

    @classmethod
    def read(cls, data: bytes) -> Self | None:
        """Read the header of a frame; None if it is too short for one or not MAVLink 2."""
        if len(data) < HEADER_SIZE + CRC_SIZE or data[MAGIC] != V2_MAGIC:
            return None
        message_id = int.from_bytes(data[MESSAGE_ID:HEADER_SIZE], "little")
        return cls(data[PAYLOAD_SIZE], data[FLAGS], data[SYSTEM], data[COMPONENT], message_id)

    @property
    def crc_offset(self) -> int:
        """Offset of the payload's end, where the checksum begins [bytes]."""
        return HEADER_SIZE + self.payload_size

    @property
    def frame_size(self) -> int:
        """Size of the whole frame [bytes]."""
        signature = SIGNATURE_SIZE if self.flags & SIGNED_FLAG else 0
        return self.crc_offset + CRC_SIZE + signature


def whole_size(data: Any, length: int) -> int:
    """Return the size of the MAVLink 2 frame that data[:length] begins with, by its header.

    Args:
        data: Bytes; compiled, as `codec.size_by_header`, an array of uint8.
        length: How many of them were received.

    Returns:
        The size [bytes], or a negative `DropReason`.
    """
    if length < 1:
        return DropReason.TRUNCATED
    if data[MAGIC] != V2_MAGIC:
        return DropReason.BAD_MAGIC
    if length < HEADER_SIZE + CRC_SIZE:
        return DropReason.TRUNCATED
    if data[FLAGS] > SIGNED_FLAG:
        return DropReason.BAD_FLAGS
    size = HEADER_SIZE + (data[PAYLOAD_SIZE] & 0xFF) + CRC_SIZE  # masked, it is a signed integer
    if data[FLAGS] == SIGNED_FLAG:
        size += SIGNATURE_SIZE
    return size if size <= length else DropReason.TRUNCATED
