"""Sensor faults as MAV_CMD_FTC_SET_SENSOR_FAULT and MAV_CMD_INJECT_FAILURE carry them."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple, Self, TypeAlias

from mavlink_defs.dialect import MAVLink_ftc_fault_message
from mavlink_defs.fault_window import Window
from mavlink_defs.faults import Fault, InvalidParam, check_window, invalid_param, is_within
from mavlink_defs.float32 import decimal_of_float32
from mavlink_defs.sensor_fault_kinds import (
    AXIS_NAMES,
    FAILURES,
    SENSOR_FAULT_KINDS,
    SENSOR_NAMES,
    SENSOR_UNITS,
    Failure,
    SensorFaultKind,
    SensorUnit,
)

MAX_SENSOR_FAULTS = 32
"""Sensor faults that one aircraft can hold at a time."""

_KINDS = tuple(SENSOR_FAULT_KINDS.values())


class SensorFault(NamedTuple):
    """One fault of a sensor: the seven parameters of the command, in their order.

    Attributes:
        sensor: FTC_SENSOR.
        code: FTC_SENSOR_FAULT_KIND.
        value: What the kind makes of it, in its unit.
        instance: Number of the sensor from 1; 0 for all.
        start_s: Start in simulation time, exclusive; NaN for now [s].
        end_s: End in simulation time, inclusive; NaN for until cleared [s].
        axis: FTC_AXIS.
    """

    sensor: int
    code: int
    value: float = 0.0
    instance: int = 0
    start_s: float = math.nan
    end_s: float = math.nan
    axis: int = 0

    @classmethod
    def from_message(cls, message: MAVLink_ftc_fault_message) -> Self:
        """Decode an FTC_FAULT of a sensor; an open end is infinite."""
        return cls(
            message.sensor,
            message.kind,
            decimal_of_float32(message.value),
            message.instance,
            decimal_of_float32(message.start),
            decimal_of_float32(message.end),
            message.axis,
        )

    @property
    def unit(self) -> SensorUnit:
        """The sensor that fails."""
        return SENSOR_UNITS[SENSOR_NAMES[self.sensor - 1]]

    @property
    def kind(self) -> SensorFaultKind:
        """Its kind."""
        return _KINDS[self.code]

    @property
    def target(self) -> str:
        """What fails: "gyro 1", or "airspeed" of which there is one."""
        unit = self.unit
        return f"{unit.name} {self.instance}" if unit.has_imus and self.instance else unit.name

    @property
    def window(self) -> Window:
        """When it acts."""
        return Window(self.start_s, self.end_s)

    def describe(self) -> str:
        """Return the fault as a text: "gyro 1 x +3 deg/s in (19, 22] s"."""
        return " ".join((*self.parts(), str(self.window)))

    def parts(self) -> tuple[str, str]:
        """Return what fails, and how, as texts: "gyro 1 x", "+3 deg/s"."""
        unit, kind = self.unit, self.kind
        axis = f" {AXIS_NAMES[self.axis - 1]}" if self.axis else ""
        what = kind.template.format(value=self.value)
        value_unit = kind.unit_of(unit) if kind.has_value else ""
        return f"{self.target}{axis}", f"{what} {value_unit}".rstrip()

    def as_dict(self, time_s: float | None) -> dict[str, Any]:
        """Return the fault as plain data; its end is None if it lasts until cleared.

        Args:
            time_s: Simulation time [s]; None if unknown.
        """
        kind = self.kind
        return {
            "sensor": self.unit.name,
            "instance": self.instance,
            "failure": kind.failure,
            **({kind.key(self.unit): self.value} if kind.has_value else {}),
            **({"axis": AXIS_NAMES[self.axis - 1]} if self.axis else {}),
            **self.window.as_dict(time_s),
        }

    def resolved(self, now_s: float) -> Self:
        """Return the fault as set at `now_s` [s]: NaN becomes now or, for the end, infinity."""
        return self._replace(**self.window.resolved(now_s)._asdict())


AnyFault: TypeAlias = Fault | SensorFault
"""A fault of an actuator or of a sensor."""


def stays(old: AnyFault, new: AnyFault, now_s: float) -> bool:
    """Return whether a fault stays when another one is set.

    Args:
        old: The earlier fault.
        new: The other one, `resolved`.
        now_s: Simulation time at which it is set [s].
    """
    if isinstance(new, Fault) and isinstance(old, Fault):
        return new.coexists_with(old.actuator, old.start_s, old.end_s, now_s)
    same = False
    if isinstance(new, SensorFault) and isinstance(old, SensorFault):
        same = old.sensor == new.sensor and new.instance in {0, old.instance}
    return old.end_s > now_s and not (same and new.window.overlaps(old.window))


def sensor_fault_from_params(params: Sequence[float]) -> SensorFault:
    """Decode and check the seven parameters of MAV_CMD_FTC_SET_SENSOR_FAULT.

    How many instances there are, only the plant knows.

    Args:
        params: Parameters 1 to 7 as they came off the wire (float32 values).

    Raises:
        InvalidParam: A parameter is not finite or out of range; the first one is named.
    """
    sensor, code, value, instance, start, end, axis = map(decimal_of_float32, params)
    if sensor not in range(1, 1 + len(SENSOR_NAMES)):
        raise _invalid(1, "Sensor", sensor, f"1 to {len(SENSOR_NAMES)}")
    if code not in range(len(_KINDS)):
        raise _invalid(2, "Kind", code, f"0 to {len(_KINDS) - 1}")
    unit, kind = SENSOR_UNITS[SENSOR_NAMES[int(sensor) - 1]], _KINDS[int(code)]
    if not kind.fits(unit):
        text = f"Sensor fault: {unit.name} has no {kind.name}, did you mean bias or drift?"
        raise InvalidParam(2, "Kind", text)
    if not kind.has_value:
        value = 0.0
    elif math.isnan(value):
        value = unit.wrong[1] if kind.name == unit.wrong[0] else kind.default
    if kind.has_value and not is_within(value, kind.bounds(unit)):
        (low, high), of = kind.bounds(unit), kind.unit_of(unit)
        raise _invalid(3, f"Value of {kind.name}", value, f"{low:g} to {high:g} {of}".rstrip(), of)
    if not 0.0 <= instance < math.inf or instance % 1.0:
        raise _invalid(4, "Instance", instance, "0 for all, or a number from 1 on")
    check_window("Sensor fault", start, end)
    axes = len(AXIS_NAMES) if unit.axes and kind.wrongs else 0
    if axis not in range(1 + axes):
        expected = f"0 to {axes}" if axes else "0"
        raise _invalid(7, "Axis", axis, f"{expected} for {kind.name} of {unit.name}")
    return SensorFault(int(sensor), int(code), value, int(instance), start, end, int(axis))


def failure_from_params(params: Sequence[float]) -> tuple[SensorUnit, int, Failure | None] | None:
    """Decode MAV_CMD_INJECT_FAILURE of a sensor: the sensor, FAILURE instance and type.

    Args:
        params: Parameters of the command as they came off the wire.

    Returns:
        None if the unit is none of these sensors; a type of None is FAILURE_TYPE_OK.

    Raises:
        InvalidParam: Type or instance is out of range.
    """
    number, kind, instance = params[:3]
    unit = next((u for u in SENSOR_UNITS.values() if u.failure_unit == number), None)
    if unit is None:
        return None
    if kind not in range(1 + len(FAILURES)):
        text = f"Failure: Type is {kind:g}, must be 0 (OK) to {len(FAILURES)} (intermittent)"
        raise InvalidParam(2, "Type", text)
    if not 0.0 <= instance < math.inf or instance % 1.0:
        text = f"Failure: Instance is {instance:g}, must be 0 for all or a number from 1 on"
        raise InvalidParam(3, "Instance", text)
    return unit, int(instance), FAILURES[int(kind) - 1] if kind else None


def _invalid(index: int, name: str, value: float, expected: str, unit: str = "") -> InvalidParam:
    return invalid_param("Sensor fault", index, name, value, expected, unit)
