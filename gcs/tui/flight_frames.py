"""The table of a flight as frames that the dashboard replays: what our vehicles would have sent."""

import math
from collections.abc import Iterator

import numpy as np

from gcs.results.logs import names
from gcs.results.logs.as_recording import origin_of, positions_of
from gcs.results.logs.table import FlightTable
from gcs.results.quantities import QUANTITIES
from mavlink_defs import dialect
from mavlink_defs.constants import MODE_NAMES
from mavlink_defs.framing.frames import FramePacker

_RATE_HZ = 10.0
_HEARTBEAT_S = 1.0
_TEXT = 50  # most bytes of a text in a message
_MOST = float(np.finfo(np.float32).max)  # that a message can have

Timed = tuple[float, dialect.MAVLink_message]


def frames_of(flight: FlightTable, system: int = 1) -> list[tuple[int, bytes]]:
    """Return time [µs] and frame of messages that show a flight, in order.

    Args:
        flight: The flight.
        system: System id of the vehicle that sends them.
    """
    packer = FramePacker(system, dialect.MAV_COMP_ID_AUTOPILOT1)
    timed = sorted(
        [*_heartbeats(flight), *_states(flight), *_texts(flight)], key=lambda one: one[0]
    )
    epoch_s = 0.0 if flight.started is None else flight.started.timestamp()
    return [(round((epoch_s + at) * 1e6), packer.pack(message)) for at, message in timed]


def _states(flight: FlightTable) -> Iterator[Timed]:
    """Yield attitude, place, airspeed, references and commands, at ten times a second."""
    time_s = flight.grid(_RATE_HZ)

    def rows(*asked: str) -> np.ndarray:
        nothing = np.full(len(time_s), np.nan)
        columns = [known[one].at(time_s) if one in known else nothing for one in asked]
        values = np.stack(columns, axis=1)
        return np.where(np.abs(values) < _MOST, values, np.nan)

    known = {**flight.channels, **positions_of(flight, origin_of(flight))}
    speed = "V" if flight.airspeed is None else flight.airspeed.name
    motion = rows(speed, *names.ATTITUDE, *names.RATES)
    places, velocity = rows(*names.POSITION), rows(*names.VELOCITY)
    references = rows(*(f"reference_{name}" for name in QUANTITIES))
    errors = np.degrees(rows(*(f"error_{name}" for name in QUANTITIES)))
    errors[:, 0] = np.radians(errors[:, 0])  # the airspeed's is no angle
    shares, altitude = rows(*names.SHARES), rows("altitude")[:, 0]
    for k, at in enumerate(time_s.tolist()):
        since_ms = round(at * 1e3)
        airspeed, *angles = motion[k].tolist()
        if not math.isnan(angles[0]):
            yield at, dialect.MAVLink_attitude_message(since_ms, *angles)
        if not math.isnan(places[k, 0]):
            where = (*places[k].tolist(), *np.nan_to_num(velocity[k]).tolist())
            yield at, dialect.MAVLink_local_position_ned_message(since_ms, *where)
        if not math.isnan(airspeed):
            ground = math.hypot(*np.nan_to_num(velocity[k, :2]).tolist())
            heading = 0 if math.isnan(angles[2]) else round(math.degrees(angles[2])) % 360
            height = float(np.nan_to_num(altitude[k]))
            climb = -float(np.nan_to_num(velocity[k, 2]))
            yield at, dialect.MAVLink_vfr_hud_message(airspeed, ground, heading, 0, height, climb)
        if not np.isnan(shares[k]).all():
            controls = shares[k].tolist() + [0.0] * 28
            yield at, dialect.MAVLink_actuator_output_status_message(round(at * 1e6), 15, controls)
        yield at, _tracking(since_ms, motion[k, :4], references[k], errors[k])


def _tracking(
    since_ms: int, actual: np.ndarray, reference: np.ndarray, error: np.ndarray
) -> dialect.MAVLink_message:
    """Return references and errors [m/s, deg]; an error without a reference is shown from 0."""
    scale = np.array([1.0, *[180.0 / np.pi] * 3])
    actual, reference = actual * scale, reference * scale
    error = np.where(np.isnan(error), actual - reference, error)
    error[1:] = (error[1:] + 180.0) % 360.0 - 180.0
    nothing = [math.nan] * 4
    return dialect.MAVLink_ftc_tracking_message(
        since_ms, reference.tolist(), error.tolist(), nothing
    )


def _heartbeats(flight: FlightTable) -> Iterator[Timed]:
    numbers = {name: number for number, name in MODE_NAMES.items()}
    changes = [(-math.inf, ""), *flight.modes]
    place = 0
    for at in np.arange(flight.begin_s, flight.end_s, _HEARTBEAT_S).tolist():
        while place + 1 < len(changes) and changes[place + 1][0] <= at:
            place += 1
        message = dialect.MAVLink_heartbeat_message(
            dialect.MAV_TYPE_FIXED_WING,
            dialect.MAV_AUTOPILOT_INVALID,
            dialect.MAV_MODE_FLAG_SAFETY_ARMED | dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED,
            numbers.get(changes[place][1], 0),
            dialect.MAV_STATE_ACTIVE,
            3,
        )
        yield at, message  # before all others of its time: a vehicle is found by it


def _texts(flight: FlightTable) -> Iterator[Timed]:
    modes = [(at, dialect.MAV_SEVERITY_NOTICE, f"mode {name}") for at, name in flight.modes]
    texts = [(one.time_s, one.severity, one.text) for one in flight.texts]
    for at, severity, text in (*modes, *texts):
        yield (
            max(at, flight.begin_s),
            dialect.MAVLink_statustext_message(severity, text.encode()[:_TEXT]),
        )
