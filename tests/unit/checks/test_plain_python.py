"""`make test`, `make check`, `make nightly` run each test once, some as plain Python.

A file is in tests/plain_python.txt whose tests call parts of the equations, each of which would be
compiled for them alone. What flies stays compiled, as do the courses, which hold values of both.
"""

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
PLAIN = "tests/plain_python.txt"
LISTED = (ROOT / PLAIN).read_text().splitlines()
LATER = (ROOT / "tests" / "nightly.txt").read_text().splitlines()


def files_under(*places: str) -> set[str]:
    """All files of tests at some places, by their paths."""
    tops = [ROOT / place for place in places]
    found = [path for top in tops for path in ([top] if top.is_file() else top.rglob("test_*.py"))]
    return {str(path.relative_to(ROOT)) for path in found}


def pytest_lines(goal: str) -> list[str]:
    """What make would run of pytest."""
    done = subprocess.run(
        ["make", "--dry-run", goal], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return [line for line in done.stdout.splitlines() if "/pytest " in line]


@pytest.mark.parametrize(
    ("goal", "places"),
    [("test", ["tests"]), ("check", ["tests/unit", "tests/test_architecture.py"])],
)
def test_each_file_is_run_once(goal: str, places: list[str]) -> None:
    plain, compiled = pytest_lines(goal)
    assert plain.startswith("NUMBA_DISABLE_JIT=1 ")
    assert plain.endswith(f" @{PLAIN}")
    assert not compiled.startswith("NUMBA_DISABLE_JIT")
    assert re.findall(r"--ignore=(\S+)", compiled) == LISTED
    assert compiled.split()[-len(places) :] == places
    options = [re.findall(r"-m \S+ \S+|-k", line) for line in (plain, compiled)]
    assert options[0] == options[1]
    assert set(LISTED) < files_under(*places)


def test_what_is_listed_is_a_file_of_its_own_that_does_not_fly() -> None:
    assert sorted(set(LISTED)) == LISTED
    flying = [name for name in LISTED if "fly_in_process" in (ROOT / name).read_text()]
    assert not flying, f"compiled in less time than flown as plain Python: {flying}"
    assert not [name for name in LISTED if name.endswith("test_courses.py")]


def test_what_make_test_leaves_out_make_nightly_and_ci_run() -> None:
    """As plain Python what is so by day."""
    for line in pytest_lines("test"):
        assert re.findall(r"--deselect=(\S+)", line) == LATER
    plain, compiled = pytest_lines("nightly")
    assert plain.startswith("NUMBA_DISABLE_JIT=1 ")
    assert not compiled.startswith("NUMBA_DISABLE_JIT")
    tests = [
        [one for one in line.split() if one.startswith("tests/")] for line in (plain, compiled)
    ]
    assert sorted(tests[0] + tests[1]) == LATER
    assert [one for one in LATER if one.partition("::")[0] in LISTED] == sorted(tests[0])
    assert {"make test", "make nightly"} < set((ROOT / ".ci" / "run").read_text().splitlines())


def test_what_is_left_for_the_night_is_there() -> None:
    assert sorted(set(LATER)) == LATER
    for one in LATER:
        path, _, name = one.partition("::")
        assert f"def {name}(" in (ROOT / path).read_text() if name else (ROOT / path).is_file(), one
