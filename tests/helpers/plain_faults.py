"""Faults as tests write them: by the parameters of their commands, unchecked."""

import math
from typing import Any

import numpy as np

from mavlink_defs.faults.actuators import ACTUATOR_FAULTS
from mavlink_defs.faults.fault import Fault
from mavlink_defs.faults.kinds import Family
from mavlink_defs.faults.sensors import SENSOR_FAULTS
from mavlink_defs.faults.table import FaultTable


def actuator_fault(
    actuator: int,
    effectiveness: float,
    value: float,
    frequency_hz: float,
    start_s: float,
    end_s: float,
    code: int = 0,
) -> Fault:
    target, kind = _named(ACTUATOR_FAULTS, actuator, code, effectiveness)
    times = (start_s, end_s)
    return Fault(target, kind, value, *times, effectiveness, frequency_hz)


def sensor_fault(
    sensor: int,
    code: int,
    value: float = 0.0,
    instance: int = 0,
    start_s: float = math.nan,
    end_s: float = math.nan,
    axis: int = 0,
) -> Fault:
    target, kind = _named(SENSOR_FAULTS, sensor, code)
    return Fault(target, kind, value, start_s, end_s, instance=instance, axis=axis)


def _named(family: Family, number: int, code: int, effectiveness: float = 0.0) -> Any:
    return family.target(number), family.kind(code, effectiveness)


def add_fault(rows: np.ndarray, fault: Fault, now_s: float) -> None:
    """Put a fault of an actuator into one aircraft's rows."""
    FaultTable(fault.family, rows).set([fault], now_s)
