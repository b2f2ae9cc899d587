"""Tuples of numbers: what laws are given, made of arrays, and with one field replaced."""

from typing import Any, TypeAlias, TypeVar, cast

import numpy as np

from mavlink_defs.runtime.jit import compiled, in_machine_code
from sitl_plant.vec3 import Vec3, vec3

Four: TypeAlias = tuple[float, float, float, float]
"""A number of each channel: airspeed, roll, pitch, yaw; or aileron, elevator, rudder, thrust."""
Rows: TypeAlias = tuple[Vec3, Vec3, Vec3, Vec3]
"""A value of each channel, and its first two derivatives."""
T = TypeVar("T", bound=tuple[Any, ...])


@compiled
def four(a: np.ndarray) -> Four:
    """Return the elements of an array of shape (4,)."""
    return a[0], a[1], a[2], a[3]


@compiled
def rows_of(a: np.ndarray) -> Rows:
    """Return the rows of an array of shape (4, 3)."""
    return vec3(a[0]), vec3(a[1]), vec3(a[2]), vec3(a[3])


def replaced(values: T, field: str, value: Any) -> T:
    """Return a NamedTuple with another value of a field.

    This is `_replace`, which compiled code has not; the field is a literal there.
    """
    made: T = cast(Any, values)._replace(**{field: value})
    return made


@in_machine_code(replaced)
def _replaced(_tools: Any, values: Any, field: Any, value: Any) -> Any:
    name = getattr(field, "literal_value", None)
    if name is None:
        return None
    k = values.fields.index(name)

    def build(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.insert_value(arguments[0], arguments[2], k)

    return values(values, field, values[k]), build
