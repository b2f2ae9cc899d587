"""Tests that leave a process behind are found out."""

import pytest

LEAVES_ONE = """
import os, pathlib, subprocess, sys

def test_leaves_one():
    arguments = "-c", "import time; time.sleep(600)"
    pid = os.spawnl(os.P_NOWAIT, sys.executable, sys.executable, *arguments)
    while b"sleep" not in pathlib.Path(f"/proc/{pid}/cmdline").read_bytes():
        pass  # until it runs, it has the environment that this process began with

def test_leaves_none():
    subprocess.run([sys.executable, "-c", ""], check=True)
"""


def test_a_process_that_is_left_is_an_error_and_killed(pytester: pytest.Pytester) -> None:
    pytester.makeconftest('pytest_plugins = ["leftovers"]')
    pytester.makepyfile(LEAVES_ONE)
    result = pytester.runpytest("-p", "no:cacheprovider")
    assert result.parseoutcomes() == {"passed": 2, "errors": 1}
    result.stdout.fnmatch_lines(["*tests left processes running: *python* -c import time*"])
