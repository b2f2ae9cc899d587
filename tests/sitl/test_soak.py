"""The short form of ``make soak``: the same seed tells the same story, and all counts agree."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from flying import TIMEOUT_S, environment

pytestmark = pytest.mark.sitl
ROOT = Path(__file__).parents[2]
OPTIONS = ["--seed", "31", "--chapters", "1", "--seconds", "1.5", "--uavs", "4"]
"""A chapter with a fault, a restart and losses on both links."""


def soaked() -> list[tuple[str, str, str]]:
    done = subprocess.run(
        [sys.executable, "-m", "soak", *OPTIONS],
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
        env=environment(),
        cwd=ROOT,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return re.findall(r"story ([0-9a-f]{12,})|(\d+) restarts|(counts agree)", done.stdout)


def test_the_same_seed_tells_the_same_story() -> None:
    first, second = soaked(), soaked()
    assert first == second
    assert ("", "", "counts agree") in first
    assert int(next(restarts for _, restarts, _ in first if restarts)) > 0
