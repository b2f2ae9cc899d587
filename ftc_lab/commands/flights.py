"""Flying what the folder of a campaign or a sweep lacks, with progress on the terminal."""

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from gcs.console.errors import Interrupted
from gcs.console.progress import Task, Work, working
from gcs.fleet.warm_up import warm_up

if TYPE_CHECKING:
    from ftc_lab.campaigns.plan import Plan
    from ftc_lab.campaigns.workers import Flown

JobsOption = Annotated[
    int | None,
    typer.Option(
        min=1,
        metavar="NUMBER",
        help="Flights at a time on this machine; by default as many as it has cores.",
    ),
]


@contextlib.contextmanager
def interruptible(folder: Path, total: int) -> Iterator[None]:
    """Report on Ctrl-C what is stored and how to continue.

    Raises:
        Interrupted: It was pressed.
    """
    from ftc_lab.campaigns.engine import missing_rows

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
    """Fly the rows that an open folder lacks; arguments and errors as of `ftc_lab.run`."""
    from ftc_lab.campaigns.engine import fly_missing, missing_rows

    total = planned.draws.num_rows
    left = len(missing_rows(folder, total))
    if left < total:
        console.print(f"{total - left} of {total} flights already flown")
    if left and scheduler is None and planned.example is not None:
        warm_up(None, console)
    with working(console) as work:
        shown = _Shown(work, work.add("flying", total, "flights", done=total - left))
        fly_missing(planned, folder, scheduler, jobs, shown.flown, enough)


class _Shown:
    """Progress over flights: done, failed, per second, time left, and of each worker."""

    def __init__(self, work: Work, task: Task) -> None:
        self._work, self._task = work, task
        self._done, self._lost = task.done, 0
        self._workers: dict[str, Task] = {}

    def flown(self, batch: "Flown") -> None:
        """Count a batch."""
        outcomes = batch.rows.column("outcome").to_pylist()
        self._done += len(outcomes)
        self._lost += sum(outcome != "completed" for outcome in outcomes)
        self._task.show(self._done, f"{self._lost} not completed")
        if batch.worker:
            if batch.worker not in self._workers:
                name = f"worker {len(self._workers) + 1}"
                self._workers[batch.worker] = self._work.add(name, unit="flights", detail=True)
            worker = self._workers[batch.worker]
            worker.show(worker.done + len(outcomes))
