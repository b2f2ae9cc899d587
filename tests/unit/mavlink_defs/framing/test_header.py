"""The header's offsets and sizes against pymavlink."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_defs import dialect
from mavlink_defs.framing.header import MAX_FRAME_SIZE, FrameHeader
from mavlink_defs.framing.signing import Signer

ids = st.integers(1, 255)


@given(ids, ids, st.binary(max_size=249), st.booleans())
def test_a_header_says_what_pymavlink_packed(
    system: int, component: int, payload: bytes, signed: bool
) -> None:
    message = dialect.MAVLink_tunnel_message(0, 0, 0, len(payload), payload.ljust(128, b"\0")[:128])
    frame = bytes(message.pack(dialect.MAVLink(None, system, component)))
    if signed:
        frame = Signer(bytes(range(32))).sign(frame)
    header = FrameHeader.read(frame + b"more")
    assert header is not None
    assert (header.system, header.component) == (system, component)
    assert header.message_id == dialect.MAVLINK_MSG_ID_TUNNEL
    assert header.frame_size == len(frame)


@pytest.mark.parametrize("data", [b"", b"\xfd" * 11, b"\xfe" * 30])
def test_what_is_no_frame_has_no_header(data: bytes) -> None:
    assert FrameHeader.read(data) is None


def test_the_longest_frame_is_signed_and_full() -> None:
    assert FrameHeader(255, 1).frame_size == MAX_FRAME_SIZE == 280
