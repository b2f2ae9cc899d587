"""An autopilot that speaks ArduPilot's side of its JSON interface, and flies.

Written from libraries/SITL/examples/JSON/readme.md of ArduPilot and what its SIM_JSON.cpp does with
answers; nothing is shared with the code under test. It holds its wings level, its first pitch angle
and the airspeed that it has when it slows for the first time, after its launch, by proportional and
integral laws, with outputs as ArduPlane's. `steer` asks for others.
"""

import json
import math
import re
import select
import socket
import struct
from collections.abc import Iterable, Sequence
from typing import Any

_VECTORS = ("imu/gyro", "imu/accel_body", "position", "attitude", "velocity", "velocity_wind")
_NUMBERS = ("timestamp", "airspeed")
_NUMBER = r"\s*([-+0-9.eE]+)"

Answer = dict[str, Any]


def servo_packet(
    frame_count: int, pwm: Sequence[int], rate_hz: int = 1000, magic: int | None = None
) -> bytes:
    """Return a servo packet of as many channels as there are pulses, 16 or 32."""
    if magic is None:
        magic = {16: 18458, 32: 29569}[len(pwm)]
    return struct.pack(f"<HHI{len(pwm)}H", magic, rate_hz, frame_count, *pwm)


def read_by_text(line: bytes) -> Answer:
    """Return what ArduPilot's parser before 2026 finds, which searches keys as texts.

    It takes the first place where the key's text occurs, skips quote and colon, and scans
    "[%f, %f, %f]" or a number there. The text lies between two line ends.
    """
    assert line.startswith(b"\n")
    assert line.endswith(b"\n")
    text = line[1:-1].decode("ascii")
    assert "\n" not in text
    found: Answer = {}
    for name in (*_VECTORS, *_NUMBERS):
        section, _, key = name.rpartition("/")
        at = text.find(key, text.find(section) + len(section) + 1)
        assert at >= 0, f"{name} is missing"
        value = text[at + len(key) + 2 :]
        pattern = rf"\[{_NUMBER},{_NUMBER},{_NUMBER}\]" if name in _VECTORS else _NUMBER
        match = re.match(pattern, value)
        assert match, f"no value of {name} where it is looked for: {value[:20]!r}"
        numbers = [float(one) for one in match.groups()]
        found[name] = numbers if name in _VECTORS else numbers[0]
    return found


def read_as_json(line: bytes) -> Answer:
    """Return the same as a reader of JSON finds it."""
    tree: Answer = json.loads(line)
    return {f"imu/{key}": value for key, value in tree.pop("imu").items()} | tree


class Autopilot:
    """A peer on a UDP socket of its own.

    Attributes:
        answers: What came, one for each frame.
        lines: The same as it came.
    """

    def __init__(self, port: int, *, rate_hz: int, channels: int = 16) -> None:
        self._address = ("127.0.0.1", port)
        self.rate_hz = rate_hz
        self.frame_count = 0
        self.answers: list[Answer] = []
        self.lines: list[bytes] = []
        self.pwm = [1500] * channels
        self.pwm[2] = 1000
        self._to_roll = self._climb = 0.0
        self._to_pitch: float | None = None
        self._to_speed: float | None = None
        self._sums = [0.0, 0.0]
        self._sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._sock.settimeout(120.0)

    def send(self, packet: bytes) -> None:
        self._sock.sendto(packet, self._address)

    def receive(self) -> bytes:
        line = self._sock.recv(65000)
        while self.frame_count == 1 and line == self.lines[0]:  # a further answer to the first one
            line = self._sock.recv(65000)
        return line

    def exchange(self, pwm: Sequence[int], copies: int = 1) -> Answer:
        """Send a frame, so many times before it hears an answer, and return that: there is one."""
        self.pwm = list(pwm)
        packet = servo_packet(self.frame_count, self.pwm, self.rate_hz)
        for _ in range(copies):
            self.send(packet)
        while not self.frame_count and not select.select([self._sock], [], [], 0.2)[0]:
            self.send(packet)  # nobody listens yet, or to another one
        line = self.receive()
        self.frame_count += 1
        self.lines.append(line)
        self.answers.append(read_by_text(line))
        return self.answers[-1]

    def steer(self, bearing: float, height: float, airspeed: float) -> None:
        """Lean towards a bearing [rad], and fly to a height [m] at an airspeed [m/s]."""
        north, east, down = self.answers[-1]["velocity"][:2] + self.answers[-1]["position"][2:]
        off = math.remainder(bearing - math.atan2(east, north), math.tau)
        self._to_roll = min(max(off, -0.02), 0.02)
        self._climb = min(max(0.01 * (height + down), -0.1), 0.1)
        self._to_speed = airspeed

    def outputs(self, thrust: float) -> list[int]:
        """Return the pulses of the law, around a share of the thrust [µs]."""
        pwm = list(self.pwm)
        if not self.answers:
            pwm[2] = round(1000 + 1000 * thrust)
            return pwm
        before, now = self.answers[-2:] if len(self.answers) > 1 else self.answers * 2
        roll, pitch, _ = now["attitude"]
        p, q, r = now["imu/gyro"]
        if self._to_pitch is None:
            self._to_pitch = pitch
        if self._to_speed is None and now["airspeed"] < before["airspeed"]:
            self._to_speed = before["airspeed"]
        to_speed = now["airspeed"] if self._to_speed is None else self._to_speed
        errors = self._to_roll - roll, self._to_pitch + self._climb - pitch
        self._sums = [x + e / self.rate_hz for x, e in zip(self._sums, errors, strict=True)]
        outputs = {
            0: 2.0 * errors[0] + 4.0 * self._sums[0] - 0.15 * p,  # positive: to the right
            1: 1.5 * errors[1] + 3.0 * self._sums[1] - 0.2 * q,  # positive: nose up
            3: -0.3 * r,  # positive: to the right
        }
        for channel, out in outputs.items():
            pwm[channel] = round(1500 + 500 * min(max(out, -1.0), 1.0))
        share = thrust + 0.1 * (to_speed - now["airspeed"])
        pwm[2] = round(1000 + 1000 * min(max(share, 0.06), 1.0))
        return pwm


def into_earth(v: Iterable[float], attitude: Iterable[float]) -> list[float]:
    """Return a vector in body axes as north, east, down, by three rotations one after another."""
    x, y, z = v
    roll, pitch, yaw = attitude
    y, z = y * math.cos(roll) - z * math.sin(roll), y * math.sin(roll) + z * math.cos(roll)
    x, z = x * math.cos(pitch) + z * math.sin(pitch), z * math.cos(pitch) - x * math.sin(pitch)
    x, y = x * math.cos(yaw) - y * math.sin(yaw), x * math.sin(yaw) + y * math.cos(yaw)
    return [x, y, z]
