"""Uploads of several stations behind the hub, whatever their addresses, never mix."""

from collections import deque
from dataclasses import dataclass
from random import Random
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
from lossy_network import GCS, OTHER_GCS, VEHICLE
from mission_bench import (
    ACCEPTED,
    CANCELLED,
    FENCE,
    MISSION,
    Servers,
    contents,
    count,
    item,
    mission,
    validate,
)

from gcs.fleet.hub import Hub
from gcs.fleet.uploads import HOLD_S
from mavlink_defs import dialect
from mavlink_defs.framing.frames import FramePacker, parse
from mavlink_defs.services.machine import SystemId, is_for
from mavlink_defs.services.mission_server import MissionAccepted, MissionServer

DENIED = dialect.MAV_MISSION_DENIED
UPLINK = ("127.0.0.1", 1001)  # of the vehicle


@dataclass
class Flying:
    """A datagram between a station and the hub, and what was in force when it was sent."""

    frame: bytes
    station: int
    to_hub: bool
    in_force: list[bytes] | None = None


class Station:
    """A client that sends what is asked for, and believes whatever it is told of an upload."""

    def __init__(self, address: SystemId, k: int, items: int) -> None:
        self.address, self.peer = address, ("127.0.0.1", 2001 + k)
        self.packer = FramePacker(*address)
        self.list = mission(items, 20.0 + k)
        self.told: list[int] = []
        self.said: Any = None  # last; None: it does not upload

    def begin(self) -> list[bytes]:
        return self._say(count(len(self.list))) if self.said is None else []

    def repeat(self) -> list[bytes]:
        return [] if self.said is None else self._say(self.said)

    def hear(self, message: Any) -> list[bytes]:
        if self.said is None or not is_for(message, self.address):
            return []
        if isinstance(message, dialect.MAVLink_mission_request_int_message):
            return self._say(self.list[message.seq]) if message.seq < len(self.list) else []
        assert isinstance(message, dialect.MAVLink_mission_ack_message)
        self.told.append(message.type)
        self.said = None
        return []

    def _say(self, message: Any) -> list[bytes]:
        self.said = message
        return [self.packer.pack(message)]


class Sky:
    """Stations, the hub and one vehicle; the hub and the vehicle are on one machine."""

    def __init__(self, stations: list[Station]) -> None:
        self.stations, self.now = stations, 0.0
        self.hub, self.server = Hub([1]), MissionServer(VEHICLE, validate)
        self.packer = FramePacker(*VEHICLE)
        self.in_air: list[Flying] = []
        self.up: deque[bytes] = deque()
        self.down: deque[tuple[bytes, list[bytes]]] = deque()
        self.lists = [contents(station.list) for station in stations]
        beat = self.packer.pack(dialect.MAVLink_heartbeat_message(1, 3, 0, 0, 4, 3))
        assert self.hub.route(beat, UPLINK, 0.0) == []

    def begin(self, k: int) -> None:
        self._launch(k, self.stations[k].begin())

    def arrive(self, flying: Flying) -> None:
        station, k = self.stations[flying.station], flying.station
        if flying.to_hub:
            self.up.extend([flying.frame] * len(self._route(flying.frame, station.peer)))
            return
        told = len(station.told)
        self._launch(k, station.hear(self._parsed(flying.frame)))
        if ACCEPTED in station.told[told:]:
            assert flying.in_force == self.lists[k]

    def fly(self) -> None:
        """Let the vehicle take in one datagram."""
        if self.up:
            self.server.receive(self._parsed(self.up.popleft()), self.now)
            self._answer()

    def hear(self) -> None:
        """Let the hub take in one datagram of the vehicle."""
        if self.down:
            self._route(*self.down.popleft())

    def wait(self, time_s: float) -> None:
        """Let time pass, in which hub and vehicle answer each other."""
        self.settle()
        self.now += time_s
        self.server.handle_timer(self.now)
        self._answer()
        for k, station in enumerate(self.stations):
            self._launch(k, station.repeat())

    def go_on(self) -> None:
        """Let one datagram of each kind arrive."""
        if self.in_air:
            self.arrive(self.in_air.pop(0))
        self.fly()
        self.hear()

    def settle(self) -> None:
        while self.up or self.down:
            self.fly()
            self.hear()

    def _answer(self) -> None:
        for event in self.server.events():
            if isinstance(event, MissionAccepted):
                assert contents(event.items) in self.lists
        for message in self.server.messages_to_send():
            self.down.append((self.packer.pack(message), contents(self.server.items)))

    def _launch(self, k: int, frames: list[bytes]) -> None:
        self.in_air += [Flying(frame, k, to_hub=True) for frame in frames]

    def _route(self, frame: bytes, sender: Any) -> list[Any]:
        """Let the hub route; `sender` of a vehicle's frame is what was in force."""
        of_vehicle = isinstance(sender, list)
        peers = self.hub.route(frame, UPLINK if of_vehicle else sender, self.now)
        by_peer = {station.peer: k for k, station in enumerate(self.stations)}
        self.in_air += [Flying(f, by_peer[p], to_hub=False) for f, p in self.hub.answers]
        self.hub.answers.clear()
        if of_vehicle:
            self.in_air += [Flying(frame, by_peer[p], False, sender) for p in peers]
            return []
        return peers

    @staticmethod
    def _parsed(frame: bytes) -> Any:
        message = parse(frame)
        assert message is not None
        return message


who = st.tuples(st.sampled_from([GCS, GCS, OTHER_GCS]), st.integers(1, 3))
weights = st.fixed_dictionaries(
    {name: st.sampled_from([0, 1, 4]) for name in ("begin", "lose", "copy", "wait")}
)


