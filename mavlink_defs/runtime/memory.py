"""Memory in compiled loops: uncounted arrays, bytes of records, copies of blocks, hash tables."""

import ctypes
from typing import Any, TypeVar

import numpy as np

from mavlink_defs.runtime.jit import compiled, in_machine_code

_T = TypeVar("_T")
_HASH_FACTOR = 0x9E3779B1


def borrowed(value: _T) -> _T:
    """Return an array, or a tuple of arrays and tuples, whose references are not counted.

    Compiled code counts a reference, by an atomic instruction, whenever it takes an array out of a
    tuple: hundreds of times per step. A compiled entry point whose caller keeps the arrays alive
    borrows them in its first line; nothing that it returns may hold one of them.
    """
    return value


@in_machine_code(borrowed)
def _borrowed(tools: Any, kind: Any) -> Any:
    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _without_owner(tools, context, builder, signature.args[0], arguments[0])

    return kind(kind), build


def _without_owner(tools: Any, context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """Return an array, or a tuple of such, that nobody owns."""
    if isinstance(kind, tools.types.Array):
        model = context.data_model_manager[kind]
        for owner in ("meminfo", "parent"):
            nobody = tools.cgutils.get_null_value(model.get(builder, value, owner).type)
            value = model.set(builder, value, nobody, owner)
        return value
    if isinstance(kind, tools.types.BaseTuple):
        parts = zip(kind, tools.cgutils.unpack_tuple(builder, value), strict=True)
        without = [_without_owner(tools, context, builder, *part) for part in parts]
        return context.make_tuple(builder, kind, without)
    return value


def copy_record(target: np.void, source: np.void) -> None:
    """Copy a record to another one of the same dtype.

    An assignment to an element of an array copies a record byte by byte.
    """
    for name in target.dtype.names or ():
        target[name] = source[name]


@in_machine_code(copy_record)
def _copy_record(tools: Any, target: Any, source: Any) -> Any:

    if not isinstance(target, tools.types.Record) or target != source:
        return None

    def build(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        size = context.get_constant(tools.types.intp, target.size)
        tools.cgutils.raw_memcpy(builder, *arguments, size, 1)
        return context.get_dummy_value()

    return tools.types.void(target, source), build


def bytes_of(record: np.void) -> np.ndarray:
    """Return the bytes of a record, uint8, which share its memory; its owner must outlive them."""
    memory = np.frombuffer(record.data, np.uint8)  # numpy hands out a read-only one
    writable = (ctypes.c_uint8 * memory.size).from_address(memory.ctypes.data)
    return np.ctypeslib.as_array(writable)


@in_machine_code(bytes_of)
def _bytes_of(tools: Any, record: Any) -> Any:

    if not isinstance(record, tools.types.Record):
        return None
    memory = tools.types.Array(tools.types.uint8, 1, "C")

    def build(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        size, one = (context.get_constant(tools.types.intp, number) for number in (record.size, 1))
        parts = {
            "nitems": size,
            "itemsize": one,
            "data": builder.bitcast(arguments[0], tools.cgutils.voidptr_t),
            "shape": tools.cgutils.pack_array(builder, [size]),
            "strides": tools.cgutils.pack_array(builder, [one]),
        }
        model = context.data_model_manager[memory]
        value = context.get_constant_null(memory)
        for name, part in parts.items():
            value = model.set(builder, value, part, name)
        return value

    return memory(record), build


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
