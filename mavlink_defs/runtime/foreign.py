"""Code of others: whatever it does, it neither ends this program unnamed nor runs it twice."""

import os
import threading
from collections.abc import Callable


class PluginError(ValueError):
    """A plug-in cannot be used; one line that names its file and the line, as far as known."""


class _Forks(threading.local):
    """How often this thread has forked, and how often it is the child of a fork."""

    made = 0
    survived = 0


_forks = _Forks()


def _forked() -> None:
    _forks.made += 1


def _is_child() -> None:
    _forks.survived += 1


os.register_at_fork(after_in_parent=_forked, after_in_child=_is_child)


class ForeignCode:
    """Context in which code of others runs: all that it raises, SystemExit too, becomes an error.

    Ctrl-C passes. A child that it forks ends at the end of the context, without a word.
    """

    def __init__(
        self, error: Callable[[BaseException], BaseException], *, may_fork: bool = True
    ) -> None:
        """Prepare it.

        Args:
            error: Makes an error of what was raised, or returns it.
            may_fork: Whether it is no error to have forked: `OSError` then says so.
        """
        self._error, self._may_fork = error, may_fork

    def __enter__(self) -> None:
        self._made, self._survived = _forks.made, _forks.survived

    def __exit__(self, kind: object, problem: BaseException | None, trace: object) -> None:
        if _forks.survived != self._survived:
            os._exit(0)
        if is_ctrl_c(problem):
            return
        if problem is None and not self._may_fork and _forks.made != self._made:
            problem = OSError("it forks, which only programs may")
        if problem is not None and (error := self._error(problem)) is not problem:
            raise error from problem


def is_ctrl_c(problem: BaseException | None) -> bool:
    """Return whether an exception is the user's: code of others raises kinds of its own."""
    return type(problem) is KeyboardInterrupt
