"""Fault commands as the simulator component takes them."""

import math
from typing import Any

import numpy as np
import pytest

from mavlink_defs import dialect
from mavlink_defs.fault_kinds import FaultLimits
from mavlink_defs.faults import MAX_FAULTS
from mavlink_defs.framing.frames import FramePacker, parse
from sitl_plant.actuators.faults import no_faults
from sitl_plant.loop.service import AircraftService

UAV, COMPONENT = 3, 25
SET, CLEAR = dialect.MAV_CMD_FTC_SET_FAULT, dialect.MAV_CMD_FTC_CLEAR_FAULTS
INJECT, REQUEST = dialect.MAV_CMD_INJECT_FAILURE, dialect.MAV_CMD_REQUEST_MESSAGE
ACCEPTED, DENIED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_DENIED
UNSUPPORTED = dialect.MAV_RESULT_UNSUPPORTED
SERVO, MOTOR = dialect.FAILURE_UNIT_SYSTEM_SERVO, dialect.FAILURE_UNIT_SYSTEM_MOTOR
OK, OFF, STUCK = (dialect.FAILURE_TYPE_OK, dialect.FAILURE_TYPE_OFF, dialect.FAILURE_TYPE_STUCK)
NAN = math.nan


class Bench:
    def __init__(self, rudder: tuple[float, float] = (-35.0, 35.0)) -> None:
        self.faults = no_faults(1)[0]
        self.applied = np.radians([5.0, -3.0, 20.0, 0.0])
        self.applied[3] = 700.0
        others = (-35.0, 35.0)
        limits = FaultLimits(surfaces_deg=(others, others, rudder), thrust_n=2000.0)
        self.service = AircraftService(UAV, COMPONENT, self.faults, self.applied, limits)
        self.speaker = FramePacker(UAV, 1)
        self.now = 0.0

    def send(self, message: Any) -> list[Any]:
        self.now += 2.0
        received = parse(self.speaker.pack(message))
        assert received is not None
        self.service.receive(received, time_s=10.0, now=self.now)
        return self.service.messages_to_send()

    def command(self, number: int, *params: float) -> tuple[int, list[Any]]:
        seven = (*params, *[0.0] * 7)[:7]
        message = dialect.MAVLink_command_long_message(UAV, COMPONENT, number, 0, *seven)
        answers = self.send(message)
        (ack,) = [m for m in answers if m.get_type() == "COMMAND_ACK"]
        return int(ack.result), [m for m in answers if m is not ack]

    @property
    def active(self) -> list[tuple[int, float, float]]:
        rows = self.faults[self.faults["actuator"] >= 0]
        return [(int(r["actuator"]), float(r["rho"]), float(r["value"])) for r in rows]


def test_an_autopilot_that_was_armed_for_another_plant_must_be_armed_again() -> None:
    bench = Bench()
    armed = dialect.MAV_MODE_FLAG_SAFETY_ARMED
    for base_mode, counts in ((armed, False), (armed, False), (0, False), (armed, True)):
        bench.send(dialect.MAVLink_heartbeat_message(1, 3, base_mode, 12, 4, 3))
        assert bench.service.armed is counts


def test_a_fault_is_set_and_cleared() -> None:
    bench = Bench()
    assert bench.command(SET, 2, 0.9, 1.0, 0.0, 19.0, 22.0)[0] == ACCEPTED
    assert bench.active == [(2, 0.9, math.radians(1.0))]
    assert bench.command(CLEAR, 2)[0] == ACCEPTED
    assert bench.active == []


@pytest.mark.parametrize(
    ("params", "named"),
    [
        ((4, 0.9, 0, 0, NAN, NAN), "Actuator"),
        ((2, 1.5, 0, 0, NAN, NAN), "Effectiveness"),
        ((2, NAN, 0, 0, NAN, NAN), "Effectiveness"),
        ((2, 0.9, 40.0, 0, NAN, NAN), "Value"),
        ((2, 0.9, 0, -1.0, NAN, NAN), "Frequency"),
        ((2, 0.9, 0, 0, -1.0, NAN), "Start"),
        ((2, 0.9, 0, 0, 5.0, 4.0), "End"),
    ],
)
def test_values_out_of_range_are_denied_and_named(params: tuple[float, ...], named: str) -> None:
    bench = Bench()
    result, said = bench.command(SET, *params)
    assert result == DENIED
    assert named in "".join(str(m.text) for m in said)
    assert bench.active == []


