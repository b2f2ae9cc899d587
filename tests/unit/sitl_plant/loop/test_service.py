"""Fault commands as the simulator component takes them."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from mavlink_defs import dialect
from mavlink_defs.faults.actuators import ACTUATOR_FAULTS, MAX_FAULTS
from mavlink_defs.faults.aircraft import AircraftFaults
from mavlink_defs.faults.kinds import FaultLimits
from mavlink_defs.faults.sensors import MAX_SENSOR_FAULTS, SENSOR_FAULTS
from mavlink_defs.faults.table import FaultTable, no_faults
from mavlink_defs.framing.frames import FramePacker, parse
from mavlink_defs.services.fault_list import FaultList
from sitl_plant.loop.service import AircraftService
from sitl_plant.sensing.failures import SensorRange, fault_table, new_failures

UAV, COMPONENT = 3, 25
NOW_S = 10.0
SET, SET_SENSOR = dialect.MAV_CMD_FTC_SET_FAULT, dialect.MAV_CMD_FTC_SET_SENSOR_FAULT
CLEAR = dialect.MAV_CMD_FTC_CLEAR_FAULTS
INJECT, REQUEST = dialect.MAV_CMD_INJECT_FAILURE, dialect.MAV_CMD_REQUEST_MESSAGE
ACCEPTED, DENIED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_DENIED
UNSUPPORTED = dialect.MAV_RESULT_UNSUPPORTED
SERVO, MOTOR = dialect.FAILURE_UNIT_SYSTEM_SERVO, dialect.FAILURE_UNIT_SYSTEM_MOTOR
GYRO, GPS = dialect.FAILURE_UNIT_SENSOR_GYRO, dialect.FAILURE_UNIT_SENSOR_GPS
OK, OFF, STUCK = (dialect.FAILURE_TYPE_OK, dialect.FAILURE_TYPE_OFF, dialect.FAILURE_TYPE_STUCK)
BIAS = dialect.FTC_SENSOR_FAULT_KIND_BIAS
NAN = math.nan
RANGES = [
    *(SensorRange(name, k, 0.1, -10.0, 10.0) for name in ("gyro", "accelerometer") for k in (1, 2)),
    *(SensorRange(name, 1, 0.1, -10.0, 10.0) for name in ("magnetometer", "barometer", "airspeed")),
    SensorRange("gps", 1, 1.0, -1e5, 1e5),
]


class Bench:
    def __init__(
        self, *, rudder: tuple[float, float] = (-35.0, 35.0), has_sensors: bool = True
    ) -> None:
        self.faults = no_faults(ACTUATOR_FAULTS, 1)[0]
        self.applied = np.radians([5.0, -3.0, 20.0, 0.0])
        self.applied[3] = 700.0
        others = (-35.0, 35.0)
        limits = FaultLimits(surfaces_deg=(others, others, rudder), thrust_n=2000.0)
        failures = new_failures(RANGES, [UAV], 1, 1000)
        self.sensor_faults = failures.faults[0]
        tables = {"actuator": FaultTable(ACTUATOR_FAULTS, self.faults)}
        if has_sensors:
            tables["sensor"] = fault_table(failures, 0)
        commands = AircraftFaults(tables, limits, self.applied)
        self.service = AircraftService(UAV, COMPONENT, commands)
        self.speaker = FramePacker(UAV, 1)
        self.now = 0.0

    def send(self, message: Any) -> list[Any]:
        self.now += 20.0
        received = parse(self.speaker.pack(message))
        assert received is not None
        self.service.receive(received, time_s=NOW_S, now=self.now)
        return self.service.messages_to_send()

    def command(self, number: int, *params: float) -> tuple[int, list[Any]]:
        seven = (*params, *[0.0] * 7)[:7]
        message = dialect.MAVLink_command_long_message(UAV, COMPONENT, number, 0, *seven)
        answers = self.send(message)
        (ack,) = [m for m in answers if m.get_type() == "COMMAND_ACK"]
        return int(ack.result), [m for m in answers if m is not ack]

    def refusal(self, command: Sequence[float]) -> str:
        """Send a command that changes nothing; return what is said about it."""
        before = self.state()
        result, said = self.command(int(command[0]), *command[1:])
        assert result == DENIED
        assert self.state() == before
        return "".join(str(m.text) for m in said)

    def state(self) -> bytes:
        return self.faults.tobytes() + self.sensor_faults.tobytes()

    @property
    def active(self) -> list[tuple[int, float, float]]:
        rows = self.faults[self.faults["target"] >= 0]
        return [(int(r["target"]), float(r["effectiveness"]), float(r["value"])) for r in rows]

    def listed(self) -> list[str]:
        found = FaultList()
        for message in self.command(REQUEST, dialect.MAVLINK_MSG_ID_FTC_FAULT)[1]:
            received = parse(self.speaker.pack(message))
            assert isinstance(received, dialect.MAVLink_ftc_fault_message)
            found.receive(received)
        assert found.complete is not None
        return [fault.describe() for fault in found.complete]


def test_an_autopilot_that_was_armed_for_another_plant_must_be_armed_again() -> None:
    bench = Bench()
    armed = dialect.MAV_MODE_FLAG_SAFETY_ARMED
    for base_mode, counts in ((armed, False), (armed, False), (0, False), (armed, True)):
        bench.send(dialect.MAVLink_heartbeat_message(1, 3, base_mode, 12, 4, 3))
        assert bench.service.armed is counts


def test_faults_are_set_listed_and_cleared() -> None:
    bench = Bench()
    assert bench.listed() == []
    assert bench.command(SET_SENSOR, 1, BIAS, 3.0, 2, 19.0, 22.0, 1)[0] == ACCEPTED
    assert bench.command(SET, 2, 0.5, 1.0, 0, NAN, NAN)[0] == ACCEPTED
    assert bench.active == [(2, 0.5, math.radians(1.0))]
    assert bench.listed() == [
        "rudder at 50 % + 1 deg after 10 s, until cleared",
        "gyro 2 x +3 deg/s in (19, 22] s",
    ]
    assert bench.command(CLEAR, 2)[0] == ACCEPTED
    assert bench.listed() == ["gyro 2 x +3 deg/s in (19, 22] s"]
    assert bench.command(CLEAR, -1)[0] == ACCEPTED
    assert bench.listed() == []


def test_a_list_says_what_is_active() -> None:
    bench = Bench()
    request = (REQUEST, dialect.MAVLINK_MSG_ID_FTC_FAULT)
    assert bench.command(*request)[1][0].count == 0
    bench.command(SET, 2, 0.9, 1.0, 0.0, 9.0, NAN)
    bench.command(SET, 3, 0.5, 0.0, 0.0, 19.0, 22.0)
    listed = bench.command(*request)[1]
    assert [(m.actuator, m.active, m.count) for m in listed] == [(2, 1, 2), (3, 0, 2)]


@pytest.mark.parametrize(
    ("command", "text"),
    [
        ((SET, 4, 0.9, 0, 0, NAN, NAN), "Actuator is 4"),
        ((SET, 2, 1.5, 0, 0, NAN, NAN), "Effectiveness is 1.5"),
        ((SET, 2, NAN, 0, 0, NAN, NAN), "Effectiveness is nan"),
        ((SET, 2, 0.9, 40.0, 0, NAN, NAN), "Value is 40 deg, must be -35 to 35 deg"),
        ((SET, 2, 0.9, 0, -1.0, NAN, NAN), "Frequency is -1 Hz"),
        ((SET, 2, 0.9, 0, 0, -1.0, NAN), "Start is -1 s"),
        ((SET, 2, 0.9, 0, 0, 5.0, 4.0), "End is 4 s"),
        ((SET, 2, 0.9, 0, 0, NAN, 9.0), "End is 9 s, it is 10 s already"),
        ((CLEAR, 4), "Actuator is 4, must be -1 to 3"),
        ((SET_SENSOR, 0, 0), "Sensor is 0, must be 1 to 6"),
        ((SET_SENSOR, 1, 11), "Kind is 11, must be 0 to 10"),
        ((SET_SENSOR, 1, BIAS, 3000.0), "Value of bias is 3000 deg/s, must be -2000 to 2000 deg/s"),
        ((SET_SENSOR, 5, 5, 2.0), "gps has no scale"),
        ((SET_SENSOR, 1, BIAS, 3.0, 3, NAN, NAN), "Instance is 3, must be 0 (all) to 2 of gyro"),
        ((SET_SENSOR, 1, BIAS, 3.0, 0.5), "Instance is 0.5"),
        ((SET_SENSOR, 1, BIAS, 3.0, 0, -1.0), "Start is -1 s"),
        ((SET_SENSOR, 1, BIAS, 3.0, 0, 5.0, 4.0), "End is 4 s, must be NaN or more than 5 s"),
        ((SET_SENSOR, 1, BIAS, 3.0, 0, NAN, 9.0), "End is 9 s, it is 10 s already"),
        ((SET_SENSOR, 4, BIAS, 3.0, 0, NAN, NAN, 1), "Axis is 1, must be 0 for bias of barometer"),
        ((INJECT, SERVO, OFF, 9), "Instance is 9, must be 0 to 3"),
        ((INJECT, GYRO, 8, 0), "Type is 8, must be 0 (OK) to 7 (intermittent)"),
        ((INJECT, GYRO, NAN, 0), "Type is nan"),
        ((INJECT, GYRO, OFF, 3), "Instance is 3, must be 0 (all) to 2 of gyro"),
        ((INJECT, GPS, OFF, 2), "Instance is 2, must be 0 (all) to 1 of gps"),
        ((INJECT, GYRO, OFF, -1), "Instance is -1"),
        ((INJECT, GYRO, OK, 9), "Instance is 9"),
    ],
)
def test_what_cannot_be_executed_is_refused_with_a_reason(
    command: tuple[float, ...], text: str
) -> None:
    assert text in Bench().refusal(command)


def test_a_rudder_that_is_not_there_does_not_fail() -> None:
    bench = Bench(rudder=(0.0, 0.0))
    for command in ((SET, 2, 0.9, 0.0, 0.0, NAN, NAN), (INJECT, SERVO, OFF, 3)):
        assert "the aircraft has no rudder" in bench.refusal(command)
    assert bench.command(INJECT, SERVO, OFF, 0)[0] == ACCEPTED
    assert [row[0] for row in bench.active] == [0, 1]


@pytest.mark.parametrize("command", [(SET_SENSOR, 1, BIAS, 3.0, 0, NAN, NAN), (INJECT, GYRO, OFF)])
def test_an_aircraft_that_flies_by_its_true_state_has_no_sensors(command: Sequence[float]) -> None:
    bench = Bench(has_sensors=False)
    said = bench.refusal(command)
    assert "has no gyro that could fail" in said
    assert "navigation: estimated" in said
    assert bench.command(CLEAR, -1)[0] == ACCEPTED
    assert bench.listed() == []


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


@pytest.mark.parametrize("sensor", SENSOR_FAULTS.targets, ids=lambda sensor: sensor.name)
def test_every_failure_of_every_sensor_is_executed_by_inject_failure(sensor: Any) -> None:
    for kind in range(1, 8):
        bench = Bench()
        assert bench.command(INJECT, sensor.failure_unit, kind, 0)[0] == ACCEPTED
        assert len(bench.listed()) == (2 if sensor.has_imus else 1)
        assert np.all(bench.sensor_faults["start"][:1] == NOW_S)
        assert bench.command(INJECT, sensor.failure_unit, OK, 0)[0] == ACCEPTED
        assert bench.listed() == []


def test_inject_failure_of_one_instance_leaves_the_other() -> None:
    bench = Bench()
    bench.command(INJECT, GYRO, STUCK, 0)
    bench.command(INJECT, GYRO, OK, 1)
    bench.command(INJECT, GPS, dialect.FAILURE_TYPE_WRONG, 1)
    assert bench.listed() == [
        "gyro 2 stuck after 10 s, until cleared",
        "gps +50 m after 10 s, until cleared",
    ]


@pytest.mark.parametrize(
    "params",
    [
        (dialect.FAILURE_UNIT_SENSOR_OPTICAL_FLOW, OFF, 0),
        (SERVO, dialect.FAILURE_TYPE_GARBAGE, 0),
        (NAN, OFF, 0),
    ],
)
def test_other_failures_are_refused(params: tuple[float, ...]) -> None:
    bench = Bench()
    assert bench.command(INJECT, *params)[0] == UNSUPPORTED
    assert bench.listed() == []


@pytest.mark.parametrize(
    ("fill", "count", "command"),
    [
        ((SET, 3, 0.5, 0.0, 0.0), MAX_FAULTS - 2, (INJECT, SERVO, OFF, 0)),
        ((SET, 3, 0.5, 0.0, 0.0), MAX_FAULTS - 2, (INJECT, SERVO, STUCK, 0)),
        ((SET_SENSOR, 6, 0, 0, 0), MAX_SENSOR_FAULTS - 1, (INJECT, GYRO, OFF)),
    ],
)
def test_a_failure_that_has_no_room_changes_nothing(
    fill: tuple[float, ...], count: int, command: tuple[float, ...]
) -> None:
    bench = Bench()
    for i in range(count):
        assert bench.command(int(fill[0]), *fill[1:], 20.0 + i, 20.5 + i)[0] == ACCEPTED
    assert "in use" in bench.refusal(command)


def test_a_value_that_is_not_given_is_the_default() -> None:
    bench = Bench()
    bench.command(SET_SENSOR, 6, dialect.FTC_SENSOR_FAULT_KIND_FADE, NAN, 0, NAN, NAN)
    bench.command(SET_SENSOR, 1, BIAS, NAN, 1, NAN, NAN)
    assert bench.listed() == [
        "airspeed fades in 60 s after 10 s, until cleared",
        "gyro 1 +3 deg/s after 10 s, until cleared",
    ]


def test_a_repeated_command_has_no_second_effect() -> None:
    bench = Bench()
    message = dialect.MAVLink_command_long_message(
        UAV, COMPONENT, SET, 0, 2, 0.9, 0, 0, NAN, NAN, 0
    )
    bench.send(message)
    first = bench.faults.copy()
    message.confirmation = 1
    bench.now -= 19.9
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
