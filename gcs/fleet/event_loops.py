"""Flights called beside an event loop, as in a cell of a notebook: it waits meanwhile."""

import asyncio
import contextlib
import threading
from collections.abc import Callable, Coroutine
from concurrent.futures import Future, wait
from functools import partial
from typing import Any, Generic, TypeVar

import numpy as np

from gcs.console.stopping import noting_ctrl_c
from gcs.fleet.in_process import OnProgress

LOOK_S = 0.1
"""Between two looks at whether the calling task is cancelled [s]."""

T = TypeVar("T")


def raise_if_cancelled() -> None:
    """Raise CancelledError if the task that called us is to be cancelled.

    It awaits nothing while we work, and the first Ctrl-C in `asyncio.run` only cancels it.
    """
    try:
        task = asyncio.current_task()
    except RuntimeError:  # no event loop runs on this thread: Ctrl-C interrupts it
        return
    if task is not None and task.cancelling():
        raise asyncio.CancelledError


def unless_cancelled(on_progress: OnProgress | None) -> OnProgress:
    """Return what reports progress, and ends the flight when the task is cancelled."""

    def report(time_s: float, events: np.ndarray) -> None:
        raise_if_cancelled()
        if on_progress is not None:
            on_progress(time_s, events)

    return report


def beside_any_loop(work: Callable[[], Coroutine[Any, Any, T]]) -> T:
    """Run a coroutine to its end, on a thread of its own if an event loop runs on this one.

    Ctrl-C cancels it, once; it may take its time to end, such as to end the processes of a fleet.
    """
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return asyncio.run(work())
    with _noting_ctrl_c() as noted:
        flight = _FlightThread(work)
        try:
            while not noted and not wait([flight.done], LOOK_S).done:
                raise_if_cancelled()
        finally:
            flight.end()
    if noted:
        raise KeyboardInterrupt
    return flight.done.result()


def _noting_ctrl_c() -> contextlib.AbstractContextManager[list[int]]:
    on_main_thread = threading.current_thread() is threading.main_thread()
    return noting_ctrl_c() if on_main_thread else contextlib.nullcontext([])


class _FlightThread(Generic[T]):
    """A thread with an event loop, on which a coroutine runs.

    Attributes:
        done: Its result.
    """

    def __init__(self, work: Callable[[], Coroutine[Any, Any, T]]) -> None:
        self.done: Future[T] = Future()
        self._work = work
        self._began = threading.Event()
        self._cancel: Callable[[], object] = lambda: None
        self._thread = threading.Thread(target=self._run, name="flight")
        self._thread.start()

    def end(self) -> None:
        """Cancel the coroutine, unless it is over, and wait for its end."""
        self._began.wait()
        with contextlib.suppress(RuntimeError):  # it has just ended
            self._cancel()
        self._thread.join()

    def _run(self) -> None:
        try:
            self.done.set_result(asyncio.run(self._main()))
        except BaseException as problem:  # which the other thread raises
            self.done.set_exception(problem)
        finally:  # without a loop, too, as when too many files are open
            self._began.set()

    async def _main(self) -> T:
        task, loop = asyncio.current_task(), asyncio.get_running_loop()
        assert task is not None
        self._cancel = partial(loop.call_soon_threadsafe, task.cancel)
        self._began.set()
        return await self._work()
