"""Fields of a log's messages as channels."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from gcs.results.logs.names import UNITS, factor
from gcs.results.logs.table import LogChannel, channel

Fields = Mapping[str, tuple[str, str]]
"""From our name of a channel to the message's field and its unit."""
Values = Mapping[str, np.ndarray]
"""Fields of many messages, each of shape (n,)."""


def vector(ours: tuple[str, ...], theirs: str, unit: str) -> dict[str, tuple[str, str]]:
    """Return the fields of a vector: `theirs` are names, apart by blanks."""
    return {name: (field, unit) for name, field in zip(ours, theirs.split(), strict=True)}


def numbered(ours: tuple[str, ...], theirs: str, unit: str) -> dict[str, tuple[str, str]]:
    """Return fields that are numbered from 1, by their pattern as of `str.format`."""
    return {name: (theirs.format(k), unit) for k, name in enumerate(ours, start=1)}


def channels_of(
    message: str, fields: Fields, time_s: np.ndarray, values: Values, clock: str
) -> Iterator[LogChannel | None]:
    """Yield what the messages of one kind have of some fields.

    Args:
        message: Name of the messages, for people.
        fields: What is asked for.
        time_s: Time of each message, shape (n,) [s].
        values: What they have.
        clock: As of `LogChannel`.
    """
    for name, (field, unit) in fields.items():
        if field in values:
            numbers = values[field] * (factor(unit, UNITS[name]) or 1.0)
            yield channel(name, time_s, numbers, f"{message}.{field}", clock)


def between(values: Values, begin_s: float, end_s: float, zero_s: float) -> Values:
    """Return the messages from one time to another.

    Args:
        values: Their fields, of which `time_s` says when they are; without it none is returned.
        begin_s: First time [s].
        end_s: Last time [s].
        zero_s: From which the times returned count [s].
    """
    time_s = values.get("time_s", np.empty(0))
    inside = (time_s >= begin_s) & (time_s <= end_s)
    found = {name: one[inside] for name, one in values.items()} if len(time_s) else {}
    return {**found, "time_s": time_s[inside] - zero_s}


def rows(values: Values, *names: str) -> Iterator[tuple[Any, ...]]:
    """Yield some fields of each message; nothing if one of them is missing."""
    if all(one in values for one in names):
        yield from zip(*(values[one].tolist() for one in names), strict=True)


def euler(q: np.ndarray) -> np.ndarray:
    """Return roll, pitch and yaw of rotations from body axes to north, east, down.

    Args:
        q: Quaternions (w, x, y, z) of Hamilton's convention, shape (4, n).

    Returns:
        Of the sequence yaw, pitch, roll, shape (3, n) [rad].
    """
    w, x, y, z = q
    return np.stack(
        [
            np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x**2 + y**2)),
            np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0)),
            np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y**2 + z**2)),
        ]
    )


def with_angles(values: Values, parts: str) -> Values:
    """Return the values with `roll`, `pitch`, `yaw` of a quaternion, if it is there.

    Args:
        values: Fields of messages.
        parts: The quaternion's fields, apart by blanks, scalar first.
    """
    names = parts.split()
    if any(name not in values for name in names):
        return values
    angles = euler(np.stack([np.asarray(values[name], float) for name in names]))
    return {**values, **dict(zip(("roll", "pitch", "yaw"), angles, strict=True))}


def with_course(values: Values, speed: str, course: str, degrees: float = 1.0) -> Values:
    """Return the values with `north` and `east` of a speed over ground and its direction.

    Args:
        values: Fields of messages.
        speed: Name of the speed.
        course: Name of the direction, from north over east.
        degrees: What one of it is in deg.
    """
    if speed not in values or course not in values:
        return values
    angle = np.radians(values[course] * degrees)
    return {
        **values,
        "north": values[speed] * np.cos(angle),
        "east": values[speed] * np.sin(angle),
    }
