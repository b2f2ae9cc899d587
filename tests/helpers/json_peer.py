"""An autopilot that speaks ArduPilot's side of its JSON interface, and flies.

Written from libraries/SITL/examples/JSON/readme.md of ArduPilot and what its SIM_JSON.cpp does with
answers; nothing is shared with the code under test. It holds wings level, its first pitch angle and
its first airspeed (or a bank) by proportional laws with outputs as ArduPlane's.
"""

import json
import math
import re
import socket
import struct
from dataclasses import dataclass, field

_REQUIRED = ("timestamp", "imu/gyro", "imu/accel_body", "position", "attitude", "velocity")
_LENGTHS = {"timestamp": 1, "airspeed": 1}


def servo_packet(frame_count, pwm, rate_hz=1000, magic=None):
    """Return a servo packet of as many channels as there are pulses, 16 or 32."""
    if magic is None:
        magic = {16: 18458, 32: 29569}[len(pwm)]
    return struct.pack(f"<HHI{len(pwm)}H", magic, rate_hz, frame_count, *pwm)


def read_by_text(line):
    """Return what ArduPilot's parser before 2026 finds, which searches keys as texts.

    It takes the first place where the key's text occurs, skips quote and colon, and scans
    "[%f, %f, %f]" or a number there. The text lies between two line ends.
    """
    assert line.startswith(b"\n")
    assert line.endswith(b"\n")
    text = line[1:-1].decode("ascii")
    assert "\n" not in text
    found = {}
    for name in (*_REQUIRED, "airspeed", "velocity_wind"):
        section, _, key = name.rpartition("/")
        begin = text.find(section) + len(section) + 1
        at = text.find(key, begin)
        assert at >= 0, f"{name} is missing"
        at += len(key) + 2
        if _LENGTHS.get(name) == 1:
            found[name] = float(re.match(r"[-+0-9.eE]+", text[at:])[0])
        else:
            number = r"\s*([-+0-9.eE]+)"
            match = re.match(rf"\[{number},{number},{number}\]", text[at:])
            assert match, f"{name} is no vector where it is looked for: {text[at : at + 20]!r}"
            found[name] = [float(one) for one in match.groups()]
    return found


def read_as_json(line):
    """Return the same as a reader of JSON finds it."""
    tree = json.loads(line)
    flat = {f"imu/{key}": value for key, value in tree.pop("imu").items()}
    return flat | tree


@dataclass
class Autopilot:
    """A peer on a UDP socket of its own."""

    port: int
    rate_hz: int = 1000
    channels: int = 16
    host: str = "127.0.0.1"
    timeout_s: float = 5.0
    frame_count: int = 0
    answers: list = field(default_factory=list)
    raw: list = field(default_factory=list)
    bank: float = 0.0  # commanded roll angle [rad]
    lose: object = None  # called with the frame count: whether its first packet is lost
    resent: int = 0

    def __post_init__(self):
        self.sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.sock.settimeout(self.timeout_s)
        self.pwm = [1500] * self.channels
        self.pwm[2] = 1000
        self.target = None

    def close(self):
        self.sock.close()

    def send(self, packet):
        self.sock.sendto(packet, (self.host, self.port))

    def exchange(self, pwm=None, lost=False):
        """Send a frame and return its answer; a lost packet, or answer, is asked for again."""
        self.pwm = list(self.pwm if pwm is None else pwm)
        packet = servo_packet(self.frame_count, self.pwm, self.rate_hz)
        if lost:
            self.resent += 1  # nothing comes: ArduPilot sends it again, uncounted
        self.send(packet)
        line = self.sock.recv(65000)
        self.frame_count += 1
        answer = read_by_text(line)
        self.raw.append(line)
        self.answers.append(answer)
        return answer

    def fly(self, frames, thrust=0.5, law=True):
        """Exchange frames, with the outputs of the law."""
        for _ in range(frames):
            lost = self.lose is not None and self.lose(self.frame_count)
            self.exchange(self._outputs(thrust) if law else None, lost)
        return self.answers[-1]

    def _outputs(self, thrust):
        pwm = list(self.pwm)
        if not self.answers:
            pwm[2] = round(1000 + 1000 * thrust)
            return pwm
        now = self.answers[-1]
        roll, pitch, _ = now["attitude"]
        p, q, r = now["imu/gyro"]
        if self.target is None:
            self.target = pitch, now["airspeed"]
        to_pitch, to_speed = self.target
        roll_out = 1.0 * (self.bank - roll) - 0.15 * p
        pitch_out = 1.5 * (to_pitch - pitch) - 0.2 * q
        yaw_out = -0.5 * r
        for channel, out in ((0, roll_out), (1, pitch_out), (3, yaw_out)):
            pwm[channel] = round(1500 + 500 * min(max(out, -1.0), 1.0))
        share = thrust + 0.1 * (to_speed - now["airspeed"])
        pwm[2] = round(1000 + 1000 * min(max(share, 0.06), 1.0))
        return pwm


def into_earth(v, attitude):
    """Return a vector in body axes as north, east, down, by three rotations one after the other."""
    x, y, z = v
    roll, pitch, yaw = attitude
    y, z = y * math.cos(roll) - z * math.sin(roll), y * math.sin(roll) + z * math.cos(roll)
    x, z = x * math.cos(pitch) + z * math.sin(pitch), z * math.cos(pitch) - x * math.sin(pitch)
    x, y = x * math.cos(yaw) - y * math.sin(yaw), x * math.sin(yaw) + y * math.cos(yaw)
    return [x, y, z]
