"""Compiled functions: numba, with a cache that can never be stale.

Numba's own cache looks only at the file that a function stands in, so a caller goes on
running the old code of a function that it calls from another file. Here every file has a cache
folder of its own, whose name is a digest of that file, of every file that it imports, directly or
not, of where they lie and of the versions of numba and numpy. After a change only what
depends on it is compiled again.

The cache lies in ``$NUMBA_CACHE_DIR``, or ``$XDG_CACHE_HOME/ftc-sitl``, or
``~/.cache/ftc-sitl``. Where it cannot be written, every process compiles for itself what it
calls, and the error of `cache_is_cold` names the remedy. With ``NUMBA_DISABLE_JIT=1`` the same
functions run as plain Python.
"""

import contextlib
import errno
import functools
import hashlib
import importlib
import os
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import numpy as np

from mavlink_defs.config.models import ConfigError, Problem

__all__ = ["cache_is_cold", "compiled", "inlined", "mark_cache_warm", "not_cached", "source_digest"]

_F = TypeVar("_F", bound=Callable[..., object])

_PACKAGES = ("mavlink_defs", "sitl_plant", "ftc_autopilot", "gcs")
_ROOT = Path(__file__).resolve().parents[2]
_GENERATED = {_ROOT / "mavlink_defs" / "dialect.py": _ROOT / "mavlink_defs" / "ftc.xml"}
_IMPORT = re.compile(r"^from ([\w.]+) import (\([^)]*\)|.*)|^import ([\w.]+)", re.MULTILINE)
_KEPT_DAYS = 14
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
_settings = vars(numba.config)  # made at run time, so that type checkers see none of them


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
    dispatcher = _dispatcher(function, forceinline=inline)
    if not _settings["DISABLE_JIT"]:
        _lend_to_compiled_code(dispatcher, function, forceinline=inline)
    return cast(_F, dispatcher)


def _dispatcher(function: Callable[..., object], variant: str = "", **options: bool) -> Any:
    """Return numba's wrapper of a function, whose cache may have a folder for each variant."""
    cached = _obstacle is None
    if cached:
        folder = (
            _cache_folder / _digest_with_imports(_resolved(function.__code__.co_filename)) / variant
        )
        _settings["CACHE_DIR"] = str(folder)
    return _njit(cache=cached, error_model="numpy", nogil=True, **options)(function)


def _lend_to_compiled_code(
    dispatcher: Any, function: Callable[..., object], **options: bool
) -> None:
    """Let compiled code call a variant that Python cannot, and that is made in half the time.

    What unpacks Python's objects is often longer than the function. The variant is one for all
    calls with the same types: numba would compile a function anew for each constant that it is
    called with.
    """

    @functools.cache
    def variant() -> Any:
        return _dispatcher(
            function, "inner", no_cpython_wrapper=True, no_cfunc_wrapper=True, **options
        )

    def call_template(arguments: Iterable[Any], keywords: dict[str, Any]) -> Any:
        plain = {name: _unliteral(kind) for name, kind in keywords.items()}
        return variant().get_call_template(tuple(map(_unliteral, arguments)), plain)

    dispatcher.get_call_template = call_template
    dispatcher.get_overload = lambda signature: variant().get_overload(signature)


def cache_is_cold() -> bool:
    """Return whether the next flight has to compile the numeric core first.

    Raises:
        ConfigError: The cache cannot be written: every process would have to.
        OSError: Too many files are open.
    """
    if _settings["DISABLE_JIT"]:
        return False
    if _obstacle is not None:
        raise not_cached(_obstacle)
    return not _warm_mark().exists()


def not_cached(problem: OSError) -> ConfigError | OSError:
    """Return the error for a cache that cannot be written, with its remedy.

    Too many open files are no fault of the cache: then `problem` itself is returned.
    """
    if problem.errno in {errno.EMFILE, errno.ENFILE}:
        return problem
    text = f"the cache of compiled code cannot be written: {problem.strerror}"
    advice = "set XDG_CACHE_HOME or NUMBA_CACHE_DIR to a folder that can"
    return ConfigError(_cache_folder, [Problem((), f"{text}; {advice}")])


def mark_cache_warm() -> None:
    """Note that every compiled function now lies in the cache; forget code of old sources."""
    if _settings["DISABLE_JIT"]:
        return
    in_use = [_cache_folder / _digest_with_imports(source) for source in _compiled_sources()]
    for place in [*in_use, _warm_mark()]:
        place.parent.mkdir(parents=True, exist_ok=True)
        if place.exists():
            os.utime(place)
    _warm_mark().touch()
    oldest = time.time() - _KEPT_DAYS * 86400
    for place in _cache_folder.iterdir():
        with contextlib.suppress(FileNotFoundError):  # another process forgets it, too
            if place.stat().st_mtime < oldest:
                shutil.rmtree(place) if place.is_dir() else place.unlink()


def source_digest(sources: Iterable[Path], place: str = "") -> str:
    """Return a digest of source files, a place, and the versions of numba and numpy."""
    digest = hashlib.sha256(f"{numba.__version__} {np.__version__} {place}".encode())
    for source in sources:
        digest.update(_content_digest(source))
    return digest.hexdigest()


@functools.cache
def _content_digest(source: Path) -> bytes:
    return hashlib.sha256(source.name.encode() + source.read_bytes()).digest()


@functools.cache
def _resolved(name: str) -> Path:
    return Path(name).resolve()


@functools.cache
def _digest_with_imports(source: Path) -> str:
    """Return a digest of a file and of all files of this project that its code depends on."""
    found: set[Path] = set()
    waiting = [source]
    while waiting:
        path = waiting.pop()
        if path not in found:
            found.add(path)
            waiting += _imports(path)
    return source_digest(sorted(_GENERATED.get(path, path) for path in found), str(source))[:16]


@functools.cache
def _imports(source: Path) -> list[Path]:
    """Return the files of this project that a file imports."""
    if source in _GENERATED:
        return []
    names: list[str] = []
    for package, members, module in _IMPORT.findall(source.read_text(encoding="utf-8")):
        names += [module or package]
        names += [f"{package}.{name}" for name in re.findall(r"\w+", members)]
    own = (name.replace(".", "/") for name in names if name.partition(".")[0] in _PACKAGES)
    files = [f"{_ROOT}/{name}{end}" for name in own for end in (".py", "/__init__.py")]
    return [Path(file) for file in files if os.path.isfile(file)]


@functools.cache
def _compiled_sources() -> list[Path]:
    sources = (path for package in _PACKAGES for path in (_ROOT / package).rglob("*.py"))
    return sorted(path for path in sources if re.search(rb"@(compiled|inlined)", path.read_bytes()))


def _warm_mark() -> Path:
    """Return the empty file that stands for a cache with every compiled function."""
    digests = "".join(map(_digest_with_imports, _compiled_sources()))
    return _cache_folder / f"warm-{hashlib.sha256(digests.encode()).hexdigest()[:16]}"


def _find_cache_folder() -> Path:
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return Path(os.environ.get("NUMBA_CACHE_DIR") or Path(home) / "ftc-sitl") / "core"


def _find_obstacle() -> OSError | None:
    """Return why the cache cannot be written; None if it can."""
    if _cache_folder.parts[0] == "~":  # not to be taken for a folder of this name
        return FileNotFoundError(errno.ENOENT, "there is no home folder", str(_cache_folder))
    try:
        _cache_folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=_cache_folder):
            return None
    except OSError as problem:
        return problem


_cache_folder = _find_cache_folder()
_obstacle = None if _settings["DISABLE_JIT"] else _find_obstacle()
