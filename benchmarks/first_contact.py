"""A newcomer's first minute, for this commit and another, in pairs.

``python -m benchmarks.first_contact [OTHER] [--rounds N] [--tests]``: OTHER is a commit, the one
before by default. Each is cloned into a temporary folder, with caches of its own: of packages,
which are downloaded again, and of compiled code. A row has the command, what was measured of it
for both commits, and what is to be reached on two quiet cores.
"""

import argparse
import os
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parent.parent
FLY = ("fly", "paper/scenario1")
NOBODY = ("--connect", "udpin:127.0.0.1:0", "--timeout", "0.1")
LIBRARIES = "import rich, typer, yaml"
LAST_LINES = 15  # of what a command that failed has printed
STATION = """
import atexit, pathlib, resource, sys
from gcs.__main__ import main
def note():
    used = resource.getrusage(resource.RUSAGE_SELF)
    pathlib.Path(sys.argv[0]).write_text(str(used.ru_utime + used.ru_stime))
sys.argv = sys.argv[1:]
atexit.register(note)
main()
"""
"""Runs `gcs`; its first argument is a file, which gets the processor time of this process."""


class Cost(NamedTuple):
    """What something took; `station_s` is the processor time of the ground station's process."""

    wall_s: float
    processor_s: float
    station_s: float | None = None


class Clone(NamedTuple):
    """A commit in a folder of its own, with its own caches."""

    name: str
    folder: Path

    @property
    def environment(self) -> Path:
        """Its environment, made by `make fly`."""
        return self.folder / "clone" / ".venv"

    def run(self, *command: str | Path, fail: bool = True, **variables: str) -> Cost:
        """Run a program in the clone to its end; what it prints goes to a file.

        Raises:
            SystemExit: It failed, unless it may (`fail`); the message has its last lines.
        """
        caches = {"XDG_CACHE_HOME": str(self.folder / "cache")}
        caches |= {
            "UV_CACHE_DIR": str(self.folder / "uv"),
            "PIP_CACHE_DIR": str(self.folder / "pip"),
        }
        leave = {"PYTHONPATH", "VIRTUAL_ENV", "PYTHONDONTWRITEBYTECODE"}
        leave |= {"NUMBA_CACHE_DIR", "NUMBA_DISABLE_JIT"}
        own = {key: text for key, text in os.environ.items() if key not in leave}
        before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
        with (self.folder / "printed.log").open("a") as log:
            code = subprocess.run(
                command,
                cwd=self.folder / "clone",
                env=own | caches | variables,
                stdout=log,
                stderr=log,
                check=False,
            ).returncode
        wall_s, after = time.monotonic() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
        if code != 0 and fail:
            lines = (self.folder / "printed.log").read_text().splitlines()[-LAST_LINES:]
            said = "\n".join(lines)
            sys.exit(f"{' '.join(map(str, command))} of {self.name} ended with {code}:\n{said}")
        used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        return Cost(wall_s, used)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("other", nargs="?", default="HEAD~1", help="commit to compare with")
    parser.add_argument("--rounds", type=int, default=5, help="of what is warm")
    parser.add_argument("--tests", action="store_true", help="`make test` of fresh clones, too")
    arguments = parser.parse_args()
    commits, rounds = ("HEAD", arguments.other), arguments.rounds
    with tempfile.TemporaryDirectory() as folder:
        clones = clones_of(Path(folder) / "fly", commits)
        print_row("command", "", "", [clone.name for clone in clones])
        both("make fly", clones, lambda clone: make(clone, "fly"), targets=("≤ 60",))
        print_size("du -sm .venv", clones, "≤ 550")
        both("pip install WHEEL", clones, install_wheel)
        both("gcs fly, of the wheel, the first", clones, first_flight, targets=("≤ 15",))
        both("gcs fly, warm", clones, warm_flight, rounds, ("≤ 3", "", "≤ 2.5"))
        both(f"python -c '{LIBRARIES}'", clones, libraries, rounds)
        times = "≤ 1.3 × the libraries"
        both("gcs --version", clones, talking("--version"), rounds, ("", times))
        both("gcs arm --help", clones, talking("arm", "--help"), rounds, ("", times))
        both("gcs arm, nobody there", clones, talking("arm", *NOBODY), rounds, ("", "≤ 0.3"))
        both("make packages", clones, lambda clone: make(clone, "packages"))
        print_size("du -sm .venv", clones, "≤ 1300")
        if arguments.tests:
            fresh = clones_of(Path(folder) / "test", commits)
            both("make test", fresh, lambda clone: make(clone, "test"), targets=("≤ 600",))


