"""`frames.frame_size` in compiled code: checks any frame of the dialect, not only hot messages."""

import numpy as np

from mavlink_defs import dialect
from mavlink_defs.framing.codec import checksum, message_id_of
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.header import (
    CRC_SIZE,
    FLAGS,
    HEADER_SIZE,
    MAGIC,
    PAYLOAD_SIZE,
    SIGNATURE_SIZE,
    SIGNED_FLAG,
    V2_MAGIC,
)
from mavlink_defs.runtime.jit import compiled

_IDS = np.array(sorted(dialect.mavlink_map), np.int64)
_EXTRAS = np.array([dialect.mavlink_map[int(i)].crc_extra for i in _IDS], np.int64)


@compiled
def checked_size(data: np.ndarray, length: int) -> int:
    """Return the size of the MAVLink 2 frame of the dialect that data[:length] begins with.

    Args:
        data: Bytes, uint8.
        length: How many of them were received.

    Returns:
        The size [bytes], or a negative `DropReason`. Signatures are not verified.
    """
    if length < 1:
        return DropReason.TRUNCATED
    if data[MAGIC] != V2_MAGIC:
        return DropReason.BAD_MAGIC
    if length < HEADER_SIZE + CRC_SIZE:
        return DropReason.TRUNCATED
    if data[FLAGS] > SIGNED_FLAG:
        return DropReason.BAD_FLAGS
    end = HEADER_SIZE + int(np.int64(data[PAYLOAD_SIZE]))
    size = end + CRC_SIZE + (SIGNATURE_SIZE if data[FLAGS] == SIGNED_FLAG else 0)
    if length < size:
        return DropReason.TRUNCATED
    extra = _crc_extra(message_id_of(data))
    if extra < 0:
        return DropReason.UNEXPECTED
    crc = checksum(data, end, extra)
    if data[end] != crc & 0xFF or data[end + 1] != crc >> 8:
        return DropReason.BAD_CRC
    return size


@compiled
def _crc_extra(message_id: int) -> int:
    """Return the CRC_EXTRA of a message, or -1 if the dialect has none with this id."""
    low, high = 0, _IDS.size
    while low < high:
        middle = (low + high) // 2
        if _IDS[middle] < message_id:
            low = middle + 1
        else:
            high = middle
    return int(_EXTRAS[low]) if low < _IDS.size and _IDS[low] == message_id else -1
