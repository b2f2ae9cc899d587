"""Memory in compiled loops: uncounted arrays, bytes of records, copies of blocks, hash tables."""

import ctypes
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numba.core import cgutils, types
from numba.extending import intrinsic

from mavlink_defs.runtime.jit import compiled, inlined

_T = TypeVar("_T")
_HASH_FACTOR = 0x9E3779B1
_tools = cast("Any", cgutils)  # without annotations
_carray = cast("Any", numba).carray
_POINTER = cast("Any", types).CPointer(types.uint8)


def _without_owner(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """Return an array, or a tuple of such, that nobody owns."""
    if isinstance(kind, types.Array):
        model = context.data_model_manager[kind]
        for owner in ("meminfo", "parent"):
            nobody = _tools.get_null_value(model.get(builder, value, owner).type)
            value = model.set(builder, value, nobody, owner)
        return value
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


@intrinsic
def _address(_context: Any, record: Any) -> Any:
    if not isinstance(record, types.Record):
        return None

    def build(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], _tools.voidptr_t)

    return _POINTER(record), build


@intrinsic
def _size(_context: Any, record: Any) -> Any:
    def build(context: Any, _builder: Any, signature: Any, _arguments: Any) -> Any:
        return context.get_constant(types.intp, signature.args[0].size)

    return types.intp(record), build


_address_of, _size_of = cast("Any", _address), cast("Any", _size)


@inlined
def _compiled_bytes_of(record: np.void) -> np.ndarray:
    memory: np.ndarray = _carray(_address_of(record), (_size_of(record),))
    return memory


def plain_bytes_of(record: np.void) -> np.ndarray:
    """Do what `bytes_of` does in plain Python; the record's owner must outlive the result."""
    memory = np.frombuffer(record.data, np.uint8)  # numpy hands out a read-only one
    writable = (ctypes.c_uint8 * memory.size).from_address(memory.ctypes.data)
    return np.ctypeslib.as_array(writable)


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

bytes_of: Any = plain_bytes_of if _plain else _compiled_bytes_of
"""Return the bytes of a record, uint8, which share its memory (record); for compiled code."""

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


@compiled
def slot_of(keys: np.ndarray, key: int) -> int:
    """Return the slot that holds a key of a hash table; the free one for it if none does.

    The table is an array of keys > 0 by open addressing; 0 marks a free slot, of which there is
    always one. Nothing is ever removed: to forget a key, fill the array again.

    Args:
        keys: Shape (2**n,) int64.
        key: What to search for, > 0.
    """
    mask = keys.size - 1
    sought = int(key)
    slot = (((sought ^ (sought >> 29)) * _HASH_FACTOR) >> 13) & mask
    while keys[slot] != 0 and keys[slot] != sought:
        slot = (slot + 1) & mask
    return int(slot)
