"""The hub passes on what vehicles say to all, and what ground stations say to whom it concerns."""

from typing import Any

from gcs.hub import PATIENCE_S, Hub
from mavlink_defs import dialect
from mavlink_defs.frames import Speaker

ONE, TWO = ("127.0.0.1", 1001), ("127.0.0.1", 1002)
GCS, OTHER = ("127.0.0.1", 2001), ("127.0.0.1", 2002)
SPEAKERS = {1: Speaker(1, 1), 2: Speaker(2, 1), 255: Speaker(255, 190)}


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
