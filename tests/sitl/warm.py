"""`gcs` forked from a process that has imported it: most of a short command's time is imports.

Each command is a process of its own all the same, with its environment, folder and output.
"""

import atexit
import multiprocessing
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from gcs.cli import COMMANDS

_PROCESSES: Any = multiprocessing.get_context("forkserver")
_LAB = Path(__file__).parents[2] / "gcs" / "lab" / "commands"
_COMMANDS = [
    f"gcs.lab.commands.{name}" if (_LAB / f"{name}.py").exists() else f"gcs.commands.{name}"
    for name in sorted({module for module, _ in COMMANDS.values()})
]
_PRELOAD = ["gcs.cli", *_COMMANDS, "gcs.lab.campaigns.preload", "gcs.fleet.flight"]

_READ_BY_IMPORTS = ("HOME", "NUMBA_", "PYTHON", "XDG_")


def can_be_warm(env: Mapping[str, str]) -> bool:
    """Return whether a command with this environment would import what we did, the same way."""
    read = {name for name in {*env, *os.environ} if name.startswith(_READ_BY_IMPORTS)}
    return all(env.get(name) == os.environ.get(name) for name in read)


def run_warm(
    arguments: Sequence[str], env: dict[str, str], cwd: Path | None, timeout_s: float
) -> subprocess.CompletedProcess[str]:
    """Run `gcs` to its end, as `subprocess.run` does."""
    _PROCESSES.set_forkserver_preload(_PRELOAD)
    with tempfile.TemporaryDirectory() as folder:
        output, errors = Path(folder) / "output", Path(folder) / "errors"
        given = (arguments, env, cwd or Path.cwd(), output, errors)
        process = _PROCESSES.Process(target=_main, args=given)
        process.start()
        process.join(timeout_s)
        if process.exitcode is None:
            process.kill()
            raise subprocess.TimeoutExpired(["gcs", *arguments], timeout_s, errors.read_bytes())
        texts = [path.read_bytes().decode() for path in (output, errors)]
        return subprocess.CompletedProcess(["gcs", *arguments], process.exitcode, *texts)


def _main(
    arguments: Sequence[str], env: dict[str, str], cwd: Path, output: Path, errors: Path
) -> None:
    from gcs.__main__ import main

    os.environ.clear()
    os.environ.update(env)
    os.chdir(cwd)
    flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND
    for number, path in enumerate((Path(os.devnull), output, errors)):
        os.dup2(os.open(path, flags if number else os.O_RDONLY), number)
    sys.argv = ["gcs", *arguments]
    try:
        main()
    finally:
        atexit._run_exitfuncs()
