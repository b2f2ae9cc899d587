"""Finding plug-ins: by the name of an entry point, or by file and class, as in ``law.py:MyLaw``.

Whatever is wrong with one is a `PluginError`, one line that names the file, and the line if there
is one.
"""

import contextlib
import functools
import hashlib
import importlib
import importlib.util
import re
import sys
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextvars import ContextVar
from importlib.machinery import SourceFileLoader
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple, TypeVar

from mavlink_defs.config.models import Model, Problems
from mavlink_defs.runtime.foreign import ForeignCode, PluginError
from mavlink_defs.runtime.sources import forget_sources, source_digest, sources_of

LAWS, TRIGGERS = "ftc_sitl.laws", "ftc_sitl.triggers"
GUIDANCE_LAWS, SCENARIOS = "ftc_sitl.guidance_laws", "ftc_sitl.scenarios"

_BY_FILE = re.compile(r"(?P<file>.+\.py):(?P<name>\w+)")
_SUFFIX = {"darwin": ".dylib", "win32": ".dll"}.get(sys.platform, ".so")
_M = TypeVar("_M", bound=Model)


Watch = Callable[[Path, str], contextlib.AbstractContextManager[None]]
"""Context in which a file runs that lies beside a scenario: gets the file, and its digest."""


@contextlib.contextmanager
def _unwatched(_file: Path, _digest: str) -> Iterator[None]:
    yield


_watch: ContextVar[Watch] = ContextVar("watch", default=_unwatched)
_runs_code: ContextVar[bool] = ContextVar("runs_code", default=True)


class Plugin(NamedTuple):
    """Where a class comes from."""

    name: str
    """As a scenario names it: of an entry point, or FILE:CLASS."""
    package: str
    """Distribution and version that registers it; empty if it is named by its file."""
    file: Path
    sources: tuple[Path, ...]
    """All files that its code depends on, but for ftc-sitl's and third packages'."""
    digest: str
    """Of the sources' content."""


def is_by_file(name: object) -> bool:
    """Return whether a name is FILE:CLASS."""
    return isinstance(name, str) and _BY_FILE.fullmatch(name) is not None


def resolved(name: str, folder: Path) -> str:
    """Return FILE:CLASS with an absolute file, which was relative to a folder; others unchanged."""
    if (match := _BY_FILE.fullmatch(name)) is None:
        return name
    return f"{(folder / Path(match['file']).expanduser()).resolve()}:{match['name']}"


def label(name: str) -> str:
    """Return a name as texts show it: FILE:CLASS without the folder."""
    match = _BY_FILE.fullmatch(name)
    return name if match is None else f"{Path(match['file']).name}:{match['name']}"


@functools.cache
def registered(group: str) -> dict[str, EntryPoint]:
    """Return the entry points of a group, by name."""
    return {point.name: point for point in entry_points(group=group)}


@contextlib.contextmanager
def watching(watch: Watch) -> Iterator[None]:
    """Let a context be around each file that is run in here because a plug-in names it."""
    token = _watch.set(watch)
    try:
        yield
    finally:
        _watch.reset(token)


@contextlib.contextmanager
def without_code() -> Iterator[None]:
    """Run no code of plug-ins in here: their names and keys are read, and not checked."""
    token = _runs_code.set(False)
    try:
        yield
    finally:
        _runs_code.reset(token)


def runs_code() -> bool:
    """Return whether code of plug-ins is run to read what names them."""
    return _runs_code.get()


def calling(found: type[Model], method: str) -> ForeignCode:
    """Return the context in which a method of a plug-in's class is called, or of one of ours.

    Raises:
        PluginError: Whatever the method of a plug-in raised, with its line.
    """

    def error(problem: BaseException) -> BaseException:
        if (plugin := plugin_of(found)) is None or isinstance(problem, PluginError | Problems):
            return problem
        text = line_about(problem, plugin.sources)
        return PluginError(f"{text}, raised by {found.__name__}.{method}")

    return ForeignCode(error)


def load_class(name: str, group: str, base: type[_M]) -> type[_M]:
    """Return the class of a plug-in, of which `plugin_of` knows where it comes from.

    Args:
        name: As of `class_of`.
        group: As of `class_of`.
        base: As of `class_of`.

    Raises:
        PluginError: It cannot be used, or its library is not there.
    """
    found, package = class_of(name, group, base)
    if found not in _PLUGINS or _PLUGINS[found].name != name:
        _PLUGINS[found] = _described(name, package, found)
    return found


def class_of(name: str, group: str, base: type[_M]) -> tuple[type[_M], str]:
    """Return the class of a plug-in and its package; the same class as long as its file stays.

    Args:
        name: Of an entry point, or FILE:CLASS with an absolute file.
        group: Of entry points.
        base: What it must be a subclass of.

    Raises:
        PluginError: It cannot be used.
    """
    if (match := _BY_FILE.fullmatch(name)) is not None:
        file = Path(match["file"])
        module, where = _module_of_file(file), str(file)
        found = _attribute(module, match["name"], where)
        package = ""
    else:
        point = registered(group)[name]
        found, package, where = _of_entry_point(point, group)
    if not (isinstance(found, type) and issubclass(found, base)):
        kind = "class" if isinstance(found, type) else type(found).__name__
        expected = f"expected a subclass of {base.__module__}.{base.__name__}"
        raise PluginError(f"{where}: {_last(name)} is a {kind}: {expected}")
    return found, package


