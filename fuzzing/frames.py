"""Datagrams to fuzz with: noise, damaged frames, every message with extreme values."""

import struct
from random import Random
from typing import Any

from fastcrc.crc16 import mcrf4xx

from mavlink_defs import dialect

MESSAGES: dict[int, Any] = dialect.mavlink_map
"""Every message class of the dialect, by id."""

_HEADER, _CRC, _MAX_PAYLOAD = 10, 2, 255
_MAX_NOISE = 400  # bytes
_SIZES = {"b": 1, "h": 2, "i": 4, "q": 8}
_FLOATS = (
    0.0,
    -0.0,
    1.0,
    -1.0,
    float("nan"),
    float("inf"),
    float("-inf"),
    3.4028234663852886e38,
    -3.4028234663852886e38,
    1e-45,
    1e9,
    180.0,
)
_DOUBLES = (*_FLOATS, 1.7976931348623157e308, 5e-324, 1e300)
_TARGETS = ("target_system", "target_component")


def frame_of(message_id: int, payload: bytes, system: int, component: int, sequence: int) -> bytes:
    """Return a valid frame of any payload; an id outside the dialect gets a CRC, too."""
    message = MESSAGES.get(message_id)
    size = len(payload.rstrip(b"\0")) or 1
    head = struct.pack("<BBBBBB", size, 0, 0, sequence & 0xFF, system, component)
    body = head + message_id.to_bytes(3, "little") + payload[:size].ljust(1, b"\0")
    crc = mcrf4xx(body + bytes([message.crc_extra if message else 0]))
    return b"\xfd" + body + crc.to_bytes(_CRC, "little")


def message_frame(
    random: Random, message_id: int, sender: tuple[int, int], target: tuple[int, int]
) -> bytes:
    """Return a valid frame of a message whose fields have extreme, plain or any values.

    Args:
        random: Source of the values.
        message_id: An id of `MESSAGES`.
        sender: System and component id of the sender.
        target: System and component id that it is meant for, mostly.
    """
    message, payload = MESSAGES[message_id], b""
    codes = message.native_format.decode()[1:]
    for name, code, count in zip(message.ordered_fieldnames, codes, message.lengths, strict=True):
        if name in _TARGETS and random.random() < 0.9:
            payload += bytes([random.choice((target[_TARGETS.index(name)], 0))])
        elif code in "sc":
            payload += random.randbytes(count)
        elif code in "fd":
            values = [random.choice(_FLOATS if code == "f" else _DOUBLES) for _ in range(count)]
            payload += struct.pack(f"<{count}{code}", *values)
        else:
            payload += b"".join(_whole(random, code) for _ in range(count))
    return frame_of(message_id, payload, *sender, random.randrange(256))


def _whole(random: Random, code: str) -> bytes:
    bits = 8 * _SIZES[code.lower()]
    low, high = (0, 2**bits - 1) if code.isupper() else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    value = random.choice((low, high, 0, 1, max(low, -1), random.randint(0, 12)))
    return struct.pack(f"<{code}", random.randint(low, high) if random.random() < 0.1 else value)


def damaged(random: Random, frame: bytes) -> bytes:
    """Return an invalid version of a good frame, to be found by CRC, length or first byte."""
    kind = random.randrange(6)
    if kind == 0:
        return frame[: random.randrange(len(frame))]
    if kind == 1:
        return frame + random.randbytes(random.randint(1, 20))
    if kind == 2:
        return bytes([random.choice((0, 0x55, 0xFC, 0xFE, 0xFF))]) + frame[1:]
    if kind == 3:
        return frame[:2] + bytes([random.randint(2, 255)]) + frame[3:]
    raw = bytearray(frame)
    if kind == 4:  # up to three wrong bits are found by the CRC
        for bit in random.sample(range(8, 8 * len(raw)), random.randint(1, 3)):
            raw[bit // 8] ^= 1 << bit % 8
    else:  # a burst within 16 bits is found, too
        i = random.randrange(1, len(raw))
        raw[i] ^= random.randint(1, 255)
    return bytes(raw)


def noise(random: Random) -> bytes:
    """Return any bytes; half of the results begin as a frame does."""
    raw = random.randbytes(random.randrange(_MAX_NOISE))
    return b"\xfd" + raw if random.random() < 0.5 else raw
