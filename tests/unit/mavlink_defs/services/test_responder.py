from typing import Any

import pytest
from lossy_network import GCS, VEHICLE, over_the_wire

from mavlink_defs import dialect
from mavlink_defs.services.responder import Responder


def answers(message: Any) -> list[Any]:
    machine = Responder(VEHICLE)
    machine.receive(over_the_wire(message, GCS), now=12.5)
    machine.handle_timer(20.0)
    assert machine.deadline() is None
    return [over_the_wire(answer, VEHICLE) for answer in machine.messages_to_send()]


def ftp(opcode: int, target: tuple[int, int] = VEHICLE, sequence: int = 65535) -> Any:
    payload = [sequence & 0xFF, sequence >> 8, 3, opcode, 5, *b"\0\0\0\0\0\0\0@PARAM/param.pck"]
    payload += [0] * (251 - len(payload))
    return dialect.MAVLink_file_transfer_protocol_message(0, *target, payload)


def test_a_ping_is_answered_to_its_sender() -> None:
    (answer,) = answers(dialect.MAVLink_ping_message(123, 9, 0, 0))
    assert (answer.target_system, answer.target_component) == GCS
    assert (answer.time_usec, answer.seq) == (123, 9)


@pytest.mark.parametrize("target", [VEHICLE, (2, 1)])
def test_answers_to_pings_are_not_answered(target: tuple[int, int]) -> None:
    assert answers(dialect.MAVLink_ping_message(123, 9, *target)) == []


def test_timesync() -> None:
    (answer,) = answers(dialect.MAVLink_timesync_message(0, 77))
    assert (answer.tc1, answer.ts1) == (12_500_000_000, 77)
    assert answers(dialect.MAVLink_timesync_message(5, 77)) == []


@pytest.mark.parametrize("opcode", [1, 2, 3, 4, 5, 15])
def test_files_are_refused(opcode: int) -> None:
    (answer,) = answers(ftp(opcode))
    assert (answer.target_system, answer.target_component) == GCS
    assert answer.payload[:8] == [0, 0, 3, 129, 1, opcode, 0, 0]
    assert answer.payload[12] == 7


@pytest.mark.parametrize(("opcode", "target"), [(128, VEHICLE), (129, VEHICLE), (4, (2, 1))])
def test_other_peoples_files_are_of_no_concern(opcode: int, target: tuple[int, int]) -> None:
    assert answers(ftp(opcode, target)) == []


def test_there_are_no_logs() -> None:
    (answer,) = answers(dialect.MAVLink_log_request_list_message(*VEHICLE, 0, 65535))
    assert answer.num_logs == 0
