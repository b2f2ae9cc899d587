"""A program that takes px4's arguments, connects to its simulator, and checks it as PX4 does.

Written from docs.px4.io (Simulation) and from what PX4's simulator_mavlink, px4-rc.mavlinksim and
px4-rc.mavlink do; nothing is shared with the code under test. Its clock is that of HIL_SENSOR, so
what it commands depends on what it is sent alone. It flies by the truth and its gyro.

It writes what it found so far to PEER_REPORT-N.json, N its instance: it is killed, not asked.
Options of its own, parameters of PX4 as their names go: PEER_BOOT_N, frames before it answers the
first; PEER_READY_S, its time until it can be armed; PEER_STOPS_S, its time after which it answers
nothing; PEER_CLOSES_S, its time at which it ends; PEER_STOPS_FLY, PEER_CLOSES_FLY, the same
since it was armed; PEER_NO_LOCKSTEP 1: its answers have no flag;
PEER_AHEAD_US: its clock is so far off; PEER_TWICE 1: each answer comes twice; PEER_NOISE 1: strange
bytes stand between its messages.
"""

import contextlib
import json
import math
import os
import random
import select
import socket
import sys
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import common as mavlink

SENSORS = {  # of fields_updated, as PX4 takes them: all of a group, or none
    "accel": 0b111,
    "gyro": 0b111000,
    "mag": 0b111000000,
    "baro": 0b1101000000000,
    "diff_press": 0b10000000000,
}
ARMED = mavlink.MAV_MODE_FLAG_SAFETY_ARMED
HEALTHY = mavlink.MAV_SYS_STATUS_PREARM_CHECK
GRAVITY = 9.80665


def parameter(name: str, default: float) -> float:
    return float(os.environ.get(f"PX4_PARAM_{name}", default))


