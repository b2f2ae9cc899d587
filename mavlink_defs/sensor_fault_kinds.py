"""The kinds of sensor faults: one table for files, commands, forms, texts and campaigns.

MAV_CMD_INJECT_FAILURE names a unit, a failure type and an instance, and has no field for how much.
MAV_CMD_FTC_SET_SENSOR_FAULT is the same with a value and a window. Types are as PX4 describes them
(https://docs.px4.io/main/en/debug/failure_injection): off publishes nothing, stuck the same value
each time, garbage random values, wrong values that still look reasonable, slow at a reduced rate,
delayed valid data late, intermittent now and then.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

from mavlink_defs import dialect

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


@dataclass(frozen=True)
class SensorUnit:
    """How one sensor can be wrong.

    Attributes:
        name: Of the sensor.
        failure_unit: FAILURE_UNIT.
        unit: Of its bias, as people read it.
        per_sample: A unit of the bias in units of the samples (see `sitl_plant.sensing.failures`).
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
        unit: Of the value; ``{unit}`` is the unit of the sensor's bias.
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
    def is_shared(self) -> bool:
        """Whether its value has the same unit for all sensors."""
        return "{" not in self.unit

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
            "Growth of what is added.",
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
            "One sample in this many is reported.",
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


def default_of(failure: Failure, sensor: SensorUnit) -> tuple[SensorFaultKind, float]:
    """Return what a FAILURE_TYPE does to a sensor if nobody says how much: kind and value."""
    if failure == "wrong":
        name, value = sensor.wrong
        return SENSOR_FAULT_KINDS[name], value
    kind = SENSOR_FAULT_KINDS[failure]
    return kind, kind.default if kind.has_value else 0.0
