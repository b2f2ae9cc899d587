"""The compiled frame check and the one in Python agree on everything."""

import numpy as np
import pytest
from fastcrc.crc16 import mcrf4xx
from hypothesis import example, given
from hypothesis import strategies as st

from mavlink_defs import dialect
from mavlink_defs.framing.codec import checked_size
from mavlink_defs.framing.frames import FramePacker, frame_size

MESSAGES = [
    dialect.MAVLink_heartbeat_message(1, 3, 0, 0, 4, 3),
    dialect.MAVLink_ftc_step_done_message(77),
    dialect.MAVLink_statustext_message(6, b"x" * 50),
    dialect.MAVLink_attitude_message(5, *[0.5] * 6),
]


def signed(message: dialect.MAVLink_message) -> bytes:
    mavlink = dialect.MAVLink(None, 3, 1)
    mavlink.signing.secret_key = bytes(32)
    mavlink.signing.sign_outgoing = True
    return bytes(message.pack(mavlink))


def agreed(data: bytes) -> int:
    """Return what both checks say: the size, or a negative `DropReason`."""
    size, wrong = frame_size(data)
    said = checked_size(np.frombuffer(data + b"\0", np.uint8).copy(), len(data))
    assert said == (size if wrong is None else int(wrong))
    return said


frames = st.sampled_from([pack(m) for m in MESSAGES for pack in (FramePacker(2, 1).pack, signed)])


@given(frames, st.binary(max_size=300))
def test_a_frame_and_what_follows(frame: bytes, rest: bytes) -> None:
    assert agreed(frame + rest) == len(frame)


@given(frames, frames, st.data())
def test_damage(first: bytes, second: bytes, data: st.DataObject) -> None:
    datagram = bytearray(first + second)
    for at in data.draw(st.lists(st.integers(0, len(datagram) - 1), max_size=3)):
        datagram[at] ^= data.draw(st.integers(1, 255))
    agreed(bytes(datagram[: data.draw(st.integers(0, len(datagram)))]))


@given(st.binary(max_size=300))
@example(b"")
def test_noise(noise: bytes) -> None:
    agreed(noise)
    agreed(b"\xfd" + noise)


@given(st.integers(0, 2**24 - 1), st.integers(0, 2), st.binary(max_size=255))
def test_any_message_id(message_id: int, flags: int, payload: bytes) -> None:
    head = bytes([0xFD, len(payload), flags, 0, 0, 1, 1]) + message_id.to_bytes(3, "little")
    agreed(head + payload + bytes(15))


def test_every_message_of_the_dialect_and_none_besides(subtests: pytest.Subtests) -> None:
    for number in {i + k for i in (*dialect.mavlink_map, -1 % 2**24) for k in (-1, 0, 1)}:
        with subtests.test(message_id=number):
            body = bytes([3, 0, 0, 0, 1, 1]) + (number % 2**24).to_bytes(3, "little") + b"abc"
            known = dialect.mavlink_map.get(number)
            crc = mcrf4xx(body + bytes([known.crc_extra if known else 0]))
            said = agreed(b"\xfd" + body + crc.to_bytes(2, "little"))
            assert (said == 15) == (known is not None)
