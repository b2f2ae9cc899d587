"""The MAVLink of a foreign autopilot, as its bridge passes it on."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as theirs

from ftc_autopilot.foreign.datagrams import frames_in
from ftc_autopilot.foreign.plant_link import PlantSide
from ftc_autopilot.foreign.resumption import GivenAgain
from ftc_autopilot.foreign.sensor_faults import SensorFaults
from ftc_autopilot.foreign.vehicle import ForeignVehicle
from ftc_autopilot.kinds import ArduPlaneAutopilot
from mavlink_defs import dialect
from mavlink_defs.framing.frames import FramePacker, parse
from mavlink_defs.origin import Origin
from mavlink_defs.services.machine import SystemId
from sitl_plant.foreign.ardupilot.instruments import JsonInstruments
from sitl_plant.sensing.config import NavigationSensors

UAV = 7
SET_SLOT = dialect.MAV_CMD_FTC_SET_SLOT


PLANE = ArduPlaneAutopilot(kind="ardupilot", binary="arduplane")


def faults(time_s: float = 5.0) -> SensorFaults:
    shown = JsonInstruments(NavigationSensors(), 1.2, UAV, 1, 1000)
    return SensorFaults(shown.failures, PLANE.refuses, lambda: time_s)


@pytest.fixture
def vehicle() -> ForeignVehicle:
    return ForeignVehicle(UAV, Origin(), PlantSide(UAV, None).counts, faults())


@pytest.fixture
def link() -> Any:
    return theirs.MAVLink(None, UAV, 1)


def heartbeat(link: Any) -> bytes:
    return bytes(theirs.MAVLink_heartbeat_message(1, 3, 81, 10, 3, 3).pack(link))


def station_command(number: int, *params: float) -> dialect.MAVLink_message:
    seven = (*params, *[0.0] * 7)[:7]
    message = dialect.MAVLink_command_long_message(UAV, 1, number, 0, *seven)
    parsed = parse(FramePacker(255, 190).pack(message))
    assert parsed is not None
    return parsed


def test_a_datagram_of_several_frames_is_taken_apart(link: Any) -> None:
    attitude = bytes(theirs.MAVLink_attitude_message(1, 0.1, 0, 0, 0, 0, 0).pack(link))
    unknown = bytes(theirs.MAVLink_meminfo_message(1, 2).pack(link))
    one = heartbeat(link)
    assert frames_in(one + attitude + unknown + one) == [one, attitude, one]
    assert frames_in(b"\x00garbage" + one + b"\xfd\x09") == [one]
    assert frames_in(b"") == frames_in(b"\xfd") == []


def test_its_heartbeat_shows_when_it_is_ready_and_has_its_home(
    vehicle: ForeignVehicle, link: Any
) -> None:
    vehicle.receive(heartbeat(link))
    assert vehicle.to_stations() == []
    assert not vehicle.is_shown
    vehicle.to_autopilot()
    checked = dialect.MAV_SYS_STATUS_PREARM_CHECK
    status = bytes(theirs.MAVLink_sys_status_message(0, 0, checked, *[0] * 10).pack(link))
    vehicle.receive(status + heartbeat(link))
    assert vehicle.to_stations() == [status]
    (frame,) = vehicle.to_autopilot()
    asked = parse(frame)
    assert isinstance(asked, dialect.MAVLink_command_int_message)
    assert (asked.command, asked.x) == (dialect.MAV_CMD_DO_SET_HOME, -353632620)
    ack = theirs.MAVLink_command_ack_message(asked.command, 0, 0, 0, UAV, 25).pack(link)
    beat = heartbeat(link)
    vehicle.receive(bytes(ack) + beat)
    assert vehicle.to_stations() == [beat], "not the acknowledgement"
    assert vehicle.is_shown


def test_a_slot_is_ordered_of_the_bridge(link: Any) -> None:
    ordered: list[Any] = []
    counts = PlantSide(UAV, None).counts
    keeps = ForeignVehicle(UAV, Origin(), counts, faults(), None, ordered.append)
    alone = ForeignVehicle(UAV, Origin(), counts, faults())
    for vehicle, params, result in (
        (keeps, (-60.0, 20.0, 10.0), dialect.MAV_RESULT_ACCEPTED),
        (keeps, (np.nan, np.nan, np.nan), dialect.MAV_RESULT_ACCEPTED),
        (keeps, (5000.0, 0.0, 0.0), dialect.MAV_RESULT_DENIED),
        (alone, (-60.0, 20.0, 10.0), dialect.MAV_RESULT_DENIED),
    ):
        vehicle.receive_from_station(station_command(SET_SLOT, *params), 0.0, 0)
        said = [parse(frame) for frame in vehicle.to_stations()]
        (ack,) = (m for m in said if isinstance(m, dialect.MAVLink_command_ack_message))
        assert (ack.command, ack.result) == (SET_SLOT, result)
        assert len(said) > 1, "and a text"
        assert not vehicle.release(), "ArduPlane does not hear of it"
    assert ordered == [(-60.0, 20.0, 10.0), None]


def test_faults_go_to_the_plant_and_all_else_to_it(vehicle: ForeignVehicle) -> None:
    for number in (dialect.MAV_CMD_FTC_SET_FAULT, dialect.MAV_CMD_INJECT_FAILURE):
        vehicle.receive_from_station(station_command(number, 2.0), 0.0, 0)
    (sent,) = vehicle.to_plant()  # one at a time
    assert isinstance(sent, dialect.MAVLink_command_long_message)
    assert (sent.command, sent.target_component) == (dialect.MAV_CMD_FTC_SET_FAULT, 25)
    assert vehicle.to_autopilot() == []
    arm = station_command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
    vehicle.receive_from_station(arm, 0.0, 0)
    assert vehicle.to_autopilot() == []
    assert vehicle.release() > 1.0, "its next HEARTBEAT shows what it has done"
    (frame,) = vehicle.to_autopilot()
    passed = parse(frame)
    assert passed is not None
    assert (passed.get_srcSystem(), passed.to_dict()) == (255, arm.to_dict())
    assert vehicle.to_plant() == []


def test_the_plants_answer_is_the_stations(vehicle: ForeignVehicle) -> None:
    vehicle.receive_from_station(station_command(dialect.MAV_CMD_FTC_SET_FAULT, 2.0), 0.0, 0)
    vehicle.to_plant()
    ack = dialect.MAVLink_command_ack_message(dialect.MAV_CMD_FTC_SET_FAULT, 0, 255, 0, UAV, 1)
    answer = parse(FramePacker(UAV, 25).pack(ack))
    assert answer is not None
    vehicle.receive_from_plant(answer, 0.1)
    (frame,) = vehicle.to_stations()
    heard = parse(frame)
    assert isinstance(heard, dialect.MAVLink_command_ack_message)
    told = heard.command, heard.result, heard.get_srcComponent(), heard.target_system
    assert told == (dialect.MAV_CMD_FTC_SET_FAULT, 0, 1, 255)


def test_a_flood_of_a_station_ends_in_the_buffer(vehicle: ForeignVehicle) -> None:
    for number in range(5000):
        vehicle.receive_from_station(station_command(number % 60_000), 0.0, 0)
    waiting = 0
    while vehicle.release():
        waiting += 1
    assert 1000 < waiting < 3000
    vehicle.to_autopilot()
    vehicle.receive_from_station(station_command(dialect.MAV_CMD_DO_SET_MODE, 1.0), 0.0, 0)
    assert vehicle.release()


def test_a_parameter_is_given_again_if_there_is_one_of_its_name(tmp_path: Path) -> None:
    own, bridge = SystemId(UAV, 1), SystemId(UAV, 191)
    kept = tmp_path / "kept"
    before = GivenAgain(own, bridge, kept)
    for k in range(500):
        before.note_station(dialect.MAVLink_param_set_message(UAV, 1, f"NOBODY_{k}".encode(), 1, 9))
    before.note_station(dialect.MAVLink_param_set_message(UAV, 1, b"TRIM", 2.5, 9))
    armed = dialect.MAV_MODE_FLAG_SAFETY_ARMED
    before.note(dialect.MAVLink_heartbeat_message(1, 3, armed, 10, 4, 3))
    before.note(dialect.MAVLink_param_value_message(b"TRIM", 2.5, 9, 1, 0))
    sent = GivenAgain(own, bridge, kept).turn(0.0)
    params = [one for one in sent if isinstance(one, dialect.MAVLink_param_set_message)]
    assert [(one.param_id, one.param_value) for one in params] == [("TRIM", 2.5)]


def test_only_changes_are_sent_and_what_was_lost_again() -> None:
    link, simulator = PlantSide(UAV, None), FramePacker(UAV, 25)

    def state(step: int, applied: int | None) -> bytes:
        message = dialect.MAVLink_ftc_sim_state_message(
            step * 1000, 2**64 - 1 if applied is None else applied * 1000,
            [0.0] * 3, [20.0, 0, 0], [0.0] * 3, [0.0] * 3, [0.0] * 3, step, 3, 99,
            [0.0] * 3, [0] * 32,
        )  # fmt: skip
        return simulator.pack(message)

    shares = np.zeros(4, np.float32)
    sent = []
    for step, applied, rudder in [
        (0, None, 0.0),
        (1, 0, 0.0),
        (2, 0, 0.5),
        (3, 0, 0.5),
        (4, 3, 0.5),
    ]:
        link.receive(state(step, applied))
        assert link.took_step
        assert not link.is_repeated
        shares[2] = rudder
        mask, frame = link.command(shares)
        sent.append((mask, frame is not None))
    assert sent == [(15, True), (0, False), (4, True), (0, True), (0, False)]
    assert link.events.tolist() == [1, 1, 2, 1]
    assert link.repeats.tolist() == [0, 0, 1, 0]
    link.receive(state(4, 3))
    assert link.is_repeated
    assert len(link.again()) == 1
    link.receive(state(4, 3)[:-1])
    assert not link.took_step
    assert link.drops.total() == 1


def answers(vehicle: ForeignVehicle) -> list[Any]:
    found = [parse(frame) for frame in vehicle.to_stations()]
    return [one for one in found if one is not None]


def injected(vehicle: ForeignVehicle, *params: float) -> tuple[int, str]:
    """Inject a failure; return the result and what is said of it."""
    command = station_command(dialect.MAV_CMD_INJECT_FAILURE, *params)
    vehicle.receive_from_station(command, 0.0, 0)
    heard = answers(vehicle)
    (ack,) = (one for one in heard if isinstance(one, dialect.MAVLink_command_ack_message))
    said = [one for one in heard if isinstance(one, dialect.MAVLink_statustext_message)]
    return ack.result, "".join(one.text for one in said)


def test_faults_of_sensors_are_the_bridges(vehicle: ForeignVehicle) -> None:
    gyro, mag = dialect.FAILURE_UNIT_SENSOR_GYRO, dialect.FAILURE_UNIT_SENSOR_MAG
    stuck, off = dialect.FAILURE_TYPE_STUCK, dialect.FAILURE_TYPE_OFF
    assert injected(vehicle, gyro, stuck) == (dialect.MAV_RESULT_ACCEPTED, "")
    result, said = injected(vehicle, mag, stuck)
    assert (result, "makes its magnetometer itself" in said) == (dialect.MAV_RESULT_DENIED, True)
    result, said = injected(vehicle, gyro, off)
    assert (result, "never off" in said) == (dialect.MAV_RESULT_DENIED, True)
    assert vehicle.to_plant() == []
    bias = station_command(dialect.MAV_CMD_FTC_SET_SENSOR_FAULT, 5.0, 3.0, 20.0, 0.0, 6.0, 9.0, 1.0)
    vehicle.receive_from_station(bias, 0.0, 0)
    answers(vehicle)
    for count in (0, 2):  # of the plant's own
        listed = []
        for index in range(max(count, 1)):
            of_plant = dialect.MAVLink_ftc_fault_message(0.5, 0, 0, 1, 2, index, count, 2, 1)
            theirs = parse(FramePacker(UAV, 25).pack(of_plant))
            assert theirs is not None
            vehicle.receive_from_plant(theirs, 0.1)
            listed += answers(vehicle)
        assert [(one.index, one.count) for one in listed] == [
            (i, count + 2) for i in range(count + 2)
        ]
        assert [one.sensor for one in listed[count:]] == [1, 5]
    vehicle.receive_from_station(station_command(dialect.MAV_CMD_FTC_CLEAR_FAULTS, -1.0), 0.0, 0)
    assert len(vehicle.to_plant()) == 1, "all are cleared, the plant's as well"
    none = parse(FramePacker(UAV, 25).pack(dialect.MAVLink_ftc_fault_message(*[0] * 9)))
    assert none is not None
    answers(vehicle)
    vehicle.receive_from_plant(none, 0.1)
    (empty,) = answers(vehicle)
    assert empty.count == 0


def test_a_command_that_is_repeated_does_not_move_its_clock(
    vehicle: ForeignVehicle, link: Any
) -> None:
    arm = station_command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
    assert isinstance(arm, dialect.MAVLink_command_long_message)

    def given(confirmation: int) -> float:
        arm.confirmation = confirmation
        vehicle.receive_from_station(arm, 0.0, 0)
        return vehicle.release()

    assert given(0) > 0.0
    assert given(1) == 0.0, "it is under way"
    ack = bytes(theirs.MAVLink_command_ack_message(arm.command, 0, 0, 0, 255, 190).pack(link))
    vehicle.receive(ack)
    assert vehicle.to_stations() == [ack]
    assert given(2) == 0.0
    assert vehicle.to_stations() == [ack], "its answer was late, or lost"
    assert given(6) > 0.0, "it was lost itself, perhaps"
    assert given(0) > 0.0, "another one"
    arm.param1 = 0.0
    assert given(1) > 0.0, "of which the first was lost"
