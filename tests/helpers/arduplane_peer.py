"""A program with ArduPlane's arguments that speaks as it does: JSON frames and MAVLink.

Written from the published protocols; nothing is shared with the code under test. It flies by the
law of `json_peer`, and in GUIDED to where it is told. Its clock is that of the answers, so its
MAVLink has the same times in each run.

Options of its own, in the environment: PEER_READY_S, its time until it can be armed; PEER_REFUSES,
the reason for which it refuses to be armed; PEER_DIES_S, its time at which it ends; PEER_HEARD, a
file to which it writes what it is told, a line each: one that finds such a file does not end;
PEER_RATE_HZ and PEER_CHANNELS of its frames; PEER_TWICE 1: once it is armed, each tenth frame is
sent twice; PEER_GARBAGE 1: something else comes before the first one; PEER_ANSWERS, the file for
the answers.
"""

import argparse
import math
import os
import socket
import sys
from typing import Any, NamedTuple

from json_peer import Autopilot, servo_packet
from pymavlink.dialects.v20 import ardupilotmega as mavlink

ARMED = mavlink.MAV_MODE_FLAG_SAFETY_ARMED
GUIDED = 15
EARTH_RADIUS_M = 6378137.0
HEALTHY = mavlink.MAV_SYS_STATUS_PREARM_CHECK


class Target(NamedTuple):
    """What it is told in GUIDED: a place [rad], a height above the sea [m], an airspeed [m/s]."""

    latitude: float = 0.0
    longitude: float = 0.0
    altitude: float = 0.0
    airspeed: float = 0.0

    def bearing(self, latitude: float, longitude: float) -> float:
        east = (self.longitude - longitude) * math.cos(latitude)
        return math.atan2(east, self.latitude - latitude)


