"""The hot-path codec against pymavlink: same bytes out, same fields in, same refusals."""

import struct
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from mavlink_defs import dialect
from mavlink_defs.framing import codec, header
from mavlink_defs.framing.drop_reason import DropReason

HOT: dict[int, tuple[np.dtype[np.void], type]] = {
    codec.MessageId.SIM_STATE: (codec.SIM_STATE, dialect.MAVLink_ftc_sim_state_message),
    codec.MessageId.SIM_STEP: (codec.SIM_STEP, dialect.MAVLink_ftc_sim_step_message),
    codec.MessageId.SENSOR: (codec.HIL_SENSOR, dialect.MAVLink_hil_sensor_message),
    codec.MessageId.GPS: (codec.HIL_GPS, dialect.MAVLink_hil_gps_message),
    codec.MessageId.STEP_DONE: (codec.STEP_DONE, dialect.MAVLink_ftc_step_done_message),
    codec.MessageId.NEIGHBOUR: (codec.NEIGHBOUR, dialect.MAVLink_ftc_neighbour_message),
    codec.MessageId.ACTUATORS: (codec.ACTUATORS, dialect.MAVLink_hil_actuator_controls_message),
}
RECORD_VALUES = {
    "i": lambda size: st.integers(-(2 ** (8 * size - 1)), 2 ** (8 * size - 1) - 1),
    "u": lambda size: st.integers(0, 256**size - 1),
    "f": lambda size: st.floats(width=8 * size),
}


def values_of(base: np.dtype) -> st.SearchStrategy[Any]:
    return st.just(0) | RECORD_VALUES[base.kind](base.itemsize)


@st.composite
def hot_messages(draw: st.DrawFn) -> tuple[int, np.ndarray]:
    message_id = draw(st.sampled_from(sorted(HOT)))
    payload = np.zeros(1, HOT[message_id][0])
    for name in payload.dtype.fields or ():
        field = payload.dtype[name]
        count = int(np.prod(field.shape))
        values = draw(st.lists(values_of(field.base), min_size=count, max_size=count))
        payload[name] = np.array(values, field.base).reshape(field.shape)
    return message_id, payload


def packed(message_id: int, payload: np.ndarray, system_id=1, component_id=1, sequence=0) -> bytes:
    datagram = codec.new_buffer()
    datagram[:] = 0xA5  # left-overs of an earlier message
    length = codec.pack(datagram, payload, message_id, system_id, component_id, sequence)
    return datagram[:length].tobytes()


def packed_by_pymavlink(message_id: int, payload: np.ndarray, *sender: int) -> bytes:
    message_class = HOT[message_id][1]
    fields = {name: payload[0][name].tolist() for name in payload.dtype.fields or ()}
    system, component, sequence = sender
    mavlink = dialect.MAVLink(None, system, component)
    mavlink.seq = sequence
    return message_class(**fields).pack(mavlink)


def received(data: bytes) -> tuple[np.ndarray, int]:
    datagram = codec.new_buffer()
    datagram[:] = 0x5A
    datagram[: len(data)] = np.frombuffer(data, np.uint8)
    return datagram, codec.check(datagram, len(data))


def sample(message_id: int) -> bytes:
    payload = np.zeros(1, HOT[message_id][0])
    payload.view(np.uint8)[:] = np.arange(1, payload.itemsize + 1)
    return packed(message_id, payload, 3, 1, 77)


@pytest.mark.parametrize("message_id", HOT)
def test_layout_matches_the_dialect(message_id: int) -> None:
    dtype: np.dtype
    message_class: Any
    dtype, message_class = HOT[message_id]
    assert dtype.itemsize == message_class.unpacker.size
    assert list(dtype.fields or ()) == message_class.ordered_fieldnames


@given(hot_messages(), st.integers(1, 255), st.integers(0, 255), st.integers(0, 255))
@example((codec.MessageId.ACTUATORS, np.zeros(1, codec.ACTUATORS)), 1, 1, 255)
@example((codec.MessageId.SIM_STATE, np.zeros(1, codec.SIM_STATE)), 1, 1, 0)
def test_bytes_match_pymavlink_and_read_back(hot, system_id, component_id, sequence) -> None:
    message_id, payload = hot
    before = payload.tobytes()
    ours = packed(message_id, payload, system_id, component_id, sequence)
    assert payload.tobytes() == before
    assert ours == packed_by_pymavlink(message_id, payload, system_id, component_id, sequence)

    datagram, answer = received(ours)
    assert answer == message_id
    assert codec.system_of(datagram) == system_id
    assert datagram[header.COMPONENT] == component_id
    assert datagram[header.SEQUENCE] == sequence
    read = np.full(payload.itemsize, 255, np.uint8)
    codec.unpack(datagram, read)
    assert read.tobytes() == before


