"""The faults of navigation sensors.

Another kind is an entry here, one of FTC_SENSOR_FAULT_KIND in `ftc.xml`, and a branch in
`sitl_plant.sensing.failures`.

MAV_CMD_INJECT_FAILURE names a unit, a failure type and an instance, and has no field for how much.
MAV_CMD_FTC_SET_SENSOR_FAULT is the same with a value and a window. Types are as PX4 describes them
(https://docs.px4.io/main/en/debug/failure_injection): off publishes nothing, stuck the same value
each time, garbage random values, wrong values that still look reasonable, slow at a reduced rate,
delayed valid data late, intermittent now and then.
"""

import math
from typing import Any, Literal, TypeAlias, get_args

from mavlink_defs import dialect
from mavlink_defs.faults.kinds import Family, Kind, Target

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

MAX_INSTANCES = 8
"""Largest number that a sensor can have."""

MAX_SENSOR_FAULTS = 32
"""Sensor faults that one aircraft can hold at a time."""

_GYRO, _ACCEL = dialect.FAILURE_UNIT_SENSOR_GYRO, dialect.FAILURE_UNIT_SENSOR_ACCEL
_MAG, _BARO = dialect.FAILURE_UNIT_SENSOR_MAG, dialect.FAILURE_UNIT_SENSOR_BARO
_GPS, _AIRSPEED = dialect.FAILURE_UNIT_SENSOR_GPS, dialect.FAILURE_UNIT_SENSOR_AIRSPEED

_SENSORS = (
    # 3 deg/s: at once beyond any calibration, and no more than a turn
    Target(
        "gyro", _GYRO, "deg/s", math.radians(1.0), 2000.0, ("bias", 3.0), axes=True, has_imus=True
    ),
    # 1 m/s^2 tilts the vertical by atan(1 / 9.81) = 5.8 deg
    Target("accelerometer", _ACCEL, "m/s^2", 1.0, 160.0, ("bias", 1.0), axes=True, has_imus=True),
    # across a horizontal field of 0.2 gauss it turns the heading by 45 deg
    Target("magnetometer", _MAG, "gauss", 1.0, 10.0, ("bias", 0.2), axes=True),
    # 120 Pa is 10 m near the ground: 1.225 kg/m^3 * 9.81 m/s^2 = 12 Pa/m
    Target("barometer", _BARO, "Pa", 0.01, 50_000.0, ("bias", 120.0), scales=False),
    # a few times what receivers call their accuracy
    Target("gps", _GPS, "m", 1.0, 100_000.0, ("bias", 50.0), axes=True, scales=False),
    # half of the dynamic pressure shows sqrt(1/2) = 71 % of the airspeed
    Target("airspeed", _AIRSPEED, "Pa", 0.01, 10_000.0, ("scale", 0.5)),
)


def _kind(
    name: str, template: str, doc: str = "", unit: str = "", failure: str = "wrong", **how: Any
) -> Kind:
    """Return a kind, of which FTC_SENSOR_FAULT_KIND has the name; `how` as of `Kind`."""
    code = getattr(dialect, f"FTC_SENSOR_FAULT_KIND_{name.upper()}")
    return Kind(name, code, template, (doc,) if doc else (), unit, failure=failure, **how)


_FACTOR: dict[str, Any] = {"suffix": "factor", "low": 1.0, "high": 1000.0, "default": 10.0}
_FADING = "Time in which samples shrink to 0, as of a pitot that ices up."
_NOISE = "Factor of the standard deviation of the white noise."

_KINDS = (
    _kind("off", "off", failure="off"),
    _kind("stuck", "stuck", failure="stuck"),
    _kind("garbage", "reports garbage", failure="garbage"),
    _kind("bias", "{value:+g}{unit}", "Added to every sample.", "{unit}"),
    _kind("drift", "drifts by {value:+g}{unit}", "Growth of what is added.", "{unit}/s"),
    _kind("scale", "times {value:g}", "Factor of every sample.", low=-10.0, high=10.0, scales=True),
    _kind(
        "fade",
        "fades in {value:g}{unit}",
        _FADING,
        "s",
        low=0.1,
        high=3600.0,
        default=60.0,
        scales=True,
    ),
    _kind("noise", "noise times {value:g}", _NOISE, **_FACTOR),
    _kind(
        "slow",
        "slow, 1 sample in {value:g}",
        "One sample in this many is reported.",
        failure="slow",
        **_FACTOR,
    ),
    # beyond the 0.2 s of samples that PX4's EKF2 can wait for (EKF2_DELAY_MAX)
    _kind(
        "delayed",
        "delayed by {value:g}{unit}",
        "Delay of every sample.",
        "s",
        "delayed",
        high=MAX_DELAY_S,
        default=0.5,
    ),
    _kind(
        "intermittent",
        "off and on at {value:g}{unit}",
        "Frequency of off and on.",
        "Hz",
        failure="intermittent",
        low=0.01,
        high=100.0,
        default=1.0,
    ),
)

SENSOR_FAULTS = Family(
    key="sensor",
    what="a navigation sensor",
    targets=_SENSORS,
    kinds=_KINDS,
    command=dialect.MAV_CMD_FTC_SET_SENSOR_FAULT,
    params=("number", "code", "value", "instance", "start_s", "end_s", "axis"),
    most=MAX_SENSOR_FAULTS,
    first=1,
    title="Sensor fault",
    numbers="1 to 6",
    slots="slots of sensor faults",
)
