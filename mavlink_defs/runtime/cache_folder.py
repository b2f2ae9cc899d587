"""Where compiled code lies, and which parts of the numeric core lie there whole.

The cache lies in ``$NUMBA_CACHE_DIR``, or ``$XDG_CACHE_HOME/ftc-sitl``, or ``~/.cache/ftc-sitl``.
Where it cannot be written, every process compiles for itself what it calls, and the error of
`parts_left` names the remedy. Who only asks imports no compiler for it: that is a third of a ground
station's memory.

It is of the code of our files that it depends on: their comments, docstrings and layout may change.

On Linux on x86 the code is made for any processor since about 2013 (x86-64-v3), so that machines
can share it; ``NUMBA_CPU_NAME`` chooses another. The bits of results do not depend on it.
"""

import ast
import contextlib
import errno
import functools
import json
import os
import platform
import shutil
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

from mavlink_defs.config.problems import ConfigError, Problem
from mavlink_defs.runtime.sources import (
    ROOT,
    compiled_sources,
    content_digest,
    digest_of,
    is_ours,
    joint_digest,
    remembered,
    with_imports,
)

COMMON_CPU = "x86-64-v3"
_ITS_FLAGS = {"abm", "avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "movbe", "xsave"}
"""As Linux names what it has."""
_WARM = "warm-"
_KEPT_DAYS = 14
_KEPT_DIGESTS = 5000


def parts_left(parts: Iterable[str]) -> list[str]:
    """Return those parts of the numeric core, of `gcs.fleet.precompile`, that are not cached.

    Raises:
        ConfigError: The cache cannot be written: every process would have to compile it.
        OSError: Too many files are open.
    """
    if OBSTACLE is not None:
        raise not_cached(OBSTACLE)
    return [part for part in parts if not _warm_mark(part).exists()]


def not_cached(problem: OSError) -> ConfigError | OSError:
    """Return the error for a cache that cannot be written, with its remedy.

    Too many open files are no fault of the cache: then `problem` itself is returned.
    """
    if problem.errno in {errno.EMFILE, errno.ENFILE}:
        return problem
    text = f"the cache of compiled code cannot be written: {problem.strerror}"
    advice = "set XDG_CACHE_HOME or NUMBA_CACHE_DIR to a folder that can"
    return ConfigError(FOLDER, [Problem((), f"{text}; {advice}")])


def mark_warm(part: str) -> None:
    """Note that a part of the numeric core lies in the cache; forget code of old sources."""
    in_use = list(_folders())
    FOLDER.mkdir(parents=True, exist_ok=True)
    _warm_mark(part).touch()
    for place in in_use:
        if place.exists():
            os.utime(place)
    oldest = time.time() - _KEPT_DAYS * 86400
    for place in FOLDER.iterdir():
        with contextlib.suppress(FileNotFoundError):  # another process forgets it, too
            if place.stat().st_mtime < oldest:
                shutil.rmtree(place) if place.is_dir() else place.unlink()


def compiled_functions() -> int:
    """Return how many of our functions lie in the cache, of present sources."""
    return sum(len([*folder.glob("*.nbi")]) for folder in _folders())


def _folders() -> Iterator[Path]:
    return (folder_of(source) for source in compiled_sources())


def folder_of(source: Path, *further: Path) -> Path:
    """Return the folder of a file's code.

    Args:
        source: The file. If it is of other people, its place counts, too.
        further: Others that its code depends on beside what it imports.
    """
    return FOLDER / _digest_with_imports(source, *further)


@remembered
def _digest_with_imports(source: Path, *further: Path) -> str:
    known = code_digests()
    before = len(known)
    places = " ".join(map(_place, (source, *further)))
    compiled_by = Path(__file__).with_name("compiler.py")
    files = (compiled_by, *with_imports(source, *further))
    digest = joint_digest(map(_code_digest, files), f"{places} {TARGET}")
    if len(known) > before and OBSTACLE is None:
        _keep(known)
    return digest[:16]


def _place(source: Path) -> str:
    return str(source.relative_to(ROOT) if source.is_relative_to(ROOT) else source)


@remembered
def _code_digest(source: Path) -> bytes:
    """Return a digest of a file's name and code; of other people's files lines count, too."""
    whole, known = content_digest(source).hex(), code_digests()
    if not is_ours(source) or source.suffix != ".py":
        return bytes.fromhex(whole)
    if whole not in known:
        content = source.read_bytes()  # it may have changed
        whole = digest_of(source, content).hex()
        known[whole] = digest_of(source, _bare(content)).hex()
    return bytes.fromhex(known[whole])


def _bare(content: bytes) -> bytes:
    """Return a text for the code of a file, the same without comments, docstrings and layout."""
    try:
        tree = ast.parse(content)
    except SyntaxError:  # a template
        return content
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            node.body = [one for one in node.body if not _is_text(one)]
    return ast.dump(tree).encode()


def _is_text(statement: ast.stmt) -> bool:
    if not isinstance(statement, ast.Expr) or not isinstance(statement.value, ast.Constant):
        return False
    return isinstance(statement.value.value, str)


@functools.cache
def code_digests() -> dict[str, str]:
    """Return digests of code by digests of whole files, as made before: to parse takes a second.

    What is made is added to them.
    """
    with contextlib.suppress(OSError, ValueError):
        known: dict[str, str] = json.loads(_digests_file().read_text(encoding="ascii"))
        return known
    return {}


def _keep(known: dict[str, str]) -> None:
    """Keep digests of code for other processes; one that does so at the same time wins."""
    part = _digests_file().with_suffix(f".{os.getpid()}")
    with contextlib.suppress(OSError):
        part.write_text(json.dumps(dict([*known.items()][-_KEPT_DIGESTS:])), encoding="ascii")
        part.replace(_digests_file())


def _digests_file() -> Path:
    return FOLDER / f"digests-{sys.implementation.cache_tag}.json"


def _warm_mark(part: str) -> Path:
    """Return the empty file that stands for a cache with a part of the numeric core."""
    return FOLDER / f"{_WARM}{_digest_of_all()}-{part.replace(' ', '-')}"


@functools.cache
def _digest_of_all() -> str:
    return _digest_with_imports(*compiled_sources())


def _find_cache_folder() -> Path:
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return Path(os.environ.get("NUMBA_CACHE_DIR") or Path(home) / "ftc-sitl") / "core"


def _find_obstacle() -> OSError | None:
    """Return why the cache cannot be written; None if it can."""
    if FOLDER.parts[0] == "~":  # not to be taken for a folder of this name
        return FileNotFoundError(errno.ENOENT, "there is no home folder", str(FOLDER))
    try:
        FOLDER.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=FOLDER):
            return None
    except OSError as problem:
        return problem


def _cpu() -> str:
    """Return the processor that code is made for, by LLVM's name."""
    chosen = os.environ.get("NUMBA_CPU_NAME")
    if chosen:
        return chosen
    if sys.platform == "linux" and platform.machine() == "x86_64" and _flags() >= _ITS_FLAGS:
        return COMMON_CPU
    from llvmlite.binding import get_host_cpu_name

    return str(get_host_cpu_name())


def _flags() -> set[str]:
    """Return what Linux says that this processor has."""
    with contextlib.suppress(OSError), open("/proc/cpuinfo", encoding="ascii") as lines:
        for line in lines:
            if line.startswith("flags"):
                return set(line.partition(":")[2].split())
    return set()


FOLDER = _find_cache_folder()
OBSTACLE = _find_obstacle()
"""Why the cache cannot be written; None if it can."""
CPU = _cpu()
TARGET = f"{sys.implementation.cache_tag} {sys.platform} {platform.machine()} {CPU}"
"""What code depends on beside its source."""
