"""Dropped datagrams, as `gcs status` shows them; invalid frames do not disturb a hub."""

from collections import Counter

from gcs.fleet.hub import Hub
from gcs.station.status import drop_lines, vehicle_status
from gcs.station.vehicle_state import VehicleState
from mavlink_defs import dialect
from mavlink_defs.framing import codec
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.frames import FramePacker
from mavlink_defs.services.machine import SystemId

BEAT = dialect.MAVLink_heartbeat_message(1, 3, 0, 12, 4, 3)
NONE = [0] * len(DropReason)


def state(system: int, gcs: list[int], plant: list[int]) -> VehicleState:
    state = VehicleState(SystemId(system, 1), 0.0)
    state.receive(BEAT, 0.0)
    state.receive(dialect.MAVLink_ftc_drops_message(0, gcs, NONE, NONE, plant), 0.0)
    return state


def test_drops_have_one_line_for_each_who_dropped() -> None:
    some = [3, 0, 0, 0, 1, *NONE[5:]]
    states = [state(1, NONE, some), state(2, some, some), VehicleState(SystemId(3, 1), 0.0)]
    assert drop_lines(Counter({"not MAVLink 2": 7}), states) == [
        "dropped here: 7 not MAVLink 2",
        "dropped by the plant: 3 truncated, 1 wrong checksum",
        "dropped by UAV 2: gcs link 3 truncated, 1 wrong checksum",
    ]
    assert drop_lines(Counter(), states[2:]) == []


def test_drops_are_data_by_link_and_reason() -> None:
    link = vehicle_status(state(1, [2, *NONE[1:]], NONE), 0.0)["link"]
    assert link["drops"] == {"gcs": {"truncated": 2}, "formation": {}, "simulator": {}, "plant": {}}


def test_there_are_as_many_reasons_as_the_message_has_room_for() -> None:
    assert dialect.MAVLink_ftc_drops_message.array_lengths[1:] == [len(DropReason)] * 4
    assert list(DropReason) == list(range(-3, -3 - len(DropReason), -1))
    assert max(-reason for reason in DropReason) < codec.DROPS_SIZE


def test_a_damaged_frame_does_not_move_a_vehicle_of_the_hub() -> None:
    hub, vehicle, station, liar = Hub([1]), ("127.0.0.1", 1), ("127.0.0.1", 2), ("127.0.0.1", 3)
    frame = FramePacker(1, 1).pack(BEAT)
    order = dialect.MAVLink_param_request_list_message(1, 1)
    hub.route(frame, vehicle, 0.0)
    assert hub.route(frame[:-1] + bytes([frame[-1] ^ 1]), liar, 0.0) == []
    assert hub.route(FramePacker(255, 190).pack(order), station, 0.0) == [vehicle]
