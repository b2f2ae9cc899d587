"""Faults of the navigation sensors of an aircraft: what they make of samples.

A sensor hands its sample to `fail` once in a step, in the units of `Target.per_unit`: gyro
[rad/s], accelerometer [m/s^2], magnetometer [gauss], barometer and airspeed [hPa], as HIL_SENSOR
has them; a GPS its position [m] and its velocity [m/s], NED. What comes back is reported. A fault
is the sensor's own: it acts on the sample with its noise, and what is wrong stays within the range.

Random numbers depend on seed, aircraft, channel and step alone, and so does all memory: a second
call for the same step makes the same.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mavlink_defs.dialect import (
    FTC_SENSOR_FAULT_KIND_BIAS,
    FTC_SENSOR_FAULT_KIND_DELAYED,
    FTC_SENSOR_FAULT_KIND_DRIFT,
    FTC_SENSOR_FAULT_KIND_FADE,
    FTC_SENSOR_FAULT_KIND_GARBAGE,
    FTC_SENSOR_FAULT_KIND_INTERMITTENT,
    FTC_SENSOR_FAULT_KIND_NOISE,
    FTC_SENSOR_FAULT_KIND_OFF,
    FTC_SENSOR_FAULT_KIND_SCALE,
    FTC_SENSOR_FAULT_KIND_SLOW,
    FTC_SENSOR_FAULT_KIND_STUCK,
)
from mavlink_defs.faults.sensors import MAX_DELAY_S, SENSOR_FAULTS, SENSOR_NAMES
from mavlink_defs.faults.table import FaultTable, no_faults
from mavlink_defs.runtime.jit import compiled
from sitl_plant.air.gaussian import normal

VALUES = 6
"""Most quantities in a sample: a GPS has them."""

MAX_SLOTS = 2000
"""Most samples that a delay line holds; of a longer one the oldest are dropped."""

_CHANNEL = 1000  # of the random numbers, above all channels of healthy sensors

UNIT = np.dtype(
    [
        ("sensor", "i8"),  # FTC_SENSOR
        ("instance", "i8"),  # from 1
        ("values", "i8"),  # quantities in a sample
        ("seed", "i8"),
        ("system", "i8"),  # the aircraft's id
        ("step_us", "i8"),  # control period
        ("noise", "f8", (VALUES,)),  # standard deviation of a sample's white noise
        ("low", "f8", (VALUES,)),  # range of a sample
        ("high", "f8", (VALUES,)),
        ("held", "f8", (VALUES,)),  # the last sample before it was stuck
        ("has_held", "i8"),
        ("step", "i8"),  # of the last call, -1: none
        ("count", "i8"),  # fresh samples since the onset of a fault that makes it slow
        ("first", "i8"),  # oldest entry of the delay line
        ("length", "i8"),  # entries in it
        ("popped", "i8"),  # step in which `late` left it, -1: none
        ("late", "f8", (VALUES,)),
    ]
)
"""One sensor of one aircraft, as far as its faults need to know it."""

_VALUES_OF = {"gyro": 3, "accelerometer": 3, "magnetometer": 3, "gps": 6}


class SensorRange(NamedTuple):
    """One sensor as its faults need to know it, in units of its samples.

    Attributes:
        sensor: Its name.
        instance: Its number, from 1.
        noise: Standard deviation of the white noise of a sample, of each quantity.
        low: Least value of each quantity.
        high: Largest value of each quantity.
    """

    sensor: str
    instance: int
    noise: Sequence[float] | float
    low: Sequence[float] | float
    high: Sequence[float] | float


class Failures(NamedTuple):
    """The faults of n aircraft with the same u sensors, and what they have to remember."""

    faults: np.ndarray  # (n, MAX_SENSOR_FAULTS), dtype FAULT
    units: np.ndarray  # (n, u), dtype UNIT, in the order of the ranges
    line: np.ndarray  # (n, u, slots, VALUES), samples on their way through a delay
    line_steps: np.ndarray  # (n, u, slots), when they entered it


def new_failures(
    ranges: Sequence[SensorRange], systems: Sequence[int], seed: int, step_us: int
) -> Failures:
    """Return no faults of the sensors of n aircraft.

    Args:
        ranges: The sensors of each aircraft; their places here are the `unit` of `fail`.
        systems: System ids of the aircraft.
        seed: Seed of the simulation.
        step_us: Control period [us].
    """
    units = np.zeros((len(systems), len(ranges)), UNIT)
    units["seed"], units["step"], units["popped"] = seed, -1, -1
    units["step_us"] = step_us
    units["system"] = np.array(systems)[:, None]
    for k, one in enumerate(ranges):
        unit = units[:, k]
        unit["sensor"] = 1 + SENSOR_NAMES.index(one.sensor)
        unit["instance"] = one.instance
        values = _VALUES_OF.get(one.sensor, 1)
        unit["values"] = values
        for name in ("noise", "low", "high"):
            unit[name][:, :values] = getattr(one, name)
    slots = min(round(MAX_DELAY_S * 1e6 / step_us) + 1, MAX_SLOTS)
    shape = (*units.shape, slots)
    faults = no_faults(SENSOR_FAULTS, len(systems))
    return Failures(faults, units, np.zeros((*shape, VALUES)), np.zeros(shape, np.int64))


def fault_table(failures: Failures, i: int) -> FaultTable:
    """Return the faults of the sensors of an aircraft."""
    instances: dict[str, list[int]] = {}
    for unit in failures.units[i]:
        name = SENSOR_NAMES[unit["sensor"] - 1]
        instances.setdefault(name, []).append(int(unit["instance"]))
    return FaultTable(SENSOR_FAULTS, failures.faults[i], instances)


@compiled
def fail(
    failures: Failures, i: int, unit: int, step: int, t: float, values: np.ndarray, fresh: bool
) -> bool:
    """Let the fault of a sensor act on what it reports in a step.

    Args:
        failures: Faults and sensors of all aircraft; what is remembered changes.
        i: Index of the aircraft.
        unit: Index of the sensor among its `ranges`.
        step: Step number.
        t: Simulation time of the step [s].
        values: The sample, shape (at least `values` of the unit,), changed in place.
        fresh: Whether the sensor has a new sample in this step.

    Returns:
        Whether it reports one.
    """
    one, faults = failures.units[i, unit], failures.faults[i]
    k = _acting(faults, one, t)
    again = one["step"] == step
    one["step"] = step
    if k < 0:
        one["count"], one["length"] = 0, 0
        if fresh:
            _hold(one, values)
        return fresh
    fault = faults[k]
    code = fault["code"]
    if code == FTC_SENSOR_FAULT_KIND_OFF:
        return False
    if code == FTC_SENSOR_FAULT_KIND_INTERMITTENT:
        return fresh and ((t - fault["start"]) * fault["value"]) % 1.0 >= 0.5
    if code == FTC_SENSOR_FAULT_KIND_DELAYED:
        late = round(fault["value"] * 1e6 / one["step_us"])
        return _delay(failures, i, unit, step, late, values, fresh and not again)
    if code == FTC_SENSOR_FAULT_KIND_SLOW:
        if fresh and not again:
            one["count"] += 1
        return fresh and (one["count"] - 1) % max(1, round(fault["value"])) == 0
    if fresh:
        _falsify(one, fault, step, t, values)
    return fresh


@compiled
def _acting(faults: np.ndarray, one: np.void, t: float) -> int:
    """Return the index of the fault that acts on a sensor at a time, or -1: at most one does."""
    for k in range(len(faults)):
        fault = faults[k]
        if fault["target"] < 0:
            return -1
        is_of = fault["target"] == one["sensor"] and fault["instance"] == one["instance"]
        if is_of and fault["start"] < t <= fault["end"]:
            return k
    return -1


@compiled
def _hold(one: np.void, values: np.ndarray) -> None:
    for j in range(one["values"]):
        one["held"][j] = values[j]
    one["has_held"] = 1


@compiled
def _falsify(one: np.void, fault: np.void, step: int, t: float, values: np.ndarray) -> None:
    """Change a sample by a fault that changes values, and keep it within the range."""
    code, value, since = fault["code"], fault["value"], t - fault["start"]
    if code == FTC_SENSOR_FAULT_KIND_STUCK and one["has_held"] == 0:
        _hold(one, values)
    channel = _CHANNEL + VALUES * (8 * one["sensor"] + one["instance"])
    for j in range(one["values"]):
        if code == FTC_SENSOR_FAULT_KIND_STUCK:
            values[j] = one["held"][j]
            continue
        low, high = one["low"][j], one["high"][j]
        number = 0.0
        if code in (FTC_SENSOR_FAULT_KIND_GARBAGE, FTC_SENSOR_FAULT_KIND_NOISE):
            number = normal(one["seed"], one["system"], channel + j, step)
        if code == FTC_SENSOR_FAULT_KIND_GARBAGE:
            # the distribution function makes a normal number a uniform one
            values[j] = low + (high - low) * 0.5 * math.erfc(-number / math.sqrt(2.0))
            continue
        if fault["axis"] != 0 and fault["axis"] != j + 1:
            continue
        is_position = j < 3  # of a GPS; its velocity has no bias
        if code == FTC_SENSOR_FAULT_KIND_BIAS and is_position:
            values[j] += value
        elif code == FTC_SENSOR_FAULT_KIND_DRIFT and is_position:
            values[j] += value * since
        elif code == FTC_SENSOR_FAULT_KIND_SCALE:
            values[j] *= value
        elif code == FTC_SENSOR_FAULT_KIND_FADE:
            values[j] *= max(0.0, 1.0 - since / value)
        elif code == FTC_SENSOR_FAULT_KIND_NOISE:
            # with the noise that is in the sample already: variances of independent noises add
            values[j] += math.sqrt(value * value - 1.0) * one["noise"][j] * number
        values[j] = min(max(values[j], low), high)


@compiled
def _delay(
    failures: Failures, i: int, unit: int, step: int, late: int, values: np.ndarray, enters: bool
) -> bool:
    """Pass a sample through a line of `late` steps; return whether one leaves it in this step."""
    one, line, steps = failures.units[i, unit], failures.line[i, unit], failures.line_steps[i, unit]
    slots, n = len(steps), one["values"]
    if enters:
        if one["length"] == slots:
            one["first"], one["length"] = (one["first"] + 1) % slots, slots - 1
        at = (one["first"] + one["length"]) % slots
        for j in range(n):
            line[at, j] = values[j]
        steps[at] = step
        one["length"] += 1
    while one["length"] > 0 and steps[one["first"]] + late <= step:
        for j in range(n):
            one["late"][j] = line[one["first"], j]
        one["first"], one["length"] = (one["first"] + 1) % slots, one["length"] - 1
        one["popped"] = step
    if one["popped"] != step:
        return False
    for j in range(n):
        values[j] = one["late"][j]
    return True
