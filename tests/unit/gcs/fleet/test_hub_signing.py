"""The hub with a key, and keys on their way through it."""

from gcs.fleet.hub import Hub
from mavlink_defs import dialect
from mavlink_defs.framing.frames import FramePacker
from mavlink_defs.framing.signing import Signer

KEY = bytes(range(1, 33))
VEHICLE, STATION, FAR = ("127.0.0.1", 1), ("127.0.0.1", 2), ("192.0.2.1", 3)


def beat(system: int, component: int) -> bytes:
    return FramePacker(system, component).pack(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))


def setup(target: int) -> bytes:
    return FramePacker(255, 190).pack(
        dialect.MAVLink_setup_signing_message(target, 1, list(KEY), 0)
    )


def test_a_hub_with_a_key_serves_those_who_sign() -> None:
    hub, vehicle, station = Hub([1], Signer(KEY)), Signer(KEY), Signer(KEY)
    assert hub.route(vehicle.sign(beat(1, 1)), VEHICLE, 0.0) == []
    assert hub.route(beat(255, 190), FAR, 0.0) == []
    assert hub.route(Signer(KEY[::-1]).sign(beat(255, 190)), FAR, 0.0) == []
    signed = station.sign(beat(255, 190))
    assert hub.route(signed, STATION, 0.0) == [VEHICLE]
    assert hub.route(signed, FAR, 0.0) == []  # replayed
    assert hub.route(beat(1, 1), FAR, 0.0) == []  # does not take the vehicle's place
    assert hub.route(vehicle.sign(beat(1, 1)), VEHICLE, 0.0) == [STATION]


def test_with_a_key_a_station_in_mavlink_1_hears_nothing() -> None:
    hub, vehicle = Hub([1], Signer(KEY)), Signer(KEY)
    greeting = dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
    frame = bytes(greeting.pack(dialect.MAVLink(None, 255, 190), force_mavlink1=True))
    assert hub.route(frame, STATION, 0.0) == hub.route(vehicle.sign(beat(1, 1)), VEHICLE, 0.0) == []


def test_what_the_hub_answers_itself_is_signed() -> None:
    hub, vehicle = Hub([1], Signer(KEY)), Signer(KEY)
    hub.route(vehicle.sign(beat(1, 1)), VEHICLE, 0.0)
    count = FramePacker(255, 190).pack(dialect.MAVLink_mission_count_message(1, 1, 2, 0))
    assert hub.route(Signer(KEY, link=1).sign(count), STATION, 0.0) == [VEHICLE]
    assert hub.route(Signer(KEY, link=2).sign(count), FAR, 0.0) == []
    [(answer, peer)] = hub.answers
    assert peer == FAR
    assert Signer(KEY).accepts(answer)


def test_a_hub_without_a_key_passes_keys_of_this_machine_to_one_vehicle() -> None:
    hub = Hub([1])
    hub.route(beat(1, 1), VEHICLE, 0.0)
    assert hub.route(setup(1), STATION, 0.0) == [VEHICLE]
    assert hub.route(setup(1), FAR, 0.0) == []
    assert hub.route(setup(0), STATION, 0.0) == []