def test_a_rudder_that_is_not_there_does_not_fail() -> None:
    bench = Bench(rudder=(0.0, 0.0))
    for command in ((SET, 2, 0.9, 0.0, 0.0, NAN, NAN), (INJECT, SERVO, OFF, 3)):
        result, said = bench.command(*command)
        assert result == DENIED
        assert "the aircraft has no rudder" in "".join(str(m.text) for m in said)
    assert bench.active == []
    assert bench.command(INJECT, SERVO, OFF, 0)[0] == ACCEPTED
    assert [row[0] for row in bench.active] == [0, 1]


def test_inject_failure_off_and_stuck_and_ok() -> None:
    bench = Bench()
    assert bench.command(INJECT, SERVO, OFF, 3)[0] == ACCEPTED
    assert bench.active == [(2, 0.0, 0.0)]
    assert bench.command(INJECT, SERVO, STUCK, 1)[0] == ACCEPTED
    assert bench.active[1] == pytest.approx((0, 0.0, math.radians(5.0)))
    assert bench.command(INJECT, MOTOR, STUCK, 0)[0] == ACCEPTED
    assert bench.active[2] == (3, 0.0, 700.0)
    assert bench.command(INJECT, SERVO, OK, 0)[0] == ACCEPTED
    assert [row[0] for row in bench.active] == [3]


@pytest.mark.parametrize(
    ("params", "result"),
    [
        ((dialect.FAILURE_UNIT_SENSOR_OPTICAL_FLOW, OFF, 0), UNSUPPORTED),
        ((SERVO, dialect.FAILURE_TYPE_GARBAGE, 0), UNSUPPORTED),
        ((SERVO, OFF, 9), DENIED),
        ((NAN, OFF, 0), UNSUPPORTED),
    ],
)
def test_other_failures_are_refused(params: tuple[float, ...], result: int) -> None:
    bench = Bench()
    assert bench.command(INJECT, *params)[0] == result
    assert bench.active == []


@pytest.mark.parametrize("kind", [OFF, STUCK])
def test_a_failure_that_has_no_room_changes_nothing(kind: int) -> None:
    bench = Bench()
    for i in range(MAX_FAULTS - 2):
        assert bench.command(SET, 3, 0.5, 0.0, 0.0, 20.0 + i, 21.0 + i)[0] == ACCEPTED
    before = bench.faults.copy()
    result, said = bench.command(INJECT, SERVO, kind, 0)
    assert result == DENIED
    assert "slots are in use" in "".join(str(m.text) for m in said)
    assert np.array_equal(bench.faults, before)


def test_faults_are_listed_on_request() -> None:
    bench = Bench()
    request = (REQUEST, dialect.MAVLINK_MSG_ID_FTC_FAULT)
    assert bench.command(*request)[1][0].count == 0
    bench.command(SET, 2, 0.9, 1.0, 0.0, 9.0, NAN)
    bench.command(SET, 3, 0.5, 0.0, 0.0, 19.0, 22.0)
    listed = bench.command(*request)[1]
    assert [(m.actuator, m.active, m.count) for m in listed] == [(2, 1, 2), (3, 0, 2)]
    assert listed[0].value == pytest.approx(1.0)


def test_a_repeated_command_has_no_second_effect() -> None:
    bench = Bench()
    message = dialect.MAVLink_command_long_message(
        UAV, COMPONENT, SET, 0, 2, 0.9, 0, 0, NAN, NAN, 0
    )
    bench.send(message)
    first = bench.faults.copy()
    message.confirmation = 1
    bench.now -= 1.9
    (ack,) = bench.send(message)
    assert ack.result == ACCEPTED
    assert np.array_equal(bench.faults, first)


def test_the_heartbeat_tells_whether_the_autopilot_is_armed() -> None:
    bench = Bench()
    armed = dialect.MAV_MODE_FLAG_SAFETY_ARMED
    bench.send(dialect.MAVLink_heartbeat_message(1, 3, 0, 10, 4, 3))
    assert not bench.service.armed
    bench.send(dialect.MAVLink_heartbeat_message(1, 3, armed, 10, 4, 3))
    assert bench.service.armed
    bench.send(dialect.MAVLink_heartbeat_message(1, 3, 0, 10, 4, 3))
    assert not bench.service.armed
