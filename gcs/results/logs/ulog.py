"""Logs of PX4 (ULog), and what `gcs export --to ulg` writes.

Topics and fields are as in PX4 1.12 to 1.16, https://github.com/PX4/PX4-Autopilot/tree/main/msg.
"""

import contextlib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from datetime import datetime
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from gcs.console.errors import BadInput
from gcs.console.extras import load_package
from gcs.results.logs import names
from gcs.results.logs.clocks import longest_span, utc
from gcs.results.logs.fields import (
    Fields,
    Values,
    between,
    channels_of,
    rows,
    vector,
    with_angles,
)
from gcs.results.logs.reading import reading
from gcs.results.logs.table import FlightTable, LogChannel, LogText, by_name, channel
from mavlink_defs.config.user_files import open_file
from mavlink_defs.constants import ACTUATORS
from mavlink_defs.visible import visible


def _indexed(ours: tuple[str, ...], array: str, unit: str) -> dict[str, tuple[str, str]]:
    return {name: (f"{array}[{k}]", unit) for k, name in enumerate(ours)}


_GNSS: Fields = {
    **vector(names.GNSS_PLACE[:2], "latitude_deg longitude_deg", "deg"),
    **vector(names.GNSS_PLACE[2:], "altitude_msl_m", "m"),
    **vector(names.GNSS_VELOCITY, "vel_n_m_s vel_e_m_s vel_d_m_s", "m/s"),
}
_OLDER_GNSS: Fields = {
    **vector(names.GNSS_PLACE[:2], "lat lon", "degE7"),
    **vector(names.GNSS_PLACE[2:], "alt", "mm"),
}
_TOPICS: tuple[tuple[str, Fields], ...] = (
    ("vehicle_attitude", vector(names.ATTITUDE, "roll pitch yaw", "rad")),
    ("vehicle_angular_velocity", _indexed(names.RATES, "xyz", "rad/s")),
    ("sensor_combined", _indexed(names.RATES, "gyro_rad", "rad/s")),
    ("vehicle_attitude", vector(names.RATES, "rollspeed pitchspeed yawspeed", "rad/s")),
    ("vehicle_acceleration", _indexed(names.FORCE, "xyz", "m/s²")),
    ("sensor_combined", _indexed(names.FORCE, "accelerometer_m_s2", "m/s²")),
    ("vehicle_local_position", vector(names.POSITION, "x y z", "m")),
    ("vehicle_local_position", vector(names.VELOCITY, "vx vy vz", "m/s")),
    ("vehicle_global_position", vector(names.PLACE[:2], "lat lon", "deg")),
    ("vehicle_global_position", vector(names.PLACE[2:], "alt", "m")),
    ("vehicle_gps_position", _GNSS),
    ("vehicle_gps_position", _OLDER_GNSS),
    ("sensor_gps", _GNSS),
    ("sensor_gps", _OLDER_GNSS),
    ("vehicle_magnetometer", _indexed(names.MAGNETIC, "magnetometer_ga", "gauss")),
    ("vehicle_air_data", {"baro_height": ("baro_alt_meter", "m")}),
    ("vehicle_air_data", {"static_pressure": ("baro_pressure_pa", "Pa")}),
    ("differential_pressure", {"dynamic_pressure": ("differential_pressure_pa", "Pa")}),
    (
        "airspeed_validated",
        {
            "V": ("true_airspeed_m_s", "m/s"),
            "indicated_airspeed": ("calibrated_airspeed_m_s", "m/s"),
        },
    ),
    (
        "airspeed",
        {
            "V": ("true_airspeed_m_s", "m/s"),
            "indicated_airspeed": ("indicated_airspeed_m_s", "m/s"),
        },
    ),
    ("wind", vector(("wind_north", "wind_east"), "windspeed_north windspeed_east", "m/s")),
    ("wind_estimate", vector(("wind_north", "wind_east"), "windspeed_north windspeed_east", "m/s")),
    ("vehicle_attitude_setpoint", vector(names.REFERENCE, "roll pitch yaw", "rad")),
    ("vehicle_attitude_setpoint", vector(names.REFERENCE, "roll_body pitch_body yaw_body", "rad")),
    ("vehicle_rates_setpoint", vector(names.REFERENCE_RATES, "roll pitch yaw", "rad/s")),
    ("tecs_status", {"reference_airspeed": ("true_airspeed_sp", "m/s")}),
    ("actuator_servos", _indexed(names.SERVOS, "control", "")),
    ("actuator_motors", _indexed(names.MOTORS, "control", "")),
    ("vehicle_torque_setpoint", _indexed(names.SHARES[:3], "xyz", "")),
    ("vehicle_thrust_setpoint", _indexed(names.SHARES[3:], "xyz", "")),
    ("actuator_controls_0", _indexed(names.SHARES, "control", "")),
    ("actuator_outputs", _indexed(names.OUTPUTS[:16], "output", "µs")),
    ("battery_status", {"battery_voltage": ("voltage_v", "V")}),
    ("battery_status", {"battery_current": ("current_a", "A")}),
    ("esc_status", {"motor_speed": ("esc[0].esc_rpm", "rpm")}),
)
"""Where our channels are; of several topics with one, the first that a log has."""
_OUR_TOPICS: tuple[tuple[str, Fields], ...] = (
    ("airspeed", {"V": ("true_airspeed_m_s", "m/s")}),
    *(one for one in _TOPICS if one[0] != "actuator_outputs"),
    (
        "actuator_outputs",
        {
            **_indexed(tuple(f"applied_{name}" for name in ACTUATORS[:3]), "output", "deg"),
            f"applied_{ACTUATORS[3]}": ("output[3]", "N"),
        },
    ),
)
"""The same in our own exports: airspeed as it was measured, and outputs in units of their own."""
_MAGIC = b"ULog\x01\x12\x35"
_OTHER_TOPICS = ("vehicle_status", "ftc_event")
_LEAST_PULSE = 200.0  # what is less is no pulse [µs]
_MODES = {
    0: "MANUAL",
    1: "ALTCTL",
    2: "POSCTL",
    3: "AUTO_MISSION",
    4: "AUTO_LOITER",
    5: "AUTO_RTL",
    10: "ACRO",
    12: "DESCEND",
    13: "TERMINATION",
    14: "OFFBOARD",
    15: "STAB",
    17: "AUTO_TAKEOFF",
    18: "AUTO_LAND",
}
"""NAVIGATION_STATE of VehicleStatus.msg."""


