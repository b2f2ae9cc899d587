"""Recorded steps and events as messages of PX4's topics.

Topics and fields are as in PX4 1.16 (PX4/px4_msgs, branch release/1.16). What a recording does
not have is NaN.
"""

from collections.abc import Mapping

import numpy as np

from ftc_autopilot.common.geography import Origin, place_of
from gcs.results.ulog_file import Topic
from mavlink_defs.constants import ACTUATORS
from mavlink_defs.faults.kinds import FaultLimits

_SURFACES = ("aileron", "elevator", "rudder")
_THROTTLE = ACTUATORS.index("throttle")


def _fields(text: str) -> list[tuple[str, str, int]]:
    """Read fields written as in a `.msg` file of PX4's, with ULog's names of the types."""
    found = []
    for part in filter(None, map(str.strip, text.split(";"))):
        kind, name = part.split()
        of, _, length = kind.partition("[")
        found.append((name, of, int(length.rstrip("]")) if length else 1))
    return found


_FORMATS = {
    "vehicle_attitude": "uint64_t timestamp_sample; float[4] q; float[4] delta_q_reset; "
    "uint8_t quat_reset_counter",
    "vehicle_angular_velocity": "uint64_t timestamp_sample; float[3] xyz; float[3] xyz_derivative",
    "vehicle_attitude_setpoint": "float yaw_sp_move_rate; float[4] q_d; float[3] thrust_body; "
    "bool reset_integral; bool fw_control_yaw_wheel",
    "vehicle_rates_setpoint": "float roll; float pitch; float yaw; float[3] thrust_body; "
    "bool reset_integral",
    "vehicle_local_position": "uint64_t timestamp_sample; bool xy_valid; bool z_valid; "
    "bool v_xy_valid; bool v_z_valid; float x; float y; float z; float[2] delta_xy; "
    "uint8_t xy_reset_counter; float delta_z; uint8_t z_reset_counter; float vx; float vy; "
    "float vz; float z_deriv; float[2] delta_vxy; uint8_t vxy_reset_counter; float delta_vz; "
    "uint8_t vz_reset_counter; float ax; float ay; float az; float heading; float heading_var; "
    "float unaided_heading; float delta_heading; uint8_t heading_reset_counter; "
    "bool heading_good_for_control; float tilt_var; bool xy_global; bool z_global; "
    "uint64_t ref_timestamp; double ref_lat; double ref_lon; float ref_alt; "
    "bool dist_bottom_valid; float dist_bottom; float dist_bottom_var; float delta_dist_bottom; "
    "uint8_t dist_bottom_reset_counter; uint8_t dist_bottom_sensor_bitfield; float eph; "
    "float epv; float evh; float evv; bool dead_reckoning; float vxy_max; float vz_max; "
    "float hagl_min; float hagl_max_z; float hagl_max_xy",
    "vehicle_global_position": "uint64_t timestamp_sample; double lat; double lon; float alt; "
    "float alt_ellipsoid; bool lat_lon_valid; bool alt_valid; float delta_alt; "
    "float delta_terrain; uint8_t lat_lon_reset_counter; uint8_t alt_reset_counter; "
    "uint8_t terrain_reset_counter; float eph; float epv; float terrain_alt; "
    "bool terrain_alt_valid; bool dead_reckoning",
    "airspeed_validated": "float indicated_airspeed_m_s; float calibrated_airspeed_m_s; "
    "float true_airspeed_m_s; float calibrated_ground_minus_wind_m_s; "
    "float true_ground_minus_wind_m_s; bool airspeed_sensor_measurement_valid; "
    "int8_t selected_airspeed_index; float airspeed_derivative_filtered; "
    "float throttle_filtered; float pitch_filtered",
    "airspeed": "uint64_t timestamp_sample; float indicated_airspeed_m_s; "
    "float true_airspeed_m_s; float confidence",
    "tecs_status": "float altitude_sp; float altitude_reference; float altitude_time_constant; "
    "float height_rate_reference; float height_rate_direct; float height_rate_setpoint; "
    "float height_rate; float equivalent_airspeed_sp; float true_airspeed_sp; "
    "float true_airspeed_filtered; float true_airspeed_derivative_sp; "
    "float true_airspeed_derivative; float true_airspeed_derivative_raw; "
    "float total_energy_rate_sp; float total_energy_rate; float total_energy_balance_rate_sp; "
    "float total_energy_balance_rate; float throttle_integ; float pitch_integ; "
    "float throttle_sp; float pitch_sp_rad; float throttle_trim; float underspeed_ratio; "
    "float fast_descend_ratio",
    "wind": "uint64_t timestamp_sample; float windspeed_north; float windspeed_east; "
    "float variance_north; float variance_east; float tas_innov; float tas_innov_var; "
    "float beta_innov; float beta_innov_var",
    "actuator_outputs": "uint32_t noutputs; float[16] output",
    "actuator_servos": "uint64_t timestamp_sample; float[8] control",
    "actuator_motors": "uint64_t timestamp_sample; uint16_t reversible_flags; float[12] control",
    "ftc_event": "uint8_t actuator; float value",  # ours: nothing of PX4's is like it
}
TOPICS = {
    name: Topic(name, number, _fields(text)) for number, (name, text) in enumerate(_FORMATS.items())
}
"""Topics by name: all of PX4's but ``ftc_event``, a transmission of one actuator's command."""
BY_EVENT = ("actuator_servos", "actuator_motors", "ftc_event")
"""Topics with a message for each transmission; the others have one for each recorded step."""
_RATES = ("omega_d_p", "omega_d_q", "omega_d_r")

