"""Make .venv of a clone: what flying needs (`fly`), or all packages (`all`).

`make` runs it, with nothing but Python and its standard library. The packages come from the locks,
with their hashes: requirements/fly.txt, a part of requirements.txt. uv installs them; where there
is none for the platform, or with INSTALLER=pip, pip does. The numeric core is compiled while the
packages that its compilation does not import are still on their way.

What is interrupted goes on where it was when it is run again: a .venv into which packages were just
installed is made again from what was downloaded, and compiled functions stay in their cache.
"""

from __future__ import annotations

import contextlib
import fcntl
import importlib.util
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
VENV = ROOT / ".venv"
BUILD = ROOT / "build"
MARK = VENV / "half-done"
LOCKS = {"fly": ROOT / "requirements" / "fly.txt", "all": ROOT / "requirements.txt"}
FIRST = (
    *("annotated-types", "fastcrc", "llvmlite", "markdown-it-py", "mdurl", "numba", "numpy"),
    *("pip", "pydantic", "pydantic-core", "pygments", "pyyaml", "rich"),
    *("typing-extensions", "typing-inspection"),
)
"""What the compilation of the numeric core imports, and pip, which may have to install the rest."""
BESIDE = {"uv"}
"""What is locked and lies in build/ and not in .venv: 38 MB that nothing imports."""
UNUSED = (
    "MAVProxy/modules/mavproxy_cesium",
    *(f"pyarrow/{x}" for x in ("include", "src", "tests", "*_flight.*", "*_s3.*", "*_s3fs.*")),
)
"""What packages bring that nothing here uses, as patterns of their files and folders.

A globe for browsers, 118 MB; of Arrow what C++ needs, 9 MB, a server and its clients, 34 MB, and a
reader of a cloud's storage, 17 MB.
"""
SPACE_MB = {"fly": 700, "all": 1700}
"""Free space that a new .venv takes, and what is downloaded for it."""
FULL_MB = 50
"""What is left on a disk that is full."""
LINE_S = 10.0
"""Between two lines of progress where there is no terminal [s]."""
LOOK_S = 0.1
"""Between two looks at what runs [s]."""
COMPILE = """
from rich.console import Console
from gcs.console import progress
from gcs.fleet.warm_up import warm_up
from gcs.scenario.model import load_scenario

progress.EVERY_S = 1.0
warm_up(load_scenario("paper/scenario1"), Console(width=200))
"""
_AS_UV = {
    "PIP_INDEX_URL": "UV_DEFAULT_INDEX",
    "PIP_EXTRA_INDEX_URL": "UV_EXTRA_INDEX_URL",
    "PIP_FIND_LINKS": "UV_FIND_LINKS",
    "PIP_CERT": "SSL_CERT_FILE",
}
"""Variables that say where packages are: pip's, and the same of uv."""


_OFFLINE = ". If no package index is reached, docs/how-to/install.md has two ways"


class FailedError(Exception):
    """Why .venv cannot be made, and what to do: one line."""


class Job(NamedTuple):
    """A program that runs: what it does, what it prints, when it began [s]."""

    what: str
    process: subprocess.Popen[bytes]
    log: Path
    begin_s: float

    def __str__(self) -> str:
        return f"{self.what}: {time.monotonic() - self.begin_s:.0f} s {self.last_line()}".rstrip()

    def last_line(self) -> str:
        """Return what it printed last, for people."""
        lines = self.log.read_text(encoding="utf-8", errors="replace").split("\n")
        return next((line.strip() for line in reversed(lines) if line.strip()), "")


