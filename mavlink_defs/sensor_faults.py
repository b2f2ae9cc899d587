"""Faults of navigation sensors: kinds, values, and the command that sets one.

MAV_CMD_INJECT_FAILURE names a unit, a failure type and an instance, and has no field for how much.
MAV_CMD_FTC_SET_SENSOR_FAULT is the same with a value and a window. Types are as PX4 describes them
(https://docs.px4.io/main/en/debug/failure_injection): off publishes nothing, stuck the same value
each time, garbage random values, wrong values that still look reasonable, slow at a reduced rate,
delayed valid data late, intermittent now and then.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Self, TypeAlias, get_args

from mavlink_defs import dialect
from mavlink_defs.dialect import MAVLink_ftc_fault_message
from mavlink_defs.faults import InvalidParam
from mavlink_defs.float32 import decimal_of_float32

SensorName: TypeAlias = Literal[
    "gyro", "accelerometer", "magnetometer", "barometer", "gps", "airspeed"
]

SENSOR_NAMES: tuple[SensorName, ...] = get_args(SensorName)
"""Names of the sensors, in the order of FTC_SENSOR from 1 on."""

Failure: TypeAlias = Literal["off", "stuck", "garbage", "wrong", "slow", "delayed", "intermittent"]

FAILURES: tuple[Failure, ...] = get_args(Failure)
"""MAVLink's FAILURE_TYPE from OFF on, in its order."""

Axis: TypeAlias = Literal["x", "y", "z"]

AXIS_NAMES: tuple[Axis, ...] = get_args(Axis)
"""Axes, in the order of FTC_AXIS from 1 on."""

MAX_DELAY_S = 1.0
"""Longest delay of a sensor's samples [s]."""

MAX_SENSOR_FAULTS = 32
"""Sensor faults that one aircraft can hold at a time."""

_TOLERANCE = 1.0 + 1e-9


@dataclass(frozen=True)
class SensorUnit:
    """How one sensor can be wrong.

    Attributes:
        name: Of the sensor.
        failure_unit: FAILURE_UNIT.
        unit: Of its bias, as people read it.
        per_sample: A unit of the bias in that of the samples (see `sitl_plant.sensing.failures`).
        most: Largest bias that can be set [unit].
        wrong: Kind and value of FAILURE_TYPE_WRONG without a value.
        axes: Whether it has three axes.
        has_imus: Whether each IMU has one.
        scales: Whether a scale of its samples means anything: neither a position nor the pressure
            of the air is 0 in flight.
    """

    name: SensorName
    failure_unit: int
    unit: str
    per_sample: float
    most: float
    wrong: tuple[str, float]
    axes: bool = False
    has_imus: bool = False
    scales: bool = True


SENSOR_UNITS: Mapping[str, SensorUnit] = {
    unit.name: unit
    for unit in (
        # 3 deg/s: at once beyond any calibration, and no more than a turn
        SensorUnit(
            "gyro",
            dialect.FAILURE_UNIT_SENSOR_GYRO,
            "deg/s",
            math.radians(1.0),
            2000.0,
            ("bias", 3.0),
            axes=True,
            has_imus=True,
        ),
        # 1 m/s^2 tilts the vertical by atan(1 / 9.81) = 5.8 deg
        SensorUnit(
            "accelerometer",
            dialect.FAILURE_UNIT_SENSOR_ACCEL,
            "m/s^2",
            1.0,
            160.0,
            ("bias", 1.0),
            axes=True,
            has_imus=True,
        ),
        # across a horizontal field of 0.2 gauss it turns the heading by 45 deg
        SensorUnit(
            "magnetometer",
            dialect.FAILURE_UNIT_SENSOR_MAG,
            "gauss",
            1.0,
            10.0,
            ("bias", 0.2),
            axes=True,
        ),
        # 120 Pa is 10 m near the ground: 1.225 kg/m^3 * 9.81 m/s^2 = 12 Pa/m
        SensorUnit(
            "barometer",
            dialect.FAILURE_UNIT_SENSOR_BARO,
            "Pa",
            0.01,
            50_000.0,
            ("bias", 120.0),
            scales=False,
        ),
        # a few times what receivers call their accuracy
        SensorUnit(
            "gps",
            dialect.FAILURE_UNIT_SENSOR_GPS,
            "m",
            1.0,
            100_000.0,
            ("bias", 50.0),
            axes=True,
            scales=False,
        ),
        # half of the dynamic pressure shows sqrt(1/2) = 71 % of the airspeed
        SensorUnit(
            "airspeed",
            dialect.FAILURE_UNIT_SENSOR_AIRSPEED,
            "Pa",
            0.01,
            10_000.0,
            ("scale", 0.5),
        ),
    )
}
"""All sensors by name, in the order of FTC_SENSOR from 1 on."""


