from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lossy_network import (
    GCS,
    OTHER_GCS,
    OTHER_VEHICLE,
    VEHICLE,
    LossyNetwork,
    over_the_wire,
    sent_by,
)
from mission_bench import (
    ACCEPTED,
    CANCELLED,
    FENCE,
    RALLY,
    MissionClearer,
    Vehicle,
    contents,
    mission,
    request,
    validate,
)

from mavlink_defs import dialect
from mavlink_defs.dialect import (
    MAVLink_message,
    MAVLink_mission_ack_message,
    MAVLink_mission_request_message,
)
from mavlink_defs.services.machine import Machine, SystemId
from mavlink_defs.services.mission import (
    MAX_REPEATS,
    MAX_RETRIES,
    RESPONSE_TIMEOUT_S,
    MissionDownloader,
    MissionFinished,
    MissionProgress,
    MissionUploader,
)
from mavlink_defs.services.mission_server import MissionAccepted, MissionServer


def run_out(machine: Machine[Any]) -> list[str]:
    while (at := machine.deadline()) is not None:
        machine.handle_timer(at)
    return [message.get_type() for message in machine.messages_to_send()]


def from_vehicle(message: Any, source: SystemId = VEHICLE) -> MAVLink_message:
    message.target_system, message.target_component = GCS
    return over_the_wire(message, source)


class TestClients:
    @pytest.mark.parametrize(
        ("machine", "asks"),
        [
            (MissionUploader(GCS, VEHICLE, mission(1)), "MISSION_COUNT"),
            (MissionDownloader(GCS, VEHICLE), "MISSION_REQUEST_LIST"),
            (MissionClearer(GCS, VEHICLE), "MISSION_CLEAR_ALL"),
        ],
    )
    def test_silent_vehicle_is_given_up(self, machine: Any, asks: str) -> None:
        machine.handle_timer(0.0)
        machine.start(now=0.0)
        with pytest.raises(RuntimeError):
            machine.start(now=0.0)
        assert machine.deadline() == RESPONSE_TIMEOUT_S
        machine.handle_timer(0.1)
        assert run_out(machine) == [asks] * (1 + MAX_RETRIES)
        assert machine.events() == [MissionFinished(None)]

    def test_cancel_tells_the_vehicle(self) -> None:
        machine = MissionUploader(GCS, VEHICLE, mission(1))
        machine.cancel()
        machine.start(now=0.0)
        machine.cancel()
        assert [m.get_type() for m in machine.messages_to_send()] == [
            "MISSION_COUNT",
            "MISSION_ACK",
        ]
        assert machine.events() == [MissionFinished(CANCELLED)]

    def test_uploader_wants_numbered_items(self) -> None:
        with pytest.raises(ValueError, match="numbered from 0"):
            MissionUploader(GCS, VEHICLE, mission(2)[1:])

    def test_uploader_addresses_copies(self) -> None:
        items = mission(1)
        machine = MissionUploader(GCS, OTHER_VEHICLE, items, RALLY)
        machine.start(now=0.0)
        machine.receive(from_vehicle(request(0, RALLY), OTHER_VEHICLE), now=0.1)
        _, sent = machine.messages_to_send()
        assert isinstance(sent, dialect.MAVLink_mission_item_int_message)
        assert (sent.target_system, sent.mission_type) == (OTHER_VEHICLE.system, RALLY)
        assert (items[0].target_system, items[0].mission_type) == (VEHICLE.system, 0)

    def test_uploader_believes_only_answers_to_itself(self) -> None:
        machine = MissionUploader(GCS, VEHICLE, mission(1))
        machine.start(now=0.0)
        accepted = MAVLink_mission_ack_message(*GCS, ACCEPTED, 0)
        refused = MAVLink_mission_ack_message(*GCS, dialect.MAV_MISSION_ERROR, 0)
        elsewhere = MAVLink_mission_ack_message(*OTHER_GCS, dialect.MAV_MISSION_ERROR, 0)
        fence = MAVLink_mission_ack_message(*GCS, dialect.MAV_MISSION_ERROR, FENCE)
        machine.receive(from_vehicle(accepted), now=0.1)  # of an earlier upload
        machine.receive(from_vehicle(request(1)), now=0.1)  # by an earlier upload
        machine.receive(from_vehicle(fence), now=0.1)
        machine.receive(over_the_wire(elsewhere, VEHICLE), now=0.1)
        machine.receive(from_vehicle(refused, OTHER_VEHICLE), now=0.1)
        assert machine.busy
        assert len(machine.messages_to_send()) == 1
        machine.receive(from_vehicle(refused), now=0.1)
        assert machine.events() == [MissionFinished(dialect.MAV_MISSION_ERROR)]

    def test_uploader_answers_legacy_requests_and_reports_progress(self) -> None:
        machine = MissionUploader(GCS, VEHICLE, mission(1))
        machine.start(now=0.0)
        assert [m.get_type() for m in machine.messages_to_send()] == ["MISSION_COUNT"]
        for seq in (0, 0, 1):
            legacy = MAVLink_mission_request_message(*VEHICLE, seq, 0)
            machine.receive(from_vehicle(legacy), now=0.1)
        items = sent_by(machine, dialect.MAVLink_mission_item_int_message)
        assert [item.seq for item in items] == [0, 0, 1]
        assert machine.events() == [MissionProgress(1, 2), MissionProgress(2, 2)]

    def test_a_vehicle_that_asks_for_one_item_for_ever_is_given_up(self) -> None:
        machine = MissionUploader(GCS, VEHICLE, mission(2))
        machine.start(now=0.0)
        for seq in [0] * MAX_REPEATS + [1] * (MAX_REPEATS + 1):
            machine.receive(from_vehicle(request(seq)), now=0.1)
        assert machine.busy
        machine.receive(from_vehicle(request(1)), now=0.1)
        assert machine.events()[-1] == MissionFinished(dialect.MAV_MISSION_INVALID_SEQUENCE)
        assert machine.messages_to_send()[-1].get_type() == "MISSION_ACK"
        assert run_out(machine) == []

    def test_downloader_passes_an_error_on(self) -> None:
        machine = MissionDownloader(GCS, VEHICLE)
        machine.start(now=0.0)
        machine.receive(from_vehicle(MAVLink_mission_ack_message(*GCS, ACCEPTED, 0)), now=0.1)
        assert machine.busy
        machine.receive(from_vehicle(MAVLink_mission_ack_message(*GCS, 1, 0)), now=0.1)
        assert machine.events() == [MissionFinished(1)]


