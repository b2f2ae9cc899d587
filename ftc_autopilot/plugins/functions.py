"""The C functions of plug-ins: their addresses, and why they failed.

A function is compiled Python, then numba makes the C function; plain Python, then ctypes calls
back; or one of a shared library.
"""

import ctypes
import inspect
import itertools
import re
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ftc_autopilot.plugins.loading import file_of, label, library_of, line_about, line_of, plugin_of
from ftc_autopilot.plugins.memory import c_function
from mavlink_defs.config.models import Model
from mavlink_defs.runtime.foreign import ForeignCode, PluginError, is_ctrl_c
from mavlink_defs.runtime.jit import CompilerMissing, compiler, is_compiled

_STYLE = re.compile(r"\x1b\[[0-9;]*m")
_PLACE = re.compile(r"During: .* at (?P<file>.+) \((?P<line>\d+)\)")

ABI = 1
"""Version of the interfaces in the C headers; it changes when a struct does."""

NOT_FINITE = -(2**31)
"""Failure of a function whose result is not finite; others are the status that it returned."""

FAILED = 1
"""Status of a plain function that raised an exception."""


class Functions(NamedTuple):
    """Addresses of a plug-in's C functions; 0 for none."""

    step: int
    init: int


class Sizes(NamedTuple):
    """Sizes of the structs of a C interface [bytes]."""

    abi: int
    given: int
    result: int
    further: int  # the largest record beside parameters and state
    parameters: int
    state: int


class _Exported(ctypes.Structure):
    """What a shared library exports, as the headers declare it."""

    _fields_ = (
        *((name, ctypes.c_uint32) for name in Sizes._fields),
        ("init", ctypes.c_void_p),
        ("step", ctypes.c_void_p),
    )


def way_of(found: type[Model]) -> str:
    """Return how the function of a plug-in is written."""
    if library_of(found) is not None:
        return "shared library"
    function: Any = getattr(found, "step", None)
    return "compiled Python" if function and is_compiled(function) else "plain Python"


def function_of(found: type[Model], counts: tuple[int, ...], signature: str) -> Callable[..., Any]:
    """Return the Python function of a plug-in.

    Args:
        found: The class of the plug-in.
        counts: Numbers of arguments that it may have.
        signature: What is expected, for messages.

    Raises:
        PluginError: It has none, or one with other arguments.
    """
    name, plugin = found.__name__, plugin_of(found)
    where = found.__module__ if plugin is None else str(plugin.file)
    declared = inspect.getattr_static(found, "step", None)
    if declared is None:
        raise PluginError(f"{where}: {name} has neither a function `step` nor LIBRARY")
    if not isinstance(declared, staticmethod):
        function = declared if inspect.isfunction(declared) else None
        place = f"{where}: " if function is None else f"{line_of(function)}: "
        raise PluginError(f"{place}{name}.step: expected a @staticmethod {signature}")
    step: Callable[..., Any] = declared.__func__
    inner = getattr(step, "__wrapped__", getattr(step, "py_func", step))
    parameters = inspect.signature(inner).parameters.values()
    if len(parameters) not in counts or any(
        one.kind > one.POSITIONAL_OR_KEYWORD for one in parameters
    ):
        text = f"{name}.step has {len(parameters)} arguments, expected {signature}"
        raise PluginError(f"{line_of(step)}: {text}")
    return step


def check_room(
    found: type[Model], record: Callable[[], np.dtype], state: np.dtype, room: tuple[int, int]
) -> None:
    """Check that the record of a plug-in's parameters, and its state, find room [bytes].

    Raises:
        PluginError: They do not, or a parameter cannot be in a record.
    """
    try:
        parameters = record()
    except TypeError as problem:
        raise PluginError(f"{file_of(found)}: {found.__name__}: {problem}") from problem
    for what, dtype, most in zip(("parameters", "a STATE"), (parameters, state), room, strict=True):
        if dtype.itemsize > most:
            text = f"{found.__name__} has {what} of {dtype.itemsize} bytes, expected at most {most}"
            raise PluginError(f"{file_of(found)}: {text}")


def compiled_function(
    entry: Callable[..., Any], records: tuple[np.dtype, ...], found: type[Model]
) -> int:
    """Return the address of a C function that numba makes.

    Args:
        entry: Of pointers to records; returns a status.
        records: Their types.
        found: The class of the plug-in, whose function `entry` calls.

    Raises:
        PluginError: The function cannot be compiled, or numba is not installed.
    """
    plugin = plugin_of(found)
    assert plugin is not None
    try:
        numba_side = compiler(f"{found.__name__}.step is compiled Python", str(file_of(found)))
    except CompilerMissing as problem:
        raise PluginError(str(problem)) from None
    kinds = [not_empty(dtype) for dtype in records]
    try:
        made = numba_side.c_function_of(entry, kinds, plugin.sources)
    except numba_side.NumbaError as problem:
        raise PluginError(_cannot_compile(problem, plugin.sources, found)) from problem
    _watch_exceptions()
    _KEPT.append(made)
    _COMPILED.append(found)
    address: Any = made.address
    return int(address)


def _cannot_compile(problem: Exception, sources: tuple[Path, ...], found: type[Model]) -> str:
    """Return what numba says in one line, with the innermost place in the sources."""
    lines = [line.strip() for line in _STYLE.sub("", str(problem)).splitlines() if line.strip()]
    place, reason = line_of(inspect.getattr_static(found, "step").__func__), lines[0]
    for before, line in itertools.pairwise(lines):
        match = _PLACE.search(line)
        if match is not None and Path(match["file"]).name in {one.name for one in sources}:
            own = next(one for one in sources if one.name == Path(match["file"]).name)
            place, reason = f"{own}:{match['line']}", before
            break
    return f"{place}: {found.__name__}.step cannot be compiled: {reason}"


