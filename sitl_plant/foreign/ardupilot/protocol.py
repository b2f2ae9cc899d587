"""The datagrams of ArduPilot's JSON interface.

Written from ArduPilot's libraries/SITL/examples/JSON/readme.md and, where that is silent, from what
libraries/SITL/SIM_JSON.{h,cpp} accept. Binary servo packets come in, one line of JSON goes out.
"""

import json
import struct
from typing import NamedTuple

from sitl_plant.vec3 import Vec3

MAX_STEP_US = 100_000
"""ArduPilot does not advance its clock by answers that are so far apart in time, or further."""

_FORMATS = {18458: struct.Struct("<HHI16H"), 29569: struct.Struct("<HHI32H")}  # by magic number
_SIZES = {form.size for form in _FORMATS.values()}


class ServoPacket(NamedTuple):
    """What ArduPilot sends in each of its frames."""

    rate_hz: int  # frames per second of simulated time that it asks for
    frame_count: int  # frames answered before; 0 again after a restart
    pulses_us: tuple[int, ...]  # of 16 or 32 outputs; 0: the output is off


class NotServoPacket(ValueError):  # noqa: N818 - the name says it
    """A datagram is no servo packet; its text says why, the same for the same mistake."""


def parse_servo_packet(datagram: bytes) -> ServoPacket:
    """Read a datagram of ArduPilot.

    Args:
        datagram: 40 bytes with 16 channels, 72 with 32.

    Raises:
        NotServoPacket: It is something else.
    """
    if len(datagram) not in _SIZES:
        sizes = " or ".join(map(str, sorted(_SIZES)))
        raise NotServoPacket(f"length other than {sizes} bytes")
    (magic,) = struct.unpack_from("<H", datagram)
    form = _FORMATS.get(magic)
    if form is None or form.size != len(datagram):
        raise NotServoPacket("wrong magic number")
    _, rate_hz, frame_count, *pulses_us = form.unpack(datagram)
    if rate_hz == 0:
        raise NotServoPacket("frame rate 0")
    return ServoPacket(rate_hz, frame_count, tuple(pulses_us))


def steps_of(rate_hz: int, step_us: int) -> int:
    """Return the control periods of a frame: at least one, and less than ArduPilot's limit.

    Args:
        rate_hz: Frames per second that ArduPilot asks for.
        step_us: Control period [µs].
    """
    return min(max(round(1e6 / (rate_hz * step_us)), 1), (MAX_STEP_US - 1) // step_us)


class Measured(NamedTuple):
    """What an answer tells of an aircraft."""

    time_s: float  # of the physics
    rates: Vec3  # gyro, body axes [rad/s]
    specific_force: Vec3  # accelerometer, body axes [m/s²]
    position: Vec3  # north, east, down of the origin [m]
    attitude: Vec3  # roll, pitch, yaw [rad]
    velocity: Vec3  # over the ground, north, east, down [m/s]
    airspeed: float  # [m/s]
    wind: Vec3  # velocity of the air, north, east, down [m/s]


def answer(measured: Measured) -> bytes:
    """Return the line of JSON that answers a servo packet.

    ArduPilot before 2026 finds keys as texts, in no order but the first, and values directly behind
    the colon: so no key may stand before one that it begins with, and there are no blanks.
    """
    fields = {
        "timestamp": measured.time_s,
        "imu": {"gyro": measured.rates, "accel_body": measured.specific_force},
        "position": measured.position,
        "attitude": measured.attitude,
        "velocity": measured.velocity,
        "airspeed": measured.airspeed,
        "velocity_wind": measured.wind,
    }
    return f"\n{json.dumps(fields, separators=(',', ':'), allow_nan=False)}\n".encode()
