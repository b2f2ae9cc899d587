"""A newcomer's first minute, for this commit and another, in pairs.

``python -m benchmarks.first_contact [OTHER] [--rounds N]``: OTHER is a commit, the one before by
default. Each is cloned into a temporary folder, with caches of its own: of packages, which are
downloaded again, and of compiled code. Rows have wall-clock time, processor time of all processes,
and the size of the environment.
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
FLIGHT = ("fly", "paper/scenario1", "--free-ports", "--quiet", "--out")
NOBODY = ("--connect", "udpin:127.0.0.1:0", "--timeout", "0.1")


class Cost(NamedTuple):
    """What something took."""

    wall_s: float
    processor_s: float


class Clone(NamedTuple):
    """A commit in a folder of its own, with its own caches."""

    name: str
    folder: Path

    @property
    def environment(self) -> Path:
        """Its environment, made by `make fly`."""
        return self.folder / "clone" / ".venv"

    def run(self, *command: str | Path, fail: bool = True) -> Cost:
        """Run a program in the clone to its end; what it prints goes to a file."""
        caches = {"XDG_CACHE_HOME": str(self.folder / "cache")}
        caches |= {
            "UV_CACHE_DIR": str(self.folder / "uv"),
            "PIP_CACHE_DIR": str(self.folder / "pip"),
        }
        leave = {"PYTHONPATH", "VIRTUAL_ENV", "NUMBA_CACHE_DIR", "PYTHONDONTWRITEBYTECODE"}
        own = {key: text for key, text in os.environ.items() if key not in leave} | caches
        before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
        with (self.folder / "printed.log").open("a") as log:
            subprocess.run(
                command, cwd=self.folder / "clone", env=own, stdout=log, stderr=log, check=fail
            )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        return Cost(time.monotonic() - begin, used)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("other", nargs="?", default="HEAD~1", help="commit to compare with")
    parser.add_argument("--rounds", type=int, default=5, help="of what is warm")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        clones = [
            cloned(Path(folder) / str(number), commit)
            for number, commit in enumerate(("HEAD", arguments.other))
        ]
        print(f"{'':44s} {'':>12s} {clones[0].name:>12s} {clones[1].name:>12s}")
        both("make fly, all caches cold", clones, fresh)
        print_row("its environment", "MB", [megabytes(clone.environment) for clone in clones], 0)
        both("wheel into an empty environment", clones, install_wheel)
        both("its first flight, compiled code cold", clones, first_flight)
        rounds = arguments.rounds
        both(
            "gcs fly, warm", clones, lambda clone: gcs(clone, *FLIGHT, flight_folder(clone)), rounds
        )
        both("gcs --version", clones, lambda clone: gcs(clone, "--version"), rounds)
        both("gcs arm --help", clones, lambda clone: gcs(clone, "arm", "--help"), rounds)
        both("gcs arm, until it listens", clones, lambda clone: gcs(clone, "arm", *NOBODY), rounds)


def cloned(folder: Path, commit: str) -> Clone:
    """Clone a commit of this repository."""
    place = folder / "clone"
    git = ("git", "-C", str(ROOT), "rev-parse", "--short", commit)
    name = subprocess.run(git, check=True, capture_output=True, text=True).stdout.strip()
    subprocess.run(["git", "clone", "--quiet", "--no-checkout", ROOT, place], check=True)
    subprocess.run(["git", "-C", place, "checkout", "--quiet", "--detach", name], check=True)
    return Clone(name, folder)


def fresh(clone: Clone) -> Cost:
    """Run `make fly` where nothing is there yet."""
    return clone.run("make", "fly", f"PYTHON={sys.executable}")


def install_wheel(clone: Clone) -> Cost:
    """Install the clone's wheel with pip in an empty environment; building it does not count."""
    python = clone.folder / "installed" / "bin" / "python"
    clone.run(sys.executable, "-m", "venv", clone.folder / "installed")
    clone.run(python, "-m", "pip", "wheel", "--no-deps", "--wheel-dir", clone.folder / "dist", ".")
    shutil.rmtree(clone.folder / "pip", ignore_errors=True)
    (wheel,) = (clone.folder / "dist").glob("*.whl")
    return clone.run(python, "-m", "pip", "install", wheel)


def first_flight(clone: Clone) -> Cost:
    """Fly with what the wheel brought, as if no flight had been before."""
    shutil.rmtree(clone.folder / "cache", ignore_errors=True)
    program = clone.folder / "installed" / "bin" / "gcs"
    return clone.run(program, *FLIGHT, flight_folder(clone))


def gcs(clone: Clone, *arguments: str | Path) -> Cost:
    """Run a command in the environment of the clone; one that finds nobody may fail."""
    return clone.run(clone.environment / "bin" / "gcs", *arguments, fail=arguments[0] == "fly")


def flight_folder(clone: Clone) -> Path:
    """Return a folder for a flight, which is not there."""
    shutil.rmtree(clone.folder / "flight", ignore_errors=True)
    return clone.folder / "flight"


def both(
    what: str, clones: list[Clone], measured: Callable[[Clone], Cost], rounds: int = 1
) -> None:
    """Print the medians of both commits, measured in turn."""
    costs = [[measured(clone) for clone in clones] for _ in range(rounds)]
    for unit, part in (("wall s", 0), ("processor s", 1)):
        medians = [
            statistics.median(cost[part] for cost in of_one) for of_one in zip(*costs, strict=True)
        ]
        print_row(what, unit, medians, 2)


def print_row(what: str, unit: str, values: list[float], digits: int) -> None:
    texts = " ".join(f"{value:12.{digits}f}" for value in values)
    print(f"{what:44s} {unit:>12s} {texts}", flush=True)


def megabytes(folder: Path) -> float:
    """Return the size of a folder as ``du -sm`` has it."""
    text = subprocess.run(["du", "-sm", folder], check=True, capture_output=True, text=True).stdout
    return float(text.split()[0])


if __name__ == "__main__":
    main()