def clones_of(folder: Path, commits: tuple[str, ...]) -> list[Clone]:
    """Clone commits, each into a folder of its own."""
    return [cloned(folder / str(number), commit) for number, commit in enumerate(commits)]


def cloned(folder: Path, commit: str) -> Clone:
    """Clone a commit of this repository."""
    place = folder / "clone"
    git = ("git", "-C", str(ROOT), "rev-parse", "--short", commit)
    name = subprocess.run(git, check=True, capture_output=True, text=True).stdout.strip()
    subprocess.run(["git", "clone", "--quiet", "--no-checkout", ROOT, place], check=True)
    subprocess.run(["git", "-C", place, "checkout", "--quiet", "--detach", name], check=True)
    return Clone(name, folder)


def make(clone: Clone, target: str) -> Cost:
    """Run make in the clone."""
    return clone.run("make", target, f"PYTHON={sys.executable}")


def install_wheel(clone: Clone) -> Cost:
    """Install the clone's wheel with pip in an empty environment; building it does not count."""
    python = clone.folder / "installed" / "bin" / "python"
    clone.run(sys.executable, "-m", "venv", clone.folder / "installed")
    build = ("-m", "pip", "wheel", "--no-deps", "--wheel-dir", clone.folder / "dist", ".")
    clone.run(python, *build, FTC_SITL_MACHINE_CODE="1")
    shutil.rmtree(clone.folder / "pip", ignore_errors=True)
    (wheel,) = (clone.folder / "dist").glob("*.whl")
    return clone.run(python, "-m", "pip", "install", wheel)


def first_flight(clone: Clone) -> Cost:
    """Fly with what the wheel brought, as if no flight had been before."""
    shutil.rmtree(clone.folder / "cache", ignore_errors=True)
    return flight(clone, clone.folder / "installed")


def warm_flight(clone: Clone) -> Cost:
    """Fly once more, from the clone."""
    return flight(clone, clone.environment)


def flight(clone: Clone, environment: Path) -> Cost:
    """Fly scenario 1, figures and all, with an environment."""
    shutil.rmtree(clone.folder / "flight", ignore_errors=True)
    used = clone.folder / "station"
    options = ("--free-ports", "--quiet", "--out", clone.folder / "flight")
    cost = clone.run(environment / "bin" / "python", "-Pc", STATION, used, *FLY, *options)
    return cost._replace(station_s=float(used.read_text()))


def libraries(clone: Clone) -> Cost:
    """Import what a command line stands on."""
    return clone.run(clone.environment / "bin" / "python", "-c", LIBRARIES)


def talking(*arguments: str) -> Callable[[Clone], Cost]:
    """Return what runs a command in the environment of a clone; one that finds nobody may fail."""
    return lambda clone: clone.run(clone.environment / "bin" / "gcs", *arguments, fail=False)


def both(
    command: str,
    clones: list[Clone],
    measured: Callable[[Clone], Cost],
    rounds: int = 1,
    targets: tuple[str, ...] = (),
) -> None:
    """Print the medians of both commits, measured in turn."""
    costs = [[measured(clone) for clone in clones] for _ in range(rounds)]
    parts = ("wall s", "processor s", "its station")
    for part, (what, target) in enumerate(zip(parts, (*targets, "", "", "")[:3], strict=True)):
        values = [[cost[part] for cost in of_one] for of_one in zip(*costs, strict=True)]
        if values[0][0] is not None:
            medians = [f"{statistics.median(of_one):.2f}" for of_one in values]
            print_row(command, what, target, medians)


def print_size(command: str, clones: list[Clone], target: str) -> None:
    """Print the sizes of both environments, as ``du -sm`` has them [MiB]."""
    sizes = []
    for clone in clones:
        du = ("du", "-sm", clone.environment)
        sizes.append(subprocess.run(du, check=True, capture_output=True, text=True).stdout)
    print_row(command, "MiB", target, [size.split()[0] for size in sizes])


def print_row(command: str, what: str, target: str, values: list[str]) -> None:
    texts = " ".join(f"{value:>9s}" for value in values)
    print(f"{command:37s} {what:11s} {texts}  {target}".rstrip(), flush=True)


if __name__ == "__main__":
    main()
