"""`gcs` forked from a process that has imported it: most of a short command's time is imports.

Each command is a process of its own all the same, with its environment, folder and output, and so
are the server of a flight and what that forks, and the workers of a campaign. Linux only.
"""

import atexit
import multiprocessing
import os
import resource
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from functools import cache, partial
from multiprocessing import forkserver
from multiprocessing.connection import Connection
from pathlib import Path
from typing import IO, Any

import pytest

from gcs.fleet import forked

_PROCESSES: Any = multiprocessing.get_context("forkserver")
_MAY_DIFFER = ("COLUMNS", "FTC_SITL_", "MARK", "NO_COLOR", "PYTHONDONTWRITEBYTECODE")
"""Variables that no import reads, by their beginnings."""


def can_be_warm(env: Mapping[str, str]) -> bool:
    """Return whether a command with this environment would import the same, the same way."""
    differ = {name for name in {*env, *os.environ} if env.get(name) != os.environ.get(name)}
    return sys.platform == "linux" and all(name.startswith(_MAY_DIFFER) for name in differ)


class WarmCommand:
    """A running `gcs`, with what the tests use of `subprocess.Popen`."""

    def __init__(
        self,
        arguments: Sequence[str],
        env: Mapping[str, str],
        cwd: Path | None = None,
        file: Path | None = None,
        file_size: int = resource.RLIM_INFINITY,
    ) -> None:
        """Start it.

        Args:
            arguments: Its arguments.
            env: Its environment.
            cwd: Its current folder; None for ours.
            file: What gets its standard output; None for a pipe.
            file_size: Its files cannot grow beyond this [bytes].
        """
        _start_server()
        self.args = ["gcs", *arguments]
        (output, child_output), (errors, child_errors) = (
            multiprocessing.Pipe(duplex=False) for _ in range(2)
        )
        if file is not None:
            file.touch()
        given = (self.args, dict(env), cwd or Path.cwd(), file, file_size)
        pipes = (child_output, child_errors)
        self._process = _PROCESSES.Process(target=_main, args=(*given, *pipes))
        self._process.start()
        child_output.close()
        child_errors.close()
        self.stdout, self.stderr = (_reader(pipe) for pipe in (output, errors))
        self.pid: int = self._process.pid

    @property
    def returncode(self) -> int | None:
        status: int | None = self._process.exitcode
        return status

    def poll(self) -> int | None:
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        self._process.join(timeout)
        if self.returncode is None:
            assert timeout is not None
            raise subprocess.TimeoutExpired(self.args, timeout)
        return self.returncode

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            os.kill(self.pid, number)

    def terminate(self) -> None:
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)

    def communicate(self, timeout: float | None = None) -> tuple[str, str]:
        """Read all output to its end, and wait."""
        texts = {self.stdout: "", self.stderr: ""}

        def read(stream: IO[str]) -> None:
            texts[stream] = "" if stream.closed else stream.read()

        readers = [threading.Thread(target=partial(read, stream), daemon=True) for stream in texts]
        for reader in readers:
            reader.start()
        for reader in readers:
            reader.join(timeout)
        self.wait(0.0 if any(reader.is_alive() for reader in readers) else timeout)
        for stream in texts:
            stream.close()
        return texts[self.stdout], texts[self.stderr]


@cache
def _start_server() -> None:
    _PROCESSES.set_forkserver_preload(["warm_imports"])
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(Path(__file__).parent))  # Python 3.11 gives it no sys.path
        forkserver.ensure_running()


def _reader(pipe: Connection) -> IO[str]:
    stream = open(os.dup(pipe.fileno()), encoding="utf-8")  # noqa: SIM115 - as Popen has it
    pipe.close()
    return stream


