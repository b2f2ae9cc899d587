"""Logs of PX4 (ULog), and what `gcs export --to ulg` writes.

Topics and fields are as in PX4 1.12 to 1.16, https://github.com/PX4/PX4-Autopilot/tree/main/msg.
"""

import contextlib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from gcs.console.errors import BadInput
from gcs.console.extras import load_package
from gcs.results.logs import names
from gcs.results.logs.clocks import longest_stretch, utc
from gcs.results.logs.fields import Fields, Values, channels_of, vector, with_angles
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
_SLOW_S = 1.0  # by which other topics may begin earlier, or end later, than the fastest
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
    data = {
        one.name: one.data
        for one in reversed(log.data_list)
        if one.multi_id == 0 and "timestamp" in one.data
    }
    begin, end, remarks = _span(path, data, {name for name, _ in topics})
    shift = 0.0 if ours else begin
    rows = {
        name: (times >= begin) & (times <= end)
        for name, values in data.items()
        for times in [_time_s(values)]
    }
    used = {name: {k: v[rows[name]] for k, v in values.items()} for name, values in data.items()}
    clock = "simulated" if ours else "boot"
    channels = by_name(
        [
            one
            for name, fields in topics
            if name in used
            for one in channels_of(
                name, fields, _time_s(used[name]) - shift, _prepared(name, used[name], ours), clock
            )
        ]
        + list(_events(used.get("ftc_event")))
    )
    if not channels:
        raise BadInput(f"{path} has no topic of a flight, such as vehicle_attitude")
    status = used.get("vehicle_status")
    return FlightTable(
        title=visible(", ".join(filter(None, (path.name, log.msg_info_dict.get("vehicle"))))),
        kind="ulg",
        channels=channels,
        modes=() if status is None else tuple(_modes(_time_s(status) - shift, status)),
        texts=tuple(_texts(log, shift)),
        parameters={
            name: float(value)
            for name, value in log.initial_parameters.items()
            if isinstance(value, int | float)
        },
        started=_started(data, shift),
        remarks=(*remarks, *_losses(log)),
    )


def _texts(log: Any, shift: float) -> Iterator[LogText]:
    for one in log.logged_messages:
        level = one.log_level - ord("0")
        yield LogText(one.timestamp / 1e6 - shift, level, visible(one.message.strip()))


def _losses(log: Any) -> Iterator[str]:
    """Yield what of the flight did not reach the file."""
    if log.dropouts:
        lost = sum(one.duration for one in log.dropouts) / 1e3
        yield f"the logger lost {lost:.3g} s in {len(log.dropouts)} pieces"
    if log.file_corruption:
        yield "the file is damaged or cut off; what could be read is shown"


def _open(path: Path) -> Any:
    asked = sorted({name for name, _ in _TOPICS} | set(_OTHER_TOPICS))
    try:
        with open_file(path) as file:
            if file.read(len(_MAGIC)) != _MAGIC:
                file.seek(0, 2)
                what = "is no ULog file: it does not begin as one" if file.tell() else "is empty"
                raise BadInput(f"{path} {what}")
            file.seek(0)
            pyulog = load_package("pyulog", f"{path.name}, a ULog file,", "logs")
            with contextlib.redirect_stdout(None):
                return pyulog.ULog(file, asked)
    except OSError as problem:
        raise BadInput(f"cannot read {path}: {problem.strerror}") from None
    except BadInput:
        raise
    except Exception as problem:  # of a file that is broken: ULogException, struct.error, ...
        text = f"{path} is a broken ULog file: {type(problem).__name__}: {problem}"
        raise BadInput(text) from None


def _time_s(values: Values) -> np.ndarray:
    return np.asarray(values["timestamp"] / 1e6)


def _span(
    path: Path, data: Mapping[str, Values], known: set[str]
) -> tuple[float, float, list[str]]:
    """Return begin and end of the longest stretch without a jump of the clock [s], and remarks."""
    flown = [_time_s(values) for name, values in data.items() if name in known]
    if not any(map(len, flown)):
        raise BadInput(f"{path} has no topic of a flight, such as vehicle_attitude")
    fastest = max(flown, key=len)
    stretch, jump = longest_stretch(fastest)
    times = np.concatenate(flown)
    low, high = fastest[stretch].min() - _SLOW_S, fastest[stretch].max() + _SLOW_S
    near = times[(times >= low) & (times <= high)]
    return float(near.min()), float(near.max()), [jump] if jump else []


def _prepared(name: str, values: Values, ours: bool) -> Values:
    """Return the fields of a topic, with angles, and without what is no value."""
    if name == "vehicle_attitude":
        return with_angles(values, "q[0] q[1] q[2] q[3]")
    if name == "vehicle_attitude_setpoint":
        return with_angles(values, "q_d[0] q_d[1] q_d[2] q_d[3]")
    if name == "actuator_outputs" and not ours:
        number = values["noutputs"] if "noutputs" in values else 16
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


def _events(values: Values | None) -> Iterator[LogChannel | None]:
    """Yield the commands held of our own exports: each transmission of one."""
    if values is None:
        return
    for number, name in enumerate(ACTUATORS):
        rows = values["actuator"] == number
        sent = np.asarray(values["value"][rows], float)
        held = sent if name == "throttle" else np.radians(sent)
        times = _time_s(values)[rows]
        one = channel(f"held_{name}", times, held, "ftc_event.value", "simulated")
        yield None if one is None else replace(one, by_event=True)


def _modes(time_s: np.ndarray, status: Values) -> Iterator[tuple[float, str]]:
    states = status["nav_state"]
    for k in np.flatnonzero(np.append(True, np.diff(states) != 0)[: len(states)]).tolist():
        yield float(time_s[k]), _MODES.get(int(states[k]), f"mode {states[k]}")


def _started(data: Mapping[str, Values], shift_s: float) -> datetime | None:
    """Return when the flight's time was 0, by the date of a GNSS receiver."""
    for name in ("vehicle_gps_position", "sensor_gps"):
        if name in data and "time_utc_usec" in data[name]:
            known = np.flatnonzero(data[name]["time_utc_usec"])
            if len(known):
                utc_s = float(data[name]["time_utc_usec"][known[0]]) / 1e6
                at = float(_time_s(data[name])[known[0]]) - shift_s
                return utc(utc_s - at)
    return None
