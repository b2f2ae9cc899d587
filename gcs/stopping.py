"""Signals that end a command: Ctrl-C, and in the same way SIGTERM and SIGHUP.

A flight ended by ``timeout`` or a closed terminal therefore keeps its recording, too.
"""

import contextlib
import signal
import threading
from collections.abc import Iterator
from pathlib import Path
from types import FrameType

from gcs.errors import Interrupted
from gcs.terminal import print_line

_LONG_S = 5.0


def stop_signals() -> list[signal.Signals]:
    """Return the signals that end a command; without SIGHUP if it is ignored, as by ``nohup``."""
    hang_up = [signal.SIGHUP] if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN else []
    return [signal.SIGINT, signal.SIGTERM, *hang_up]


def stop_as_ctrl_c() -> None:
    """Make SIGTERM and SIGHUP act like Ctrl-C, with exit statuses of their own.

    Ctrl-C is a KeyboardInterrupt from here on.
    """
    for number in stop_signals():
        if number != signal.SIGINT:
            signal.signal(number, _interrupt)
    if signal.getsignal(signal.SIGINT) == signal.SIG_DFL:
        signal.signal(signal.SIGINT, signal.default_int_handler)


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
