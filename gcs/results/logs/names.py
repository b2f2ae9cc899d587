"""What the channels of a flight are called, their units, and how they go on between samples.

Names and units are as in our recordings where these have such a quantity. Body axes are forward,
right, down, the others north, east, down.
"""

from collections.abc import Iterable

import numpy as np

from gcs.results.columns import COLUMNS, ESTIMATES
from mavlink_defs.constants import ACTUATORS

ATTITUDE = ("roll", "pitch", "yaw")
RATES = ("p", "q", "r")
FORCE = ("specific_force_x", "specific_force_y", "specific_force_z")
"""What the accelerometer measures: in level flight z is about -9.8."""
MAGNETIC = ("magnetic_x", "magnetic_y", "magnetic_z")
POSITION = ("north", "east", "down")
VELOCITY = ("v_north", "v_east", "v_down")
PLACE = ("latitude", "longitude", "altitude")
GNSS_PLACE = ("gnss_latitude", "gnss_longitude", "gnss_altitude")
GNSS_VELOCITY = ("gnss_v_north", "gnss_v_east", "gnss_v_down")
REFERENCE = ("reference_roll", "reference_pitch", "reference_yaw")
REFERENCE_RATES = ("reference_p", "reference_q", "reference_r")
AIRSPEEDS = ("V", "indicated_airspeed")
"""True airspeed, and what a pitot tube shows at its height; in the order of preference."""
SHARES = tuple(f"share_{name}" for name in ACTUATORS)
"""Commands as shares of the whole travel, signs as the autopilot has them."""
OUTPUTS = tuple(f"output_{k}" for k in range(1, 33))
"""Pulses of the autopilot's outputs, by their number."""
SERVOS = tuple(f"servo_{k}" for k in range(1, 9))
MOTORS = tuple(f"motor_{k}" for k in range(1, 13))


def _all(names: Iterable[str], unit: str) -> dict[str, str]:
    return dict.fromkeys(names, unit)


UNITS: dict[str, str] = {
    **{column.name: column.unit for column in (*COLUMNS, *ESTIMATES)},
    **_all(FORCE, "m/s²"),
    **_all(MAGNETIC, "gauss"),
    **_all(("indicated_airspeed", "wind_north", "wind_east", "error_airspeed"), "m/s"),
    **_all(("static_pressure", "dynamic_pressure"), "Pa"),
    **_all(("baro_height", "error_height", "error_cross_track", "reference_height"), "m"),
    **_all(("angle_of_attack", "sideslip"), "rad"),
    **_all((*VELOCITY, *GNSS_VELOCITY, *(f"error_{name}" for name in VELOCITY)), "m/s"),
    **_all(("latitude", "longitude", "gnss_latitude", "gnss_longitude"), "deg"),
    **_all(("altitude", "gnss_altitude"), "m"),
    **_all(REFERENCE_RATES, "rad/s"),
    **_all((*SHARES, *SERVOS, *MOTORS, "mode", "fault"), ""),
    **_all(OUTPUTS, "µs"),
    "motor_speed": "rad/s",
    "battery_voltage": "V",
    "battery_current": "A",
}
"""Unit of every channel that has a name of ours."""

_HELD = {*SHARES, *OUTPUTS, *SERVOS, *MOTORS, "mode", "fault"}
_ANGLES = ("roll", "yaw", "longitude")


def is_held(name: str) -> bool:
    """Return whether a value holds until the next one: of commands and flags."""
    return name in _HELD or name.startswith("held_")


def turn_of(name: str) -> float | None:
    """Return what a full turn is in the unit of an angle that goes round; None of all others."""
    if not name.endswith(_ANGLES):
        return None
    return 360.0 if UNITS.get(name) == "deg" else 2.0 * np.pi


_ALIKE = {"m/s2": "m/s²", "us": "µs", "uT": "µT", "rad/s2": "rad/s²"}
_FACTORS = {
    "rad": {"deg": np.pi / 180.0, "cdeg": np.pi / 18000.0},
    "deg": {"rad": 180.0 / np.pi, "degE7": 1e-7},
    "rad/s": {"deg/s": np.pi / 180.0, "rpm": np.pi / 30.0},
    "m": {"cm": 1e-2, "mm": 1e-3, "km": 1e3, "ft": 0.3048},
    "m/s": {"cm/s": 1e-2, "km/h": 1.0 / 3.6, "kt": 1852.0 / 3600.0, "ft/s": 0.3048},
    "m/s²": {"g": 9.80665, "mg": 9.80665e-3, "ft/s²": 0.3048},
    "gauss": {"mgauss": 1e-3, "µT": 1e-2},
    "Pa": {"hPa": 1e2, "kPa": 1e3, "mbar": 1e2},
    "": {"%": 1e-2},
    "V": {"mV": 1e-3},
    "A": {"mA": 1e-3, "cA": 1e-2},
    "s": {"ms": 1e-3, "µs": 1e-6, "ns": 1e-9},
}


def units_into(unit: str) -> tuple[str, ...]:
    """Return the units that can be converted to one of ours, itself the first."""
    return (unit, *_FACTORS.get(unit, {}))


def factor(unit: str, ours: str) -> float | None:
    """Return what a value in some unit is multiplied by for ours; None if they do not fit."""
    unit = _ALIKE.get(unit, unit)
    return 1.0 if unit == ours else _FACTORS.get(ours, {}).get(unit)
