"""Values as a C function sees them: tuples of numbers in memory, and the call by an address.

A tuple of floats, integers and such tuples lies in memory as a C struct of doubles and 64-bit
integers, in order and without padding. Compiled code puts it on the stack.
"""

import ctypes
import functools
import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, TypeAlias, TypeVar, cast, get_args, get_origin, get_type_hints

import numpy as np

from mavlink_defs.runtime.jit import in_machine_code

Buffer: TypeAlias = bytes | ctypes.Array[ctypes.c_char]
T = TypeVar("T", bound=tuple[Any, ...])


def layout_of(kind: Any) -> np.dtype:
    """Return the memory of a tuple's type, such as a NamedTuple of floats and of other ones.

    Raises:
        TypeError: It holds something else than numbers.
    """
    if kind is float:
        return np.dtype("f8")
    if kind is int:
        return np.dtype("i8")
    if get_origin(kind) is tuple:
        inner = {layout_of(part) for part in get_args(kind)}
        if len(inner) == 1:  # of equal ones
            return np.dtype((inner.pop(), (len(get_args(kind)),)))
    elif isinstance(kind, type) and issubclass(kind, tuple):
        hints = get_type_hints(kind)
        return np.dtype([(name, layout_of(hints[name])) for name in hints])
    raise TypeError(f"{kind} is no number and no tuple of numbers")


def offset_of(layout: np.dtype, *names: str) -> int:
    """Return where a field of a field of a record begins [bytes]."""
    offset = 0
    for name in names:
        layout, at = dict(layout.fields or {})[name][:2]
        offset += at
    return offset


def tuple_at(kind: type[T], memory: Buffer) -> T:
    """Return a value of a tuple's type from memory of `layout_of` it."""
    form, make = _reader_of(kind)
    return cast(T, make(iter(form.unpack(memory))))


def bytes_of(value: tuple[Any, ...]) -> bytes:
    """Return the memory of a tuple, as `layout_of` its type.

    Raises:
        struct.error: It has other numbers.
    """
    form, _ = _reader_of(type(value))
    return form.pack(*_flat(value))


@functools.cache
def _reader_of(kind: Any) -> tuple[struct.Struct, Callable[[Iterator[float]], Any]]:
    return struct.Struct("=" + "".join(_codes(kind))), _maker_of(kind)


def _parts(kind: Any) -> Iterable[Any]:
    return get_args(kind) if get_origin(kind) is tuple else get_type_hints(kind).values()


def _codes(kind: Any) -> Iterator[str]:
    """Yield the code of each number as of the module struct."""
    if kind in {float, int}:
        yield "d" if kind is float else "q"
    else:
        for part in _parts(kind):
            yield from _codes(part)


def _maker_of(kind: Any) -> Callable[[Iterator[float]], Any]:
    """Return what takes the numbers of a value in order and makes it."""
    if kind in {float, int}:
        return next
    makers = [_maker_of(part) for part in _parts(kind)]
    if get_origin(kind) is tuple:
        return lambda numbers: tuple([make(numbers) for make in makers])
    return lambda numbers: kind(*[make(numbers) for make in makers])


def _flat(value: Iterable[Any]) -> Iterator[float]:
    for part in value:
        if isinstance(part, tuple):
            yield from _flat(part)
        else:
            yield part


def call(
    address: int, given: tuple[Any, ...], preset: T, records: tuple[np.void, ...]
) -> tuple[int, T]:
    """Call a C function by its address; return its status and the result.

    Args:
        address: Of the function. Its arguments are pointers: to `given`, to the result, and to
            each record.
        given: A tuple of numbers.
        preset: What the result is before.
        records: It may change them.
    """
    out = ctypes.create_string_buffer(bytes_of(preset))
    value = ctypes.create_string_buffer(bytes_of(given))
    status = _plainly_called(address, [value, out], records)
    size = layout_of(type(preset)).itemsize
    return status, tuple_at(type(preset), out.raw[:size])


def call_records(address: int, records: tuple[np.void, ...]) -> int:
    """Call a C function by its address with pointers to records; return its status."""
    return _plainly_called(address, [], records)


