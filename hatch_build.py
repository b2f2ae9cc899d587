"""Build hook: generate `mavlink_defs/dialect.py`, bundle scenarios, aircraft and machine code.

It runs for wheels and for editable installs alike, so the dialect is never committed.
Wheels get copies of `scenarios/` and `aircraft/`; an editable install reads these folders.

With ``FTC_SITL_MACHINE_CODE=1`` a wheel carries machine code for this Python and platform
(`scripts/prebuild.py`), and is named so. The build takes minutes then, and numba.
"""

import os
import platform
import py_compile
import runpy
import subprocess
import sys
import sysconfig
import tempfile
import tomllib
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

ASKED = "FTC_SITL_MACHINE_CODE"
LINKER = "ziglang>=0.13"  # with C libraries of every age


class DialectHook(BuildHookInterface):
    """Prepares the package before hatchling collects its files."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Prepare a wheel; `version` is 'standard' or 'editable'."""
        root = Path(self.root)
        generate(root / "mavlink_defs")
        if version == "standard":
            build_data["force_include"]["scenarios"] = "gcs/bundled_scenarios"
            build_data["force_include"]["aircraft"] = "gcs/bundled_aircraft"
            if asks_for_machine_code():
                self._scratch = tempfile.TemporaryDirectory()
                scratch = Path(self._scratch.name)
                write_metadata(root, scratch / "metadata")
                made = machine_code(root, scratch)
                build_data["force_include"][str(made)] = f"mavlink_defs/runtime/{made.name}"
                build_data["pure_python"], build_data["tag"] = False, tag()

    def dependencies(self) -> list[str]:
        """Return what an isolated build needs beside this hook: all that flies, to compile it."""
        if not asks_for_machine_code():
            return []
        check_headers()
        project = tomllib.loads((Path(self.root) / "pyproject.toml").read_text())["project"]
        further = [LINKER] if sys.platform == "linux" else []
        compiler = project["optional-dependencies"]["compile"]
        return [*project["dependencies"], *compiler, "setuptools", *further]


def asks_for_machine_code() -> bool:
    """Return whether the wheel is to carry machine code."""
    return os.environ.get(ASKED, "") not in {"", "0"}


def check_headers() -> None:
    """Check that C can be compiled for this Python, before all is compiled that is linked with it.

    Raises:
        SystemExit: Its headers are missing.
    """
    folder = sysconfig.get_path("include")
    if not Path(folder, "Python.h").is_file():
        sys.exit(
            f"machine code needs the C headers of Python, and {folder} has no Python.h: install"
            " them, such as by `apt install python3-dev`"
        )


def write_metadata(root: Path, folder: Path) -> None:
    """Write what is read of an installed ftc-sitl, which an isolated build has not."""
    project = tomllib.loads((root / "pyproject.toml").read_text())["project"]
    info = folder / f"ftc_sitl-{project['version']}.dist-info"
    info.mkdir(parents=True)
    text = f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
    (info / "METADATA").write_text(text)
    commands = project["entry-points"]["ftc_sitl.commands"]
    lines = (f"{name} = {place}\n" for name, place in commands.items())
    (info / "entry_points.txt").write_text(f"[ftc_sitl.commands]\n{''.join(lines)}")


def machine_code(root: Path, scratch: Path) -> Path:
    """Make the machine code in a folder that has the `metadata`; return its file.

    Raises:
        subprocess.CalledProcessError: It could not be made.
    """
    folder = scratch / "made"
    folder.mkdir()
    command = [sys.executable, str(root / "scripts" / "prebuild.py"), str(folder)]
    paths = [str(root), str(scratch / "metadata"), *filter(None, sys.path)]  # isolated, too
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "ftc-sitl"
    cache = Path(os.environ.get("NUMBA_CACHE_DIR") or home) / "ahead"  # here nothing is apart
    env = os.environ | {"PYTHONPATH": os.pathsep.join(paths), "NUMBA_DISABLE_JIT": "0"}
    env["NUMBA_CACHE_DIR"] = str(cache)
    subprocess.run(command, check=True, env=env, stdout=sys.stderr)
    (made,) = folder.iterdir()
    return made


def tag() -> str:
    """Return the tag of a wheel with machine code; manylinux if it was linked for old libraries."""
    from importlib.util import find_spec

    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    place = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    if sys.platform == "linux" and find_spec("ziglang") is not None:
        place = f"manylinux_2_28_{platform.machine()}"  # see `ahead_of_time.GLIBC`
    return f"{python}-{python}-{place}"


def generate(package: Path) -> None:
    """Generate `package/dialect.py` from `package/ftc.xml`.

    Raises:
        RuntimeError: pymavlink refused the definition.
    """
    text = runpy.run_path(str(package / "mavgen.py"))["generate"]("Python3")
    (package / "dialect.py").write_text(text, encoding="utf-8")
    # the module is large: every process of a fleet would parse it again if none may write bytecode
    py_compile.compile(str(package / "dialect.py"), doraise=True)


if __name__ == "__main__":
    generate(Path(__file__).parent / "mavlink_defs")
