"""Machine code of our functions that came with the package, so that nobody has to compile it.

`mavlink_defs.runtime.ahead_of_time` makes it when a wheel is built: one extension module for one
version of Python and one platform, which needs neither numba nor anything else but libc. It says of
itself which sources it was made of; a function is taken from it only if its own file, and all that
this imports, are the same.

Its functions do not look at their arguments, and a wrong one would end the process. So each is
found by the kinds of all arguments (`kinds_of`): there is one for each kind of call that was seen
when it was made, and no other call reaches it.
"""

import ctypes
import functools
import hashlib
import importlib
import importlib.util
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from mavlink_defs.runtime.sources import ROOT, content_digest

MODULE = "mavlink_defs.runtime.machine_code"
CONTENT = "ftc_sitl_content"
"""Symbol of the text in the module that says what it is, JSON of `Content`."""

Kinds: TypeAlias = tuple[Any, ...]
"""The kinds of some arguments: names, and tuples of kinds."""


class Made(NamedTuple):
    """What there is of a function in the module.

    Attributes:
        sources: Numbers of the files that it depends on.
        calls: Kinds of the arguments, and the name in the module, of each kind of call.
    """

    sources: list[int]
    calls: list[tuple[Kinds, str]]


class Content(NamedTuple):
    """What a module says of itself.

    Attributes:
        numba: The version that made it.
        sources: Files, below the folder of our packages, and the digest of each.
        functions: By the name of each, see `name_of`.
    """

    numba: str
    sources: list[tuple[str, str]]
    functions: dict[str, Made]


def name_of(function: Callable[..., object]) -> str:
    """Return the name of a function in the module's content."""
    return f"{function.__module__}:{function.__qualname__}"


def entries_of(function: Callable[..., object]) -> dict[Kinds, Callable[..., Any]]:
    """Return what machine code there is of a function, by the kinds of its arguments."""
    made = _made_of(function)
    if made is None or _changed(made):
        return {}
    module = importlib.import_module(MODULE)
    return {kinds: getattr(module, name) for kinds, name in made.calls}


def is_complete() -> bool:
    """Return whether there is machine code of all that flies, as its sources are now."""
    found = content()
    return found is not None and not _changed_sources()


def why_not(
    function: Callable[..., object] | None = None, arguments: tuple[Any, ...] = ()
) -> tuple[str, str]:
    """Return why something has to be compiled, and the file where that is.

    Args:
        function: A function; None if it is all that flies.
        arguments: Of a call of it.
    """
    found = content()
    place = str(ROOT if function is None else function.__code__.co_filename)
    if found is None:
        return "no machine code came with this installation", place
    made = None if function is None else _made_of(function)
    changed = _changed_sources() if made is None else _changed(made)
    if changed:
        return "it was changed since its machine code was made", str(ROOT / sorted(changed)[0])
    if function is None or made is None:
        return f"it has no machine code of {function and function.__qualname__}", place
    return f"{function.__qualname__} has no machine code for {kinds_of(arguments)}", place


@functools.cache
def content() -> Content | None:
    """Return what the module says of itself; None if there is none for this Python."""
    found = importlib.util.find_spec(MODULE)
    if found is None or found.origin is None:
        return None
    text = ctypes.c_char.in_dll(ctypes.CDLL(found.origin), CONTENT)
    numba, sources, functions = json.loads(ctypes.string_at(ctypes.addressof(text)))
    named = {
        name: Made(used, [(_tuples(kinds), entry) for kinds, entry in calls])
        for name, (used, calls) in functions.items()
    }
    return Content(numba, [(file, digest) for file, digest in sources], named)


def _tuples(kinds: Any) -> Any:
    return tuple(map(_tuples, kinds)) if isinstance(kinds, list) else kinds


def _made_of(function: Callable[..., object]) -> Made | None:
    found = content()
    return None if found is None else found.functions.get(name_of(function))


def _changed(made: Made) -> set[str]:
    """Return the sources of a function that have changed."""
    found = content()
    assert found is not None
    return {found.sources[number][0] for number in made.sources} & _changed_sources()


@functools.cache
def _changed_sources() -> frozenset[str]:
    found = content()
    assert found is not None
    return frozenset(file for file, digest in found.sources if digest_now(ROOT / file) != digest)


def digest_now(file: Path) -> str:
    """Return the digest of a source file; nothing if there is none."""
    return content_digest(file).hex() if file.is_file() else ""


# kinds of arguments

_ORDERS = 1 | 2  # of numpy's flags: rows or columns are contiguous
_LAYOUT = _ORDERS | 256 | 1024  # and aligned, writeable
_NAMES: dict[type, str] = {
    float: "f8",
    int: "i8",
    bool: "b1",
    type(None): "none",
    **{np.dtype(code).type: np.dtype(code).str[1:] for code in "?bBhHiIlLqQfd"},
}
_texts: dict[np.dtype, str] = {}


def kinds_of(arguments: tuple[Any, ...]) -> Kinds:
    """Return the kinds of arguments: all that compiled code takes for granted of them.

    Of an array its elements, dimensions and layout; of a record its fields; of a tuple its length
    and the kinds of its parts, and its class if it has names. What compiled code is never given
    has the kind of its class.
    """
    return tuple([_NAMES.get(type(one)) or _kind_of(one) for one in arguments])


def _kind_of(value: Any) -> Any:
    kind: Any = type(value)
    if kind is np.ndarray:
        flags = value.flags.num & _LAYOUT
        if flags & _ORDERS == _ORDERS:
            flags -= 2
        return "array", _text_of(value.dtype), value.ndim, flags
    if kind is np.void:
        return "record", _text_of(value.dtype)
    if isinstance(value, tuple):
        return "tuple" if kind is tuple else _name_of_class(kind), *kinds_of(value)
    return _name_of_class(kind)


@functools.cache
def _name_of_class(kind: Any) -> str:
    return f"{kind.__module__}.{kind.__qualname__}"


def _text_of(dtype: np.dtype) -> str:
    text = _texts.get(dtype)
    if text is None:
        whole = _whole_text(dtype)
        text = whole if dtype.names is None else hashlib.sha256(whole.encode()).hexdigest()[:16]
        _texts[dtype] = text
    return text


def _whole_text(dtype: np.dtype) -> str:
    if dtype.subdtype is not None:
        inner, shape = dtype.subdtype
        return f"{shape}{_whole_text(inner)}"
    if dtype.fields is None:
        return dtype.str
    fields = ((name, *dtype.fields[name][:2]) for name in dtype.names or ())
    inside = ",".join(f"{name}@{offset}:{_whole_text(one)}" for name, one, offset in fields)
    return f"{{{inside}}}{dtype.itemsize}{'a' * dtype.isalignedstruct}"
