"""Faults of the instruments that an ArduPilot is shown by JSON."""

import math

import pytest

from mavlink_defs.faults.fault import Fault
from mavlink_defs.faults.sensors import SENSOR_FAULTS
from sitl_plant.foreign.ardupilot.config import JSON_INSTRUMENTS
from sitl_plant.foreign.ardupilot.instruments import JsonInstruments
from sitl_plant.foreign.ardupilot.protocol import Measured
from sitl_plant.sensing.config import NavigationSensors
from sitl_plant.sensing.failures import fault_table


def motion(step: int) -> Measured:
    x = float(step)
    return Measured(
        time_s=100.0 + x / 1000.0,
        rates=(0.001 * x, 0.0, 0.1),
        specific_force=(0.0, 0.5, -9.8),
        position=(20.0 * x, 3.0, -100.0),
        attitude=(0.1, 0.0, 1.0),
        velocity=(20.0, 0.0, 1.0),
        airspeed=24.0,
        wind=(1.0, 0.0, 0.0),
    )


def shown(sensor: str, kind: str, value: float = 0.0, axis: int = 0) -> list[Measured]:
    """Return what is shown in 20 steps, with a fault in (4, 14] ms."""
    instruments = JsonInstruments(NavigationSensors(), 1.2, 1, 1, 1000)
    target = SENSOR_FAULTS.named(sensor)
    fault = Fault(target, SENSOR_FAULTS.kinds_of(target)[kind], value, 0.004, 0.014, axis=axis)
    fault_table(instruments.failures, 0).set([fault], 0.0)
    return [instruments.shown(step, step / 1000.0, motion(step)) for step in range(20)]


@pytest.mark.parametrize("sensor", JSON_INSTRUMENTS)
def test_outside_its_window_a_fault_changes_nothing(sensor: str) -> None:
    kind, axis = ("bias", 0) if sensor == "airspeed" else ("bias", 1)
    found = shown(sensor, kind, 1.0, axis)
    for step in (0, 4, 15, 19):
        assert found[step]._replace(airspeed=24.0) == motion(step)
        assert found[step].airspeed == pytest.approx(24.0, rel=1e-12)
    assert all(found[step] != motion(step) for step in range(5, 15))


def test_each_acts_on_its_own_quantity() -> None:
    rates = shown("gyro", "bias", 3.0, axis=2)[10].rates
    assert rates == pytest.approx((0.01, math.radians(3.0), 0.1))
    assert shown("accelerometer", "scale", 2.0)[10].specific_force == (0.0, 1.0, -19.6)
    east = shown("gps", "drift", 1000.0, axis=2)[10]
    assert east.position == pytest.approx((200.0, 3.0 + 6.0, -100.0))
    assert east.velocity == motion(10).velocity
    half = shown("airspeed", "scale", 0.5)[10]
    assert half.airspeed == pytest.approx(24.0 * math.sqrt(0.5))
    assert half.rates == motion(10).rates


def test_what_is_stuck_slow_or_late_shows_what_was() -> None:
    assert {one.rates[0] for one in shown("gyro", "stuck")[5:15]} == {0.004}
    slow = [one.rates[0] for one in shown("gyro", "slow", 3.0)[5:15]]
    assert slow == pytest.approx([0.001 * n for n in (5, 5, 5, 8, 8, 8, 11, 11, 11, 14)])
    late = [one.rates[0] for one in shown("gyro", "delayed", 0.003)[8:15]]
    assert late == pytest.approx([0.001 * n for n in range(5, 12)])


def test_one_that_becomes_late_shows_its_last_value_until_then() -> None:
    instruments = JsonInstruments(NavigationSensors(), 1.2, 1, 1, 1000)
    gyro = SENSOR_FAULTS.named("gyro")
    assert instruments.shown(4, 0.004, motion(4)) == motion(4)
    late = Fault(gyro, SENSOR_FAULTS.kinds_of(gyro)["delayed"], 0.5)
    fault_table(instruments.failures, 0).set([late], 0.004)
    found = [instruments.shown(step, step / 1000.0, motion(step)) for step in (5, 6)]
    assert [one.rates[0] for one in found] == [0.005, 0.005]
