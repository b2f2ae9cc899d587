"""Frames of every message of the dialect: the bytes match pymavlink's."""

import struct
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mavlink_defs import dialect
from mavlink_defs.framing.frames import FramePacker, of_mavlink1, parse

MESSAGES = list(dialect.mavlink_map.values())


@st.composite
def messages(draw: st.DrawFn, kind: Any) -> dialect.MAVLink_message:
    """Any bytes as a payload; its last ones may be zeros, which are cut off on the wire."""
    size = kind.unpacker.size
    payload = draw(st.binary(min_size=size, max_size=size))
    zeros = draw(st.integers(0, size))
    values = list(kind.unpacker.unpack(payload[: size - zeros].ljust(size, b"\0")))
    fields: dict[str, Any] = {}
    for name, code, count in zip(
        kind.ordered_fieldnames,
        kind.native_format.decode().lstrip("<"),
        kind.array_lengths,
        strict=True,
    ):
        if count and code != "c":
            fields[name], values = values[:count], values[count:]
        else:
            fields[name] = values.pop(0)
    message: dialect.MAVLink_message = kind(**fields)
    return message


def by_pymavlink(message: dialect.MAVLink_message, sequence: int = 0) -> bytes:
    mavlink = dialect.MAVLink(None, 7, 190)
    mavlink.seq = sequence
    return bytes(message.pack(mavlink))


@given(data=st.data())
@settings(max_examples=6)
def packs_as_pymavlink_does(kind: type[dialect.MAVLink_message], data: st.DataObject) -> None:
    message = data.draw(messages(kind))
    assert FramePacker(7, 190).pack(message) == by_pymavlink(message)


@given(data=st.data())
@settings(max_examples=3)
def says_the_same_in_mavlink_1(kind: type[dialect.MAVLink_message], data: st.DataObject) -> None:
    """All but extensions; no byte may be another, or be missing."""
    mavlink = dialect.MAVLink(None, 7, 190)
    mavlink.seq = 200
    older = bytes(data.draw(messages(kind)).pack(mavlink, force_mavlink1=True))
    newer = of_mavlink1(older)
    assert newer is not None
    message, original = parse(newer), dialect.MAVLink(None).decode(bytearray(older))
    assert message is not None
    assert repr(message.to_dict()) == repr(original.to_dict())
    assert (message.get_seq(), message.get_srcSystem(), message.get_srcComponent()) == (200, 7, 190)
    place = data.draw(st.integers(0, len(older) - 1))
    damaged = older[:place] + bytes([older[place] ^ 1]) + older[place + 1 :]
    assert [of_mavlink1(one) for one in (damaged, older[:-1], older + b"\0", b"", newer)] == [
        None
    ] * 5


@pytest.mark.hypothesis
def test_every_message(subtests: pytest.Subtests) -> None:
    for kind in MESSAGES:
        with subtests.test(kind.msgname):
            packs_as_pymavlink_does(kind)
            if kind.id < 256:
                says_the_same_in_mavlink_1(kind)


def test_sequence_numbers_are_contiguous() -> None:
    beat, packer = dialect.MAVLink_heartbeat_message(1, 3, 0, 0, 4, 3), FramePacker(7, 190)
    for sent in range(600):
        assert packer.pack(beat) == by_pymavlink(beat, sent % 256)


def test_a_shared_counter_gives_the_sequence_numbers() -> None:
    beat = dialect.MAVLink_heartbeat_message(1, 3, 0, 0, 4, 3)
    packer = FramePacker(7, 190, iter([5, 256 + 9]).__next__)
    assert [packer.pack(beat) for _ in range(2)] == [by_pymavlink(beat, n) for n in (5, 9)]


def test_a_number_that_a_field_cannot_hold_is_our_own_mistake() -> None:
    with pytest.raises(struct.error):
        FramePacker(7, 190).pack(dialect.MAVLink_heartbeat_message(256, 3, 0, 0, 4, 3))
