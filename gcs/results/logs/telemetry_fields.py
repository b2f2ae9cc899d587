"""Messages of telemetry as channels: which fields they are, and what has to be done to them."""

from collections.abc import Iterator

import numpy as np

from gcs.results.logs import names
from gcs.results.logs.fields import (
    Fields,
    Values,
    channels_of,
    numbered,
    vector,
    with_angles,
    with_course,
)
from gcs.results.logs.table import LogChannel
from gcs.results.logs.telemetry_systems import HeardSystem
from gcs.results.quantities import QUANTITIES
from mavlink_defs import dialect

ARDUPILOT, PX4 = dialect.MAV_AUTOPILOT_ARDUPILOTMEGA, dialect.MAV_AUTOPILOT_PX4
_OURS = "FTC_TRACKING"

_ATTITUDE: Fields = {
    **vector(names.ATTITUDE, "roll pitch yaw", "rad"),
    **vector(names.RATES, "rollspeed pitchspeed yawspeed", "rad/s"),
}
_SCALED_IMU: Fields = {
    **vector(names.FORCE, "xacc yacc zacc", "mg"),
    **vector(names.MAGNETIC, "xmag ymag zmag", "mgauss"),
}
MESSAGES: tuple[tuple[str, Fields], ...] = (
    ("ATTITUDE", _ATTITUDE),
    ("ATTITUDE_QUATERNION", _ATTITUDE),
    (
        "HIGHRES_IMU",
        {
            **vector(names.FORCE, "xacc yacc zacc", "m/s²"),
            **vector(names.MAGNETIC, "xmag ymag zmag", "gauss"),
            "static_pressure": ("abs_pressure", "hPa"),
            "dynamic_pressure": ("diff_pressure", "hPa"),
            "baro_height": ("pressure_alt", "m"),
        },
    ),
    ("SCALED_IMU", _SCALED_IMU),
    ("RAW_IMU", _SCALED_IMU),  # scaled as well by ArduPilot
    (
        "SCALED_PRESSURE",
        {"static_pressure": ("press_abs", "hPa"), "dynamic_pressure": ("press_diff", "hPa")},
    ),
    (
        "LOCAL_POSITION_NED",
        {**vector(names.POSITION, "x y z", "m"), **vector(names.VELOCITY, "vx vy vz", "m/s")},
    ),
    (
        "GLOBAL_POSITION_INT",
        {
            **vector(names.PLACE[:2], "lat lon", "degE7"),
            **vector(names.PLACE[2:], "alt", "mm"),
            **vector(names.VELOCITY, "vx vy vz", "cm/s"),
        },
    ),
    (
        "GPS_RAW_INT",
        {
            **vector(names.GNSS_PLACE[:2], "lat lon", "degE7"),
            **vector(names.GNSS_PLACE[2:], "alt", "mm"),
            **vector(names.GNSS_VELOCITY[:2], "north east", "cm/s"),
        },
    ),
    ("VFR_HUD", {"indicated_airspeed": ("airspeed", "m/s"), "share_throttle": ("throttle", "%")}),
    ("AIRSPEED", {"indicated_airspeed": ("airspeed", "m/s")}),
    ("WIND_COV", vector(("wind_north", "wind_east"), "wind_x wind_y", "m/s")),
    (
        "FTC_TRACKING",
        {
            "reference_airspeed": ("reference[0]", "m/s"),
            **vector(names.REFERENCE, "reference[1] reference[2] reference[3]", "deg"),
            "error_airspeed": ("error[0]", "m/s"),
            **{
                f"error_{name}": (f"error[{k}]", "deg")
                for k, name in enumerate(QUANTITIES[1:], start=1)
            },
        },
    ),
    ("ATTITUDE_TARGET", vector(names.REFERENCE, "roll pitch yaw", "rad")),
    (
        "ATTITUDE_TARGET",
        vector(names.REFERENCE_RATES, "body_roll_rate body_pitch_rate body_yaw_rate", "rad/s"),
    ),
    (
        "NAV_CONTROLLER_OUTPUT",
        {
            **vector(names.REFERENCE[:2], "nav_roll nav_pitch", "deg"),
            "error_airspeed": ("aspd_error", "m/s"),
            "error_height": ("alt_error", "m"),
            "error_cross_track": ("xtrack_error", "m"),
        },
    ),
    (
        "ACTUATOR_OUTPUT_STATUS",
        vector(names.SHARES, " ".join(f"actuator[{k}]" for k in range(4)), ""),
    ),
    ("SERVO_OUTPUT_RAW", numbered(names.OUTPUTS[:16], "servo{}_raw", "µs")),
    (
        "SYS_STATUS",
        {
            "battery_voltage": ("voltage_battery", "mV"),
            "battery_current": ("current_battery", "cA"),
        },
    ),
)
"""Where our channels are; of several messages with one, the first that a log has."""


def message_channels(
    name: str, fields: Fields, heard: HeardSystem, time_s: np.ndarray, clock: str
) -> Iterator[LogChannel | None]:
    """Yield what all messages of a kind have of some fields.

    Args:
        name: Of the kind.
        fields: What is asked for.
        heard: What was heard of the vehicle.
        time_s: Time of each message, shape (n,) [s].
        clock: As of `LogChannel`.
    """
    values = heard.values(name)
    autopilot, ours = heard.heartbeat.get("autopilot"), _OURS in heard.kinds
    if name == "RAW_IMU" and autopilot != ARDUPILOT:
        return
    if name == "VFR_HUD" and ours:
        fields = {"V": ("airspeed", "m/s")}
    if name == "ACTUATOR_OUTPUT_STATUS" and not ours:
        return  # outputs in the order of the airframe's, which it does not say
    yield from channels_of(name, fields, time_s, _prepared(name, values, autopilot), clock)


def _prepared(name: str, values: Values, autopilot: int | None) -> Values:
    """Return the fields of a kind with angles, and NaN for what is no value."""
    if name == "ATTITUDE_QUATERNION":
        return with_angles(values, "q1 q2 q3 q4")
    if name == "ATTITUDE_TARGET":
        ignored = values["type_mask"] & 0b111
        rates = {f"body_{axis}_rate": 1 << k for k, axis in enumerate(("roll", "pitch", "yaw"))}
        kept = {
            field: np.where(ignored & bit, np.nan, values[field]) for field, bit in rates.items()
        }
        return with_angles({**values, **kept}, "q[0] q[1] q[2] q[3]")
    if name == "GPS_RAW_INT":
        has_fix = values["fix_type"] >= dialect.GPS_FIX_TYPE_2D_FIX
        fixed = {one: np.where(has_fix, column, np.nan) for one, column in values.items()}
        return with_course(fixed, "vel", "cog", 0.01)
    if name == "NAV_CONTROLLER_OUTPUT":  # theirs are commanded minus measured
        scale = -0.01 if autopilot == ARDUPILOT else -1.0
        return {
            **values,
            "aspd_error": values["aspd_error"] * scale,
            "alt_error": -values["alt_error"],
        }
    if name == "SERVO_OUTPUT_RAW":
        main = values["port"] == 0
        return {
            one: np.where(main & (column > 0) & (column < 2**16 - 1), column, np.nan)
            for one, column in values.items()
        }
    if name == "SYS_STATUS":
        current = np.where(values["current_battery"] < 0, np.nan, values["current_battery"])
        return {**values, "current_battery": current}
    return values