def _plainly_called(address: int, values: Sequence[Any], records: Sequence[np.void]) -> int:
    """Call a C function with copies of records, which are copied back."""
    copies = [np.array([record]) for record in records]
    passed = [*values, *(copy.ctypes.data_as(ctypes.c_void_p) for copy in copies)]
    status = c_function(len(passed))(int(address))(*passed)
    for record, copy in zip(records, copies, strict=True):
        for name in record.dtype.names or ():
            record[name] = copy[0][name]
    return int(status)


@functools.cache
def c_function(arguments: int) -> Any:
    """Return the type of a C function of so many pointers that returns an int32."""
    return ctypes.CFUNCTYPE(ctypes.c_int32, *[ctypes.c_void_p] * arguments)


# in compiled code


@in_machine_code(call)
def _call(tools: Any, address: Any, given: Any, preset: Any, records: Any) -> Any:

    for one in (given, preset):
        _check(tools, one, one.instance_class)
    result = tools.types.Tuple([tools.types.int64, preset])

    def build(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        function, value, initial, pointers = arguments
        out = _on_stack(builder, initial)
        passed = [_on_stack(builder, value), out]
        passed += [builder.extract_value(pointers, k) for k in range(len(records))]
        status = _called(tools, builder, function, passed)
        return context.make_tuple(builder, result, [status, builder.load(out)])

    return result(address, given, preset, records), build


@in_machine_code(call_records)
def _call_records(tools: Any, address: Any, records: Any) -> Any:

    def build(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        function, pointers = arguments
        passed = [builder.extract_value(pointers, k) for k in range(len(records))]
        return _called(tools, builder, function, passed)

    return tools.types.int64(address, records), build


def load(pointer: Any, like: T) -> T:
    """Return the tuple of the type of another one at a pointer; for compiled code alone."""
    raise NotImplementedError


@in_machine_code(load)
def _load(_tools: Any, pointer: Any, like: Any) -> Any:
    def build(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        kind = context.get_value_type(like).as_pointer()
        return builder.load(builder.bitcast(arguments[0], kind))

    return like(pointer, like), build


def store(pointer: Any, value: tuple[Any, ...]) -> None:
    """Write a tuple to a pointer; for compiled code alone."""
    raise NotImplementedError


@in_machine_code(store)
def _store(tools: Any, pointer: Any, value: Any) -> Any:

    _check(tools, value, value.instance_class)

    def build(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        kind = context.get_value_type(value).as_pointer()
        builder.store(arguments[1], builder.bitcast(arguments[0], kind))
        return context.get_dummy_value()

    return tools.types.void(pointer, value), build


def record_at(pointer: Any) -> Any:
    """Return the record at a pointer; for compiled code alone."""
    raise NotImplementedError


@in_machine_code(record_at)
def _record_at(_tools: Any, pointer: Any) -> Any:
    def build(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], context.get_value_type(pointer.dtype))

    return pointer.dtype(pointer), build


def _check(tools: Any, kind: Any, declared: Any) -> None:
    """Check that compiled code has the numbers that a tuple's type declares.

    Raises:
        TypingError: It has others.
    """
    if declared in {float, int}:
        fits = kind == (tools.types.float64 if declared is float else tools.types.int64)
    else:
        parts = list(_parts(declared))
        fits = isinstance(kind, tools.types.BaseTuple) and len(kind) == len(parts)
        for inner, part in zip(kind, parts, strict=True) if fits else ():
            _check(tools, inner, part)
    if not fits:
        raise tools.TypingError(f"expected {declared}, got {kind}")


def _on_stack(builder: Any, value: Any) -> Any:
    """Return a pointer to a value on the stack of the function."""
    with builder.goto_entry_block():
        place = builder.alloca(value.type)
    builder.store(value, place)
    return place


def _called(tools: Any, builder: Any, address: Any, pointers: Sequence[Any]) -> Any:
    """Return the status of a C function as an int64."""
    memory = tools.ir.IntType(8).as_pointer()
    kind = tools.ir.FunctionType(tools.ir.IntType(32), [memory] * len(pointers))
    function = builder.inttoptr(address, kind.as_pointer())
    status = builder.call(function, [builder.bitcast(pointer, memory) for pointer in pointers])
    return builder.sext(status, tools.ir.IntType(64))
