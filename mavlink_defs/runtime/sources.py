"""Digests of sources: of a file with all that it imports, directly or not.

By them compiled code is found in the cache (`mavlink_defs.runtime.cache_folder`), and machine code
that was made before is known to be of these sources (`mavlink_defs.runtime.prebuilt`).
"""

import ast
import functools
import hashlib
import importlib.metadata
import importlib.util
import os
import re
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, TypeVar

_F = TypeVar("_F", bound=Callable[..., Any])
_PACKAGES = ("mavlink_defs", "sitl_plant", "ftc_autopilot", "gcs", "ftc_lab")
ROOT = Path(__file__).resolve().parents[2]
"""The folder of our packages."""
_GENERATED = {ROOT / "mavlink_defs" / "dialect.py": ROOT / "mavlink_defs" / "ftc.xml"}
_IMPORT = re.compile(r"^from ([\w.]+) import (\([^)]*\)|.*)|^import ([\w.]+)", re.MULTILINE)
_forget: list[Callable[[], None]] = []


def remembered(function: _F) -> _F:
    """Decorate what is computed once for each file, until `forget_sources`."""
    known: Any = functools.cache(function)
    _forget.append(known.cache_clear)
    return known  # type: ignore[no-any-return]  # it is called as the function is


def sources_of(file: Path) -> list[Path]:
    """Return a file of another project and the files of that project that it imports, sorted.

    What it imports must have been imported.
    """
    return [path for path in with_imports(file) if not is_ours(path)]


def forget_sources() -> None:
    """Read files again: one of another project has changed while this process runs."""
    for forget in _forget:
        forget()


def source_digest(sources: Iterable[Path]) -> str:
    """Return a digest of source files and of the versions of numba and numpy."""
    return joint_digest(map(content_digest, sources))


def joint_digest(digests: Iterable[bytes], place: str = "") -> str:
    """Return a digest of digests, a place, and the versions of numba and numpy."""
    joint = hashlib.sha256(f"{version_of('numba')} {version_of('numpy')} {place}".encode())
    for digest in digests:
        joint.update(digest)
    return joint.hexdigest()


@functools.cache
def version_of(package: str) -> str:
    """Return the version of a package, which is not imported for it, or "not installed"."""
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


@remembered
def content_digest(source: Path) -> bytes:
    """Return a digest of one file and its name."""
    return digest_of(source, source.read_bytes())


def digest_of(source: Path, content: bytes) -> bytes:
    """Return the digest of a file's content and its name."""
    return hashlib.sha256(source.name.encode() + content).digest()


@functools.cache
def resolved(name: str) -> Path:
    """Return the path of a file without links."""
    return Path(name).resolve()


def with_imports(*sources: Path) -> list[Path]:
    """Return files and all that they import, directly or not, sorted."""
    found: set[Path] = set()
    waiting = list(sources)
    while waiting:
        path = waiting.pop()
        if path not in found:
            found.add(path)
            waiting += _imports(path)
    return sorted(_GENERATED.get(path, path) for path in found)


def is_ours(source: Path) -> bool:
    """Return whether a file is of our packages."""
    return any(source.is_relative_to(ROOT / package) for package in _PACKAGES)


@remembered
def _imports(source: Path) -> list[Path]:
    """Return the files that a file imports of this project, and of its own one."""
    if source in _GENERATED or source.suffix != ".py":
        return []
    text = source.read_text(encoding="utf-8")
    names: list[str] = []
    for package, members, module in _IMPORT.findall(text):
        names += [module or package]
        if _is_folder(package):
            names += [f"{package}.{name}" for name in re.findall(r"\w+", members)]
    own = (name.replace(".", "/") for name in names if name.partition(".")[0] in _PACKAGES)
    files = [f"{ROOT}/{name}{end}" for name in own for end in (".py", "/__init__.py")]
    found = [Path(file) for file in files if os.path.isfile(file)]
    return found if is_ours(source) else [*found, *_imports_of_its_project(source, text)]


@functools.cache
def _is_folder(package: str) -> bool:
    """Return whether a name is a folder of ours: what is imported of it may be a file."""
    return os.path.isdir(ROOT / package.replace(".", "/"))


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
    return resolved(origin) if origin.endswith(".py") else None


def _first(source: Path, top: Path) -> str:
    """Return the name of the package below a folder that a file is in."""
    return source.relative_to(top).parts[0]


@functools.cache
def compiled_sources() -> list[Path]:
    """Return the files of ours that have compiled functions, sorted."""
    sources = (path for package in _PACKAGES for path in (ROOT / package).rglob("*.py"))
    return sorted(
        path for path in sources if re.search(rb"@(compiled|inlined|apart)", path.read_bytes())
    )