@dataclass(frozen=True)
class SensorFaultKind:
    """One kind of sensor fault; its number is its place in `SENSOR_FAULT_KINDS`.

    Attributes:
        name: In keys, options and campaigns.
        failure: The FAILURE_TYPE that it is an instance of.
        doc: What the value means; empty if there is none.
        template: The fault in a text, with ``{value}`` and its unit.
        unit: Of the value; ``{unit}`` is that of the sensor's bias.
        low: Least value.
        high: Largest value; infinite: the sensor's own `most`, on either side.
        default: Value if none is given; NaN: one must be.
        wrongs: Whether samples are wrong, which a single axis can be.
        scales: Whether it multiplies samples.
    """

    name: str
    failure: Failure
    doc: str = ""
    template: str = ""
    unit: str = ""
    low: float = 0.0
    high: float = 0.0
    default: float = math.nan
    wrongs: bool = False
    scales: bool = False

    @property
    def has_value(self) -> bool:
        """Whether the kind has a value."""
        return bool(self.doc)

    @property
    def code(self) -> int:
        """FTC_SENSOR_FAULT_KIND."""
        return list(SENSOR_FAULT_KINDS).index(self.name)

    def fits(self, sensor: SensorUnit) -> bool:
        """Return whether a sensor can fail in this way."""
        return sensor.scales or not self.scales

    def unit_of(self, sensor: SensorUnit) -> str:
        """Return the unit of the value, such as "deg/s" or "Pa/s"."""
        unit = self.unit.format(unit=sensor.unit)
        return unit.replace("deg/s/s", "deg/s^2").replace("m/s^2/s", "m/s^3")

    def key(self, sensor: SensorUnit) -> str:
        """Return the key of the value in a scenario: ``bias_deg_s``, ``slow_factor``."""
        unit = self.unit_of(sensor) or ("factor" if self.name in {"slow", "noise"} else "")
        unit = unit.lower().replace("/", "_").replace("^", "")
        return f"{self.name}_{unit}" if unit else self.name

    def bounds(self, sensor: SensorUnit) -> tuple[float, float]:
        """Return the least and the largest value of a sensor, in its unit."""
        return (-sensor.most, sensor.most) if math.isinf(self.high) else (self.low, self.high)


_OWN = math.inf

SENSOR_FAULT_KINDS: Mapping[str, SensorFaultKind] = {
    kind.name: kind
    for kind in (
        SensorFaultKind("off", "off", template="off"),
        SensorFaultKind("stuck", "stuck", template="stuck"),
        SensorFaultKind("garbage", "garbage", template="reports garbage"),
        SensorFaultKind(
            "bias",
            "wrong",
            "Added to every sample.",
            "{value:+g}",
            "{unit}",
            high=_OWN,
            wrongs=True,
        ),
        SensorFaultKind(
            "drift",
            "wrong",
            "Rate at which what is added grows.",
            "drifts by {value:+g}",
            "{unit}/s",
            high=_OWN,
            wrongs=True,
        ),
        SensorFaultKind(
            "scale",
            "wrong",
            "Factor of every sample.",
            "times {value:g}",
            low=-10.0,
            high=10.0,
            wrongs=True,
            scales=True,
        ),
        SensorFaultKind(
            "fade",
            "wrong",
            "Time in which samples shrink to 0, as of a pitot that ices up.",
            "fades in {value:g}",
            "s",
            low=0.1,
            high=3600.0,
            default=60.0,
            wrongs=True,
            scales=True,
        ),
        SensorFaultKind(
            "noise",
            "wrong",
            "Factor of the standard deviation of the white noise.",
            "noise times {value:g}",
            low=1.0,
            high=1000.0,
            default=10.0,
            wrongs=True,
        ),
        SensorFaultKind(
            "slow",
            "slow",
            "One sample in as many is reported.",
            "slow, 1 sample in {value:g}",
            low=1.0,
            high=1000.0,
            default=10.0,
        ),
        # beyond the 0.2 s of samples that PX4's EKF2 can wait for (EKF2_DELAY_MAX)
        SensorFaultKind(
            "delayed",
            "delayed",
            "Delay of every sample.",
            "delayed by {value:g}",
            "s",
            low=0.0,
            high=MAX_DELAY_S,
            default=0.5,
        ),
        SensorFaultKind(
            "intermittent",
            "intermittent",
            "Frequency of off and on.",
            "off and on at {value:g}",
            "Hz",
            low=0.01,
            high=100.0,
            default=1.0,
        ),
    )
}
"""All kinds by name, in the order of FTC_SENSOR_FAULT_KIND."""

