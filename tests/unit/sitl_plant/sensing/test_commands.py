"""Fault commands of sensors as the simulator component takes them."""

import math

import numpy as np
import pytest

from mavlink_defs import dialect
from mavlink_defs.fault_kinds import FaultLimits
from mavlink_defs.framing.frames import FramePacker, parse
from mavlink_defs.sensor_fault_kinds import SENSOR_UNITS
from mavlink_defs.sensor_faults import MAX_SENSOR_FAULTS
from mavlink_defs.services.fault_list import FaultList
from sitl_plant.actuators.faults import no_faults
from sitl_plant.loop.service import AircraftService
from sitl_plant.sensing.commands import SensorFaultCommands
from sitl_plant.sensing.failures import SensorRange, new_failures

UAV, COMPONENT = 3, 25
NOW_S = 10.0
SET, CLEAR = dialect.MAV_CMD_FTC_SET_SENSOR_FAULT, dialect.MAV_CMD_FTC_CLEAR_FAULTS
INJECT, REQUEST = dialect.MAV_CMD_INJECT_FAILURE, dialect.MAV_CMD_REQUEST_MESSAGE
ACCEPTED, DENIED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_DENIED
GYRO, GPS = dialect.FAILURE_UNIT_SENSOR_GYRO, dialect.FAILURE_UNIT_SENSOR_GPS
BIAS, OFF = dialect.FTC_SENSOR_FAULT_KIND_BIAS, dialect.FAILURE_TYPE_OFF
NAN = math.nan
RANGES = [
    *(
        SensorRange(name, 1 + k, 0.1, -10.0, 10.0)
        for name in ("gyro", "accelerometer")
        for k in (0, 1)
    ),
    *(SensorRange(name, 1, 0.1, -10.0, 10.0) for name in ("magnetometer", "barometer", "airspeed")),
    SensorRange("gps", 1, 1.0, -1e5, 1e5),
]


class Bench:
    def __init__(self, has_sensors: bool = True) -> None:
        failures = new_failures(RANGES, [UAV], 1, 1000)
        self.faults, units = failures.faults[0], failures.units[0]
        limits = FaultLimits(((-35.0, 35.0),) * 3, 2000.0)
        sensors = SensorFaultCommands(self.faults, units) if has_sensors else None
        rest = (no_faults(1)[0], np.zeros(4), limits, sensors)
        self.service = AircraftService(UAV, COMPONENT, *rest)
        self.packer = FramePacker(UAV, 1)
        self.now = 0.0

    def command(self, number: int, *params: float) -> tuple[int, str]:
        """Send a command; return its result and what was said."""
        self.now += 20.0
        seven = (*params, *[0.0] * 7)[:7]
        message = dialect.MAVLink_command_long_message(UAV, COMPONENT, number, 0, *seven)
        received = parse(self.packer.pack(message))
        assert received is not None
        self.service.receive(received, NOW_S, self.now)
        self.answers = self.service.messages_to_send()
        (ack,) = [m for m in self.answers if isinstance(m, dialect.MAVLink_command_ack_message)]
        texts = [
            str(m.text) for m in self.answers if isinstance(m, dialect.MAVLink_statustext_message)
        ]
        return int(ack.result), "".join(texts)

    def listed(self) -> list[str]:
        self.command(REQUEST, dialect.MAVLINK_MSG_ID_FTC_FAULT)
        found = FaultList()
        for message in self.answers:
            if isinstance(message, dialect.MAVLink_ftc_fault_message):
                received = parse(self.packer.pack(message))
                assert isinstance(received, dialect.MAVLink_ftc_fault_message)
                found.receive(received)
        assert found.complete is not None
        return [fault.describe() for fault in found.complete]


def test_a_fault_with_value_and_window_is_set_listed_and_cleared() -> None:
    bench = Bench()
    assert bench.command(SET, 1, BIAS, 3.0, 2, 19.0, 22.0, 1)[0] == ACCEPTED
    assert bench.command(dialect.MAV_CMD_FTC_SET_FAULT, 2, 0.5, 0, 0, NAN, NAN)[0] == ACCEPTED
    assert bench.listed() == [
        "rudder at 50 % after 10 s, until cleared",
        "gyro 2 x +3 deg/s in (19, 22] s",
    ]
    assert bench.command(CLEAR, 2)[0] == ACCEPTED
    assert bench.listed() == ["gyro 2 x +3 deg/s in (19, 22] s"]
    assert bench.command(CLEAR, -1)[0] == ACCEPTED
    assert bench.listed() == []