class Checks:
    """What PX4 demands of its simulator.

    Attributes:
        wrong: What was found, at most 20 texts.
        counts: Messages and samples, by name.
    """

    def __init__(self) -> None:
        self.wrong: list[str] = []
        self.counts: dict[str, int] = {}
        self.now_us = 0
        self.first_us = 0
        self.truth: Any = None
        self.truth_us: list[int] = []
        self._frame_us: int | None = None
        self._gps_us = -1
        self._ids: list[int] = []
        self._last: dict[tuple[int, str], tuple[float, ...]] = {}
        self._repeated: dict[tuple[int, str], int] = {}
        self._sequence: dict[tuple[int, int], int] = {}

    def expect(self, right: bool, text: str) -> None:
        if not right and len(self.wrong) < 20:
            self.wrong.append(f"at {self.now_us} us: {text}")

    def count(self, name: str) -> None:
        self.counts[name] = self.counts.get(name, 0) + 1

    def take(self, message: Any) -> None:
        kind = message.get_type()
        self.count(kind)
        if kind == "BAD_DATA":
            self.expect(False, "bytes that are no message")
            return
        sender = message.get_srcSystem(), message.get_srcComponent()
        before = self._sequence.get(sender)
        self._sequence[sender] = message.get_seq()
        self.expect(
            before is None or message.get_seq() == (before + 1) % 256, "a gap in the sequence"
        )
        if kind == "HIL_SENSOR":
            self.sensor(message)
        elif kind == "HIL_GPS":
            self.gps(message)
        elif kind == "HIL_STATE_QUATERNION":
            self.state(message)
        else:
            self.expect(kind == "HEARTBEAT", f"{kind}, which no simulator sends")

    def sensor(self, m: Any) -> None:
        if m.id == 0:
            self._clock(m.time_usec)
        else:
            self.expect(m.time_usec == self.now_us, f"IMU {m.id} at {m.time_usec}")
            self.expect(self._ids == list(range(m.id)), f"IMU {m.id} after {self._ids}")
        self._ids.append(m.id)
        self.expect(m.id < 3, f"IMU {m.id}: PX4 has 3")
        for name, bits in SENSORS.items():
            updated = m.fields_updated & bits
            self.expect(updated in {0, bits}, f"{name} is new in part: {m.fields_updated:#x}")
            if updated == bits:
                self.count(f"{name} {m.id}")
                self.sample(m.id, name, m)
            else:
                self.expect(m.id > 0 or name not in {"accel", "gyro"}, f"no new {name}")
        known = sum(SENSORS.values())
        self.expect(m.fields_updated & ~known == 0, f"unknown bits of {m.fields_updated:#x}")

    def _clock(self, time_us: int) -> None:
        step = time_us - self.now_us
        if self.now_us == 0:
            self.first_us = time_us
            self.expect(time_us > 0, "the clock begins at 0")
        else:
            self.expect(step > 0, f"the clock goes back, to {time_us}")
            self._frame_us = step if self._frame_us is None else self._frame_us
            self.expect(step == self._frame_us, f"a step of {step} us, not {self._frame_us}")
        self.now_us = time_us
        self._ids = []

    def sample(self, imu: int, name: str, m: Any) -> None:
        values = {
            "accel": (m.xacc, m.yacc, m.zacc),
            "gyro": (m.xgyro, m.ygyro, m.zgyro),
            "mag": (m.xmag, m.ymag, m.zmag),
            "baro": (m.abs_pressure, m.temperature),
            "diff_press": (m.diff_pressure,),
        }[name]
        self.expect(all(map(math.isfinite, values)), f"{name} {values}")
        limit = {"accel": 16.0 * GRAVITY, "gyro": math.radians(2000.0), "mag": 2.0}.get(name, 1e9)
        self.expect(all(abs(v) <= limit for v in values), f"{name} {values}")
        if name == "baro":
            self.expect(300.0 < values[0] < 1100.0, f"pressure {values[0]} hPa")
        key = imu, name
        same = self._last.get(key) == values and name in {"accel", "gyro"}
        self._repeated[key] = self._repeated.get(key, 0) + 1 if same else 0
        self.expect(self._repeated[key] < 100, f"{name} {imu} is stuck")
        self._last[key] = values

    def gps(self, m: Any) -> None:
        self.expect(m.fix_type >= 3, f"fix {m.fix_type}")
        self.expect(m.satellites_visible >= 6, f"{m.satellites_visible} satellites")
        self.expect(0 < m.eph <= 300 and 0 < m.epv <= 500, f"eph {m.eph}, epv {m.epv} cm")
        self.expect(m.time_usec > self._gps_us, f"GPS time goes back, to {m.time_usec}")
        self.expect(m.time_usec <= self.now_us, f"GPS time {m.time_usec} is to come")
        self._gps_us = m.time_usec
        if self.truth is not None:
            north = (m.lat - self.truth.lat) / 1e7 * 111_320.0
            east = (m.lon - self.truth.lon) / 1e7 * 111_320.0 * math.cos(math.radians(m.lat / 1e7))
            self.expect(math.hypot(north, east) < 30.0, f"GPS is {north:.0f}, {east:.0f} m off")
            self.expect(abs(m.alt - self.truth.alt) < 30_000, f"GPS altitude {m.alt} mm")

    def state(self, m: Any) -> None:
        q = m.attitude_quaternion
        self.expect(abs(sum(x * x for x in q) - 1.0) < 1e-5, f"quaternion {q}")
        self.expect(m.time_usec == self.now_us, f"truth of {m.time_usec}")
        self.truth = m
        if len(self.truth_us) < 50:
            self.truth_us.append(m.time_usec)


