"""What is measured of a newcomer's first minute runs in clones, each with caches of its own."""

import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks import first_contact

CACHES = (
    "import os; "
    "print(*(os.environ[k] for k in ('XDG_CACHE_HOME', 'UV_CACHE_DIR', 'PIP_CACHE_DIR')))"
)


def test_a_commit_runs_in_a_clone_with_its_own_caches(tmp_path: Path) -> None:
    clone = first_contact.cloned(tmp_path / "0", "HEAD")
    assert (clone.folder / "clone" / "Makefile").is_file()
    cost = clone.run(sys.executable, "-c", CACHES)
    assert cost.processor_s > 0.0
    printed = (clone.folder / "printed.log").read_text().split()
    assert printed == [str(tmp_path / "0" / name) for name in ("cache", "uv", "pip")]
    with pytest.raises(SystemExit, match=r"-c raise OSError\('full'\) of .* ended with 1:"):
        clone.run(sys.executable, "-c", "raise OSError('full')")
    clone.run("false", fail=False)


def test_rows_have_both_commits_in_turn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    clones = [first_contact.Clone(name, tmp_path) for name in ("new", "old")]
    turns = []

    def measured(clone: first_contact.Clone) -> first_contact.Cost:
        turns.append(clone.name)
        return first_contact.Cost(len(turns), 10.0 * len(turns), 0.5)

    first_contact.both("gcs fly", clones, measured, rounds=3, targets=("≤ 3", "", "≤ 2.5"))
    assert turns == ["new", "old"] * 3
    rows = [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]
    assert rows == [
        "gcs fly wall s 3.00 4.00 ≤ 3",
        "gcs fly processor s 30.00 40.00",
        "gcs fly its station 0.50 0.50 ≤ 2.5",
    ]


def test_the_station_counts_apart(tmp_path: Path) -> None:
    used, station = tmp_path / "used", first_contact.STATION
    command = (sys.executable, "-c", station, used, "--version")
    said = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    assert said.startswith("ftc-sitl ")
    assert float(used.read_text()) > 0.0