Columns = Mapping[str, np.ndarray]


def topics_of(columns: set[str]) -> list[Topic]:
    """Return the topics that a recording with these columns can fill."""
    return [
        topic
        for name, topic in TOPICS.items()
        if name != "vehicle_rates_setpoint" or columns.issuperset(_RATES)
    ]


def step_messages(
    columns: Columns, origin: Origin, limits: FaultLimits
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return the messages of recorded steps of one UAV.

    Args:
        columns: Of the trajectory, each of shape (steps,) [SI units, rad].
        origin: Place of north = east = down = 0.
        limits: Ranges of the actuators.

    Returns:
        Timestamps [µs], shape (steps,), and the messages of each topic in the same way.
    """
    at = np.round(columns["time_s"] * 1e6).astype(np.int64)
    attitude = _quaternion(columns["roll"], columns["pitch"], columns["yaw"])
    velocity = _to_earth(attitude, _stacked(columns, "u", "v", "w"))
    wind = _to_earth(attitude, _stacked(columns, "wind_u", "wind_v", "wind_w"))
    thrust = _normalised(columns["held_throttle"], _THROTTLE, limits)
    made = {name: TOPICS[name].messages(at) for name in TOPICS if name not in BY_EVENT}
    for messages in made.values():
        if "timestamp_sample" in (messages.dtype.names or ()):
            messages["timestamp_sample"] = at
    _fill_position(made, columns, velocity, origin)
    made["vehicle_attitude"]["q"] = attitude
    made["vehicle_attitude"]["delta_q_reset"] = (1.0, 0.0, 0.0, 0.0)
    made["vehicle_angular_velocity"]["xyz"] = _stacked(columns, "p", "q", "r")
    angles = (columns[f"reference_{name}"] for name in ("roll", "pitch", "yaw"))
    made["vehicle_attitude_setpoint"]["q_d"] = _quaternion(*angles)
    for topic in ("vehicle_attitude_setpoint", "vehicle_rates_setpoint"):
        made[topic]["thrust_body"] = 0.0
        made[topic]["thrust_body"][:, 0] = thrust
    rates = made["vehicle_rates_setpoint"]
    if columns.keys() >= set(_RATES):
        for field, name in zip(("roll", "pitch", "yaw"), _RATES, strict=True):
            rates[field] = columns[name]
    else:
        del made["vehicle_rates_setpoint"]
    _fill_air(made, columns, velocity, wind)
    made["tecs_status"]["throttle_sp"] = thrust
    outputs = made["actuator_outputs"]
    outputs["noutputs"] = len(ACTUATORS)
    for channel, name in enumerate(ACTUATORS):
        applied = columns[f"applied_{name}"]
        outputs["output"][:, channel] = applied if name == "throttle" else np.degrees(applied)
    return at, list(made.values())


def event_messages(
    time_s: np.ndarray, channel: np.ndarray, value: np.ndarray, limits: FaultLimits
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the messages of one UAV's events, each a transmission of one actuator's command.

    Args:
        time_s: Of each event [s], in order.
        channel: Index into `ACTUATORS`.
        value: Held from then on [rad, throttle N].
        limits: Ranges of the actuators.

    Returns:
        For each topic timestamps [µs] and messages; servos and motor have one for
        each time at which a command was sent, with the ones that still hold.
    """
    at = np.round(time_s * 1e6).astype(np.int64)
    times, place = np.unique(at, return_inverse=True)
    held = np.full((len(times), len(ACTUATORS)), np.nan)
    held[place, channel] = value
    sent = np.isfinite(held)
    newest = np.maximum.accumulate(np.where(sent, np.arange(len(times))[:, None], 0), axis=0)
    held = np.take_along_axis(held, newest, axis=0)
    found = []
    surfaces = [ACTUATORS.index(name) for name in _SURFACES]
    for name, channels in (("actuator_servos", surfaces), ("actuator_motors", [_THROTTLE])):
        when = sent[:, channels].any(axis=1)
        messages = TOPICS[name].messages(times[when])
        messages["timestamp_sample"] = times[when]
        for k, one in enumerate(channels):
            messages["control"][:, k] = _normalised(held[when, one], one, limits)
        found.append((times[when], messages))
    events = TOPICS["ftc_event"].messages(at)
    events["actuator"] = channel
    events["value"] = np.where(channel == _THROTTLE, value, np.degrees(value))
    return [*found, (at, events)]


def _fill_position(
    made: dict[str, np.ndarray], columns: Columns, velocity: np.ndarray, origin: Origin
) -> None:
    local, globally = made["vehicle_local_position"], made["vehicle_global_position"]
    for flag in ("xy_valid", "z_valid", "v_xy_valid", "v_z_valid", "xy_global", "z_global"):
        local[flag] = 1
    local["heading_good_for_control"] = 1
    for field, name in zip("xyz", ("north", "east", "down"), strict=True):
        local[field] = columns[name]
    local["vx"], local["vy"], local["vz"] = velocity.T
    local["z_deriv"] = velocity[:, 2]
    local["heading"] = columns["yaw"]
    local["ref_lat"], local["ref_lon"] = origin.latitude_deg, origin.longitude_deg
    local["ref_alt"] = origin.altitude_m
    positions = (columns[name].tolist() for name in ("north", "east", "down"))
    places = [place_of(origin, *one) for one in zip(*positions, strict=True)]
    globally["lat"] = [place.latitude / 1e7 for place in places]
    globally["lon"] = [place.longitude / 1e7 for place in places]
    globally["alt"] = [place.altitude / 1e3 for place in places]
    globally["lat_lon_valid"] = globally["alt_valid"] = 1


def _fill_air(
    made: dict[str, np.ndarray], columns: Columns, velocity: np.ndarray, wind: np.ndarray
) -> None:
    airspeed = np.sqrt(((velocity - wind) ** 2).sum(axis=1))
    made["airspeed_validated"]["true_airspeed_m_s"] = airspeed
    made["airspeed_validated"]["true_ground_minus_wind_m_s"] = airspeed
    made["airspeed_validated"]["airspeed_sensor_measurement_valid"] = 1
    made["airspeed"]["true_airspeed_m_s"] = columns["V"]
    tecs = made["tecs_status"]
    tecs["true_airspeed_sp"] = columns["reference_airspeed"]
    tecs["true_airspeed_filtered"] = columns["V"]
    tecs["height_rate"] = -velocity[:, 2]
    tecs["pitch_sp_rad"] = columns["reference_pitch"]
    made["wind"]["windspeed_north"], made["wind"]["windspeed_east"] = wind[:, 0], wind[:, 1]


def _normalised(values: np.ndarray, channel: int, limits: FaultLimits) -> np.ndarray:
    """Return commands [rad or N] as shares of the stop on their side; NaN without the actuator."""
    if channel == _THROTTLE:
        return np.asarray(values / limits.thrust_n)
    least, most = np.radians(limits.surfaces_deg[channel])
    if least == most == 0.0:
        return np.full(len(values), np.nan)
    stops = np.where(values < 0.0, abs(least), most)
    return np.asarray(np.divide(values, stops, out=np.zeros(len(values)), where=stops > 0.0))


def _stacked(columns: Columns, *names: str) -> np.ndarray:
    return np.column_stack([columns[name] for name in names])


def _quaternion(roll: np.ndarray, pitch: np.ndarray, yaw: np.ndarray) -> np.ndarray:
    """Return the rotation from body axes to north, east, down, as (w, x, y, z).

    Args:
        roll: Of the sequence yaw, pitch, roll [rad], shape (steps,).
        pitch: The same of pitch.
        yaw: The same of yaw.

    Returns:
        Shape (steps, 4), of Hamilton's convention.
    """
    cr, cp, cy = (np.cos(angle / 2.0) for angle in (roll, pitch, yaw))
    sr, sp, sy = (np.sin(angle / 2.0) for angle in (roll, pitch, yaw))
    return np.column_stack(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ]
    )


def _to_earth(rotation: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Return vectors of body axes in north, east, down: v + 2 w (q × v) + 2 q × (q × v)."""
    axis, scalar = rotation[:, 1:], rotation[:, :1]
    across = 2.0 * np.cross(axis, vectors)
    return np.asarray(vectors + scalar * across + np.cross(axis, across))
