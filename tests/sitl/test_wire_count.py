"""Transmissions on the wire, counted by a relay and by pymavlink alone.

No counter, codec or dialect of this project takes part in the counting.
"""

import select
import socket
import struct
import threading
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from flying import CHANNELS, fly_well, free_links, summary_of, write_scenario
from pymavlink.dialects.v20 import common

pytestmark = pytest.mark.sitl

STEP_DONE = 53101
COMMAND_CANCEL = 80  # not in every release of pymavlink's dialect
ALLOWED = {
    common.MAVLINK_MSG_ID_HEARTBEAT,
    common.MAVLINK_MSG_ID_COMMAND_INT,
    common.MAVLINK_MSG_ID_COMMAND_LONG,
    common.MAVLINK_MSG_ID_COMMAND_ACK,
    COMMAND_CANCEL,
    common.MAVLINK_MSG_ID_HIL_ACTUATOR_CONTROLS,
    STEP_DONE,
}
CONTROLS = ("aileron", "elevator", "rudder", "throttle")


class Relay(threading.Thread):
    """Hands datagrams on between autopilots and plant; keeps those to the plant."""

    def __init__(self, plant_port: int) -> None:
        super().__init__(daemon=True)
        self.to_plant: list[bytes] = []
        self.autopilots: dict[tuple[str, int], socket.socket] = {}
        self._plant = ("127.0.0.1", plant_port)
        self._front = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._front.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        self._front.bind(("127.0.0.1", 0))
        self._closing = threading.Event()

    @property
    def port(self) -> int:
        return int(self._front.getsockname()[1])

    def run(self) -> None:
        peers: dict[socket.socket, tuple[str, int]] = {}
        while not self._closing.is_set():
            readable, _, _ = select.select([self._front, *peers], [], [], 0.05)
            for sock in readable:
                try:
                    datagram, sender = sock.recvfrom(4096)
                except ConnectionRefusedError:  # the plant is not there yet, or gone
                    continue
                if sock is not self._front:
                    self._front.sendto(datagram, peers[sock])
                    continue
                self.to_plant.append(datagram)
                if sender not in self.autopilots:
                    back = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
                    back.connect(self._plant)
                    self.autopilots[sender], peers[back] = back, sender
                try:
                    self.autopilots[sender].send(datagram)
                except ConnectionRefusedError:
                    continue

    def close(self) -> None:
        self._closing.set()
        self.join()
        for sock in (self._front, *self.autopilots.values()):
            sock.close()


class Count:
    """Frames and changes of value of one aircraft's HIL_ACTUATOR_CONTROLS."""

    def __init__(self) -> None:
        self.frames = 0
        self.unchanged = 0
        self.events: Counter[str] = Counter()
        self._before: tuple[float, ...] | None = None

    def add(self, controls: tuple[float, ...]) -> None:
        before = self._before or (None,) * len(CONTROLS)
        changed = [name for name, a, b in zip(CONTROLS, before, controls, strict=True) if a != b]
        self.frames += 1
        self.unchanged += not changed
        self.events.update(changed)
        self._before = controls


def message_id(datagram: bytes) -> int:
    """Id in the header of a MAVLink 2 frame, https://mavlink.io/en/guide/serialization.html."""
    assert datagram[0] == 0xFD
    low, high = struct.unpack("<HB", datagram[7:10])
    return int(low | high << 16)


def count(datagrams: list[bytes]) -> dict[int, Count]:
    parser = common.MAVLink(None)
    parser.robust_parsing = False  # a broken frame fails the test
    counts: dict[int, Count] = {}
    for datagram in datagrams:
        if message_id(datagram) != common.MAVLINK_MSG_ID_HIL_ACTUATOR_CONTROLS:
            continue
        messages = parser.parse_buffer(datagram)
        assert len(messages) == 1
        assert messages[0].get_type() == "HIL_ACTUATOR_CONTROLS"
        uav = counts.setdefault(messages[0].get_srcSystem(), Count())
        uav.add(tuple(messages[0].controls[: len(CONTROLS)]))
    return counts


def fly_through_relay(folder: Path) -> tuple[dict[str, Any], list[bytes]]:
    """Summary of scenario 1, flown through the relay, and the datagrams that the plant got."""
    links = free_links()
    relay = Relay(links["plant_port"])
    relay.start()
    links["plant_relay"] = f"127.0.0.1:{relay.port}"
    try:
        fly_well(write_scenario(folder, links=links), "--quiet", "--out", folder / "run")
    finally:
        relay.close()
    assert len(relay.autopilots) == 3
    return summary_of(folder / "run"), relay.to_plant


def assert_only_what_the_simulator_link_allows(datagrams: list[bytes]) -> None:
    ids = Counter(map(message_id, datagrams))
    assert not ids.keys() - ALLOWED
    assert ids[STEP_DONE] >= 3 * 24_000


def assert_counts_agree(summary: dict[str, Any], datagrams: list[bytes]) -> None:
    counts = count(datagrams)
    assert sorted(counts) == [uav["id"] for uav in summary["uavs"]] == [1, 2, 3]
    for uav in summary["uavs"]:
        counted = counts[uav["id"]]
        claimed = {name: uav["channels"][name]["events"] for name in CHANNELS}
        assert dict(counted.events) == claimed
        assert counted.frames == uav["actuator_messages"] + counted.unchanged
        repeated = [uav["channels"][name]["repeats"] for name in CHANNELS]
        assert counted.unchanged == 0
        assert repeated == [0, 0, 0, 0]
    sent = sum(sum(counted.events.values()) for counted in counts.values())
    assert summary["saving"] == pytest.approx(1.0 - sent / (24_000 * 4 * 3), abs=1e-12)


def assert_figures_of_the_paper(summary: dict[str, Any]) -> None:
    assert summary["completed"] is True
    assert (summary["steps"], summary["duration_s"]) == (24_000, 24.0)
    assert summary["saving"] > 0.9
    follower_2 = summary["uavs"][2]
    assert follower_2["id"] == 3
    assert follower_2["saving"] > 0.9
    assert follower_2["iae"] == pytest.approx(
        {"airspeed": 16.5, "roll": 13.2, "pitch": 12.8, "yaw": 22.7}, rel=0.01
    )
    events = {name: follower_2["channels"][name]["events"] for name in CHANNELS}
    # of another implementation of the paper: IAEs agree, but demands chatter around the thresholds,
    # so that events do so only roughly; ours are exact in the tests of docs/explanation/results.md
    assert events.pop("throttle") == pytest.approx(105, rel=0.2)
    assert events == pytest.approx({"aileron": 6055, "elevator": 1404, "rudder": 763}, rel=0.1)


def test_scenario_1_on_the_wire(tmp_path: Path) -> None:
    summary, datagrams = fly_through_relay(tmp_path)
    assert_only_what_the_simulator_link_allows(datagrams)
    assert_counts_agree(summary, datagrams)
    assert_figures_of_the_paper(summary)