def not_empty(dtype: np.dtype) -> np.dtype:
    """Return a record that numba can have: one of nothing has a number that nobody uses."""
    return dtype if dtype.itemsize else np.dtype([("_", "i8")])


def plain_function(work: Callable[..., None], arguments: int, found: type[Model]) -> int:
    """Return the address of a C function that calls Python back.

    Args:
        work: Called with addresses.
        arguments: How many.
        found: The class of the plug-in, to which an exception is put down.
    """

    def entry(*addresses: int) -> int:
        try:
            with ForeignCode(_itself):
                work(*addresses)
        except BaseException as problem:  # of whatever kind: it cannot pass through compiled code
            _note(found, problem)
            return FAILED
        return 0

    made = c_function(arguments)(entry)
    _KEPT.append(made)
    return int(ctypes.cast(made, ctypes.c_void_p).value or 0)


def _itself(problem: BaseException) -> BaseException:
    return problem


def array_at(address: int, dtype: np.dtype) -> np.ndarray:
    """Return memory as an array of one element, shape (1,)."""
    if not dtype.itemsize:
        return np.zeros(1, dtype)
    memory: Any = (ctypes.c_char * dtype.itemsize).from_address(address)
    array: np.ndarray = np.frombuffer(memory, dtype)
    return array


def library_functions(found: type[Model], symbol: str, expected: Sizes) -> Functions:
    """Return the functions of a shared library, its interface checked.

    Args:
        found: The class of the plug-in.
        symbol: Name of the struct that it exports.
        expected: Version and sizes that it must have.

    Raises:
        PluginError: It cannot be loaded, or was built for something else.
    """
    path = library_of(found)
    assert path is not None
    if not path.is_file():
        raise PluginError(f"{path}: no such file, which {found.__name__}.LIBRARY names: build it")
    try:
        library = ctypes.CDLL(str(path))
    except OSError as problem:
        raise PluginError(f"{path}: cannot be loaded: {problem}") from problem
    try:
        exported = _Exported.in_dll(library, symbol)
    except ValueError:
        text = f"exports no struct {symbol!r}; see {symbol}.h, `gcs laws header` writes it"
        raise PluginError(f"{path}: {text}") from None
    if exported.abi != expected.abi:
        text = f"was built for version {exported.abi} of {symbol}.h, this is {expected.abi}"
        raise PluginError(f"{path}: {text}: build it again")
    names = {"given": "input", "result": "output", "further": "aircraft"}
    for name in Sizes._fields[1:]:
        has, must = getattr(exported, name), getattr(expected, name)
        if has != must:
            text = f"its {names.get(name, name)} have {has} bytes, {found.__name__} has {must}"
            text = (
                text
                if name in {"parameters", "state"}
                else f"{text}: build it with this {symbol}.h"
            )
            raise PluginError(f"{path}: {text}")
    if not exported.step:
        raise PluginError(f"{path}: `step` in {symbol!r} is no function")
    _KEPT.append(library)
    return Functions(exported.step, exported.init or 0)


# why functions failed

_KEPT: list[Any] = []
"""What must not be freed: compiled code knows its address only."""
_COMPILED: list[type[Model]] = []
_EXCEPTIONS: dict[type[Model], BaseException] = {}


def _note(found: type[Model], problem: BaseException) -> None:
    """Keep the first exception of a plug-in, or one that is not an error of its own."""
    if found not in _EXCEPTIONS or is_ctrl_c(problem):
        _EXCEPTIONS[found] = problem


def exception_of(found: type[Model]) -> str | None:
    """Return the exception that a plug-in's function raised, as a text; forget it.

    Raises:
        KeyboardInterrupt: It was none of the function's own.
    """
    problem = _EXCEPTIONS.pop(found, None)
    if problem is None:
        return None
    if is_ctrl_c(problem):
        raise problem
    return line_about(problem, _sources_of(found))


def failure_text(what: str, found: type[Model], status: int, time_s: float) -> str:
    """Return why a plug-in's function failed, in a line.

    Args:
        what: Kind of the plug-in, such as "law".
        found: Its class.
        status: That it returned, or `NOT_FINITE`.
        time_s: When [s].
    """
    reason = exception_of(found)
    if reason is None:
        reason = f"it returned {status}"
        if status == NOT_FINITE:
            reason = "it gave a command that is not finite"
    plugin = plugin_of(found)
    name = found.__name__ if plugin is None else label(plugin.name)
    return f"the {what} {name} failed at {time_s:.3f} s: {reason}"


def _watch_exceptions() -> None:
    """Note what compiled functions of plug-ins raise, where Python would print a traceback."""
    before = sys.unraisablehook
    if getattr(before, "of_plugins", False):
        return

    def hook(unraisable: Any) -> None:
        problem = unraisable.exc_value
        if problem is None or "CPUContext" not in str(unraisable.object):
            before(unraisable)
            return
        files = {frame.filename for frame in traceback.extract_tb(problem.__traceback__)}
        own = (one for one in _COMPILED if files & set(map(str, _sources_of(one))))
        _note(next(own, _COMPILED[-1]), problem)

    hook.of_plugins = True  # type: ignore[attr-defined]  # a mark
    sys.unraisablehook = hook


def _sources_of(found: type[Model]) -> tuple[Path, ...]:
    plugin = plugin_of(found)
    return () if plugin is None else plugin.sources