def test_sequence_wraps_and_rows_of_an_array_pack_alone() -> None:
    rows = np.zeros(3, codec.STEP_DONE)
    rows["step"] = [5, 6, 7]
    third = packed(codec.MessageId.STEP_DONE, rows[2:3], sequence=256 + 9)
    assert third == packed(codec.MessageId.STEP_DONE, rows[2:].copy(), sequence=9)


def test_packing_an_unknown_message_is_our_own_mistake() -> None:
    with pytest.raises(ValueError, match="not a hot message"):
        packed(0, np.zeros(1, codec.STEP_DONE))


@pytest.mark.parametrize("message_id", HOT)
def test_every_flipped_bit_is_detected(message_id: int) -> None:
    frame = np.frombuffer(sample(message_id), np.uint8)
    for bit in range(8 * frame.size):
        damaged = frame.copy()
        damaged[bit // 8] ^= 1 << bit % 8
        assert received(damaged.tobytes())[1] < 0, f"bit {bit}"


@pytest.mark.parametrize("message_id", HOT)
def test_every_cut_is_detected(message_id: int) -> None:
    frame = sample(message_id)
    for length in range(len(frame)):
        assert received(frame[:length])[1] == DropReason.TRUNCATED
    assert received(frame + b"\0")[1] == DropReason.BAD_LENGTH


@given(st.sampled_from(sorted(HOT)), st.data())
def test_damaged_frames_are_accepted_only_where_pymavlink_accepts_them(message_id, data) -> None:
    frame = bytearray(sample(message_id))
    for _ in range(data.draw(st.integers(1, 4))):
        frame[data.draw(st.integers(0, len(frame) - 1))] = data.draw(st.integers(0, 255))
    answer = received(bytes(frame))[1]
    assert answer in HOT or answer in set(DropReason) or answer in {codec.FOREIGN, codec.SIGNED}
    if answer in HOT:
        assert dialect.MAVLink(None).decode(frame).get_msgId() == answer


@given(st.binary(max_size=codec.BUFFER_SIZE), st.booleans())
def test_random_bytes_are_refused(data: bytes, with_magic: bool) -> None:
    data = b"\xfd" + data[1:] if with_magic else data
    _, answer = received(data)
    assert answer < 0
    if not data.startswith(b"\xfd"):
        assert answer == (DropReason.BAD_MAGIC if data else DropReason.TRUNCATED)


def test_reasons_are_distinguished() -> None:
    frame = sample(codec.MessageId.STEP_DONE)
    assert received(frame[:-1] + bytes([frame[-1] ^ 1]))[1] == DropReason.BAD_CRC
    assert received(frame[:2] + b"\x02" + frame[3:])[1] == DropReason.BAD_FLAGS
    assert received(b"\xfe" + frame[1:])[1] == DropReason.BAD_MAGIC
    assert codec.check(codec.new_buffer(), -1) == DropReason.TRUNCATED


def test_other_messages_and_signed_frames_are_left_to_pymavlink() -> None:
    mavlink = dialect.MAVLink(None, 255, 190)
    heartbeat = dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
    assert received(heartbeat.pack(mavlink))[1] == codec.FOREIGN
    mavlink.signing.secret_key = bytes(32)
    mavlink.signing.sign_outgoing = True
    signed = dialect.MAVLink_ftc_step_done_message(5).pack(mavlink)
    assert received(signed)[1] == codec.SIGNED
    assert received(signed[:-1])[1] == DropReason.TRUNCATED


def test_longer_payload_of_a_newer_dialect_is_read() -> None:
    body = (
        bytes([6, 0, 0, 1, 2, 3])
        + codec.MessageId.STEP_DONE.to_bytes(3, "little")
        + bytes(range(1, 7))
    )
    crc = dialect.x25crc(body + bytes([dialect.MAVLink_ftc_step_done_message.crc_extra])).crc
    datagram, answer = received(b"\xfd" + body + struct.pack("<H", crc))
    assert answer == codec.MessageId.STEP_DONE
    done = np.zeros(1, codec.STEP_DONE)
    codec.unpack(datagram, done.view(np.uint8))
    assert done[0]["step"] == 0x04030201
