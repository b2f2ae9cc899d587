"""A session of tests ends without a process that it started."""

import contextlib
import os
import signal
import time
import uuid
from collections.abc import Iterator
from pathlib import Path

import pytest

_VARIABLE = "FTC_SITL_TESTS"
_GRACE_S = 5.0  # some are about to end
_PYTHONS_OWN = ("multiprocessing.resource_tracker", "multiprocessing.forkserver")
"""End with their parent, or with the last process forked."""


@pytest.fixture(scope="session", autouse=True)
def no_process_is_left() -> Iterator[None]:
    """Mark the environment of all children; fail and kill them if one is still running (Linux)."""
    with pytest.MonkeyPatch.context() as patch:
        mark = uuid.uuid4().hex
        patch.setenv(_VARIABLE, mark)
        yield
        end = time.monotonic() + _GRACE_S
        while (left := marked(_VARIABLE, mark)) and time.monotonic() < end:
            time.sleep(0.02)
    for pid in left:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    assert not left, f"tests left processes running: {'; '.join(left.values())}"


def marked(variable: str, mark: str) -> dict[int, str]:
    """Return the command lines of all processes with a mark in their environment, by id."""
    found = {}
    for environ in Path("/proc").glob("[0-9]*/environ"):
        with contextlib.suppress(OSError):
            if f"{variable}={mark}".encode() in environ.read_bytes():
                command = (environ.parent / "cmdline").read_bytes().replace(b"\0", b" ").decode()
                if command and not any(own in command for own in _PYTHONS_OWN):
                    found[int(environ.parent.name)] = command
    return found
