"""Compiled functions: numba, with the cache of `mavlink_defs.runtime.code_cache`.

With ``NUMBA_DISABLE_JIT=1`` the same functions run as plain Python.
"""

import functools
import importlib
import sys
from collections.abc import Callable, Iterable
from typing import Any, TypeVar, cast

import numba

from mavlink_defs.runtime.code_cache import code_cache_of
from mavlink_defs.runtime.linked_code import EntryCompiler, LinkedCompiler

_F = TypeVar("_F", bound=Callable[..., object])

_BLAS = ("scipy.linalg", "scipy.linalg.cython_blas")


def _import_array_functions() -> None:
    """Import what numba would import at the first call, but without scipy, in half the time.

    It looks for scipy's BLAS then, for `np.cov` alone, which does without it as well. `np.dot` and
    the like look for it when they are compiled.
    """
    found = {name: sys.modules.get(name) for name in _BLAS}
    sys.modules.update(dict.fromkeys(_BLAS, cast(Any, None)))  # as if it were not installed
    importlib.import_module("numba.np.arraymath")
    for name, module in found.items():
        del sys.modules[name]
        if module is not None:
            sys.modules[name] = module


_import_array_functions()
_unliteral: Any = numba.types.unliteral  # which has no types of its own
_njit: Any = numba.njit  # whose types leave out some of its options


def compiled(function: _F) -> _F:
    """Compile a function with numba on its first call, and keep the machine code on disk.

    Floating-point rules stay strict (no ``fastmath``), so that the same inputs give the
    same bits in every process and from every caller; division by zero gives inf or NaN as
    in numpy.
    """
    return _compiled(function, inline=False)


def inlined(function: _F) -> _F:
    """Compile a function as `compiled` does, into the machine code of each caller.

    A call passes a tuple of arrays by value, seven words for each array: for the arrays of a fleet
    that takes longer than many a function.
    """
    return _compiled(function, inline=True)


def _compiled(function: _F, inline: bool) -> _F:
    dispatcher = _dispatcher(function, EntryCompiler, inline)
    if not vars(numba.config)["DISABLE_JIT"]:
        _lend_to_compiled_code(dispatcher, function, inline)
    return cast(_F, dispatcher)


def _dispatcher(
    function: Callable[..., object],
    compiler: type[EntryCompiler | LinkedCompiler],
    inline: bool,
) -> Any:
    """Return numba's wrapper of a function, for Python or for compiled code."""
    linked = compiler is LinkedCompiler
    dispatcher = _njit(
        error_model="numpy",
        nogil=True,
        forceinline=inline,
        no_cfunc_wrapper=True,
        no_cpython_wrapper=linked,
        pipeline_class=compiler,
    )(function)
    if (cache := code_cache_of(function, "linked" if linked else "")) is not None:
        dispatcher._cache = cache  # as its `enable_caching` does
    return dispatcher


def _lend_to_compiled_code(dispatcher: Any, function: Callable[..., object], inline: bool) -> None:
    """Let compiled code call a variant that Python cannot.

    It is made sooner: what unpacks Python's objects is often longer than the function. The variant
    is one for all calls with the same types: numba would compile a function anew for each constant
    that it is called with.
    """

    @functools.cache
    def variant() -> Any:
        return _dispatcher(function, LinkedCompiler, inline)

    def call_template(arguments: Iterable[Any], keywords: dict[str, Any]) -> Any:
        plain = {name: _unliteral(kind) for name, kind in keywords.items()}
        return variant().get_call_template(tuple(map(_unliteral, arguments)), plain)

    dispatcher.get_call_template = call_template
    dispatcher.get_overload = lambda signature: variant().get_overload(signature)
