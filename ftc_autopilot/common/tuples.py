"""Tuples of numbers: what laws are given, made of arrays, and with one field replaced."""

from collections.abc import Callable
from typing import Any, TypeAlias, TypeVar, cast

import numba
import numpy as np
from numba.extending import intrinsic

from mavlink_defs.runtime.jit import compiled
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


def _plainly_replaced(values: T, field: str, value: Any) -> T:
    made: T = cast(Any, values)._replace(**{field: value})
    return made


@intrinsic(prefer_literal=True)
def _replaced(_context: Any, values: Any, field: Any, value: Any) -> Any:
    k = values.fields.index(field.literal_value)

    def build(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.insert_value(arguments[0], arguments[2], k)

    return values(values, field, values[k]), build


_plain = vars(numba.config)["DISABLE_JIT"]
replaced: Callable[[T, str, Any], T] = _plainly_replaced if _plain else cast(Any, _replaced)
"""Return a NamedTuple with another value of a field (values, field, value); for compiled code.

`_replace`, which compiled code has not; the field is a literal.
"""
