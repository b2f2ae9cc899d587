"""Datagrams of ArduPilot's JSON interface, against a codec and a parser written from its text."""

import struct

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from json_peer import read_as_json, read_by_text, servo_packet

from sitl_plant.foreign.ardupilot.protocol import (
    Measured,
    NotServoPacket,
    answer,
    parse_servo_packet,
)

PULSES = st.sampled_from([16, 32]).flatmap(
    lambda n: st.lists(st.integers(0, 65535), min_size=n, max_size=n)
)
NUMBER = st.floats(-1e7, 1e7)
VECTOR = st.tuples(NUMBER, NUMBER, NUMBER)


@given(PULSES, st.integers(1, 65535), st.integers(0, 2**32 - 1))
def test_a_servo_packet_of_16_or_32_channels_is_read(pwm, rate_hz, frame_count):
    packet = servo_packet(frame_count, pwm, rate_hz)
    assert len(packet) == (40 if len(pwm) == 16 else 72)
    assert parse_servo_packet(packet) == (rate_hz, frame_count, tuple(pwm))


@given(st.binary(max_size=120))
@example(b"")
@example(servo_packet(1, [1500] * 16)[:-1])
@example(servo_packet(1, [1500] * 32) + b"\0")
def test_anything_else_is_refused_with_a_reason(datagram):
    magic = struct.unpack_from("<H", datagram)[0] if len(datagram) > 1 else None
    if (magic, len(datagram)) in {(18458, 40), (29569, 72)} and any(datagram[2:4]):
        return
    with pytest.raises(NotServoPacket, match=r"length|magic|rate"):
        parse_servo_packet(datagram)


@pytest.mark.parametrize(
    ("packet", "reason"),
    [
        (servo_packet(0, [1500] * 16, magic=29569), "magic"),
        (servo_packet(0, [1500] * 32, magic=18458), "magic"),
        (servo_packet(0, [1500] * 16, magic=18459), "magic"),
        (servo_packet(0, [1500] * 16, rate_hz=0), "rate"),
        (servo_packet(0, [1500] * 16) * 2, "length"),
    ],
)
def test_what_is_wrong_is_named(packet, reason):
    with pytest.raises(NotServoPacket, match=reason):
        parse_servo_packet(packet)


@given(st.tuples(st.floats(0, 1e6), VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, NUMBER, VECTOR))
def test_an_answer_is_found_by_readers_of_json_and_by_searchers_of_text(values):
    line = answer(Measured(*values))
    names = "timestamp imu/gyro imu/accel_body position attitude velocity airspeed velocity_wind"
    expected = {
        name: list(value) if isinstance(value, tuple) else value
        for name, value in zip(names.split(), values, strict=True)
    }
    assert read_as_json(line) == expected
    assert read_by_text(line) == expected
