"""Flying what the folder of a campaign or a sweep lacks, with progress on the terminal."""

import contextlib
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

from gcs.commands.common import warm_up
from gcs.errors import Interrupted

if TYPE_CHECKING:
    from gcs.campaigns.engine import Flown
    from gcs.campaigns.plan import Plan

__all__ = ["fly_plan", "interruptible"]


@contextlib.contextmanager
def interruptible(folder: Path, total: int) -> Iterator[None]:
    """Say on Ctrl-C what is stored and how to go on.

    Raises:
        Interrupted: It was pressed.
    """
    from gcs.campaigns.engine import missing_rows

    try:
        yield
    except KeyboardInterrupt:
        stored = total - len(missing_rows(folder, total))
        raise Interrupted(
            f"interrupted with {stored} of {total} flights in {folder}",
            "the same command continues where it stopped",
        ) from None


def fly_plan(
    planned: "Plan",
    folder: Path,
    jobs: int | None,
    console: Console,
    scheduler: str | None = None,
    enough: Callable[[], bool] = lambda: False,
) -> None:
    """Fly the rows that an open folder lacks; arguments and errors as of `run_campaign`."""
    from gcs.campaigns.engine import missing_rows
    from gcs.campaigns.run import fly_missing

    total = planned.draws.num_rows
    left = len(missing_rows(folder, total))
    if left < total:
        console.print(f"{total - left} of {total} flights already flown")
    if left and scheduler is None and planned.example is not None:
        warm_up(planned.example, console)
    with _progress(total, left, console) as show:
        fly_missing(planned, folder, scheduler, jobs, show.flown, enough)


class _Shown:
    """Progress over flights: done, failed, per second, time left, and of each worker."""

    def __init__(self, progress: Progress, task: TaskID) -> None:
        self._progress, self._task = progress, task
        self._begin: float | None = None
        self._done = self._lost = 0
        self._workers: dict[str, TaskID] = {}

    def flown(self, batch: "Flown") -> None:
        """Count a batch."""
        outcomes = batch.rows.column("outcome").to_pylist()
        self._done += len(outcomes)
        self._lost += sum(outcome != "completed" for outcome in outcomes)
        now = time.monotonic()
        self._begin = now - batch.wall_s if self._begin is None else self._begin
        pace = self._done / max(now - self._begin, 1e-3)
        text = f"{pace:.1f} flights/s, {self._lost} not completed"
        self._progress.update(self._task, advance=len(outcomes), text=text)
        if batch.worker:
            if batch.worker not in self._workers:
                name = f"worker {len(self._workers) + 1}"
                self._workers[batch.worker] = self._progress.add_task(name, total=None, text="")
            task = self._workers[batch.worker]
            rate = len(outcomes) / max(batch.wall_s, 1e-3)
            self._progress.update(task, advance=len(outcomes), text=f"{rate:.1f} flights/s")


@contextlib.contextmanager
def _progress(total: int, missing: int, console: Console) -> Iterator[_Shown]:
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:g} flights"),
        TextColumn("{task.fields[text]}"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task(
            "flying", total=total, completed=total - missing, text="starting the workers"
        )
        yield _Shown(progress, task)
