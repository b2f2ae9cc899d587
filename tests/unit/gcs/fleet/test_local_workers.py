"""Processes that share work can be ended from their first instant on, and so can others."""

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
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=600)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


ANOTHER = """
import multiprocessing, operator, time
from gcs.fleet.local_workers import LocalWorkers

workers = LocalWorkers(1, operator.concat)
workers.submit("work of ")
print(workers.wait()[1])
workers.close()
another = multiprocessing.get_context("forkserver").Process(target=time.sleep, args=(60,))
another.start()
another.terminate()
another.join(30)
print(another.exitcode)
another.kill()
"""


def test_processes_of_the_same_program_that_are_none_of_ours_can_be_ended_afterwards() -> None:
    command = [sys.executable, "-c", ANOTHER]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=600)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines() == ["work of worker 1", "-15"]