@settings(max_examples=60)
@given(st.lists(who, min_size=2, max_size=3), weights, st.integers(0, 2**32))
def test_what_is_in_force_is_one_stations_list_and_only_that_one_is_told(
    who: list[tuple[SystemId, int]], weights: dict[str, int], seed: int
) -> None:
    """Between stations and hub datagrams are lost, copied and overtaken as it comes."""
    sky = Sky([Station(address, k, items) for k, (address, items) in enumerate(who)])
    random = Random(seed)
    weights = {"arrive": 20, "fly": 10, "hear": 10, **weights}
    for name in random.choices(list(weights), list(weights.values()), k=300):
        if name == "wait":
            sky.wait(random.choice([0.02, 0.6, 1.6, HOLD_S + 0.1, 31.0]))
        elif name in {"fly", "hear"}:
            getattr(sky, name)()
        elif name == "begin" or not sky.in_air:
            sky.begin(random.randrange(len(who)))
        else:
            flying = random.choice(sky.in_air)
            if name != "copy":
                sky.in_air.remove(flying)
            if name != "lose":
                sky.arrive(flying)


@given(st.integers(1, 4), st.integers(1, 4), st.integers(0, 12), st.booleans())
def test_the_second_station_is_answered_and_the_first_one_gets_through(
    first: int, second: int, after: int, same: bool
) -> None:
    sky = Sky([Station(GCS, 0, first), Station(GCS if same else OTHER_GCS, 1, second)])
    sky.begin(0)
    for step in range(60):
        if step == after:
            sky.begin(1)
        sky.go_on()
    assert sky.stations[0].told == [ACCEPTED]
    assert sky.stations[1].told in ([ACCEPTED], [DENIED])
    assert sky.stations[1].told == [DENIED] or contents(sky.server.items) == sky.lists[1]


def test_a_station_that_falls_silent_locks_nobody_out() -> None:
    sky = Sky([Station(GCS, 0, 3), Station(GCS, 1, 3)])
    sky.begin(0)
    sky.arrive(sky.in_air.pop(0))
    sky.settle()
    late = sky.stations[0].packer.pack(item(0, sky.stations[0].list))
    sky.in_air.clear()
    for expected, time_s in ((DENIED, 0.0), (ACCEPTED, HOLD_S + 0.1)):
        sky.now += time_s
        sky.begin(1)
        while sky.in_air:
            sky.arrive(sky.in_air.pop(0))
            sky.settle()
        assert sky.stations[1].told.pop() == expected
    sky.arrive(Flying(late, 0, to_hub=True))
    [answer] = sky.in_air  # to the first alone: its upload is no more
    message: Any = parse(answer.frame)
    assert (answer.station, message.get_type(), message.type) == (0, "MISSION_ACK", CANCELLED)
    assert contents(sky.server.items) == sky.lists[1]


def test_nobody_else_cancels_or_clears_meanwhile() -> None:
    sky = Sky([Station(GCS, 0, 2), Station(GCS, 1, 2)])
    sky.begin(0)
    sky.arrive(sky.in_air.pop(0))
    sky.settle()
    other, items = sky.stations[1], sky.stations[1].list
    answered: list[tuple[Any, list[int]]] = [
        (dialect.MAVLink_mission_clear_all_message(*VEHICLE, 0), [DENIED]),
        (dialect.MAVLink_mission_ack_message(*VEHICLE, CANCELLED, 0), []),
        (count(2), [DENIED]),
        (item(1, items), [CANCELLED]),
    ]
    for message, results in answered:
        assert sky.hub.route(other.packer.pack(message), other.peer, sky.now) == []
        answers: list[Any] = [parse(frame) for frame, _ in sky.hub.answers]
        assert [(answer.get_srcSystem(), answer.type) for answer in answers] == [
            (1, result) for result in results
        ]
        sky.hub.answers.clear()
    ends_a_download = dialect.MAVLink_mission_ack_message(*VEHICLE, ACCEPTED, 0)
    assert sky.hub.route(other.packer.pack(ends_a_download), other.peer, sky.now) == [UPLINK]
    while sky.in_air:
        sky.arrive(sky.in_air.pop(0))
        sky.settle()
    assert sky.stations[0].told == [ACCEPTED]


def test_stations_with_one_address_upload_two_types_at_a_time() -> None:
    """The hub holds the uploads apart: none waits for the other, and each has its own answers."""
    hub, servers = Hub([1]), Servers()
    of_vehicle, packer = FramePacker(*VEHICLE), FramePacker(*GCS)
    hub.route(of_vehicle.pack(dialect.MAVLink_heartbeat_message(1, 3, 0, 0, 4, 3)), UPLINK, 0.0)
    peers = {kind: ("127.0.0.1", 2001 + kind) for kind in (MISSION, FENCE)}
    heard: dict[int, list[str]] = {kind: [] for kind in peers}

    def say(kind: int, message: Any) -> None:
        frame = packer.pack(message)
        assert hub.route(frame, peers[kind], 0.0) == [UPLINK]
        servers.receive(Sky._parsed(frame), 0.0)
        for answer in servers.messages_to_send():
            assert answer.mission_type == kind
            assert hub.route(of_vehicle.pack(answer), UPLINK, 0.0) == [peers[kind]]
            heard[kind].append(answer.get_type())

    for kind in peers:
        say(kind, count(2, kind))
    for seq in range(2):
        for kind in peers:
            one = item(seq)
            one.mission_type = kind
            say(kind, one)
    expected = ["MISSION_REQUEST_INT", "MISSION_REQUEST_INT", "MISSION_ACK"]
    assert heard == dict.fromkeys(peers, expected)
    assert [len(servers.servers[kind].items) for kind in peers] == [2, 2]