def plugin_of(found: type[Model]) -> Plugin | None:
    """Return where a class comes from; None of our own ones."""
    return _PLUGINS.get(found)


def check_shadowed(group: str, own: str) -> None:
    """Check that no entry point has a certain name of ours.

    Raises:
        PluginError: One has.
    """
    if (point := registered(group).get(own)) is not None:
        raise PluginError(
            f"{_package_of(point)} registers {own!r} ({point.value}) in {group}, "
            "which is a name of ftc-sitl itself: rename its entry point"
        )


def file_of(found: type[Model]) -> Path:
    """Return the file of a class."""
    return Path(str(sys.modules[found.__module__].__file__)).resolve()


def line_of(function: Any) -> str:
    """Return FILE:LINE of a function."""
    code = getattr(function, "__wrapped__", getattr(function, "py_func", function)).__code__
    return f"{code.co_filename}:{code.co_firstlineno}"


def line_about(problem: BaseException, files: Iterable[Path]) -> str:
    """Return an exception as "FILE:LINE: TYPE: text", with the innermost line in the files."""
    places = [
        (frame.filename, frame.lineno) for frame in traceback.extract_tb(problem.__traceback__)
    ]
    if isinstance(problem, SyntaxError) and problem.filename:
        places.append((problem.filename, problem.lineno))
    own = set(map(str, files))
    inner = [f"{file}:{line}: " for file, line in places if file in own]
    text = problem.msg if isinstance(problem, SyntaxError) else str(problem)
    text = " ".join(text.split())
    if isinstance(problem, PluginError):
        return text
    return f"{inner[-1] if inner else ''}{type(problem).__name__}{': ' if text else ''}{text}"


_PLUGINS: dict[type[Model], Plugin] = {}
_MODULES: dict[Path, tuple[str, ModuleType]] = {}


def _module_of_file(file: Path) -> ModuleType:
    """Return the module of a file, executed again only if it has changed."""
    try:
        content = file.read_bytes()
    except OSError as problem:
        raise PluginError(f"{file}: {problem.strerror}") from problem
    digest = hashlib.sha256(content).hexdigest()[:16]
    known = _MODULES.get(file)
    if known is not None and known[0] == digest:
        return known[1]
    if known is not None:
        forget_sources()
    # a name of its own for every content: compiled code finds its module by it
    place = hashlib.sha256(str(file).encode()).hexdigest()[:8]
    name = f"ftc_plugin_{re.sub(r'[^A-Za-z0-9_]', '_', file.stem)}_{place}_{digest}"
    loader = SourceFileLoader(name, str(file))
    spec = importlib.util.spec_from_file_location(name, file, loader=loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        with _watch.get()(file, source_digest([file])[:16]), importing(file):
            # what was read, not a .pyc, which passes for the new code if saved in the same second
            exec(loader.source_to_code(content, str(file)), module.__dict__)
    except BaseException:
        del sys.modules[name]
        raise
    _MODULES[file] = digest, module
    return module


def importing(file: Path) -> ForeignCode:
    """Return the context in which a file is run, in which nothing may fork.

    Raises:
        PluginError: Whatever was raised, with its line.
    """
    return ForeignCode(lambda problem: PluginError(_cannot_import(problem, file)), may_fork=False)


def _cannot_import(problem: BaseException, file: Path) -> str:
    text = line_about(problem, [file])
    place = "" if text.startswith(str(file)) else f"{file}: "
    lacking = isinstance(problem, ModuleNotFoundError)
    advice = "; a plug-in by its file is one file: install what it imports" if lacking else ""
    return f"{place}{text}, raised when it was imported{advice}"


def _of_entry_point(point: EntryPoint, group: str) -> tuple[Any, str, str]:
    """Return what an entry point means, its package, and the file of its module."""
    package = _package_of(point)

    def error(problem: BaseException) -> PluginError:
        frames = traceback.extract_tb(problem.__traceback__)
        text = line_about(problem, {Path(frame.filename) for frame in frames[-1:]})
        text = f"{text}, raised when {point.module} was imported"
        return PluginError(f"{point.name!r} of {package} in {group}: {text}")

    with ForeignCode(error, may_fork=False):
        module = importlib.import_module(point.module)
    file = str(module.__file__)
    return _attribute(module, point.attr, file), package, file


def _package_of(point: EntryPoint) -> str:
    return "a package" if point.dist is None else f"{point.dist.name} {point.dist.version}"


def _attribute(module: ModuleType, name: str, where: str) -> Any:
    if not hasattr(module, name):
        raise PluginError(f"{where}: has no class {name!r}")
    return getattr(module, name)


def _last(name: str) -> str:
    return name.rpartition(":")[2]


def _described(name: str, package: str, found: type[Model]) -> Plugin:
    file = file_of(found)
    library = library_of(found)
    sources = (*sources_of(file), *([] if library is None else [library]))
    try:
        digest = source_digest(sources)[:16]
    except OSError as problem:
        raise PluginError(f"{file}: LIBRARY is {problem.filename}: {problem.strerror}") from problem
    return Plugin(name, package, file, sources, digest)


def library_of(found: type[Model]) -> Path | None:
    """Return the shared library that a plug-in's function is in; None if it is in Python."""
    name = getattr(found, "LIBRARY", None)
    if name is None:
        return None
    path: Path = (file_of(found).parent / name).expanduser()
    return path if path.suffix else path.with_suffix(_SUFFIX)
