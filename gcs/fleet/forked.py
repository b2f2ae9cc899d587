"""Plant and autopilots forked from a warm process, `fork_server`, and started as by `Popen`.

Light, since the command line imports it before all else: a server that is started then is warm
when the scenario has been read.
"""

import atexit
import contextlib
import json
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

FORKS = sys.platform == "linux"
"""Whether plant and autopilots can be forked: elsewhere, libraries do not allow it."""

_MODULES = {"sitl-plant": "sitl_plant.loop.process", "ftc-autopilot": "ftc_autopilot.process"}
_ROOM = " " * 512
"""An argument for the server, which makes room for the command lines of those it forks."""
_ahead: list[subprocess.Popen[bytes]] = []
"""The server that was started ahead, until a `ForkServer` takes it."""


def without_threads() -> dict[str, str]:
    """Return the environment of a process in which numpy starts no threads."""
    return {**os.environ, "OPENBLAS_NUM_THREADS": "1"}


def start_alone(program: str, arguments: Sequence[str], log: Path) -> subprocess.Popen[bytes]:
    """Start a program as `ForkServer.start` does, as a process of its own from the start."""
    ends = ["--exit-with-parent", str(os.getpid())]
    with log.open("ab") as output:
        return _start(_MODULES[program], *arguments, *ends, stdout=output, stderr=output)


def processor_time_s(pid: int | None) -> float | None:
    """Return the processor time that a process has used [s]; None if that is unknown."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:  # it has ended, or this is no Linux
        return None
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")  # utime, stime of proc(5)


def start_server_ahead() -> None:
    """Start the server that the next `ForkServer` will use; it ends with this process.

    If that fails, the `ForkServer` will report why.
    """
    if FORKS:
        atexit.register(_end_unused)
        with contextlib.suppress(OSError):
            _ahead.append(_start_server(subprocess.DEVNULL))


def _end_unused() -> None:
    while _ahead:
        server = _ahead.pop()
        server.kill()
        server.communicate()


def leave_server() -> None:
    """Let go of the server that was started ahead: called in a fork of the process that has it.

    It ends when no process has its pipes any more.
    """
    while _ahead:
        server = _ahead.pop()
        assert server.stdin is not None
        assert server.stdout is not None
        server.stdin.close()
        server.stdout.close()


def _started_ahead() -> subprocess.Popen[bytes] | None:
    """Return the server that was started ahead, if it runs; if not, another one reports why."""
    server = _ahead.pop() if _ahead else None
    return server if server is not None and server.poll() is None else None


class ForkServer:
    """The process that plant and autopilots are forked from; started with the first of them."""

    def __init__(self) -> None:
        self._popen: subprocess.Popen[bytes] | None = None
        self._forked: list[Forked] = []
        self._unread = b""

    @property
    def pid(self) -> int | None:
        """Its process id; None before its start."""
        return None if self._popen is None else self._popen.pid

    def start(
        self, program: str, arguments: Sequence[str], log: Path, *, more: bool = False
    ) -> "Forked":
        """Start ``sitl-plant`` or ``ftc-autopilot``; it writes to the file `log`.

        Args:
            program: Its name.
            arguments: Its arguments.
            log: The file.
            more: Whether others follow at once: those that are started together share memory.
        """
        if self._popen is not None and self._popen.poll() is not None:
            self.close()
            self._popen, self._forked, self._unread = None, [], b""
        if self._popen is None:
            with log.open("ab") as errors:
                self._popen = _started_ahead() or _start_server(errors)
        request = {"program": program, "arguments": list(arguments), "log": str(log)}
        assert self._popen.stdin is not None
        with contextlib.suppress(BrokenPipeError):  # it has ended; so have those it forked
            self._popen.stdin.write(json.dumps(request).encode() + b"\n")
            if not more:
                self._popen.stdin.flush()
        forked = Forked(self, program)
        self._forked.append(forked)
        return forked

    def read(self, timeout_s: float) -> bool:
        """Take in what the server has reported; return whether there was anything.

        Args:
            timeout_s: How long to wait for a report [s].
        """
        if self._popen is None or self._popen.stdout is None or self._popen.stdout.closed:
            return False
        assert self._popen.stdin is not None
        with contextlib.suppress(BrokenPipeError):
            self._popen.stdin.flush()  # what waits for others that may never follow
        if not select.select([self._popen.stdout], [], [], timeout_s)[0]:
            return False
        received = os.read(self._popen.stdout.fileno(), 1 << 16)
        *lines, self._unread = (self._unread + received).split(b"\n")
        for line in lines:
            number, pid, status = json.loads(line)
            self._forked[number].pid, self._forked[number].returncode = pid, status
        if not received:
            self.close()
        return True

    def close(self) -> None:
        """End the server, which stops all that it has forked."""
        if self._popen is None or self._popen.stdin is None or self._popen.stdout is None:
            return
        self._popen.stdin.close()
        self._popen.stdout.close()
        status = self._popen.wait()
        for forked in self._forked:
            if forked.returncode is None:
                forked.returncode = status


class Forked:
    """A forked process, with the methods of `Popen` that are used here.

    Attributes:
        pid: Its process id; None until the server has reported it.
        returncode: As of `Popen`.
    """

    def __init__(self, server: ForkServer, program: str) -> None:
        self._server = server
        self._program = program
        self.pid: int | None = None
        self.returncode: int | None = None

    @property
    def working_pid(self) -> int | None:
        """Its process id, or the server's, which compiles, while it is not forked yet."""
        return self._server.pid if self.pid is None else self.pid

    def poll(self) -> int | None:
        """Return the exit status; None while it runs."""
        while self.returncode is None and self._server.read(0.0):
            pass
        return self.returncode

    def wait(self, timeout: float) -> int:
        """Wait for the end.

        Raises:
            subprocess.TimeoutExpired: It still runs.
        """
        end = time.monotonic() + timeout
        while self.poll() is None:
            left = end - time.monotonic()
            if left <= 0.0:
                raise subprocess.TimeoutExpired(self._program, timeout)
            self._server.read(left)
        assert self.returncode is not None
        return self.returncode

    def terminate(self) -> None:
        """Ask it to end."""
        self._send(signal.SIGTERM)

    def kill(self) -> None:
        """End it."""
        self._send(signal.SIGKILL)

    def _send(self, number: int) -> None:
        while self.poll() is None and self.pid is None:  # it is about to be started
            self._server.read(1.0)
        if self.returncode is None and self.pid is not None:
            with contextlib.suppress(ProcessLookupError):  # it has ended; the report is to come
                os.kill(self.pid, number)


def _start_server(errors: int | BinaryIO) -> subprocess.Popen[bytes]:
    pipe = subprocess.PIPE
    return _start("gcs.fleet.fork_server", _ROOM, stdin=pipe, stdout=pipe, stderr=errors)


def _start(
    module: str,
    *arguments: str,
    stdin: int = subprocess.DEVNULL,
    stdout: int | BinaryIO,
    stderr: int | BinaryIO,
) -> subprocess.Popen[bytes]:
    """Start `main` of a module in a session of its own.

    Python collects garbage neither while it imports, nor later in what it has imported.
    """
    main = f"import gc; gc.disable(); from {module} import main; gc.freeze(); gc.enable(); main()"
    return subprocess.Popen(
        # -P: do not import from the user's current folder
        [sys.executable, "-P", "-c", main, *arguments],
        stdin=stdin,
        stdout=stdout,
        stderr=stderr,
        start_new_session=True,
        env=without_threads(),  # which a fork does not copy
    )
