"""Compiled functions: numba, with one cache that can never be stale.

Numba's own cache looks only at the file that a function stands in, so a caller goes on
running the old code of a function that it calls from another file. Here the cache folder's
name is a digest of every compiled source of the four packages and where they lie, of the dialect
and of the versions of numba and numpy, so that a change anywhere starts a new folder.

The cache lies in ``$NUMBA_CACHE_DIR``, or ``$XDG_CACHE_HOME/ftc-sitl``, or
``~/.cache/ftc-sitl``. Where it cannot be written, every process compiles for itself what it
calls, and the error of `cache_is_cold` names the remedy. With ``NUMBA_DISABLE_JIT=1`` the same
functions run as plain Python.
"""

import hashlib
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TypeVar, cast

import numba
import numpy as np

from mavlink_defs.config.models import ConfigError, Problem

__all__ = ["cache_is_cold", "compiled", "mark_cache_warm", "not_cached", "source_digest"]

_F = TypeVar("_F", bound=Callable[..., object])

_PACKAGES = ("mavlink_defs", "sitl_plant", "ftc_autopilot", "gcs")
_KEPT_DAYS = 14

_settings = vars(numba.config)  # made at run time, so that type checkers see none of them


def compiled(function: _F) -> _F:
    """Compile a function with numba on its first call, and keep the machine code on disk.

    Floating-point rules stay strict (no ``fastmath``), so that the same inputs give the
    same bits in every process and from every caller; division by zero gives inf or NaN as
    in numpy.
    """
    cache = _obstacle is None
    return cast(_F, numba.njit(cache=cache, error_model="numpy", nogil=True)(function))


def cache_is_cold() -> bool:
    """Return whether the next flight has to compile the numeric core first.

    Raises:
        ConfigError: The cache cannot be written: every process would have to.
    """
    if _settings["DISABLE_JIT"]:
        return False
    if _obstacle is not None:
        raise not_cached(_obstacle)
    return not (_cache_folder / "warm").exists()


def not_cached(problem: OSError) -> ConfigError:
    """Return the error for a cache that cannot be written, with its remedy."""
    text = f"the cache of compiled code cannot be written: {problem.strerror}"
    advice = "set XDG_CACHE_HOME or NUMBA_CACHE_DIR to a folder that can"
    return ConfigError(_cache_folder, [Problem((), f"{text}; {advice}")])


def mark_cache_warm() -> None:
    """Note that every compiled function now lies in the cache; forget caches of old sources."""
    if _settings["DISABLE_JIT"]:
        return
    _cache_folder.mkdir(parents=True, exist_ok=True)
    (_cache_folder / "warm").touch()
    oldest = time.time() - _KEPT_DAYS * 86400
    for other in _cache_folder.parent.glob("core-*"):
        warm = other / "warm"
        if other != _cache_folder and warm.exists() and warm.stat().st_mtime < oldest:
            shutil.rmtree(other, ignore_errors=True)


def source_digest(sources: Iterable[Path], place: str = "") -> str:
    """Return a digest of source files, a place, and the versions of numba and numpy."""
    digest = hashlib.sha256(f"{numba.__version__} {np.__version__} {place}".encode())
    for source in sources:
        digest.update(source.name.encode() + source.read_bytes())
    return digest.hexdigest()


def _find_cache_folder() -> Path:
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    base = Path(os.environ.get("NUMBA_CACHE_DIR") or Path(home) / "ftc-sitl")
    root = Path(__file__).resolve().parents[2]
    sources = (path for package in _PACKAGES for path in sorted((root / package).rglob("*.py")))
    compiled_sources = [path for path in sources if b"@compiled" in path.read_bytes()]
    digest = source_digest([*compiled_sources, root / "mavlink_defs" / "ftc.xml"], str(root))
    return base / f"core-{digest[:16]}"


def _find_obstacle() -> OSError | None:
    """Return why the cache cannot be written; None if it can."""
    try:
        _cache_folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=_cache_folder):
            return None
    except OSError as problem:
        return problem


_cache_folder = _find_cache_folder()
_obstacle = None if _settings["DISABLE_JIT"] else _find_obstacle()
_settings["CACHE_DIR"] = str(_cache_folder)
