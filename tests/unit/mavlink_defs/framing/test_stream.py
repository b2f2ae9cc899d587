"""Frames in a stream of bytes that is cut anywhere, damaged, and has strange bytes in it."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_defs import dialect
from mavlink_defs.framing.frames import FramePacker
from mavlink_defs.framing.stream import FrameStream

packer = FramePacker(1, 1)
FRAMES = [
    packer.pack(dialect.MAVLink_heartbeat_message(2, 12, 128, 3, 4, 3)),
    packer.pack(dialect.MAVLink_hil_actuator_controls_message(4000, [0.5] * 16, 129, 1)),
    packer.pack(dialect.MAVLink_hil_actuator_controls_message(8000, [-0.0, 1.0] * 8, 129, 1)),
    packer.pack(dialect.MAVLink_command_long_message(0, 0, 511, 0, 115, 5000, 0, 0, 0, 0, 0)),
]


def received(pieces):
    stream = FrameStream()
    return [frame for piece in pieces for frame in stream.feed(piece)], stream


@given(st.data())
def test_frames_come_whole_however_the_stream_is_cut(data):
    whole = b"".join(FRAMES)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(whole)), max_size=9)))
    pieces = [whole[a:b] for a, b in zip([0, *cuts], [*cuts, len(whole)], strict=True)]
    frames, stream = received(pieces)
    assert frames == FRAMES
    assert stream.dropped == 0


@given(st.lists(st.binary(max_size=40), min_size=len(FRAMES) + 1, max_size=len(FRAMES) + 1))
def test_strange_bytes_between_frames_take_none_along(noise):
    pieces = [
        piece for pair in zip(noise, [*FRAMES, b""], strict=True) for piece in pair
    ]  # each by itself: the other side waits for an answer to each frame
    frames, stream = received(pieces)
    assert frames == FRAMES
    assert stream.dropped <= sum(map(len, noise))


def test_a_header_that_promises_too_much_holds_nothing_up():
    """The other side sends nothing more before this frame is answered."""
    stream = FrameStream()
    promise = b"\xfd\xff\x00\x00\x00\x01\x01" + FRAMES[1][7:10]
    assert stream.feed(promise + FRAMES[1]) == [FRAMES[1]]
    assert stream.dropped == len(promise)


@pytest.mark.parametrize("at", range(len(FRAMES[1])))
def test_a_damaged_frame_is_lost_and_the_next_is_not(at):
    damaged = bytearray(FRAMES[1])
    damaged[at] ^= 0x10
    frames, _ = received([bytes(damaged), FRAMES[2]])
    assert frames == [FRAMES[2]]


def test_what_is_kept_is_no_longer_than_a_frame():
    chance = random.Random(1)
    stream = FrameStream()
    total = 0
    for _ in range(300):
        noise = bytes(chance.choice((0xFD, 0, 93, 1)) for _ in range(100))
        total += len(noise)
        assert stream.feed(noise) == []
    assert total - stream.dropped <= 280