_KINDS = tuple(SENSOR_FAULT_KINDS.values())


def default_of(failure: Failure, sensor: SensorUnit) -> tuple[SensorFaultKind, float]:
    """Return what a FAILURE_TYPE does to a sensor if nobody says how much: kind and value."""
    if failure == "wrong":
        name, value = sensor.wrong
        return SENSOR_FAULT_KINDS[name], value
    kind = SENSOR_FAULT_KINDS[failure]
    return kind, kind.default if kind.has_value else 0.0


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

    def describe(self) -> str:
        """Return the fault as a text: "gyro 1 x +3 deg/s in (19, 22] s"."""
        unit, kind = self.unit, self.kind
        axis = f" {AXIS_NAMES[self.axis - 1]}" if self.axis else ""
        what = kind.template.format(value=self.value)
        value_unit = kind.unit_of(unit) if kind.has_value else ""
        return f"{self.target}{axis} {what} {value_unit}".rstrip() + " " + self._window()

    def _window(self) -> str:
        ends = f"{self.end_s:g}] s" if math.isfinite(self.end_s) else "until cleared"
        if math.isnan(self.start_s):
            return f"from now, {ends}"
        if math.isfinite(self.end_s):
            return f"in ({self.start_s:g}, {ends}"
        return f"after {self.start_s:g} s, {ends}"

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
            "start_s": self.start_s,
            "end_s": self.end_s if math.isfinite(self.end_s) else None,
            "active": time_s is not None and self.is_active(time_s),
        }

    def is_active(self, time_s: float) -> bool:
        """Return whether its window contains a simulation time [s]."""
        return self.start_s < time_s <= self.end_s

    def resolved(self, now_s: float) -> Self:
        """Return the fault as set at `now_s` [s]: NaN becomes now or, for the end, infinity."""
        return self._replace(
            start_s=now_s if math.isnan(self.start_s) else self.start_s,
            end_s=math.inf if math.isnan(self.end_s) else self.end_s,
        )


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
        text = f"Sensor fault: a {unit.name} has no {kind.name}, did you mean bias or drift?"
        raise InvalidParam(2, "Kind", text)
    if not kind.has_value:
        value = 0.0
    elif math.isnan(value):
        value = unit.wrong[1] if kind.name == unit.wrong[0] else kind.default
    low, high = kind.bounds(unit)
    if not low * _TOLERANCE <= value <= high * _TOLERANCE and kind.has_value:  # false for NaN
        of = kind.unit_of(unit)
        raise _invalid(3, f"Value of {kind.name}", value, f"{low:g} to {high:g} {of}".rstrip(), of)
    if not 0.0 <= instance < math.inf or instance % 1.0:
        raise _invalid(4, "Instance", instance, "0 for all, or a number from 1 on")
    if not math.isnan(start) and not 0.0 <= start < math.inf:
        raise _invalid(5, "Start", start, "NaN or at least 0 s", "s")
    earliest = 0.0 if math.isnan(start) else start
    if not math.isnan(end) and not end > earliest:
        raise _invalid(6, "End", end, f"NaN or more than {earliest:g} s", "s")
    axes = len(AXIS_NAMES) if unit.axes and kind.wrongs else 0
    if axis not in range(1 + axes):
        raise _invalid(7, "Axis", axis, f"0 to {axes} of {kind.name} of a {unit.name}")
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
    shown = f"{value:g} {unit}".rstrip()
    return InvalidParam(index, name, f"Sensor fault: {name} is {shown}, must be {expected}")