class Vehicle:
    """Its MAVLink: a UDP client of the address that --serial0 names."""

    def __init__(self, serial0: str, system: int) -> None:
        kind, host, port = serial0.split(":")
        assert kind == "udpclient"
        self._to = (host, int(port))
        self._sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._sock.setblocking(False)
        self._link = mavlink.MAVLink(None, system, mavlink.MAV_COMP_ID_AUTOPILOT1)
        self._link.robust_parsing = True
        self.armed, self.mode, self.items, self.home, self.item = False, 0, 0, False, 0
        self._expected = 0
        self.target = Target()
        self._refuses = os.environ.get("PEER_REFUSES", "")
        self.ready = False

    def note(self, text: str) -> None:
        if "PEER_HEARD" in os.environ:
            with open(os.environ["PEER_HEARD"], "a") as file:
                file.write(text + "\n")

    def send(self, *messages: Any) -> None:
        """Send messages in one datagram, as ArduPilot does what has gathered."""
        self._sock.sendto(b"".join(one.pack(self._link) for one in messages), self._to)

    def beat(self, time_s: float, answer: dict[str, Any]) -> None:
        health = HEALTHY if self.ready else 0
        base = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | (ARMED if self.armed else 0)
        status = mavlink.MAV_STATE_ACTIVE if self.armed else mavlink.MAV_STATE_STANDBY
        roll, pitch, yaw = answer["attitude"]
        self.send(
            mavlink.MAVLink_heartbeat_message(1, 3, base, self.mode, status, 3),
            mavlink.MAVLink_sys_status_message(0, 0, health, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0),
            mavlink.MAVLink_attitude_message(int(time_s * 1e3), roll, pitch, yaw, 0, 0, 0),
            mavlink.MAVLink_mission_current_message(self.item),
            mavlink.MAVLink_meminfo_message(0, 0),  # of its dialect, not of ours
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
                result = self._execute(message)
                ack = mavlink.MAVLink_command_ack_message(message.command, result, 0, 0, *back)
                self.send(ack)
            case "MISSION_COUNT":
                self._expected, self.items = message.count, 0
                self._ask(back, message.mission_type)
            case "SET_POSITION_TARGET_GLOBAL_INT" if self.mode == GUIDED:
                assert (message.coordinate_frame, message.type_mask) == (5, 0xFFFB)
                self.target = self.target._replace(altitude=message.alt)
                self.note(f"height {message.alt:.3f}")
            case "MISSION_ITEM_INT" if message.seq == self.items:
                self.items += 1
                self._ask(back, message.mission_type)

    def _ask(self, back: tuple[int, int], kind: int) -> None:
        if self.items < self._expected:
            self.send(mavlink.MAVLink_mission_request_int_message(*back, self.items, kind))
        else:
            self.note(f"{self.items} items")
            self.send(mavlink.MAVLink_mission_ack_message(*back, 0, kind))

    def _execute(self, message: Any) -> int:
        match message.command:
            case mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
                if self._refuses or not self.ready:
                    text = f"Arm: {self._refuses or 'not ready'}".encode()
                    self.send(mavlink.MAVLink_statustext_message(2, text))
                    return int(mavlink.MAV_RESULT_FAILED)
                self.armed = message.param1 == 1.0
                self.note("armed")
            case mavlink.MAV_CMD_DO_SET_HOME:
                self.home = True
            case mavlink.MAV_CMD_MISSION_START:
                self.mode, self.item = 10, 2
                self.note("mission")
            case mavlink.MAV_CMD_DO_SET_MODE:
                self.mode = int(message.param2)
                self.note(f"mode {self.mode}")
            case mavlink.MAV_CMD_DO_SET_MISSION_CURRENT:
                self.item = int(message.param1)
                self.note(f"item {self.item}")
            case mavlink.MAV_CMD_DO_REPOSITION if self.mode == GUIDED:
                place = math.radians(message.x / 1e7), math.radians(message.y / 1e7), message.z
                self.target = Target(*place, self.target.airspeed)
                self.note("place")
            case mavlink.MAV_CMD_GUIDED_CHANGE_SPEED if self.mode == GUIDED:
                self.target = self.target._replace(airspeed=message.param2)
                self.note(f"airspeed {message.param2:.3f}")
            case mavlink.MAV_CMD_SET_MESSAGE_INTERVAL if message.param1 < 50_000:
                pass
            case _:
                return int(mavlink.MAV_RESULT_UNSUPPORTED)
        return int(mavlink.MAV_RESULT_ACCEPTED)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("-I")
    names = ("model", "rc-in-port", "base-port", "serial1", "serial2", "speedup", "home")
    for name in (*names, "start-time"):
        parser.add_argument(f"--{name}")
    parser.add_argument("--sim-port-out", type=int, required=True)
    parser.add_argument("--sysid", type=int, required=True)
    parser.add_argument("--serial0", required=True)
    parser.add_argument("--defaults", required=True)
    # a latitude in the south looks like an option to argparse, and to getopt does not
    given = " ".join(sys.argv[1:]).replace("--home ", "--home=").split(" ")
    options = parser.parse_args(given)
    assert options.model == "JSON:127.0.0.1"
    for file in options.defaults.split(","):
        assert os.path.getsize(file)
    ready_s = float(os.environ.get("PEER_READY_S", "1"))
    dies_s = float(os.environ.get("PEER_DIES_S", "inf"))
    if os.path.exists(os.environ.get("PEER_HEARD", "")):
        dies_s = float("inf")
    rate_hz = int(os.environ.get("PEER_RATE_HZ", "500"))
    twice, garbage = "PEER_TWICE" in os.environ, "PEER_GARBAGE" in os.environ
    vehicle = Vehicle(options.serial0, options.sysid)
    channels = int(os.environ.get("PEER_CHANNELS", "16"))
    peer = Autopilot(options.sim_port_out, rate_hz=rate_hz, channels=channels)
    for strange in (b"GET / HTTP/1.0\r\n\r\n", servo_packet(0, [1500] * 16, magic=18457)):
        if garbage:
            peer.send(strange)
    frame, began_s = 0, 0.0
    with open(os.environ.get("PEER_ANSWERS", os.devnull), "ab", buffering=0) as answers:
        while True:
            pwm = peer.outputs(0.4)
            held = [1500, 1500, 1000, *pwm[3:]]
            copies = 2 if twice and vehicle.armed and frame % 10 == 9 else 1
            answer = peer.exchange(pwm if vehicle.armed else held, copies)
            answers.write(peer.lines[-1][1:])
            began_s = answer["timestamp"] if frame == 0 else began_s
            time_s = answer["timestamp"] - began_s
            vehicle.ready = time_s >= ready_s
            if time_s >= dies_s:
                print("panic: the peer was to end here", flush=True)
                sys.exit(3)
            vehicle.serve()
            if vehicle.target.airspeed:
                latitude, longitude, altitude, _ = map(float, options.home.split(","))
                north, east, _ = answer["position"]
                here = math.radians(latitude) + north / EARTH_RADIUS_M, math.radians(longitude)
                here = here[0], here[1] + east / EARTH_RADIUS_M / math.cos(here[0])
                to = vehicle.target
                peer.steer(to.bearing(*here), to.altitude - altitude, to.airspeed)
            if frame % (rate_hz // 5) == 0:
                vehicle.beat(time_s, answer)
            frame += 1


if __name__ == "__main__":
    main()