class Mavlink:
    """PX4's MAVLink instance of px4-rc.mavlink: UDP to the address of its options -t and -o."""

    def __init__(self, instance: int) -> None:
        local, self._to = _ends_of_script()
        self._sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._sock.bind(("127.0.0.1", local))
        self._sock.setblocking(False)
        self._link = mavlink.MAVLink(None, instance + 1, mavlink.MAV_COMP_ID_AUTOPILOT1)
        self._link.robust_parsing = True
        self.armed = self.ready = False
        self.mode = 0
        self.items = self._expected = 0
        self.commands: list[int] = []

    def send(self, *messages: Any) -> None:
        for message in messages:
            self._sock.sendto(message.pack(self._link), self._to)

    def beat(self, time_us: int) -> None:
        base = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | (ARMED if self.armed else 0)
        status = mavlink.MAV_STATE_ACTIVE if self.armed else mavlink.MAV_STATE_STANDBY
        health = HEALTHY if self.ready else 0
        self.send(
            mavlink.MAVLink_heartbeat_message(1, 12, base, self.mode, status, 3),
            mavlink.MAVLink_sys_status_message(0, 0, health, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0),
            mavlink.MAVLink_attitude_message(time_us // 1000, 0, 0, 0, 0, 0, 0),
        )

    def serve(self) -> None:
        while True:
            try:
                data = self._sock.recv(65536)
            except BlockingIOError:
                return
            for message in self._link.parse_buffer(bytearray(data)) or []:
                self._receive(message)

    def _receive(self, message: Any) -> None:
        back = message.get_srcSystem(), message.get_srcComponent()
        match message.get_type():
            case "COMMAND_LONG" | "COMMAND_INT":
                self.commands.append(message.command)
                result = self._execute(message)
                ack = mavlink.MAVLink_command_ack_message(message.command, result, 0, 0, *back)
                self.send(ack)
            case "MISSION_COUNT":
                self._expected, self.items = message.count, 0
                self._ask(back, message.mission_type)
            case "MISSION_ITEM_INT" if message.seq == self.items:
                self.items += 1
                self._ask(back, message.mission_type)

    def _ask(self, back: tuple[int, int], kind: int) -> None:
        if self.items < self._expected:
            self.send(mavlink.MAVLink_mission_request_int_message(*back, self.items, kind))
        else:
            self.send(mavlink.MAVLink_mission_ack_message(*back, 0, kind))

    def _execute(self, message: Any) -> int:
        match message.command:
            case mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
                if not self.ready:
                    return int(mavlink.MAV_RESULT_TEMPORARILY_REJECTED)
                self.armed = message.param1 == 1.0
            case mavlink.MAV_CMD_DO_SET_MODE:
                main, sub = int(message.param2), int(message.param3)
                if main != 4 or sub not in {2, 3, 4}:
                    return int(mavlink.MAV_RESULT_DENIED)
                self.mode = main << 16 | sub << 24
            case mavlink.MAV_CMD_SET_MESSAGE_INTERVAL if message.param1 < 50_000:
                pass
            case mavlink.MAV_CMD_DO_SET_HOME:
                pass
            case _:
                return int(mavlink.MAV_RESULT_UNSUPPORTED)
        return int(mavlink.MAV_RESULT_ACCEPTED)


def _ends_of_script() -> tuple[int, tuple[str, int]]:
    """Return own port and partner of the one instance that px4-rc.mavlink in the PATH starts."""
    for folder in os.environ["PATH"].split(os.pathsep):
        script = Path(folder) / "px4-rc.mavlink"
        if script.is_file():
            (line,) = (x for x in script.read_text().splitlines() if x.startswith("mavlink start"))
            words = line.split()
            own, host, port = (words[words.index(one) + 1] for one in ("-u", "-t", "-o"))
            return int(own), (host, int(port))
    raise AssertionError("no px4-rc.mavlink in the PATH")


class Law:
    """It holds level wings, its first pitch angle and its first airspeed."""

    def __init__(self) -> None:
        self.first: tuple[float, float] | None = None

    def outputs(self, truth: Any, gyro: tuple[float, ...], armed: bool) -> list[float]:
        out = [0.0] * 16
        if not armed:
            return out
        w, x, y, z = truth.attitude_quaternion
        roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
        pitch = math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x))))
        airspeed = truth.true_airspeed / 100.0
        out[4] = 0.4
        pushed = math.hypot(truth.xacc, truth.yacc, truth.zacc) > 8e3  # thousandths of a m/s²
        if self.first is None and (airspeed < 15.0 or pushed):  # on its launcher
            return out
        if self.first is None:
            self.first = pitch, airspeed
        aileron = -2.0 * roll - 0.15 * gyro[0]
        elevator = 1.5 * (self.first[0] - pitch) - 0.2 * gyro[1]
        out[4] = 0.4 + 0.1 * (self.first[1] - airspeed)
        out[2], out[5], out[6], out[7] = -0.3 * gyro[2], -aileron, aileron, elevator
        return [max(-1.0, min(1.0, value)) for value in out[:4]] + [
            max(0.0, min(1.0, out[4])),
            *(max(-1.0, min(1.0, value)) for value in out[5:]),
        ]


