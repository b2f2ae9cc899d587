"""Orderly shutdown of a process: on a signal, or when its parent process is gone."""

import atexit
import os
import signal
from collections.abc import Callable

_POLL_S = 0.5


def on_stop(stop: Callable[[], None], parent: int | None = None) -> None:
    """Call `stop` on SIGTERM or SIGINT, and when the parent process is gone.

    Args:
        stop: Called from a signal handler; should only set a flag.
        parent: Process id of the parent, as the parent gave it: it may be gone already. None to
            continue without one.
    """

    def handle(number: int, _: object) -> None:
        if number != signal.SIGALRM or os.getppid() != parent:
            stop()

    signal.signal(signal.SIGTERM, handle)
    signal.signal(signal.SIGINT, handle)
    if parent is not None:
        if os.getppid() != parent:
            stop()
        signal.signal(signal.SIGALRM, handle)
        signal.setitimer(signal.ITIMER_REAL, _POLL_S, _POLL_S)
        # while the interpreter shuts down the handler is gone, and the alarm would kill
        atexit.register(signal.setitimer, signal.ITIMER_REAL, 0.0)
