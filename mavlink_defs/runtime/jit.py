"""Compiled functions: their machine code came with the package, or numba makes it.

Machine code that was made when the wheel was built is called if it is of these sources
(`mavlink_defs.runtime.prebuilt`). Otherwise numba, which is imported only then, compiles a function
on its first call and keeps the code on disk (`mavlink_defs.runtime.cache_folder`).

With ``NUMBA_DISABLE_JIT=1`` the same functions run as plain Python.
"""

import functools
import inspect
import os
from collections.abc import Callable, Iterable
from types import FunctionType
from typing import Any, TypeAlias, TypeVar, cast

import numpy as np

from mavlink_defs.config.problems import ConfigError, Problem
from mavlink_defs.runtime.prebuilt import Kinds, entries_of, is_complete, kinds_of, why_not

_F = TypeVar("_F", bound=Callable[..., object])
_Typed = Callable[..., Any]
Memory: TypeAlias = np.dtype | np.ndarray | tuple[Any, ...]

PLAIN = os.environ.get("NUMBA_DISABLE_JIT", "0") not in {"", "0"}
"""Whether all runs as plain Python."""

_compiled_functions: set[Callable[..., object]] = set()
_imported: list[Any] = []  # the module `mavlink_defs.runtime.compiler`, once it is needed
_waiting: list[Callable[[], None]] = []
_apart: dict[Callable[..., object], Callable[..., object]] = {}
EVERYTHING = "everything"
"""All parts of the numeric core."""
listeners: list[Callable[[Callable[..., object], tuple[Any, ...]], None]] = []
"""Called with every function that Python calls, and all its arguments."""


class CompilerMissing(ConfigError):  # noqa: N818 - the name says it
    """Something has to be compiled, and numba is not installed."""


def compiled(function: _F) -> _F:
    """Compile a function on its first call, unless its machine code came with the package.

    Floating-point rules stay strict (no ``fastmath``), so that the same inputs give the
    same bits in every process and from every caller; division by zero gives inf or NaN as
    in numpy.
    """
    return _compiled(function, forceinline=False)


def inlined(function: _F) -> _F:
    """Compile a function as `compiled` does, into the machine code of each caller.

    For functions of a few operations: a call, with its tuples by value, takes longer than they do.
    """
    return _compiled(function, forceinline=True)


def apart(**memory: Memory) -> Callable[[_F], _F]:
    """Compile a function as `compiled` does, but apart from what calls it.

    Compiled code calls it by an address: a caller is compiled without it, what a flight does not
    call is not compiled, and what it calls is compiled once, not into each level above it. The
    first call makes the code, or loads it from the cache; `load` does that ahead of a flight. It is
    for functions of which a flight needs few, or that several levels would repeat.

    Args:
        memory: The dtype of each argument that is a record, an example of one that is an array or
            holds one. The others are numbers and tuples of such, and so is what it returns, as
            annotated; none has a default.
    """

    def decorate(function: _F) -> _F:
        call = _entry(function)
        if not PLAIN:
            _apart[call] = function
            _when_compiling(
                lambda numba_side: numba_side.add_part(call, function, memory, bool(listeners))
            )
        return call

    return decorate


def apart_in(module: str) -> list[Callable[..., object]]:
    """Return the functions that are compiled apart of a module, and of the package around it."""
    place = module.removesuffix(".parameters")
    return [one for one in _apart if one.__module__.startswith(place)]


def load(*functions: Callable[..., object]) -> None:
    """Have functions ready that are compiled apart: their first calls would else make them so.

    Raises:
        CompilerMissing: Numba is not installed.
        OSError: The cache cannot be read.
    """
    if PLAIN or is_complete():
        return
    for function in functions:
        compiler(*why_not(_apart[function])).load_part(_apart[function])


def in_python(function: _F) -> _F:
    """Return a compiled function, and what it calls, as plain Python: few calls need no compiler.

    The bits are the same of sums, products, comparisons, and quotients of what is not zero.
    """
    if function not in _compiled_functions:
        return function
    plain = cast(FunctionType, inspect.unwrap(function))
    known = plain.__globals__
    called = {n: in_python(known[n]) for n in plain.__code__.co_names if callable(known.get(n))}
    own = FunctionType(plain.__code__, known | called, plain.__name__, plain.__defaults__)
    return cast(_F, own)


