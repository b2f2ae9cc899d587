"""Makes the module of `mavlink_defs.runtime.prebuilt`, by numba's ahead-of-time compiler.

`numba.pycc` is to be replaced one day, and only this file knows it. The way out, should it go: take
the object code of every entry from the library that compile_extra of numba fills, as pycc does,
and link it with the C sources of numba's helpers by the system's linker.

With `ziglang` installed, C sources are compiled, and all is linked, against a C library as old as
`GLIBC`, so that the module runs on all distributions since; otherwise by the system's compiler,
against the library that is here.
"""

import contextlib
import json
import os
import platform
import subprocess
import sys
import sysconfig
import tempfile
import warnings
from collections.abc import Callable, Iterator
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from mavlink_defs.runtime import jit, prebuilt
from mavlink_defs.runtime.sources import ROOT, resolved, version_of, with_imports

GLIBC = "2.28"
"""Of distributions since 2018: Debian 10, Ubuntu 18.10, RHEL 8."""


class _Entry(NamedTuple):
    name: str
    types: tuple[Any, ...]


class Calls:
    """The kinds of calls that machine code is made for: what Python calls while it listens."""

    def __init__(self) -> None:
        self._functions: dict[str, Callable[..., object]] = {}
        self._entries: dict[str, dict[prebuilt.Kinds, _Entry]] = {}

    @property
    def names(self) -> set[str]:
        """The functions that were called, as of `name_of`."""
        return set(self._entries)

    @contextlib.contextmanager
    def listening(self) -> Iterator[None]:
        """Note every call of a compiled function."""
        jit.listeners.append(self._note)
        try:
            yield
        finally:
            jit.listeners.remove(self._note)

    def _note(self, function: Callable[..., object], arguments: tuple[Any, ...]) -> None:
        name, kinds = prebuilt.name_of(function), prebuilt.kinds_of(arguments)
        entries = self._entries.setdefault(name, {})
        if kinds not in entries:
            _check(name, kinds)
            self._functions[name] = function
            entry = f"{function.__name__}_{len(self._functions)}_{len(entries)}"
            entries[kinds] = _Entry(entry, jit.compiler("").types_of(arguments))

    def build(self, folder: Path) -> Path:
        """Make the module in a folder; return its file.

        Raises:
            subprocess.CalledProcessError: The C compiler failed.
        """
        with tempfile.TemporaryDirectory() as scratch, _c_compiler(Path(scratch), self._content()):
            warnings.filterwarnings("ignore", message=".*pycc")  # that it is to be replaced one day
            pycc: Any = import_module("numba.pycc")
            module = pycc.CC(prebuilt.MODULE.rpartition(".")[2], __name__)
            module.output_dir = str(folder)
            for name, function in self._functions.items():
                for entry in self._entries[name].values():
                    module.export(entry.name, entry.types)(function)
            with _our_flags():
                module.compile()
        return folder / str(module.output_file)

    def _content(self) -> str:
        options = Path(__file__).with_name("compiler.py")
        used = {
            name: with_imports(resolved(function.__code__.co_filename), options)
            for name, function in self._functions.items()
        }
        files = sorted({file for needed in used.values() for file in needed})
        functions = {
            name: prebuilt.Made(
                [files.index(file) for file in used[name]],
                [(kinds, entry.name) for kinds, entry in entries.items()],
            )
            for name, entries in self._entries.items()
        }
        sources = [(str(file.relative_to(ROOT)), prebuilt.digest_now(file)) for file in files]
        return json.dumps(prebuilt.Content(version_of("numba"), sources, functions))


def _check(name: str, kinds: Any) -> None:
    """Check that kinds say all that compiled code takes for granted."""
    for kind in kinds:
        if isinstance(kind, tuple):
            _check(name, kind[1:])
        elif isinstance(kind, str) and "." in kind:
            raise TypeError(f"{name} cannot be compiled ahead: an argument is a {kind}")


@contextlib.contextmanager
def _our_flags() -> Iterator[None]:
    """Compile with the options of `compiler.add_function`, which pycc has no way to ask for."""
    pycc: Any = import_module("numba.pycc.compiler")
    plain = pycc.Flags

    def flags() -> Any:
        chosen = plain()
        chosen.error_model, chosen.release_gil = "numpy", True
        return chosen

    pycc.Flags = flags
    try:
        yield
    finally:
        pycc.Flags = plain


@contextlib.contextmanager
def _c_compiler(scratch: Path, content: str) -> Iterator[None]:
    """Let setuptools find the C compiler, and link the text of the content into what it links."""
    headers = headers_beside(scratch)
    compile_c, compile_cxx = (_command(language, headers) for language in ("cc", "c++"))
    source, linked = scratch / "content.c", scratch / "content.o"
    source.write_text(
        f"const char {prebuilt.CONTENT}[] = {json.dumps(content)};\n", encoding="ascii"
    )
    names = {"ZIG_GLOBAL_CACHE_DIR": str(scratch), "ZIG_LOCAL_CACHE_DIR": str(scratch)}
    command = [*compile_c.split(), "-fPIC", "-c", str(source), "-o", str(linked)]
    subprocess.run(command, check=True, env=os.environ | names)
    shared = "-bundle -undefined dynamic_lookup" if sys.platform == "darwin" else "-shared -s"
    names |= {"CC": compile_c, "CXX": compile_cxx, "LDSHARED": f"{compile_c} {shared} {linked}"}
    before = dict(os.environ)
    os.environ.update(names)
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)


def links_old_library() -> bool:
    """Return whether the module will run with any C library since `GLIBC`."""
    return sys.platform == "linux" and find_spec("ziglang") is not None


def headers_beside(scratch: Path) -> Path:
    """Return a folder that has what the Python of Debian and Ubuntu includes from /usr/include.

    Their pyconfig.h includes <x86_64-linux-gnu/python3.13/pyconfig.h>. A compiler for another C
    library must not search /usr/include itself.
    """
    headers = scratch / "headers"
    headers.mkdir()
    folder = str(sysconfig.get_config_var("MULTIARCH") or "")
    if folder and (there := Path("/usr/include", folder)).is_dir():
        (headers / folder).symlink_to(there)
    return headers


def _command(language: str, headers: Path) -> str:
    if not links_old_library():
        return language
    target = f"{platform.machine()}-linux-gnu.{GLIBC}"
    options = f"-target {target} -fno-sanitize=undefined -I{headers}"
    return f"{sys.executable} -m ziglang {language} {options}"
