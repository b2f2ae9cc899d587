"""The cache of compiled code on disk, which can never be stale.

Numba's own cache checks only the file that a function is in, so a caller continues
running the old code of a function that it calls from another file. Here every file has a cache
folder of its own, whose name is a digest of that file, of every file that it imports, directly or
not, of the versions of Python, numba and numpy, and of the processor that the code is made for.
After a change only what depends on it is compiled again. Equal sources share their code, wherever
they lie. A file of another project counts with what it imports of its own package or from beside
it.

The cache lies in ``$NUMBA_CACHE_DIR``, or ``$XDG_CACHE_HOME/ftc-sitl``, or
``~/.cache/ftc-sitl``. Where it cannot be written, every process compiles for itself what it
calls, and the error of `parts_left` names the remedy.

On x86 the code is made for any processor since about 2013 (x86-64-v3), so that machines can share
it; ``NUMBA_CPU_NAME`` chooses another. The bits of results do not depend on it.
"""

import contextlib
import errno
import functools
import hashlib
import os
import pickle
import platform
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import llvmlite.binding
import numba
from numba.core import caching
from numba.core.annotations import type_annotations

from mavlink_defs.config.models import ConfigError, Problem
from mavlink_defs.runtime.sources import (
    compiled_sources,
    content_digest,
    digest_with_imports,
    resolved,
)

_WARM = "warm-"
_KEPT_DAYS = 14
_COMMON_CPU = "x86-64-v3"
_FURTHER_LOCATORS = (
    "UserProvidedCacheLocator,InTreeCacheLocator,UserWideCacheLocator,"
    "IPythonCacheLocator,ZipCacheLocator"
)
"""Numba's own, for the functions of others."""
_ITS_FEATURES = {"avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe", "xsave"}

_UserProvidedCacheLocator: Any = caching.UserProvidedCacheLocator  # without annotations
_settings = vars(numba.config)  # made at run time, so that type checkers see none of them


class DigestLocator(_UserProvidedCacheLocator):
    """Tells numba where the code of one function lies; the folder's name says how fresh it is."""

    def __init__(self, function: Callable[..., object], file: str) -> None:
        """Locate the code of a function that is in a file."""
        super().__init__(function, file)
        further = _functions[function]
        self._folder = _cache_folder / digest_with_imports(_target, resolved(file), *further)

    @classmethod
    def from_function(cls, function: Callable[..., object], file: str) -> "DigestLocator | None":
        """Return the locator of a function; None if `add_to_cache` does not know it."""
        return cls(function, file) if function in _functions else None

    def get_cache_path(self) -> str:
        """Return the folder with its code."""
        return str(self._folder)

    def get_source_stamp(self) -> str:
        """Return what distinguishes fresh code from stale: nothing beside the folder."""
        return ""


def add_to_cache(*variants: Callable[..., object], further: tuple[Path, ...] = ()) -> bool:
    """Let numba find the code of a function's variants in the cache.

    Args:
        variants: The variants, all of one file.
        further: Files that their code depends on beside that file and what it imports.

    Returns:
        Whether it can lie there: not if the cache cannot be written, and not if the function is
        of a notebook or of ``python -c`` and is in no file.
    """
    if _obstacle is not None or not resolved(variants[0].__code__.co_filename).is_file():
        return False
    _functions.update(dict.fromkeys(variants, further))
    return True


def _text_of(annotation: Any) -> str:
    """Return how a function's lines were typed, as numba stores it for people who inspect it.

    It is longer than the machine code; of ours nothing is stored.
    """
    return "" if annotation.func_id.func in _functions else str(_annotated(annotation))


def forget_unreadable() -> bool:
    """Remove the indices that name the type of a module which was renamed since.

    The index of a function names the types of all its callers' arguments, also from modules that
    it does not import, so that its folder does not show them.

    Returns:
        Whether there were any.
    """
    unreadable = []
    for path in _cache_folder.rglob("*.nbi"):
        try:
            with path.open("rb") as index:  # numba's version, then all else
                pickle.load(index), pickle.load(index)
        except (AttributeError, ModuleNotFoundError):
            unreadable.append(path)
    for path in unreadable:
        path.unlink(missing_ok=True)
    return bool(unreadable)