def is_compiled(function: Callable[..., object]) -> bool:
    """Return whether compiled code can call a function; none is with ``NUMBA_DISABLE_JIT=1``."""
    if function in _compiled_functions:
        return True
    return hasattr(function, "py_func") and bool(compiler("").is_jitted(function))


def in_machine_code(plain: Callable[..., object]) -> Callable[[_Typed], _Typed]:
    """Decorate what builds the machine code of a function, as intrinsics of numba do.

    Python calls the function itself, compiled code what is built.

    Args:
        plain: The function.

    Returns:
        The decorator of a function that gets the module `mavlink_defs.runtime.compiler`, with
        numba's tools, and the types of the arguments. It returns a signature, and what builds code
        from (context, builder, signature, arguments); None if the types do not fit.
    """

    def decorate(typed: _Typed) -> _Typed:
        @_when_compiling
        def add(numba_side: Any) -> None:
            numba_side.add_builtin(plain, functools.partial(typed, numba_side))

        return typed

    return decorate


def _when_compiling(add: Callable[[Any], None]) -> None:
    """Call a function with the module `mavlink_defs.runtime.compiler` as soon as it is needed."""
    if _imported:
        add(_imported[0])
    else:
        _waiting.append(lambda: add(_imported[0]))


def compiler(why: str, file: str = "") -> Any:
    """Import the compiler, the module `mavlink_defs.runtime.compiler`.

    Args:
        why: What needs it, for the message.
        file: Where that is.

    Raises:
        CompilerMissing: Numba is not installed.
    """
    try:
        from mavlink_defs.runtime import compiler as numba_side
    except ModuleNotFoundError as problem:
        if problem.name not in {"numba", "llvmlite"}:
            raise
        from mavlink_defs.extras import install_command

        advice = f"{install_command('compile')} (the extra `compile`)"
        text = f"{why}, and the compiler numba is not installed: {advice}"
        raise CompilerMissing(file, [Problem((), text)]) from None
    _imported[:] = [numba_side]
    numba_side.do(_waiting)
    return numba_side


def cold_parts(parts: Iterable[str]) -> list[str]:
    """Return those parts of the numeric core that are still to be compiled.

    Args:
        parts: As `gcs.fleet.precompile` names them, or `EVERYTHING`.

    Raises:
        ConfigError: There are some, and the cache cannot be written, or numba is not installed.
        OSError: Too many files are open.
    """
    if PLAIN or is_complete():
        return []
    from mavlink_defs.runtime.cache_folder import parts_left

    left = parts_left(parts)
    if left:
        compiler(*why_not())
    return left


def _compiled(function: _F, forceinline: bool) -> _F:
    """Return a function for Python; compiled code calls a variant that Python cannot."""
    call = _entry(function)
    if not PLAIN:
        _when_compiling(lambda numba_side: numba_side.add_function(call, function, forceinline))
    return call


def _entry(function: _F) -> _F:
    """Return a function for Python: itself in plain Python."""
    if PLAIN:
        return function
    signature = inspect.signature(function)
    count = len(signature.parameters)
    made: dict[Kinds, Callable[..., Any]] | None = None
    by_numba: Callable[..., Any] | None = None

    @functools.wraps(function)
    def call(*arguments: Any, **keywords: Any) -> Any:
        nonlocal made, by_numba
        if made is None:
            made = entries_of(function)
        given = arguments
        if keywords or len(arguments) != count:
            given = _bound(signature, arguments, keywords)
        for heard in listeners:
            heard(function, given)
        entry = made.get(kinds_of(given)) if made else None
        if entry is not None:
            return entry(*given)
        if by_numba is None:
            by_numba = compiler(*why_not(function, given)).entry_of(function)
        return by_numba(*arguments, **keywords)

    _compiled_functions.add(call)
    return cast(_F, call)


def _bound(
    signature: inspect.Signature, arguments: tuple[Any, ...], keywords: dict[str, Any]
) -> tuple[Any, ...]:
    """Return all arguments of a call in order, defaults among them."""
    bound = signature.bind(*arguments, **keywords)
    bound.apply_defaults()
    return bound.args
