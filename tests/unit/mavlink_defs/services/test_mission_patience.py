"""How long a vehicle waits for the items of an upload: that a machine is busy must not end it."""

from typing import Any

from lossy_network import GCS, OTHER_GCS, over_the_wire
from mission_bench import CANCELLED, Vehicle, ack, count, item

from mavlink_defs.dialect import MAVLink_heartbeat_message
from mavlink_defs.services.mission import ITEM_TIMEOUT_S, MAX_RETRIES
from mavlink_defs.services.mission_server import MissionRefused

HEARTBEAT = MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)


def test_missing_item_is_asked_for_again_then_given_up() -> None:
    vehicle = Vehicle(segments=1)
    vehicle.answers(count(3), now=10.0)
    assert vehicle.server.deadline() == 10.0 + ITEM_TIMEOUT_S
    vehicle.server.handle_timer(10.1)
    assert vehicle.sent() == []
    while (at := vehicle.server.deadline()) is not None:
        vehicle.server.receive(over_the_wire(HEARTBEAT, GCS), at)
        vehicle.server.handle_timer(at)
    assert vehicle.sent() == [("MISSION_REQUEST_INT", 0)] * MAX_RETRIES + ack(CANCELLED)
    assert vehicle.server.events() == [
        MissionRefused(CANCELLED, "Mission upload: item 0 did not come")
    ]
    assert len(vehicle.server.items) == 2
    assert vehicle.answers(item(0)) == ack(CANCELLED)


def test_a_client_that_is_heard_may_be_late_with_its_items() -> None:
    """A ground station of a busy machine sends heartbeats, and answers what came seconds ago."""
    vehicle = Vehicle()
    vehicle.answers(count(2), now=10.0)
    while (at := vehicle.server.deadline()) is not None and at < 17.0:
        vehicle.server.receive(over_the_wire(HEARTBEAT, GCS), at)
        vehicle.server.handle_timer(at)
    assert vehicle.server.events() == []
    assert vehicle.sent() == [("MISSION_REQUEST_INT", 0)] * 5
    vehicle.answers(item(0), now=17.0)
    vehicle.answers(item(1), now=17.1)
    assert len(vehicle.server.items) == 2


def test_a_silent_client_is_waited_for_longer() -> None:
    vehicle = Vehicle()
    vehicle.answers(count(2), now=10.0)
    while (at := vehicle.server.deadline()) is not None and at < 39.0:
        vehicle.server.handle_timer(at)
    assert vehicle.server.events() == []
    vehicle.answers(item(0), now=39.0)
    vehicle.answers(item(1), now=39.1)
    assert len(vehicle.server.items) == 2


def test_a_client_that_stays_silent_is_given_up() -> None:
    vehicle = Vehicle()
    vehicle.answers(count(2), now=10.0)
    while (at := vehicle.server.deadline()) is not None:
        end = at
        vehicle.server.handle_timer(at)
    assert 40.0 < end < 41.0
    assert vehicle.sent()[-1:] == ack(CANCELLED)


def test_a_stuck_client_makes_way_for_another() -> None:
    vehicle = Vehicle()
    vehicle.answers(count(3))
    for _ in range(MAX_RETRIES):
        at = vehicle.server.deadline()
        assert at is not None
        vehicle.server.handle_timer(at)
    vehicle.sent()
    vehicle.server.receive(over_the_wire(count(2), OTHER_GCS), 3.0)
    message: Any
    reported = []
    for message in vehicle.server.messages_to_send():
        reported.append((message.get_type(), message.target_system))
    assert reported == [("MISSION_ACK", GCS.system), ("MISSION_REQUEST_INT", OTHER_GCS.system)]


def test_patience_is_for_each_item() -> None:
    vehicle = Vehicle()
    vehicle.answers(count(3))
    for seq in (0, 1, 2):
        for _ in range(MAX_RETRIES):
            at = vehicle.server.deadline()
            assert at is not None
            vehicle.server.handle_timer(at)
        assert vehicle.sent() == [("MISSION_REQUEST_INT", seq)] * MAX_RETRIES
        vehicle.answers(item(seq), now=at or 0.0)
    assert len(vehicle.server.items) == 3