def _main(
    command: Sequence[str],
    env: dict[str, str],
    cwd: Path,
    file: Path | None,
    file_size: int,
    output: Connection,
    errors: Connection,
) -> None:
    """Be the command: in a process that has just been forked."""
    from gcs.__main__ import main
    from gcs.console.progress import Work
    from gcs.fleet import local_workers
    from gcs.fleet.fork_server import _set_command_line

    os.environ.clear()
    os.environ.update(env)
    os.chdir(cwd)
    for number, pipe in enumerate((output, errors), start=1):
        os.dup2(pipe.fileno(), number)
        pipe.close()
    if file is not None:
        os.dup2(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), 1)
    resource.setrlimit(resource.RLIMIT_FSIZE, (file_size, resource.RLIM_INFINITY))
    _set_command_line(*command)
    sys.argv = [*command]
    Work.last_line_s = time.monotonic()  # when the command began
    start_cold = forked._start_server

    def start_warm(errors: Any) -> Any:
        forked._start_server = start_cold  # any later one
        return _FlightServer()

    forked._start_server = start_warm
    local_workers._PROCESSES = multiprocessing.get_context(
        "fork"
    )  # its server would import all again
    try:
        main()
    finally:
        atexit._run_exitfuncs()


class _FlightServer:
    """`gcs.fleet.fork_server`, with what `gcs.fleet.forked` uses of `subprocess.Popen`."""

    def __init__(self) -> None:
        (requests, to_requests), (from_reports, reports) = os.pipe(), os.pipe()
        self.pid = os.fork()
        if not self.pid:
            try:
                os.close(to_requests)
                os.close(from_reports)
                self._serve(requests, reports)
            finally:
                os._exit(1)
        os.close(requests)
        os.close(reports)
        self.stdin, self.stdout = open(to_requests, "wb"), open(from_reports, "rb")  # noqa: SIM115 - as there
        self._status: int | None = None

    @staticmethod
    def _serve(requests: int, reports: int) -> None:
        from gcs.fleet import fork_server

        os.setsid()
        os.environ.update(forked.without_threads())
        nothing = os.open(os.devnull, os.O_WRONLY)
        for number, descriptor in enumerate((requests, reports, nothing)):
            os.dup2(descriptor, number)
            os.close(descriptor)
        fork_server._set_command_line("python", "-c", "gcs.fleet.fork_server")
        status = 0
        try:
            fork_server.main()
        except SystemExit as end:
            status = end.code if isinstance(end.code, int) else 0
        os._exit(status)

    def poll(self) -> int | None:
        return self._wait(os.WNOHANG)

    def wait(self) -> int:
        status = self._wait(0)
        assert status is not None
        return status

    def kill(self) -> None:
        if self.poll() is None:
            os.kill(self.pid, signal.SIGKILL)

    def communicate(self) -> None:
        self.stdin.close()
        self.stdout.close()
        self.wait()

    def _wait(self, options: int) -> int | None:
        if self._status is None:
            pid, status = os.waitpid(self.pid, options)
            self._status = os.waitstatus_to_exitcode(status) if pid else None
        return self._status


class _DistantFlightServer(_FlightServer):
    """The same for a test's own process, which has threads and more open than a fork should get."""

    def __init__(self) -> None:
        _start_server()
        (requests, to_requests), (from_reports, reports) = (
            multiprocessing.Pipe(duplex=False) for _ in range(2)
        )
        given = (dict(os.environ), Path.cwd(), requests, reports)
        self._process = _PROCESSES.Process(target=_serve_flights, args=given)
        self._process.start()
        self.pid = self._process.pid
        self.stdin = open(os.dup(to_requests.fileno()), "wb")  # noqa: SIM115 - as there
        self.stdout = open(os.dup(from_reports.fileno()), "rb")  # noqa: SIM115 - as there
        for pipe in (requests, to_requests, from_reports, reports):
            pipe.close()

    def _wait(self, options: int) -> int | None:
        self._process.join(0.0 if options else None)
        status: int | None = self._process.exitcode
        return status


def _serve_flights(
    env: dict[str, str], cwd: Path, requests: Connection, reports: Connection
) -> None:
    os.environ.clear()
    os.environ.update(env)
    os.chdir(cwd)
    _FlightServer._serve(requests.fileno(), reports.fileno())


def start_warm_flight_server(errors: int | IO[bytes]) -> Any:
    """Start what `gcs.fleet.forked` starts as an interpreter of its own."""
    return _DistantFlightServer()
