"""Processes that share work can be ended from their first instant on."""

import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="processes are bound to a core")
ENDED_AT_ONCE = """
import os, signal
from gcs.console.stopping import stop_as_ctrl_c
from gcs.fleet.local_workers import LocalWorkers

stop_as_ctrl_c()
os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})  # what starts has to wait
for _ in range(100):
    workers = LocalWorkers(1, lambda task, name: None, forked=True)
    try:
        workers.submit(None)
        workers.close()
    except KeyboardInterrupt:
        os.write(2, b"it went on as the one that started it")
        os._exit(1)
"""


def test_a_forked_one_that_ends_before_it_has_begun_says_and_does_nothing() -> None:
    command = [sys.executable, "-c", ENDED_AT_ONCE]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
