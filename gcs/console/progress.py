"""How far a long command is: a bar on a terminal, elsewhere a line every half minute."""

import contextlib
import threading
import time
from collections.abc import Iterator
from importlib.util import find_spec
from typing import ClassVar

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

EVERY_S = 30.0
"""Longest silence where there is no terminal, over all tasks of a command [s]."""
LOOK_S = 0.5
"""Interval at which a due line is polled [s]."""


class Task:
    """Something that takes long.

    Attributes:
        done: How much of it is done.
    """

    def __init__(self, what: str, total: float | None, unit: str, done: float, rated: bool) -> None:
        self._what, self._total, self._unit, self._rated = what, total, unit, rated
        self.done = self._first = done
        self._text = ""
        self._begin = time.monotonic()
        self._id: tuple[Progress, TaskID] | None = None

    def draw(self, progress: Progress) -> None:
        """Draw it as a bar, too."""
        self._id = progress, progress.add_task(self._what, total=self._total, state="")
        self.show(self.done)

    def show(self, done: float, text: str = "", *, total: float | None = None) -> None:
        """Show how much is done, and what else is to be said about it."""
        if done <= self._first:
            self._begin = time.monotonic()
        self.done, self._text = done, text
        self._total = self._total if total is None else total
        if self._id is not None:
            progress, task = self._id
            progress.update(task, completed=done, total=self._total, state=self._state())

    def advance(self, text: str = "") -> None:
        """Show that one more is done."""
        self.show(self.done + 1, text)

    def line(self) -> str:
        """Return all about it, as in "flying: 5 of 20 flights, 1.0 flights/s, 15 s left"."""
        state = self._state()
        return (
            f"{self._what}: {state}" if state else f"{self._what}: {self._elapsed_s:.0f} s so far"
        )

    @property
    def is_done(self) -> bool:
        """Whether nothing is left."""
        return self._total is not None and self.done >= self._total

    @property
    def _elapsed_s(self) -> float:
        return max(time.monotonic() - self._begin, 1e-3)

    def _state(self) -> str:
        if not self._unit:
            return self._text
        of = "" if self._total is None else f" of {self._total:g}"
        parts = [f"{self.done:g}{of} {self._unit}"]
        rate = (self.done - self._first) / self._elapsed_s
        if self._rated and rate > 0.0:
            per_s = f"{rate:.1f} {self._unit}/s"
            parts.append(per_s if rate >= 1.0 else f"{60.0 * rate:.1f} {self._unit}/min")
        parts += [self._text] * bool(self._text)
        if self._total is not None and rate > 0.0 and not self.is_done:
            parts.append(f"{(self._total - self.done) / rate:.0f} s left")
        return ", ".join(parts)


class Work:
    """The tasks of a command that are shown together.

    Attributes:
        last_line_s: When a line was printed last, for whatever tasks; at first, when this command
            began [s].
    """

    last_line_s: ClassVar[float] = time.monotonic()

    def __init__(self, progress: Progress | None) -> None:
        self._progress = progress
        self.tasks: list[Task] = []

    def add(
        self,
        what: str,
        total: float | None = None,
        unit: str = "",
        *,
        done: float = 0.0,
        rated: bool = True,
        detail: bool = False,
    ) -> Task:
        """Add a task.

        Args:
            what: Its name.
            total: How much there is to do; None if that is not known.
            unit: What is counted, in the plural; nothing if nothing is.
            done: How much was done before.
            rated: Whether units per second are shown.
            detail: Whether it is for a terminal only.
        """
        task = Task(what, total, unit, done, rated)
        if not detail:
            self.tasks.append(task)
        if self._progress is not None:
            task.draw(self._progress)
        return task


@contextlib.contextmanager
def working(console: Console, what: str = "") -> Iterator[Work]:
    """Show the progress of tasks while the context lasts; `what` is a task that counts nothing."""
    if console.is_terminal or (console.is_jupyter and find_spec("ipywidgets")):
        columns = (
            TextColumn("{task.description}", markup=False),
            BarColumn(bar_width=20),
            TextColumn("{task.fields[state]}", markup=False),
            TimeElapsedColumn(),
        )
        with Progress(*columns, console=console, transient=True) as progress:
            yield _begun(Work(progress), what)
        return
    work, over = _begun(Work(None), what), threading.Event()
    lines = threading.Thread(target=_print_lines, args=(work, console, over), daemon=True)
    lines.start()
    try:
        yield work
    finally:
        over.set()
        lines.join()


def _begun(work: Work, what: str) -> Work:
    if what:
        work.add(what)
    return work


def _print_lines(work: Work, console: Console, over: threading.Event) -> None:
    with contextlib.suppress(OSError):  # nobody reads them
        while not over.wait(min(LOOK_S, EVERY_S)):
            unfinished = [task for task in work.tasks if not task.is_done]
            if unfinished and time.monotonic() - Work.last_line_s >= EVERY_S:
                for task in unfinished:
                    console.print(task.line(), soft_wrap=True)
                Work.last_line_s = time.monotonic()
