"""Signals that end a command: Ctrl-C, and in the same way SIGTERM and SIGHUP.

A flight ended by ``timeout`` or a closed terminal therefore keeps its recording, too. What only
shows something ends with its session, by force if need be.
"""

import contextlib
import os
import select
import signal
import sys
import termios
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType

from gcs.console.errors import Interrupted
from gcs.console.lines import print_line

_LONG_S = 5.0
_STDIN = 0

_FORCE_S = 1.7
"""Time that a process has to end well after its session [s]."""
_LOOK_S = 0.2
"""Period of looking whether the session is still there [s]."""
_PR_SET_PDEATHSIG = 1  # of <sys/prctl.h>
_started_by = os.getppid()


def stop_signals() -> list[signal.Signals]:
    """Return the signals that end a command; without SIGHUP if it is ignored, as by ``nohup``."""
    hang_up = [signal.SIGHUP] if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN else []
    return [signal.SIGINT, signal.SIGTERM, *hang_up]


def stop_as_ctrl_c() -> None:
    """Make SIGTERM and SIGHUP act like Ctrl-C, with exit statuses of their own.

    Ctrl-C is a KeyboardInterrupt from here on. Called when the command begins.
    """
    global _started_by  # noqa: PLW0603 - by now it is this command's
    _started_by = os.getppid()
    for number in stop_signals():
        if number != signal.SIGINT:
            signal.signal(number, _interrupt)
    if signal.getsignal(signal.SIGINT) == signal.SIG_DFL:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def end_with_session(end: Callable[[], object]) -> None:
    """Call `end` when the session ends; what is still there 1.7 s later is killed (SIGALRM).

    It ends by the signals of `stop_signals`, by a terminal that is gone, and, unless SIGHUP is
    ignored, as by ``nohup``, with the process that has started this one. The event loop need not
    run for that: a terminal that nobody reads stops it for good.

    Args:
        end: Called in the middle of whatever runs, in any thread; RuntimeError if it is too late.
    """
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    restore = _terminal_as_it_is()

    def ended(*_: object) -> None:
        if not signal.getitimer(signal.ITIMER_REAL)[0]:
            signal.setitimer(signal.ITIMER_REAL, _FORCE_S)
        restore()
        with contextlib.suppress(RuntimeError):
            end()

    def watch() -> None:
        terminals = select.poll()
        for number in filter(os.isatty, range(3)):
            terminals.register(number, 0)  # a hang-up is always reported
        while not (
            any(event & select.POLLHUP for _, event in terminals.poll(0))
            or (os.getppid() != parent and signal.SIGHUP in numbers)
        ):
            time.sleep(_LOOK_S)
        ended()

    numbers, parent = stop_signals(), _started_by
    for number in numbers:
        signal.signal(number, ended)
    threading.Thread(target=watch, daemon=True).start()


def _terminal_as_it_is() -> Callable[[], None]:
    """Return what gives the terminal the modes that it has now: no matter how a program ends."""
    modes = None
    with contextlib.suppress(termios.error):
        modes = termios.tcgetattr(_STDIN)

    def restore() -> None:
        with contextlib.suppress(OSError, termios.error):  # it is gone
            if modes is not None and os.tcgetpgrp(_STDIN) == os.getpgrp():  # or it would be stopped
                termios.tcsetattr(_STDIN, termios.TCSANOW, modes)

    return restore


def die_with(parent: int) -> None:
    """Be killed when the process that has started this one, by its main thread, is gone.

    On systems other than Linux only if it is gone already.
    """
    if sys.platform == "linux":
        import ctypes  # takes time, of every command

        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os.kill(os.getpid(), signal.SIGKILL)


@contextlib.contextmanager
def ending_at_once() -> Iterator[None]:
    """Let those signals end the process without a word, as long as it has nothing to tidy up.

    An exception in the middle of an import is reported, or lost, by whatever is being imported.
    """
    before = {number: signal.getsignal(number) for number in stop_signals()}
    for number, handler in before.items():
        if handler != signal.SIG_IGN:
            signal.signal(number, signal.SIG_DFL)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextlib.contextmanager
def noting_ctrl_c() -> Iterator[list[int]]:
    """Note those signals in place of raising KeyboardInterrupt in the middle of a step.

    Yields:
        The numbers of those that have come; whoever is in here ends when there is one.
    """
    noted: list[int] = []
    before = signal.getsignal(signal.SIGINT)
    if before != signal.SIG_IGN:  # as a shell has it in the background
        signal.signal(signal.SIGINT, lambda number, _frame: noted.append(number))
    try:
        yield noted
    finally:
        signal.signal(signal.SIGINT, before)


@contextlib.contextmanager
def running_code(file: Path, digest: str) -> Iterator[None]:
    """Tell of a file that is run because a scenario names it, and of one that takes long.

    Of the command line, those signals meanwhile end the process, with the name of the file: code of
    others may catch, or lose, an exception.
    """
    print_line(f"runs {file}, code {digest}", stderr=True)
    what = f"{file} is being imported"
    text = f"{what} for {_LONG_S:g} s now; Ctrl-C ends it"
    timer = threading.Timer(_LONG_S, print_line, [text], {"stderr": True})
    timer.daemon = True
    timer.start()
    try:
        with _ending_with(f"interrupted while {what}"):
            yield
    finally:
        timer.cancel()


@contextlib.contextmanager
def _ending_with(text: str) -> Iterator[None]:
    if signal.getsignal(signal.SIGTERM) is not _interrupt:  # not of the command line
        yield
        return
    with ending_at_once():

        def end(number: int, _frame: FrameType | None) -> None:
            signal.signal(number, signal.SIG_DFL)
            with contextlib.suppress(OSError):
                print_line(text, stderr=True)
            signal.raise_signal(number)

        before = {number: signal.getsignal(number) for number in stop_signals()}
        for number, handler in before.items():
            if handler == signal.SIG_DFL:
                signal.signal(number, end)
        yield


def _interrupt(number: int, frame: FrameType | None) -> None:
    Interrupted.exit_status = 128 + number
    on_ctrl_c = signal.getsignal(signal.SIGINT)  # Python's own, or of a running event loop
    if not callable(on_ctrl_c):  # a shell ignores it for what it runs in the background
        raise KeyboardInterrupt
    on_ctrl_c(signal.SIGINT, frame)
