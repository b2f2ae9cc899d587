"""Memory in compiled loops: arrays that nobody counts references to, copies of blocks."""

from typing import Any, TypeVar, cast

import numba
import numpy as np
from numba.core import cgutils, types
from numba.extending import intrinsic

from mavlink_defs.runtime.jit import compiled

__all__ = ["borrowed", "copy_bytes", "copy_record", "copy_values"]

_T = TypeVar("_T")
_tools = cast("Any", cgutils)  # without annotations


def _without_owner(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """Return an array, or a tuple of such, that nobody owns."""
    if isinstance(kind, types.Array):
        array = context.make_array(kind)(context, builder, value)
        for pointer in ("meminfo", "parent"):
            setattr(array, pointer, _tools.get_null_value(getattr(array, pointer).type))
        return array._getvalue()
    if isinstance(kind, types.BaseTuple):
        parts = zip(cast("Any", kind), _tools.unpack_tuple(builder, value), strict=True)
        return context.make_tuple(
            builder, kind, [_without_owner(context, builder, inner, part) for inner, part in parts]
        )
    return value


@intrinsic
def _borrowed(_context: Any, kind: Any) -> Any:
    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _without_owner(context, builder, signature.args[0], arguments[0])

    return kind(kind), build


@intrinsic
def _copy_record(_context: Any, target: Any, source: Any) -> Any:
    if not isinstance(target, types.Record) or target != source:
        return None

    def build(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        size = context.get_constant(types.intp, target.size)
        _tools.raw_memcpy(builder, *arguments, size, 1)
        return context.get_dummy_value()

    return types.void(target, source), build


def _same(value: _T) -> _T:
    return value


def _assign(target: np.void, source: np.void) -> None:
    for name in target.dtype.names or ():
        target[name] = source[name]


_plain = vars(numba.config)["DISABLE_JIT"]

borrowed = _same if _plain else cast("Any", _borrowed)
"""Return an array, or a tuple of arrays and tuples, whose references are not counted.

Compiled code counts a reference, by an atomic instruction, whenever it takes an array out of a
tuple: hundreds of times per step. A compiled entry point whose caller keeps the arrays alive
borrows them in its first line; nothing that it returns may hold one of them.
"""

copy_record = _assign if _plain else cast("Any", _copy_record)
"""Copy a record to another one of the same dtype (target, source).

An assignment to an element of an array copies a record byte by byte.
"""


@compiled
def copy_bytes(target: np.ndarray, at: int, source: np.ndarray, begin: int, size: int) -> None:
    """Copy source[begin : begin + size] to target[at : at + size]; faster to compile, as below.

    Args:
        target: Bytes, uint8.
        at: Where to copy to.
        source: Bytes, uint8.
        begin: Where to copy from.
        size: How many.
    """
    for k in range(size):
        target[at + k] = source[begin + k]


@compiled
def copy_values(target: np.ndarray, source: np.ndarray) -> None:
    """Copy the first elements of an array, as many as the target has.

    An assignment to a slice takes as long to compile as many a function, for its error messages.

    Args:
        target: Shape (n,).
        source: Shape (n,) or longer.
    """
    for k in range(len(target)):
        target[k] = source[k]
