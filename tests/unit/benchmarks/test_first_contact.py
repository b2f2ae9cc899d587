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
    with pytest.raises(subprocess.CalledProcessError):
        clone.run("false")
    clone.run("false", fail=False)


def test_rows_have_both_commits_in_turn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    clones = [first_contact.Clone(name, tmp_path) for name in ("new", "old")]
    turns = []

    def measured(clone: first_contact.Clone) -> first_contact.Cost:
        turns.append(clone.name)
        return first_contact.Cost(len(turns), 10.0 * len(turns))

    first_contact.both("a flight", clones, measured, rounds=3)
    assert turns == ["new", "old"] * 3
    rows = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert rows[0] == ["a", "flight", "wall", "s", "3.00", "4.00"]
    assert rows[1] == ["a", "flight", "processor", "s", "30.00", "40.00"]
