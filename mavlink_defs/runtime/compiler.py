"""What numba makes of our functions; imported when something has to be compiled.

Every function has two variants: an entry for Python, and one for compiled code that Python cannot
call. The latter takes half the time to compile: what unpacks Python's objects is often longer than
the function, and an overload is compiled once for all calls with the same types, where numba
would compile a function for each constant that it is called with.
"""

import functools
import inspect
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from types import FunctionType
from typing import Any, cast

import numba
import numpy as np
from llvmlite import ir
from numba import extending
from numba.core import cgutils, types
from numba.core.compiler_lock import global_compiler_lock
from numba.core.errors import NumbaError, TypingError

from mavlink_defs.runtime.code_cache import add_to_cache, forget_unreadable
from mavlink_defs.runtime.parts import Part

is_jitted = extending.is_jitted

# what `jit.in_machine_code` builds with
__all__ = ["NumbaError", "TypingError", "cgutils", "ir", "types"]

_njit: Any = numba.njit  # whose types leave out some of its options
_extending: Any = extending
_cfunc: Any = numba.cfunc
_typeof: Any = numba.typeof
_types: Any = types  # without annotations
_RULES: dict[str, Any] = {"error_model": "numpy", "nogil": True}
_UNWRAPPED: dict[str, Any] = {"no_cfunc_wrapper": True, "no_cpython_wrapper": True}
_options: dict[Callable[..., object], dict[str, Any]] = {}
_parts: dict[Callable[..., object], Part] = {}


def do(waiting: list[Callable[[], None]]) -> None:
    """Do what waits for this module, once; other threads wait meanwhile."""
    with global_compiler_lock:
        while waiting:
            waiting.pop(0)()


def add_function(
    call: Callable[..., object], function: Callable[..., object], forceinline: bool
) -> None:
    """Let compiled code call a function.

    Args:
        call: As it stands in the code of its callers.
        function: The function itself.
        forceinline: Whether it is compiled into its callers.
    """
    inner = _renamed(function, f"{function.__qualname__}.inner")
    cache = add_to_cache(function, inner)
    _options[function] = {"cache": cache}
    inside: Any = {
        **_RULES,
        **_UNWRAPPED,
        "forceinline": forceinline,
        "cache": cache and not forceinline,  # what is compiled into its callers lies with them
    }
    _extending.overload(call, jit_options=inside, strict=False)(lambda *_, **__: inner)


def add_part(
    call: Callable[..., object],
    function: Callable[..., object],
    memory: Mapping[str, Any],
    ahead: bool,
) -> None:
    """Let compiled code call a function that is compiled apart.

    Args:
        call: As of `add_function`.
        function: As of `add_function`.
        memory: As of `jit.apart`.
        ahead: Whether code is made ahead of time: all of it is one module then, nothing is apart.
    """
    if not ahead:
        compile_as = functools.partial(_part_of, function)
        _parts[function] = Part(function, call, memory, compile_as)
    add_function(call, function, forceinline=False)  # for records of others that have more


def load_part(function: Callable[..., object]) -> None:
    """Compile a function that is compiled apart, or load it from the cache."""
    if function in _parts:
        _parts[function].resolve()


def _part_of(function: Callable[..., object], signature: Any) -> Any:
    made: Any = _njit(function, **_RULES, **_UNWRAPPED, **_options[function])
    try:
        made.compile(signature)
    except (AttributeError, ModuleNotFoundError):
        if not forget_unreadable():
            raise
        made.compile(signature)
    return made


def entry_of(function: Callable[..., object]) -> Callable[..., Any]:
    """Return what Python calls in the place of a function; a call compiles it, unless cached."""
    entry: Callable[..., Any] = _njit(
        function, **_RULES, no_cfunc_wrapper=True, **_options[function]
    )

    def call(*arguments: Any, **keywords: Any) -> Any:
        try:
            return entry(*arguments, **keywords)
        except (AttributeError, ModuleNotFoundError):
            if not forget_unreadable():
                raise
            return entry(*arguments, **keywords)

    return call


def types_of(arguments: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return numba's types of arguments."""
    return tuple(_typeof(one) for one in arguments)


def c_function_of(
    function: Callable[..., int], records: Iterable[np.dtype], sources: tuple[Path, ...]
) -> Any:
    """Return a C function, with its `address`, that numba makes of a function.

    Args:
        function: Of pointers to records; returns a status.
        records: Their types.
        sources: Files that its code depends on beside its own file.

    Raises:
        NumbaError: It cannot be compiled.
    """
    pointers = [_types.CPointer(numba.from_dtype(dtype)) for dtype in records]
    cached = add_to_cache(function, further=sources)
    return _cfunc(_types.int32(*pointers), cache=cached, error_model="numpy")(function)


def add_builtin(plain: Callable[..., object], typed: Callable[..., Any]) -> None:
    """Let compiled code have what `typed` builds where a function is called."""

    def typer(_context: Any) -> Callable[..., Any]:
        def signature(*kinds: Any) -> Any:
            made = typed(*kinds)
            return None if made is None else made[0]

        vars(signature)["__signature__"] = inspect.signature(plain)
        return signature

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return typed(*signature.args)[1](context, builder, signature, arguments)

    _extending.type_callable(plain)(typer)
    _extending.lower_builtin(plain, _types.VarArg(_types.Any))(build)


def _renamed(function: Callable[..., object], name: str) -> FunctionType:
    """Return a copy of a function whose code has a name of its own in the cache."""
    original = cast(FunctionType, function)
    copy = FunctionType(original.__code__, original.__globals__, closure=original.__closure__)
    functools.update_wrapper(copy, original)
    copy.__defaults__, copy.__kwdefaults__ = original.__defaults__, original.__kwdefaults__
    copy.__qualname__ = name
    return copy
