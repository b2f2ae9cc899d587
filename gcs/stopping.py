"""Signals that end a command: Ctrl-C, and in the same way SIGTERM and SIGHUP.

A flight ended by ``timeout`` or a closed terminal therefore keeps its recording, too.
"""

import signal
from types import FrameType

from gcs.errors import Interrupted

__all__ = ["stop_as_ctrl_c", "stop_signals"]


def stop_signals() -> list[signal.Signals]:
    """Return the signals that end a command; without SIGHUP if it is ignored, as by ``nohup``."""
    hang_up = [signal.SIGHUP] if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN else []
    return [signal.SIGINT, signal.SIGTERM, *hang_up]


def stop_as_ctrl_c() -> None:
    """Make SIGTERM and SIGHUP act like Ctrl-C, with exit statuses of their own."""
    for number in stop_signals():
        if number != signal.SIGINT:
            signal.signal(number, _interrupt)


def _interrupt(number: int, frame: FrameType | None) -> None:
    Interrupted.exit_status = 128 + number
    on_ctrl_c = signal.getsignal(signal.SIGINT)  # Python's own, or of a running event loop
    if not callable(on_ctrl_c):  # a shell ignores it for what it runs in the background
        raise KeyboardInterrupt
    on_ctrl_c(signal.SIGINT, frame)
