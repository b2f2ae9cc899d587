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
calls, and the error of `cold_parts` names the remedy.

On x86 the code is made for any processor since about 2013 (x86-64-v3), so that machines can share
it; ``NUMBA_CPU_NAME`` chooses another. The bits of results do not depend on it.
"""

import ast
import contextlib
import errno
import functools
import hashlib
import importlib.util
import os
import pickle
import platform
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import llvmlite.binding
import numba
import numpy as np
from numba.core import caching

from mavlink_defs.config.models import ConfigError, Problem

_PACKAGES = ("mavlink_defs", "sitl_plant", "ftc_autopilot", "gcs", "ftc_lab")
_ROOT = Path(__file__).resolve().parents[2]
_GENERATED = {_ROOT / "mavlink_defs" / "dialect.py": _ROOT / "mavlink_defs" / "ftc.xml"}
_IMPORT = re.compile(r"^from ([\w.]+) import (\([^)]*\)|.*)|^import ([\w.]+)", re.MULTILINE)
_DECORATED = re.compile(rb"@(?:compiled|inlined|apart)\b")
_WARM = "warm-"
EVERYTHING = "everything"
"""All parts of the numeric core."""
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
        self._folder = _cache_folder / _digest_with_imports(_resolved(file), *further)

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
    if _obstacle is not None or not _resolved(variants[0].__code__.co_filename).is_file():
        return False
    _functions.update(dict.fromkeys(variants, further))
    return True


def sources_of(file: Path) -> list[Path]:
    """Return a file of another project and the files of that project that it imports, sorted.

    What it imports must have been imported.
    """
    return [path for path in _with_imports(file) if not _is_ours(path)]


def forget_sources() -> None:
    """Read files again: one of another project has changed while this process runs."""
    for known in (_content_digest, _digest_with_imports, _imports, _digest_of_all):
        known.cache_clear()


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


def cold_parts(parts: Iterable[str]) -> list[str]:
    """Return those parts of the numeric core that are still to be compiled.

    Args:
        parts: As `gcs.fleet.precompile` names them.

    Raises:
        ConfigError: The cache cannot be written: every process would have to.
        OSError: Too many files are open.
    """
    if _settings["DISABLE_JIT"]:
        return []
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
    in_use = [_cache_folder / _digest_with_imports(source) for source in _compiled_sources()]
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
    folders = [_cache_folder / _digest_with_imports(source) for source in _compiled_sources()]
    return sum(len([*folder.glob("*.nbi")]) for folder in folders)


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
def _digest_with_imports(source: Path, *further: Path) -> str:
    """Return a digest of a file and of all files of this project that its code depends on.

    Of other people's files the place counts, too.
    """
    place = source.relative_to(_ROOT) if source.is_relative_to(_ROOT) else source
    files = _with_imports(source, *further)
    return source_digest(files, f"{place} {_target}")[:16]


def _with_imports(*sources: Path) -> list[Path]:
    """Return files and all that they import, directly or not, sorted."""
    found: set[Path] = set()
    waiting = list(sources)
    while waiting:
        path = waiting.pop()
        if path not in found:
            found.add(path)
            waiting += _imports(path)
    return sorted(_GENERATED.get(path, path) for path in found)


def _is_ours(source: Path) -> bool:
    return any(source.is_relative_to(_ROOT / package) for package in _PACKAGES)


@functools.cache
def _imports(source: Path) -> list[Path]:
    """Return the files that a file imports of this project, and of its own one."""
    if source in _GENERATED or source.suffix != ".py":
        return []
    text = source.read_text(encoding="utf-8")
    names: list[str] = []
    for package, members, module in _IMPORT.findall(text):
        names += [module or package]
        names += [f"{package}.{name}" for name in re.findall(r"\w+", members)]
    own = (name.replace(".", "/") for name in names if name.partition(".")[0] in _PACKAGES)
    files = [f"{_ROOT}/{name}{end}" for name in own for end in (".py", "/__init__.py")]
    found = [Path(file) for file in files if os.path.isfile(file)]
    return found if _is_ours(source) else [*found, *_imports_of_its_project(source, text)]


def _imports_of_its_project(source: Path, text: str) -> Iterator[Path]:
    """Yield what a file of another project imports of its package, or from beside it."""
    top = source.parent
    while (top / "__init__.py").is_file():
        top = top.parent
    own = source.relative_to(top).with_suffix("").parts
    for node in ast.walk(ast.parse(text)):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            package = ".".join(own[: -node.level]) if node.level else ""
            name = ".".join(filter(None, (package, node.module)))
            names = [name, *(f"{name}.{alias.name}" for alias in node.names)]
        for name in names:
            file = _file_of(name) or source
            beside = file.parent == source.parent
            if beside or (top != source.parent and file.is_relative_to(top / _first(source, top))):
                yield file


def _file_of(module: str) -> Path | None:
    """Return the file of a module; None if there is none of that name, or it is no Python."""
    try:
        spec = importlib.util.find_spec(module)
    except (ImportError, AttributeError, ValueError):
        return None
    origin = "" if spec is None else spec.origin or ""
    return _resolved(origin) if origin.endswith(".py") else None


def _first(source: Path, top: Path) -> str:
    """Return the name of the package below a folder that a file is in."""
    return source.relative_to(top).parts[0]


@functools.cache
def _compiled_sources() -> list[Path]:
    sources = (path for package in _PACKAGES for path in (_ROOT / package).rglob("*.py"))
    return sorted(path for path in sources if _DECORATED.search(path.read_bytes()))


def _warm_mark(part: str) -> Path:
    """Return the empty file that stands for a cache with a part of the numeric core."""
    return _cache_folder / f"{_WARM}{_digest_of_all()}-{part.replace(' ', '-')}"


@functools.cache
def _digest_of_all() -> str:
    digests = "".join(map(_digest_with_imports, _compiled_sources()))
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
    return f"{sys.implementation.cache_tag} {sys.platform} {platform.machine()} {name}"


_settings["CACHE_LOCATOR_CLASSES"] = (
    f"{__name__}.{DigestLocator.__name__},{_settings['CACHE_LOCATOR_CLASSES'] or _FURTHER_LOCATORS}"
)
_functions: dict[Callable[..., object], tuple[Path, ...]] = {}
"""Those whose code is cached, each with the further files that it depends on."""
_cache_folder = _find_cache_folder()
_obstacle = None if _settings["DISABLE_JIT"] else _find_obstacle()
_target = _choose_target()