@pytest.mark.parametrize("name", SENSOR_UNITS)
def test_every_failure_of_every_sensor_is_executed_by_inject_failure(name: str) -> None:
    unit = SENSOR_UNITS[name]
    for kind in range(1, 8):
        bench = Bench()
        assert bench.command(INJECT, unit.failure_unit, kind, 0)[0] == ACCEPTED
        assert len(bench.listed()) == (2 if unit.has_imus else 1)
        assert np.all(bench.faults["start"][:1] == NOW_S)
        assert bench.command(INJECT, unit.failure_unit, dialect.FAILURE_TYPE_OK, 0)[0] == ACCEPTED
        assert bench.listed() == []


def test_inject_failure_of_one_instance_leaves_the_other() -> None:
    bench = Bench()
    bench.command(INJECT, GYRO, dialect.FAILURE_TYPE_STUCK, 0)
    bench.command(INJECT, GYRO, dialect.FAILURE_TYPE_OK, 1)
    bench.command(INJECT, GPS, dialect.FAILURE_TYPE_WRONG, 1)
    assert bench.listed() == [
        "gyro 2 stuck after 10 s, until cleared",
        "gps +50 m after 10 s, until cleared",
    ]


@pytest.mark.parametrize(
    ("params", "text"),
    [
        ((SET, 0, 0), "Sensor is 0, must be 1 to 6"),
        ((SET, 1, 11), "Kind is 11, must be 0 to 10"),
        ((SET, 1, BIAS, 3000.0), "Value of bias is 3000 deg/s, must be -2000 to 2000 deg/s"),
        ((SET, 5, 5, 2.0), "gps has no scale"),
        ((SET, 1, BIAS, 3.0, 3, NAN, NAN), "Instance is 3, must be 0 (all) to 2 of gyro"),
        ((SET, 1, BIAS, 3.0, 0.5), "Instance is 0.5"),
        ((SET, 1, BIAS, 3.0, 0, -1.0), "Start is -1 s"),
        ((SET, 1, BIAS, 3.0, 0, 5.0, 4.0), "End is 4 s, must be NaN or more than 5 s"),
        ((SET, 1, BIAS, 3.0, 0, NAN, 9.0), "End is 9 s, it is 10 s already"),
        ((SET, 4, BIAS, 3.0, 0, NAN, NAN, 1), "Axis is 1, must be 0 for bias of barometer"),
        ((INJECT, GYRO, 8, 0), "Type is 8, must be 0 (OK) to 7 (intermittent)"),
        ((INJECT, GYRO, NAN, 0), "Type is nan"),
        ((INJECT, GYRO, OFF, 3), "Instance is 3, must be 0 (all) to 2 of gyro"),
        ((INJECT, GPS, OFF, 2), "Instance is 2, must be 0 (all) to 1 of gps"),
        ((INJECT, GYRO, OFF, -1), "Instance is -1"),
        ((INJECT, GYRO, dialect.FAILURE_TYPE_OK, 9), "Instance is 9"),
    ],
)
def test_what_cannot_be_executed_is_refused_with_a_reason(
    params: tuple[float, ...], text: str
) -> None:
    bench = Bench()
    result, said = bench.command(int(params[0]), *params[1:])
    assert result == DENIED
    assert text in said
    assert bench.listed() == []


@pytest.mark.parametrize("params", [(SET, 1, BIAS, 3.0, 0, NAN, NAN), (INJECT, GYRO, OFF)])
def test_an_aircraft_that_flies_by_its_true_state_has_no_such_sensors(
    params: tuple[float, ...],
) -> None:
    bench = Bench(has_sensors=False)
    result, said = bench.command(int(params[0]), *params[1:])
    assert result == DENIED
    assert "has no gyro that could fail" in said
    assert "navigation: estimated" in said
    assert bench.command(CLEAR, -1)[0] == ACCEPTED
    assert bench.listed() == []


def test_a_failure_that_has_no_room_changes_nothing() -> None:
    bench = Bench()
    for i in range(MAX_SENSOR_FAULTS - 1):
        bench.command(SET, 6, 0, 0, 0, 20.0 + i, 20.5 + i)
    before = bench.faults.copy()
    result, said = bench.command(INJECT, GYRO, OFF)
    assert result == DENIED
    assert "slots of sensor faults are in use" in said
    assert np.array_equal(bench.faults, before)


def test_a_value_that_is_not_given_is_the_default() -> None:
    bench = Bench()
    bench.command(SET, 6, dialect.FTC_SENSOR_FAULT_KIND_FADE, NAN, 0, NAN, NAN)
    bench.command(SET, 1, BIAS, NAN, 1, NAN, NAN)
    assert bench.listed() == [
        "airspeed fades in 60 s after 10 s, until cleared",
        "gyro 1 +3 deg/s after 10 s, until cleared",
    ]
