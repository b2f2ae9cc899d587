"""What watches a fleet, on threads of its own: it may fail or hang, and the fleet flies on."""

import threading
import time
from collections.abc import Callable

from gcs.console.errors import GcsError
from mavlink_defs.runtime.spool import unwritten

HANGS_S = 10.0
"""Time without a turn after which an observer is said to hang [s]."""
_END_S = 5.0  # in which it must end when the fleet has


class Observer:
    """Something that watches, from its making until `close`; what befalls it is reported once."""

    def __init__(
        self, what: str, watch: "Callable[[Observer], None]", on_message: Callable[[str], None]
    ) -> None:
        """Begin to watch.

        Args:
            what: What watches, at the begin of a message to the user.
            watch: Called once, on the thread; it returns soon after `goes_on` returns False.
            on_message: Called with why it has ended, or that it hangs; from any thread.
        """
        self._what, self._watch, self._on_message = what, watch, on_message
        self._over = threading.Event()
        self._turn_s = time.monotonic()
        self._reported = False
        self._thread = threading.Thread(target=self._run, name=what, daemon=True)
        self._thread.start()

    def goes_on(self, pause_s: float = 0.0) -> bool:
        """Wait, and return whether to go on; the observer itself calls it at each turn."""
        self._turn_s = time.monotonic()
        return not self._over.wait(pause_s)

    def check(self) -> None:
        """Tell if it hangs; call it often."""
        silent_s = time.monotonic() - self._turn_s
        if silent_s > HANGS_S and self._thread.is_alive():
            self._tell(f"hangs for {silent_s:.0f} s by now; the fleet flies on")

    def close(self) -> None:
        """End it, and leave it behind if it hangs."""
        self._over.set()
        self._thread.join(_END_S)
        if self._thread.is_alive():
            self._tell("hangs, and is left as it is")

    def _run(self) -> None:
        try:
            self._watch(self)
        except Exception as problem:
            why = str(problem) if isinstance(problem, GcsError) else unwritten(problem)
            self._tell(f"ended: {why}; the fleet flies on")

    def _tell(self, text: str) -> None:
        if not self._reported:
            self._reported = True
            self._on_message(f"{self._what} {text}")
