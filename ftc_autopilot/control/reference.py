"""The reference: profile segments, and the filter that makes them continuous (Assumption 4).

Channels are in the order airspeed [m/s], roll, pitch, yaw [rad].
"""

import math
from typing import NamedTuple

import numpy as np

from ftc_autopilot.common.angles import wrap
from mavlink_defs.profile import MAX_SEGMENTS, Segment
from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import Vec3, square

_CHANNELS, _YAW = 4, 3


class Reference(NamedTuple):
    """The filtered reference at one instant."""

    V: float  # airspeed [m/s]
    V_dot: float  # [m/s²]
    phi: Vec3  # roll, pitch, yaw [rad]
    phi_dot: Vec3  # their derivatives [rad/s]


PROFILE = np.dtype(
    [
        ("count", "i8"),  # segments in use
        ("start", "f8", (MAX_SEGMENTS,)),  # exclusive [s]
        ("value", "f8", (MAX_SEGMENTS, 4)),
        ("ramp", "i8", (MAX_SEGMENTS,)),
    ]
)


def profile_record(segments: tuple[Segment, ...]) -> np.void:
    """Turn checked segments into a record of dtype `PROFILE`, SI units and radians."""
    record: np.void = np.zeros(1, PROFILE)[0]
    record["count"] = len(segments)
    for i, segment in enumerate(segments):
        angles = (segment.roll_deg, segment.pitch_deg, segment.yaw_deg)
        record["start"][i] = segment.start_s
        record["value"][i] = (segment.airspeed_m_s, *map(math.radians, angles))
        record["ramp"][i] = segment.ramp
    return record


def profile_segments(record: np.void) -> tuple[Segment, ...]:
    """Return the segments of a record of dtype `PROFILE`, angles to their last digits but one."""
    count = int(record["count"])
    return tuple(
        Segment(start, airspeed, _degrees(roll), _degrees(pitch), _degrees(yaw), bool(ramp))
        for start, (airspeed, roll, pitch, yaw), ramp in zip(
            record["start"][:count].tolist(),
            record["value"][:count].tolist(),
            record["ramp"][:count],
            strict=True,
        )
    )


def _degrees(angle: float) -> float:
    return float(f"{math.degrees(angle):.14g}")


@compiled
def profile_value(profile: np.void, t: float, value: np.ndarray) -> None:
    """Write the commanded, unfiltered reference at time t [s] since the mission's start.

    A segment is in force over (start, start of the next one]; the first one also at its start.

    Args:
        profile: Record of dtype `PROFILE` with at least one segment.
        t: Time since the mission's start [s].
        value: Shape (4,), is written.
    """
    i = 0
    while i + 1 < profile["count"] and profile["start"][i + 1] < t:
        i += 1
    share = 1.0
    if profile["ramp"][i]:
        start = profile["start"][i]
        share = (t - start) / (profile["start"][i + 1] - start)
    for c in range(_CHANNELS):
        here = profile["value"][i, c]
        if share == 1.0:
            value[c] = here
        else:
            before = profile["value"][i - 1, c]
            change = wrap(here - before) if c == _YAW else here - before
            value[c] = before + share * change


@compiled
def start_filter(value: np.ndarray, x: np.ndarray) -> None:
    """Set the filter state x, shape (4, 3), to rest at a value, shape (4,)."""
    for c in range(_CHANNELS):
        x[c, 0] = value[c]
        x[c, 1] = 0.0
        x[c, 2] = 0.0


@compiled
def read_reference(x: np.ndarray) -> Reference:
    """Return the reference of a filter state, shape (4, 3)."""
    return Reference(x[0, 0], x[0, 1], (x[1, 0], x[2, 0], x[3, 0]), (x[1, 1], x[2, 1], x[3, 1]))


@compiled
def filter_reference(command: np.ndarray, x: np.ndarray, bandwidth: float, dt: float) -> None:
    """Make one explicit Euler step of (ω/(s+ω))³ per channel; yaw turns the short way round.

    Args:
        command: Unfiltered reference, shape (4,).
        x: Filtered reference and its first two derivatives, shape (4, 3), updated in place.
        bandwidth: ω [rad/s].
        dt: Step [s].
    """
    for c in range(_CHANNELS):
        error = command[c] - x[c, 0]
        if c == _YAW:
            error = wrap(error)
        jerk = (
            square(bandwidth) * bandwidth * error
            - 3.0 * square(bandwidth) * x[c, 1]
            - 3.0 * bandwidth * x[c, 2]
        )
        x[c, 0] += dt * x[c, 1]
        x[c, 1] += dt * x[c, 2]
        x[c, 2] += dt * jerk
