"""Try a wheel as its users have it: in an empty environment, from any folder.

``python scripts/check_wheel.py WHEEL [--plain]``: it must fly, record, export, and fly in a test of
the pytest plugin. With ``--plain`` as plain Python, so that nothing waits for the compiler. uv
installs if it is in build/, else pip; the versions are the locked ones.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from setup import BUILD, LOCKS, locked

TEST = """
import pytest


@pytest.mark.ftc_scenario("paper/scenario1", duration_s=0.1)
def test_a_flight(ftc_flight):
    ftc_flight.assert_completed()
"""


def main(wheel: Path, plain: bool) -> None:
    """Install a wheel with its dependencies in an empty environment, and use it there.

    Raises:
        subprocess.CalledProcessError: Something failed, and has printed why.
        FileNotFoundError: A flight left no recording or no figure.
    """
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        _install(place, wheel)
        environment = {key: text for key, text in os.environ.items() if key != "PYTHONPATH"}
        environment |= {"XDG_CACHE_HOME": str(place / "cache")}
        environment |= {"NUMBA_DISABLE_JIT": "1"} if plain else {}

        def run(*command: str) -> None:
            print(f"{wheel.name}: {' '.join(command)}", flush=True)
            program = place / "environment" / "bin" / command[0]
            subprocess.run([program, *command[1:]], check=True, cwd=place, env=environment)

        fly = ("fly", "paper/scenario1", "--set", "duration_s=0.1", "--quiet")
        run("gcs", "--version")
        run("gcs", *fly, "--free-ports", "--out", "flight")
        run("gcs", "export", "flight", "--to", "csv")
        for name in ("flight.png", "trajectory.arrows", "trajectory.csv"):
            (place / "flight" / name).stat()
        (place / "test_it.py").write_text(TEST, encoding="utf-8")
        run("pytest", "-q", "test_it.py")


def _install(place: Path, wheel: Path) -> None:
    entries = "".join(locked(LOCKS["all"]).values())
    (place / "locked.txt").write_text(
        "\n".join(re.findall(r"^\w.*(?= \\$)", entries, re.MULTILINE))
    )
    what = ["--constraint", str(place / "locked.txt"), str(wheel), "pytest"]
    python = place / "environment" / "bin" / "python"
    if found := sorted(BUILD.glob("uv==*/bin/uv")):
        make: list[str | Path] = [found[-1], "venv", "--quiet", "--python", sys.executable]
        install: list[str | Path] = [found[-1], "pip", "install", "--quiet", "--python", python]
    else:
        make = [sys.executable, "-m", "venv"]
        install = [python, "-m", "pip", "install", "--quiet", "--no-compile"]
    subprocess.run([*make, place / "environment"], check=True)
    subprocess.run([*install, *what], check=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve(), "--plain" in sys.argv)
