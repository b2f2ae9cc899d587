"""Processes on this machine that share work, such as flights, on all cores."""

import contextlib
import multiprocessing
import multiprocessing.connection
import multiprocessing.resource_tracker
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from typing import Any, Generic, TypeVar

_Task = TypeVar("_Task")
_Result = TypeVar("_Result")

_FORKS = "forkserver" in multiprocessing.get_all_start_methods()
_PROCESSES: Any = multiprocessing.get_context("forkserver" if _FORKS else "spawn")
_END_S = 5.0
STOPPING = {signal.SIGINT, signal.SIGHUP, signal.SIGTERM}
"""What is blocked where processes start."""


class LocalWorkers(Generic[_Task, _Result]):
    """Processes on this machine, which end with this one; a killed one is replaced."""

    def __init__(
        self, count: int, work: Callable[[_Task, str], _Result], *, forked: bool = False
    ) -> None:
        """Prepare the processes; each is started with its first task.

        Args:
            count: How many.
            work: Does a task, given it and the name of the worker; like tasks and results, it can
                be pickled.
            forked: Fork them from this process, which has no other threads yet, so that they have
                what it has imported, and `work` need not be pickled. Where `FORKS` says so.
        """
        self._count, self._work = count, work
        self._workers: dict[multiprocessing.connection.Connection, Any] = {}
        self._running: dict[Any, _Task] = {}
        self._processes = _PROCESSES
        if forked:
            self._processes = multiprocessing.get_context("fork")
            return
        multiprocessing.resource_tracker.ensure_running()  # it would unblock the signals
        if _FORKS:
            _PROCESSES.set_forkserver_preload(["gcs.fleet.preload"])

    def capacity(self) -> int:
        """Return the number of processes."""
        return self._count

    def submit(self, task: _Task) -> None:
        """Let an idle process do a task, or a new one."""
        idle = (known for known in self._workers if known not in self._running)
        connection = next(idle, None) or self._start()
        self._running[connection] = task
        with contextlib.suppress(OSError):  # killed while idle: `wait` finds out
            connection.send(task)

    def done(self, timeout_s: float) -> bool:
        """Return whether a task is done, after waiting for one at most so long [s]."""
        return bool(multiprocessing.connection.wait(list(self._running), timeout_s))

    def wait(self) -> tuple[_Task, _Result | None]:
        """Return the next task that is done, and its result; None if it killed its process.

        What the task raised is raised here.
        """
        connection: Any = multiprocessing.connection.wait(list(self._running))[0]
        task = self._running.pop(connection)
        try:
            result = connection.recv()
        except (EOFError, OSError):
            self._end(connection)
            return task, None
        if isinstance(result, Exception):
            raise result
        return task, result

    def close(self) -> None:
        """End the processes, whatever they do."""
        for connection in list(self._workers):
            self._end(connection)

    def _start(self) -> Any:
        ours, theirs = self._processes.Pipe()
        name = f"worker {len(self._workers) + 1}"
        arguments = (theirs, self._work, name)
        process = self._processes.Process(target=_serve, args=arguments, daemon=True)
        with _signals_blocked(), _program_not_imported():
            process.start()
        theirs.close()
        self._workers[ours] = process
        return ours

    def _end(self, connection: Any) -> None:
        process = self._workers.pop(connection)
        process.terminate()
        process.join(_END_S)
        process.kill()
        process.join()
        process.close()
        connection.close()


def _serve(connection: Any, work: Callable[[Any, str], Any], name: str) -> None:
    """Do tasks; this is the program of a process of `LocalWorkers`."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    # the end of the process that started this one, or, of a forked one, its handler of SIGTERM
    with contextlib.suppress(EOFError, KeyboardInterrupt):
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGHUP})
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})
        while True:
            task = connection.recv()
            try:
                connection.send(work(task, name))
            except Exception as problem:  # the process that started this one raises it
                connection.send(problem)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


@contextlib.contextmanager
def _signals_blocked() -> Iterator[None]:
    """Block Ctrl-C in processes that start here, and until they serve what ends them, too.

    A terminal sends it to all processes; the workers end when the command ends them. One that is
    ended before it has begun would, forked, go on as the command that was interrupted. The fork
    server, which also forks what is none of ours, unblocks them when it is ready.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, STOPPING)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def _program_not_imported() -> Iterator[None]:
    """Let processes that start here not import the program that started this one.

    `multiprocessing` finds it by these attributes, and would run a script without a guard again.
    The workers need nothing of it.
    """
    program = sys.modules["__main__"].__dict__
    places = ("__spec__", "__file__")
    before: dict[str, Any] = {name: program[name] for name in places if name in program}
    program["__spec__"] = None
    program.pop("__file__", None)
    try:
        yield
    finally:
        program.update(before)