class Jobs:
    """The programs that run: one line on a terminal, which changes; elsewhere one now and then."""

    def __init__(self) -> None:
        self._running: list[Job] = []
        self._live = sys.stdout.isatty()
        self._shown_s = time.monotonic()

    def start(self, what: str, name: str, command: list[str]) -> Job:
        """Start a program.

        Args:
            what: What it does, for people.
            name: Of the file in build/ that takes what it prints.
            command: The program and its arguments. It inherits the lock, as it may outlive us.
        """
        log = BUILD / f"{name}.log"
        with log.open("wb") as file:
            process = subprocess.Popen(
                command,
                cwd=ROOT,
                env=_environment(),
                stdin=subprocess.DEVNULL,
                stdout=file,
                stderr=subprocess.STDOUT,
                close_fds=False,
            )
        job = Job(what, process, log, time.monotonic())
        self._running.append(job)
        return job

    def wait(self, job: Job) -> bool:
        """Show progress until a program has ended; return whether it ended well."""
        while job.process.poll() is None:
            self._show()
            time.sleep(LOOK_S)
        self._running.remove(job)
        if job.process.returncode == 0:
            self.say(f"{job.what}: {time.monotonic() - job.begin_s:.1f} s")
        return job.process.returncode == 0

    def must(self, job: Job, advice: str = "") -> None:
        """Show progress until a program has ended.

        Args:
            job: The program.
            advice: What to do if it fails, before it is run again.

        Raises:
            FailedError: It failed.
        """
        if self.wait(job):
            return
        free_mb = shutil.disk_usage(ROOT).free / 2**20
        if free_mb < FULL_MB:
            why = f"{ROOT} has {free_mb:.0f} MB left: free some"
        else:
            code = job.process.returncode
            last = (
                f"{signal.Signals(-code).name} ended it"
                if code < 0
                else job.last_line().rstrip(".")
            )
            why = f"{last}. {job.log.relative_to(ROOT)} says more{advice}"
        raise FailedError(f"{job.what}: {why}; run make again, which goes on from here")

    def stop(self) -> None:
        """End what still runs."""
        for job in self._running:
            job.process.kill()
            job.process.wait()

    def say(self, text: str) -> None:
        """Print a line that stays."""
        print(f"\r\x1b[K{text}" if self._live else text, flush=True)
        self._shown_s = time.monotonic()

    def _show(self) -> None:
        text = " | ".join(map(str, self._running))
        if self._live:
            text = text[: shutil.get_terminal_size().columns - 1]
            print(f"\r\x1b[K{text}", end="", flush=True)
        elif time.monotonic() - self._shown_s >= LINE_S:
            self.say(text)


def main(what: str) -> None:
    """Make .venv for `fly`, or for `all`.

    Raises:
        FailedError: That is not possible here.
    """
    BUILD.mkdir(exist_ok=True)
    jobs, begin_s = Jobs(), time.monotonic()
    with _alone(jobs):
        _forget_half_done(jobs)
        if not VENV.exists():
            _check_space(SPACE_MB[what])
        try:
            _make(jobs, locked(LOCKS[what]))
        finally:
            jobs.stop()
    size_mb = sum(512 * path.lstat().st_blocks for path in VENV.rglob("*")) / 1e6
    jobs.say(f".venv is ready: {size_mb:.0f} MB, {time.monotonic() - begin_s:.0f} s")


def locked(path: Path) -> dict[str, str]:
    """Return the entries of a lock by the package's name: versions with their hashes."""
    entries: dict[str, str] = {}
    for entry in re.split(r"^(?=\w)", path.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]:
        name = entry.partition("==")[0]
        entries[name] = entries.get(name, "") + entry  # there is one for each Python
    return entries


def _make(jobs: Jobs, packages: dict[str, str]) -> None:
    first = {name: packages[name] for name in FIRST}
    rest = {name: entry for name, entry in packages.items() if name not in {*FIRST, *BESIDE}}
    with _half_done():
        install = _installer(jobs)
        text = f"{len(first)} packages, the compiler among them"
        jobs.must(jobs.start(text, "first", [*install, *_chosen("first", first)]), _OFFLINE)
        own = jobs.start("ftc-sitl and its MAVLink messages", "own", [*install, *_own()])
        jobs.must(own, _OFFLINE)
        compiling = jobs.start("compiling", "compile", [_python(), "-c", COMPILE])
        text = f"{len(rest)} packages more"
        jobs.must(jobs.start(text, "rest", [*install, *_chosen("rest", rest)]), _OFFLINE)
        _leave_out()
    jobs.must(compiling)


def _leave_out() -> None:
    for place in VENV.glob("lib/python*/site-packages"):
        for found in [found for pattern in UNUSED for found in place.glob(pattern)]:
            if found.is_dir():
                shutil.rmtree(found, ignore_errors=True)
            else:
                found.unlink(missing_ok=True)


@contextlib.contextmanager
def _alone(jobs: Jobs) -> Iterator[None]:
    """Wait until nothing else fills .venv, not even what outlived an earlier run."""
    with (BUILD / "setup.lock").open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            jobs.say("waiting for another make, which fills .venv")
            fcntl.flock(file, fcntl.LOCK_EX)
        os.set_inheritable(file.fileno(), True)
        yield


@contextlib.contextmanager
def _half_done() -> Iterator[None]:
    """Mark .venv while packages are installed: the mark stays, whatever ends this program."""
    VENV.mkdir(exist_ok=True)
    MARK.touch()
    yield
    MARK.unlink()