class Peer:
    """One PX4."""

    def __init__(self, instance: int) -> None:
        self.instance = instance
        self.checks, self.mavlink, self.law = Checks(), Mavlink(instance), Law()
        self.first_s = parameter("PEER_READY_S", 0.5)
        host = os.environ.get("PX4_SIM_HOSTNAME", "localhost")
        self.sock = socket.create_connection((host, 4560 + instance), timeout=60.0)
        self.sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.parser = mavlink.MAVLink(None, instance + 1, 1)
        self.parser.robust_parsing = True
        self.frames = self.answers = 0
        self.armed_s: float | None = None
        self.gyro = (0.0, 0.0, 0.0)
        self.chance = random.Random(instance)
        self.noise = parameter("PEER_NOISE", 0.0) > 0.0
        self.twice = parameter("PEER_TWICE", 0.0) > 0.0

    def say(self, message: Any) -> None:
        noise = b""
        if self.noise:  # nothing that could be part of a message, and false headers
            noise = self.chance.randbytes(self.chance.randrange(40)) + b"\xfd\xff\x00"
        self.sock.sendall(noise + message.pack(self.parser))

    def fly(self) -> None:
        self.say(mavlink.MAVLink_heartbeat_message(0, 12, 0, 0, 0, 3))
        interval = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        self.say(mavlink.MAVLink_command_long_message(0, 0, interval, 0, 115, 5e3, 0, 0, 0, 0, 0))
        boot = parameter("PEER_BOOT_N", 40)
        while data := self.sock.recv(65536):
            fresh, before = False, len(self.checks.wrong)
            for message in self.parser.parse_buffer(bytearray(data)) or []:
                self.checks.take(message)
                if message.get_type() == "HIL_SENSOR" and message.id == 0:
                    self.frames += 1
                    self.gyro = (message.xgyro, message.ygyro, message.zgyro)
                    fresh = True
            if self.frames % 50 == 0 or len(self.checks.wrong) > before:
                self.report()
            if self._is_time_for("PEER_CLOSES"):
                return
            if fresh and not self._is_time_for("PEER_STOPS"):
                self._step()
                if self.frames > boot and self.checks.truth is not None:
                    self._answer()

    def _is_time_for(self, name: str) -> bool:
        now_s = self.checks.now_us / 1e6
        if self.mavlink.armed and self.armed_s is None:
            self.armed_s = now_s
        flown_s = 0.0 if self.armed_s is None else now_s - self.armed_s
        by_armed = flown_s >= parameter(f"{name}_FLY", math.inf)
        return by_armed or now_s >= parameter(f"{name}_S", math.inf)

    def _step(self) -> None:
        now_us = self.checks.now_us
        self.mavlink.ready = now_us >= self.first_s * 1e6
        self.mavlink.serve()
        if self.frames % 25 == 1:
            self.mavlink.beat(now_us)

    def _answer(self) -> None:
        armed = self.mavlink.armed
        if self.answers % 100 == 50:  # whoever waits for nobody would go on in that time
            early, _, _ = select.select([self.sock], [], [], 0.03)
            self.checks.expect(not early, "the simulator did not wait for the answer")
        controls = self.law.outputs(self.checks.truth, self.gyro, armed)
        flags = 0 if parameter("PEER_NO_LOCKSTEP", 0.0) else 1
        time_us = self.checks.now_us + int(parameter("PEER_AHEAD_US", 0.0))
        mode = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | (ARMED if armed else 0)
        message = mavlink.MAVLink_hil_actuator_controls_message(time_us, controls, mode, flags)
        self.say(message)
        if self.twice:
            self.say(message)
        self.answers += 1

    def report(self) -> None:
        if "PEER_REPORT" not in os.environ:
            return
        checks = self.checks
        found = {
            "wrong": checks.wrong,
            "counts": checks.counts,
            "frames": self.frames,
            "answers": self.answers,
            "seconds": (checks.now_us - checks.first_us) / 1e6,
            "truth_us": checks.truth_us,
            "mode": self.mavlink.mode,
            "items": self.mavlink.items,
            "commands": self.mavlink.commands,
        }
        file = Path(f"{os.environ['PEER_REPORT']}-{self.instance}.json")
        part = file.with_suffix(".part")
        part.write_text(json.dumps(found))
        part.replace(file)


def main() -> None:
    """Take px4's arguments: -d, -i INSTANCE, and the folder of its data."""
    daemon, option, instance, data = sys.argv[1:]
    assert (daemon, option) == ("-d", "-i")
    assert (Path(data) / "init.d-posix" / "rcS").is_file()
    assert os.environ["PX4_SIM_MODEL"] == "gazebo-classic_plane"
    with contextlib.suppress(OSError):  # the simulator has ended
        Peer(int(instance)).fly()


if __name__ == "__main__":
    main()
