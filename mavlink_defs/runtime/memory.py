"""Memory in compiled loops: uncounted arrays, tables of them, copies of blocks, hash tables."""

from typing import Any, TypeVar, cast

import numba
import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic

from mavlink_defs.runtime.jit import compiled

_T = TypeVar("_T")
_HASH_FACTOR = 0x9E3779B1
_tools = cast("Any", cgutils)  # without annotations


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
def _size(_context: Any, kind: Any) -> Any:
    def build(context: Any, _builder: Any, _signature: Any, _arguments: Any) -> Any:
        size = context.get_abi_sizeof(context.get_value_type(kind))
        return context.get_constant(types.intp, size)

    return types.intp(kind), build


@intrinsic
def _store(_context: Any, table: Any, at: Any, kind: Any) -> Any:
    def build(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        array, index, value = arguments
        entry = _entry(context, builder, table, array, index, kind)
        builder.store(value, entry)
        return context.get_dummy_value()

    return types.void(table, at, kind), build


@intrinsic
def _load(_context: Any, table: Any, at: Any, kind: Any) -> Any:
    def build(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        array, index, _ = arguments
        value = _parts(builder, _entry(context, builder, table, array, index, kind))
        return _without_owner(context, builder, kind, value)  # which the compiler then knows

    return kind(table, at, kind), build


def _entry(context: Any, builder: Any, table: Any, array: Any, index: Any, kind: Any) -> Any:
    """Return a pointer to an entry of a table."""
    data = context.make_array(table)(context, builder, array).data
    pointer = builder.bitcast(data, context.get_value_type(kind).as_pointer())
    return builder.gep(pointer, [index])


def _parts(builder: Any, pointer: Any) -> Any:
    """Load a value part by part, so that the compiler leaves out what is not used."""
    kind = pointer.type.pointee
    if not isinstance(kind, ir.Aggregate):
        return builder.load(pointer)
    value = ir.Constant(kind, ir.Undefined)
    for k in range(len(kind)):
        part = _parts(builder, _tools.gep_inbounds(builder, pointer, 0, k))
        value = builder.insert_value(value, part, k)
    return value


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


_size_compiled, _store_compiled = cast("Any", _size), cast("Any", _store)


@compiled
def _size_of(value: object) -> int:
    size: int = _size_compiled(value)
    return size


@compiled
def _store_in(table: np.ndarray, at: int, value: object) -> None:
    _store_compiled(table, at, value)


def _new_table(count: int, like: object) -> np.ndarray:
    return np.zeros((count, _size_of(like) // 8), np.int64)


def _new_list(count: int, _like: object) -> list[object]:
    return [None] * count


def _set(table: list[object], at: int, value: object) -> None:
    table[at] = value


def _get(table: list[object], at: int, _like: object) -> object:
    return table[at]


_plain = vars(numba.config)["DISABLE_JIT"]

borrowed = _same if _plain else cast("Any", _borrowed)
"""Return an array, or a tuple of arrays and tuples, whose references are not counted.

Compiled code counts a reference, by an atomic instruction, whenever it takes an array out of a
tuple: hundreds of times per step. A compiled entry point whose caller keeps the arrays alive
borrows them in its first line; nothing that it returns may hold one of them.
"""

new_table: Any = _new_list if _plain else _new_table
"""Return a table with a number of entries for tuples of one type (count, like).

Compiled code cannot index tuples of tuples by a variable; a table it can. It holds no references:
its caller keeps the arrays alive.
"""

store_tuple: Any = _set if _plain else _store_in
"""Write a tuple of arrays and tuples to an entry of a table (table, at, tuple); for Python."""

load_tuple: Any = _get if _plain else _load
"""Return the tuple of an entry, borrowed (table, at, like); for compiled code.

`like` is a tuple of the same type.
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