def _forget_half_done(jobs: Jobs) -> None:
    runs = [_python(), "-c", "import sys; sys.exit(sys.version_info < (3, 11))"]
    if not VENV.exists():
        return
    with contextlib.suppress(OSError):  # its Python is gone
        if not MARK.exists() and subprocess.run(runs, check=False).returncode == 0:
            return
    jobs.say("making .venv again: the last installation into it did not end, or its Python is gone")
    shutil.rmtree(VENV)


def _check_space(needed_mb: float) -> None:
    free_mb = shutil.disk_usage(ROOT).free / 2**20
    if free_mb < needed_mb:
        raise FailedError(f"{ROOT} has {free_mb:.0f} MB left, packages take {needed_mb}: free some")


def _python() -> str:
    return str(VENV / "bin" / "python")


def _installer(jobs: Jobs) -> list[str]:
    """Make .venv if it is empty; return the command that installs packages there."""
    pip = [sys.executable, "-m", "pip"]
    if os.environ.get("INSTALLER") == "pip" or importlib.util.find_spec("pip") is None:
        pip = _pip_of_its_own(jobs)
    if os.environ.get("INSTALLER") != "pip" and (uv := _uv(jobs, pip)) is not None:
        if not Path(_python()).exists():
            new = [uv, "venv", "--allow-existing", "--python", sys.executable, str(VENV)]
            jobs.must(jobs.start("an empty .venv", "venv", new))
        options = ["--no-index"] if os.environ.get("PIP_NO_INDEX") else []
        return [uv, "pip", "install", "--python", _python(), *options]
    return [*_pip_of_its_own(jobs), "install", "--no-compile", "--disable-pip-version-check"]


def _uv(jobs: Jobs, pip: list[str]) -> str | None:
    """Return uv, which pip downloads if it is not in build/; None if pip cannot."""
    entry = {"uv": locked(LOCKS["all"])["uv"]}
    folder = BUILD / entry["uv"].split()[0]
    if not folder.exists():
        part = BUILD / "uv-part"
        shutil.rmtree(part, ignore_errors=True)
        options = ["--quiet", "--no-compile", "--only-binary=:all:", "--target", str(part)]
        get = [*pip, "install", *options, *_chosen("uv", entry)]
        job = jobs.start("uv, which installs", "uv", get)
        if not jobs.wait(job):
            jobs.say(f"without uv, pip installs, which takes longer: {job.last_line()}")
            return None
        part.rename(folder)
    return str(folder / "bin" / "uv")


def _pip_of_its_own(jobs: Jobs) -> list[str]:
    pip = [_python(), "-m", "pip"]
    if not (VENV / "bin" / "pip").exists():
        job = jobs.start(".venv with pip", "venv", [sys.executable, "-m", "venv", str(VENV)])
        if not jobs.wait(job):
            text = f"{sys.executable} makes no virtual environment: {job.last_line()}"
            raise FailedError(
                f"{text}; install its venv module, such as `apt install python3-venv`"
            )
    return pip


def _chosen(name: str, packages: dict[str, str]) -> list[str]:
    """Return the options that install locked packages and nothing else."""
    path = BUILD / f"{name}.txt"
    path.write_text("".join(packages.values()), encoding="utf-8")
    return ["--require-hashes", "--no-deps", "--requirement", str(path)]


def _own() -> list[str]:
    """Return the options that install ftc-sitl itself; what builds it is locked, too."""
    again = ["--force-reinstall", "--no-deps"]  # whether or not the definition of messages changed
    return [*again, "--build-constraint", str(LOCKS["all"]), "--editable", str(ROOT)]


def _environment() -> dict[str, str]:
    found = dict(os.environ)
    for of_pip, of_uv in _AS_UV.items():
        if of_pip in found:
            found.setdefault(of_uv, found[of_pip])
    return found | {"UV_PYTHON_DOWNLOADS": "never", "UV_NO_PROGRESS": "1", "PIP_RETRIES": "2"}


def _interrupt(*_: object) -> None:
    raise KeyboardInterrupt


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, _interrupt)
    try:
        main(sys.argv[1])
    except FailedError as problem:
        sys.exit(f"make: {problem}")
    except OSError as problem:
        sys.exit(f"make: {problem}; run make again, which goes on from here")
    except KeyboardInterrupt:
        sys.exit("\ninterrupted: run make again, which goes on from here")