networks = st.builds(
    LossyNetwork,
    seed=st.integers(0, 2**32),
    loss=st.floats(0.0, 0.4),
    duplication=st.floats(0.0, 0.3),
    delay_s=st.floats(0.0, 0.3),
)


def result_of(events: list[Any]) -> MissionFinished:
    (finished,) = (event for event in events if isinstance(event, MissionFinished))
    return finished


def clean_network_or_failure(finished: MissionFinished, network: LossyNetwork) -> None:
    if network.loss == 0.0:
        assert finished.result == ACCEPTED


@given(networks, st.integers(0, 12), st.booleans())
def test_upload_arrives_whole_or_fails(network: LossyNetwork, segments: int, good: bool) -> None:
    server = MissionServer(VEHICLE, validate)
    sent = mission(segments, airspeed=30.0 if good else 99.0)
    uploader = MissionUploader(GCS, VEHICLE, sent)
    gcs, vehicle = network.join(uploader, GCS), network.join(server, VEHICLE)
    network.join(MissionServer(OTHER_VEHICLE, validate), OTHER_VEHICLE)
    uploader.start(now=0.0)
    network.run(limit_s=120.0)

    finished = result_of(gcs.events)
    if finished.result == ACCEPTED:
        assert contents(server.items) == contents(sent)
    if network.loss == 0.0:
        expected = ACCEPTED if good or not segments else dialect.MAV_MISSION_INVALID_PARAM2
        assert finished.result == expected
    accepted = [event for event in vehicle.events if isinstance(event, MissionAccepted)]
    assert bool(accepted) == bool(server.items)