def parts_left(parts: Iterable[str]) -> list[str]:
    """Return those parts of the numeric core, of `gcs.fleet.precompile`, that are not cached.

    Raises:
        ConfigError: The cache cannot be written: every process would have to compile it.
        OSError: Too many files are open.
    """
    if _obstacle is not None:
        raise not_cached(_obstacle)
    return [part for part in parts if not _warm_mark(part).exists()]


def not_cached(problem: OSError) -> ConfigError | OSError:
    """Return the error for a cache that cannot be written, with its remedy.

    Too many open files are no fault of the cache: then `problem` itself is returned.
    """
    if problem.errno in {errno.EMFILE, errno.ENFILE}:
        return problem
    text = f"the cache of compiled code cannot be written: {problem.strerror}"
    advice = "set XDG_CACHE_HOME or NUMBA_CACHE_DIR to a folder that can"
    return ConfigError(_cache_folder, [Problem((), f"{text}; {advice}")])


def mark_warm(part: str) -> None:
    """Note that a part of the numeric core lies in the cache; forget code of old sources."""
    if _settings["DISABLE_JIT"]:
        return
    in_use = [_cache_folder / digest_with_imports(_target, source) for source in compiled_sources()]
    _cache_folder.mkdir(parents=True, exist_ok=True)
    _warm_mark(part).touch()
    for place in in_use:
        if place.exists():
            os.utime(place)
    oldest = time.time() - _KEPT_DAYS * 86400
    for place in _cache_folder.iterdir():
        with contextlib.suppress(FileNotFoundError):  # another process forgets it, too
            if place.stat().st_mtime < oldest:
                shutil.rmtree(place) if place.is_dir() else place.unlink()


def compiled_functions() -> int:
    """Return how many of our functions lie in the cache, of present sources."""
    folders = (_cache_folder / digest_with_imports(_target, one) for one in compiled_sources())
    return sum(len([*folder.glob("*.nbi")]) for folder in folders)


def _warm_mark(part: str) -> Path:
    """Return the empty file that stands for a cache with a part of the numeric core."""
    return _cache_folder / f"{_WARM}{_digest_of_all()}-{part.replace(' ', '-')}"


@functools.cache
def _digest_of_all() -> str:
    digests = "".join(digest_with_imports(_target, one) for one in compiled_sources())
    return hashlib.sha256(digests.encode()).hexdigest()[:16]


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


def _choose_target() -> str:
    """Choose the processor that code is made for; return what code depends on beside its source."""
    if _settings["CPU_NAME"] is None and platform.machine() == "x86_64":
        features = llvmlite.binding.get_host_cpu_features()
        if all(features.get(name) for name in _ITS_FEATURES):
            _settings["CPU_NAME"], _settings["CPU_FEATURES"] = _COMMON_CPU, ""
    name = _settings["CPU_NAME"] or llvmlite.binding.get_host_cpu_name()
    options = content_digest(Path(__file__).with_name("compiler.py")).hex()
    machine = f"{sys.platform} {platform.machine()} {name}"
    return f"{sys.implementation.cache_tag} {machine} {options}"


_settings["CACHE_LOCATOR_CLASSES"] = (
    f"{__name__}.{DigestLocator.__name__},{_settings['CACHE_LOCATOR_CLASSES'] or _FURTHER_LOCATORS}"
)
_TypeAnnotation: Any = type_annotations.TypeAnnotation  # without annotations
_annotated = _TypeAnnotation.__str__
_TypeAnnotation.__str__ = _text_of
_functions: dict[Callable[..., object], tuple[Path, ...]] = {}
"""Those whose code is cached, each with the further files that it depends on."""
_cache_folder = _find_cache_folder()
_obstacle = None if _settings["DISABLE_JIT"] else _find_obstacle()
_target = _choose_target()
