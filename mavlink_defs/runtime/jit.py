"""Compiled functions: numba, with the cache of `mavlink_defs.runtime.code_cache`.

With ``NUMBA_DISABLE_JIT=1`` the same functions run as plain Python.
"""

import functools
from collections.abc import Callable
from types import FunctionType
from typing import Any, TypeVar, cast

import numba
from numba.extending import is_jitted, overload

from mavlink_defs.runtime.code_cache import add_to_cache, forget_unreadable

_F = TypeVar("_F", bound=Callable[..., object])

_njit: Any = numba.njit  # whose types leave out some of its options
_compiled_functions: set[Callable[..., object]] = set()
OPTIONS: dict[str, Any] = {"error_model": "numpy", "nogil": True}
"""Of all compiled code: division by zero gives inf or NaN, as in numpy."""


def compiled(function: _F) -> _F:
    """Compile a function with numba on its first call, and keep the machine code on disk.

    Floating-point rules stay strict (no ``fastmath``), so that the same inputs give the
    same bits in every process and from every caller; division by zero gives inf or NaN as
    in numpy.
    """
    return _compiled(function, forceinline=False)


def is_compiled(function: Callable[..., object]) -> bool:
    """Return whether compiled code can call a function; none is with ``NUMBA_DISABLE_JIT=1``."""
    return function in _compiled_functions or is_jitted(function)


def compiled_for_python(function: _F) -> _F:
    """Compile a function as `compiled` does; how compiled code calls it is said elsewhere."""
    return _compiled(function, forceinline=False, inside=False)


def inlined(function: _F) -> _F:
    """Compile a function as `compiled` does, into the machine code of each caller.

    A call passes a tuple of arrays by value, seven words for each array: for the arrays of a fleet
    that takes longer than many a function.
    """
    return _compiled(function, forceinline=True)


def _compiled(function: _F, forceinline: bool, inside: bool = True) -> _F:
    """Return a function for Python; compiled code calls a variant that Python cannot.

    That variant takes half the time to compile: what unpacks Python's objects is often longer than
    the function, and an overload is compiled once for all calls with the same types, where numba
    would compile a function for each constant that it is called with.
    """
    if vars(numba.config)["DISABLE_JIT"]:
        return function
    inner = _renamed(function, f"{function.__qualname__}.inner")
    options: dict[str, Any] = {
        **OPTIONS,
        "no_cfunc_wrapper": True,
        "forceinline": forceinline,
        "cache": add_to_cache(function, inner),
    }
    entry: Any = None

    @functools.wraps(function)
    def call(*arguments: Any, **keywords: Any) -> Any:
        nonlocal entry
        if entry is None:
            entry = _njit(function, **options)
        try:
            return entry(*arguments, **keywords)
        except (AttributeError, ModuleNotFoundError):
            if not forget_unreadable():
                raise
            return entry(*arguments, **keywords)

    if inside:  # what is compiled into its caller is cached with that
        inside_options: Any = options | {"no_cpython_wrapper": True}
        inside_options["cache"] = options["cache"] and not forceinline
        overload(call, jit_options=inside_options, strict=False)(lambda *_, **__: inner)
    _compiled_functions.add(call)
    return cast(_F, call)


def _renamed(function: Callable[..., object], name: str) -> FunctionType:
    """Return a copy of a function whose code has a name of its own in the cache."""
    original = cast(FunctionType, function)
    copy = FunctionType(original.__code__, original.__globals__, closure=original.__closure__)
    functools.update_wrapper(copy, original)
    copy.__defaults__, copy.__kwdefaults__ = original.__defaults__, original.__kwdefaults__
    copy.__qualname__ = name
    return copy