def read_ulog(path: Path) -> FlightTable:
    """Read a log of PX4, or one that we exported.

    Raises:
        BadInput: It cannot be read, is none, has nothing of a flight, or no pyulog.
    """
    log = _open(path)
    ours = log.msg_info_dict.get("sys_name") == "ftc-sitl"
    topics = _OUR_TOPICS if ours else _TOPICS
    logged = {
        one.name: {**one.data, "time_s": one.data["timestamp"] / 1e6}
        for one in reversed(log.data_list)
        if one.multi_id == 0 and "timestamp" in one.data
    }
    flown = [logged[name]["time_s"] for name in dict(topics) if name in logged]
    begin, end, jumps = longest_span(flown)
    zero = 0.0 if ours else begin
    used = {name: between(values, begin, end, zero) for name, values in logged.items()}
    clock = "simulated" if ours else "boot"
    channels = by_name(
        [
            one
            for name, fields in topics
            if name in used
            for one in channels_of(
                name, fields, used[name]["time_s"], _prepared(name, used[name], ours), clock
            )
        ]
        + list(_events(used.get("ftc_event", {})))
    )
    if not channels:
        raise BadInput(f"{path} has no topic of a flight, such as vehicle_attitude")
    return FlightTable(
        title=visible(", ".join(filter(None, (path.name, log.msg_info_dict.get("vehicle"))))),
        kind="ulg",
        channels=channels,
        modes=tuple(_modes(used.get("vehicle_status", {}))),
        texts=tuple(_texts(log, zero)),
        parameters={
            name: float(value)
            for name, value in log.initial_parameters.items()
            if isinstance(value, int | float)
        },
        started=_started(used),
        remarks=(*jumps, *_losses(log)),
    )


