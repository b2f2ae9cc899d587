"""Numba finds compiled code in a cache on disk, which can never be stale.

Numba's own cache checks only the file that a function is in, so a caller continues
running the old code of a function that it calls from another file. Here every file has a cache
folder of its own, whose name is a digest of that file, of every file that it imports, directly or
not, of the versions of Python, numba and numpy, and of the processor that the code is made for.
After a change only what depends on it is compiled again; comments, docstrings and layout of our own
files do not count, so that a function may stand in another line than when it was compiled. Equal sources share their code, wherever
they lie. A file of another project counts with what it imports of its own package or from beside
it.
"""

import hashlib
import pickle
from collections.abc import Callable
from pathlib import Path
from types import CodeType
from typing import Any

import numba
from numba.core import caching
from numba.core.annotations import type_annotations

from mavlink_defs.runtime.cache_folder import COMMON_CPU, CPU, FOLDER, OBSTACLE, folder_of
from mavlink_defs.runtime.sources import resolved

_FURTHER_LOCATORS = (
    "UserProvidedCacheLocator,InTreeCacheLocator,UserWideCacheLocator,"
    "IPythonCacheLocator,ZipCacheLocator"
)
"""Numba's own, for the functions of others."""

_UserProvidedCacheLocator: Any = caching.UserProvidedCacheLocator  # without annotations
_settings = vars(numba.config)  # made at run time, so that type checkers see none of them


class DigestLocator(_UserProvidedCacheLocator):
    """Tells numba where the code of one function lies; the folder's name says how fresh it is."""

    def __init__(self, function: Callable[..., object], file: str) -> None:
        """Locate the code of a function that is in a file."""
        super().__init__(function, file)
        self._folder = folder_of(resolved(file), *_functions[function])
        self._digest = _digest_of(function)

    @classmethod
    def from_function(cls, function: Callable[..., object], file: str) -> "DigestLocator | None":
        """Return the locator of a function; None if `add_to_cache` does not know it."""
        return cls(function, file) if function in _functions else None

    def get_cache_path(self) -> str:
        """Return the folder with its code."""
        return str(self._folder)

    def get_disambiguator(self) -> str:
        """Return what distinguishes the function from others of its name; numba takes its line."""
        return self._digest

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
    if OBSTACLE is not None or not resolved(variants[0].__code__.co_filename).is_file():
        return False
    _functions.update(dict.fromkeys(variants, further))
    return True


def _digest_of(function: Callable[..., object]) -> str:
    """Return a digest of a function's own code, wherever it stands."""
    code = function.__code__
    numbers = [one for one in code.co_consts if not isinstance(one, str | CodeType)]
    text = repr((code.co_code, code.co_names, numbers))
    return hashlib.sha256(text.encode()).hexdigest()[:8]


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
    for path in FOLDER.rglob("*.nbi"):
        try:
            with path.open("rb") as index:  # numba's version, then all else
                pickle.load(index), pickle.load(index)
        except (AttributeError, ModuleNotFoundError):
            unreadable.append(path)
    for path in unreadable:
        path.unlink(missing_ok=True)
    return bool(unreadable)


_settings["CACHE_LOCATOR_CLASSES"] = (
    f"{__name__}.{DigestLocator.__name__},{_settings['CACHE_LOCATOR_CLASSES'] or _FURTHER_LOCATORS}"
)
_TypeAnnotation: Any = type_annotations.TypeAnnotation  # without annotations
_annotated = _TypeAnnotation.__str__
_TypeAnnotation.__str__ = _text_of
_functions: dict[Callable[..., object], tuple[Path, ...]] = {}
"""Those whose code is cached, each with the further files that it depends on."""
if CPU == COMMON_CPU:
    _settings["CPU_NAME"], _settings["CPU_FEATURES"] = CPU, ""
