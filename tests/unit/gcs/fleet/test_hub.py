"""The hub passes on what vehicles say to all, and what ground stations say to whom it concerns."""

from typing import Any

from gcs.fleet.hub import MAX_STATIONS, PATIENCE_S, VEHICLE_RATE_HZ, Hub
from mavlink_defs import dialect
from mavlink_defs.framing.frames import FramePacker

ONE, TWO = ("127.0.0.1", 1001), ("127.0.0.1", 1002)
GCS, OTHER = ("127.0.0.1", 2001), ("127.0.0.1", 2002)
SPEAKERS = {1: FramePacker(1, 1), 2: FramePacker(2, 1), 255: FramePacker(255, 190)}


def frame(message: Any, system: int) -> bytes:
    return SPEAKERS[system].pack(message)


def telemetry(system: int) -> bytes:
    return frame(dialect.MAVLink_system_time_message(0, 0), system)


def beat() -> bytes:
    return frame(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3), 255)


def command(system: int) -> bytes:
    return frame(dialect.MAVLink_command_long_message(system, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0), 255)


def fleet() -> Hub:
    hub = Hub([1, 2])
    assert hub.route(telemetry(1), ONE, 0.0) == hub.route(telemetry(2), TWO, 0.0) == []
    return hub


def test_vehicles_are_heard_by_every_station() -> None:
    hub = fleet()
    hub.route(beat(), GCS, 0.0)
    hub.route(beat(), OTHER, 0.0)
    assert hub.route(telemetry(1), ONE, 0.1) == [GCS, OTHER]


def test_stations_are_heard_by_the_vehicle_they_mean() -> None:
    hub = fleet()
    assert hub.route(beat(), GCS, 0.0) == [ONE, TWO]
    assert hub.route(command(2), GCS, 0.0) == [TWO]
    assert hub.route(command(3), GCS, 0.0) == []


def test_a_station_that_fell_silent_is_forgotten() -> None:
    hub = fleet()
    hub.route(beat(), GCS, 0.0)
    hub.route(beat(), OTHER, PATIENCE_S)
    assert hub.route(telemetry(1), ONE, PATIENCE_S + 0.1) == [OTHER]


def test_a_vehicle_that_comes_back_elsewhere_is_found() -> None:
    hub = fleet()
    hub.route(telemetry(1), TWO, 1.0)
    assert hub.route(command(1), GCS, 1.0) == [TWO]


def test_noise_goes_nowhere() -> None:
    hub = fleet()
    for noise in (b"", b"\xfd" * 30, beat()[:-1], b"hello"):
        assert hub.route(noise, GCS, 0.0) == []
    assert hub.route(telemetry(1), ONE, 0.1) == []
    assert hub.drops == {"unknown incompatibility flags": 1, "truncated": 1, "not MAVLink 2": 1}
    assert hub.route(b"", GCS, 0.2) == []  # a command looks whether there is a hub
    assert hub.drops.total() == 3


def older(message: Any) -> bytes:
    return bytes(message.pack(dialect.MAVLink(None, 249, 1), force_mavlink1=True))


def test_a_station_that_speaks_mavlink_1_first_is_answered_and_told_of_once() -> None:
    hub = fleet()
    greeting = older(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    damaged = (greeting[:-1], greeting + b"\0", b"\xfe" * 20, greeting[:9] + b"\7" + greeting[10:])
    for datagram in damaged:
        assert hub.route(datagram, GCS, 0.0) == []
    assert hub.route(telemetry(1), ONE, 0.1) == []
    assert hub.old_speakers == []
    unread = older(dialect.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0))
    for datagram in (greeting, unread, greeting):
        assert hub.route(datagram, GCS, 0.2) == []
    assert hub.route(telemetry(1), ONE, 0.3) == [GCS]
    assert hub.old_speakers == [GCS]
    assert hub.drops == {"not MAVLink 2": 4, "MAVLink 1": 3}
    assert hub.route(command(1), GCS, 0.4) == [ONE]  # now in MAVLink 2


def test_stations_beyond_the_limit_are_turned_away_and_counted() -> None:
    hub = fleet()
    crowd = [("192.0.2.1", 5000 + k) for k in range(MAX_STATIONS + 3)]
    for peer in crowd:
        hub.route(beat(), peer, 0.0)
    assert hub.route(telemetry(1), ONE, 0.1) == crowd[:MAX_STATIONS]
    assert hub.route(command(1), GCS, 0.1) == []
    assert hub.drops.total() == 4
    hub.route(beat(), crowd[0], PATIENCE_S)  # who goes on is served on
    assert hub.route(beat(), GCS, PATIENCE_S + 0.1) == [ONE, TWO]  # and there is room again
    assert hub.route(telemetry(1), ONE, PATIENCE_S + 0.2) == [crowd[0], GCS]


def test_vehicles_of_other_machines_are_refused() -> None:
    hub = Hub([1, 2], host="192.0.2.7")
    for own in (ONE, ("192.0.2.7", 1003)):
        hub.route(telemetry(1), own, 0.0)
        assert hub.route(command(1), GCS, 0.0) == [own]
    assert hub.route(telemetry(1), ("192.0.2.8", 1003), 0.0) == []
    assert hub.route(command(1), GCS, 0.0) == [own]
    assert hub.drops == {"wrong sender": 1}


def test_a_vehicle_that_moves_is_noted_once() -> None:
    hub = fleet()
    hub.route(telemetry(2), ONE, 1.0)
    hub.route(telemetry(2), ONE, 1.1)
    assert hub.moved == [2]


def test_a_station_that_floods_has_its_share_and_no_more() -> None:
    """Forwarded of a flood in a second: what the limit says, and what it may save up."""
    hub, sent = fleet(), 0
    for k in range(20_000):
        sent += bool(hub.route(command(1), GCS, k / 20_000))
        if k % 1000 == 0:
            assert hub.route(command(1), OTHER, k / 20_000) == [ONE]
            assert hub.route(telemetry(1), ONE, k / 20_000)
    limit = VEHICLE_RATE_HZ
    assert limit <= sent <= 3.0 * limit + 1.0
    assert hub.drops.total() == 20_000 - sent
    later = sum(bool(hub.route(command(1), GCS, 1.0 + k / 20_000)) for k in range(20_000))
    assert 0.9 * limit <= later <= 1.1 * limit  # a flood that goes on is not cut off