@given(networks, st.integers(0, 12))
def test_download_is_whole_or_fails(network: LossyNetwork, segments: int) -> None:
    server, downloader = Vehicle(segments).server, MissionDownloader(GCS, VEHICLE)
    gcs = network.join(downloader, GCS)
    network.join(server, VEHICLE)
    downloader.start(now=0.0)
    network.run(limit_s=120.0)

    finished = result_of(gcs.events)
    if finished.result == ACCEPTED:
        assert contents(finished.items) == contents(server.items)
    clean_network_or_failure(finished, network)


@given(networks)
def test_clear_is_done_or_fails(network: LossyNetwork) -> None:
    server, clearer = Vehicle(3).server, MissionClearer(GCS, VEHICLE)
    gcs = network.join(clearer, GCS)
    network.join(server, VEHICLE)
    clearer.start(now=0.0)
    network.run(limit_s=20.0)

    finished = result_of(gcs.events)
    assert finished.result in {ACCEPTED, None}
    assert server.items == () or finished.result is None
    clean_network_or_failure(finished, network)


@given(networks, st.floats(0.0, 2.0))
def test_two_uploads_and_a_download_never_mix(network: LossyNetwork, second_at: float) -> None:
    server = MissionServer(VEHICLE, validate)
    missions = [contents(mission(4, speed)) for speed in (20.0, 40.0)]
    first = MissionUploader(GCS, VEHICLE, mission(4, 20.0))
    second = MissionUploader(OTHER_GCS, VEHICLE, mission(4, 40.0))
    reader = MissionDownloader(SystemId(253, 1), VEHICLE)
    network.join(server, VEHICLE)
    nodes = [network.join(first, GCS), network.join(second, OTHER_GCS)]
    reading = network.join(reader, SystemId(253, 1))
    first.start(now=0.0)
    network.call_at(second_at, lambda: second.start(network.now))
    network.call_at(second_at, lambda: reader.start(network.now))
    network.run(limit_s=120.0)

    results = [result_of(node.events).result for node in nodes]
    assert contents(server.items) in [[], *missions]
    if ACCEPTED in results:
        assert server.items
    if results == [ACCEPTED, dialect.MAV_MISSION_DENIED]:
        assert contents(server.items) == missions[0]
    finished = result_of(reading.events)
    if finished.result == ACCEPTED:
        assert contents(finished.items) in [[], *missions]


@given(networks, st.sampled_from([FENCE, RALLY]), st.sampled_from(["up", "empty", "down", "clear"]))
def test_geofence_and_rally_points_cross_the_same_network(
    network: LossyNetwork, mission_type: int, operation: str
) -> None:
    vehicle = Vehicle(3)
    vehicle.upload(before := mission(1), mission_type=mission_type)
    vehicle.servers.events()
    machine: Any = {
        "up": lambda: MissionUploader(GCS, VEHICLE, mission(2), mission_type),
        "empty": lambda: MissionUploader(GCS, VEHICLE, [], mission_type),
        "down": lambda: MissionDownloader(GCS, VEHICLE, mission_type),
        "clear": lambda: MissionClearer(GCS, VEHICLE, mission_type),
    }[operation]()
    gcs = network.join(machine, GCS)
    servers: Any = vehicle.servers
    network.join(servers, VEHICLE)
    machine.start(now=0.0)
    network.run(limit_s=60.0)

    finished = result_of(gcs.events)
    assert finished.result in {ACCEPTED, None}
    if network.loss == 0.0:
        assert finished.result == ACCEPTED
    after = {"up": mission(2), "empty": [], "down": before, "clear": []}[operation]
    held = contents(vehicle.servers.servers[mission_type].items)
    assert held in [contents(before), contents(after)]
    if finished.result == ACCEPTED:
        assert held == contents(after)
    if operation == "down" and finished.result == ACCEPTED:
        assert contents(finished.items) == contents(before)
    assert contents(vehicle.server.items) == contents(mission(3))