def _texts(log: Any, zero_s: float) -> Iterator[LogText]:
    for one in log.logged_messages:
        level = min(max(one.log_level - ord("0"), 0), 7)
        yield LogText(one.timestamp / 1e6 - zero_s, level, visible(one.message.strip()))


def _losses(log: Any) -> Iterator[str]:
    """Yield what of the flight did not reach the file."""
    if log.dropouts:
        lost = sum(one.duration for one in log.dropouts) / 1e3
        yield f"the logger lost {lost:.3g} s in {len(log.dropouts)} pieces"
    if log.file_corruption:
        yield "the file is damaged or cut off; what could be read is shown"


def _open(path: Path) -> Any:
    asked = sorted({name for name, _ in _TOPICS} | set(_OTHER_TOPICS))
    with reading(path, "is a broken ULog file"), open_file(path) as file:
        if file.read(len(_MAGIC)) != _MAGIC:
            file.seek(0, 2)
            what = "is no ULog file: it does not begin as one" if file.tell() else "is empty"
            raise BadInput(f"{path} {what}")
        file.seek(0)
        pyulog = load_package("pyulog", f"{path.name}, a ULog file,", "logs")
        with contextlib.redirect_stdout(None):
            return pyulog.ULog(file, asked)


def _prepared(name: str, values: Values, ours: bool) -> Values:
    """Return the fields of a topic, with angles, and without what is no value."""
    if name == "vehicle_attitude":
        return with_angles(values, "q[0] q[1] q[2] q[3]")
    if name == "vehicle_attitude_setpoint":
        return with_angles(values, "q_d[0] q_d[1] q_d[2] q_d[3]")
    if name == "actuator_outputs" and not ours:
        number = values.get("noutputs", np.array(16))
        pulses = {k: values.get(f"output[{k}]", np.empty(0)) for k in range(16)}
        return {
            f"output[{k}]": np.where((p >= _LEAST_PULSE) & (k < number), p, np.nan)
            for k, p in pulses.items()
            if len(p)
        }
    if name in {"vehicle_gps_position", "sensor_gps"} and "fix_type" in values:
        has_fix = values["fix_type"] >= 2
        return {field: np.where(has_fix, column, np.nan) for field, column in values.items()}
    return values


def _events(values: Values) -> Iterator[LogChannel | None]:
    """Yield the commands held of our own exports: each transmission of one."""
    if not {"actuator", "value"} <= values.keys():
        return
    for number, name in enumerate(ACTUATORS):
        own = values["actuator"] == number
        sent = np.asarray(values["value"][own], float)
        held = sent if name == "throttle" else np.radians(sent)
        one = channel(f"held_{name}", values["time_s"][own], held, "ftc_event.value", "simulated")
        yield None if one is None else replace(one, by_event=True)


def _modes(status: Values) -> Iterator[tuple[float, str]]:
    for state, same in groupby(rows(status, "time_s", "nav_state"), itemgetter(1)):
        yield next(same)[0], _MODES.get(state, f"mode {state}")


def _started(logged: Mapping[str, Values]) -> datetime | None:
    """Return when the flight's time was 0, by the date of a GNSS receiver."""
    for name in ("vehicle_gps_position", "sensor_gps"):
        for at, utc_us in rows(logged.get(name, {}), "time_s", "time_utc_usec"):
            if utc_us:
                return utc(utc_us / 1e6 - at)
    return None
