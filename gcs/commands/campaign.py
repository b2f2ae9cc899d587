"""``gcs campaign``: fly many draws of a scenario, here or on a cluster."""

import contextlib
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

from gcs.commands.common import QuietOption, console_of, warm_up
from gcs.errors import GcsError, Interrupted

if TYPE_CHECKING:
    from gcs.campaigns.engine import Flown
    from gcs.campaigns.plan import Plan

__all__ = ["EPILOG", "campaign"]

EPILOG = """
Examples:

- gcs campaign campaigns/uncertainty
- gcs campaign my.yaml --draws 59 --out runs/robust
- gcs campaign my.yaml --scheduler tcp://cluster:8786
- gcs campaign my.yaml --until 'p(attitude_lost) < 0.05 at 95 %'
- gcs fly --campaign runs/robust --row 17

Exit status: 0 every draw is flown (lost flights are results, too), 1 a flight could not be
computed, the scheduler was lost or results cannot be written, 2 bad input, 70 a defect of
ftc-sitl, 130 Ctrl-C; the same command continues.
"""


def campaign(
    file: Annotated[
        Path, typer.Argument(help="Campaign: a file, or a bundled one.", metavar="CAMPAIGN")
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder of the campaign, new or to continue; runs/campaign-NAME-DIGEST by "
            "default, the same for the same campaign and code."
        ),
    ] = None,
    draws: Annotated[
        int | None, typer.Option(min=1, help="Draws per variant instead of the file's.")
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option(min=1, help="Worker processes here; by default as many as there are cores."),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(help="Dask scheduler whose workers fly instead.", metavar="tcp://HOST:PORT"),
    ] = None,
    until: Annotated[
        str | None,
        typer.Option(
            help="Stop as soon as this is shown or refuted for every variant, as in "
            "'p(attitude_lost) < 0.05 at 95 %'.",
            metavar="CONDITION",
        ),
    ] = None,
    quiet: QuietOption = False,
) -> None:
    """Fly every draw of a campaign, in process, on all cores or on a cluster.

    All draws are checked before the first flight. The folder gets a table in Parquet, one row a
    flight, stored every few seconds: after any interruption, the same command continues there.
    """
    from gcs.campaigns.engine import missing_rows
    from gcs.campaigns.folder import default_folder
    from gcs.campaigns.plan import load_plan
    from gcs.campaigns.run import begin_campaign
    from gcs.errors import BadInput
    from gcs.scenario.bundled import find_scenario

    if jobs is not None and scheduler is not None:
        raise BadInput("--jobs starts workers here; --scheduler has its own", "leave one out")
    console = console_of(quiet=quiet)
    path = find_scenario(file)
    with console.status("checking every draw"):
        planned = load_plan(path, draws)
    folder = out or default_folder(planned.mark)
    enough = begin_campaign(planned, folder, until)
    total = planned.draws.num_rows
    try:
        if not enough():
            _fly(planned, folder, scheduler, jobs, console, enough)
        if enough():
            console.print(f"{until} is decided for every variant")
        _keep(planned, folder, console)
    except KeyboardInterrupt:
        stored = total - len(missing_rows(folder, total))
        raise Interrupted(
            f"interrupted with {stored} of {total} flights in {folder}",
            "the same command continues where it stopped",
        ) from None
    _report(folder, console)


def _fly(
    planned: "Plan",
    folder: Path,
    scheduler: str | None,
    jobs: int | None,
    console: Console,
    enough: Callable[[], bool],
) -> None:
    from gcs.campaigns.engine import missing_rows
    from gcs.campaigns.plan import row_of
    from gcs.campaigns.run import fly_missing

    total = planned.draws.num_rows
    left = len(missing_rows(folder, total))
    if left < total:
        console.print(f"{total - left} of {total} flights already flown")
    if left and scheduler is None:
        warm_up(planned.flights.scenario(row_of(planned.draws, 0)), console)
    with _progress(total, left, console) as show:
        fly_missing(planned, folder, scheduler, jobs, show.flown, enough)


def _keep(planned: "Plan", folder: Path, console: Console) -> None:
    from gcs.campaigns.keep import keep_flights

    with console.status("flying chosen flights again, for their trajectories") as status:
        for done, chosen in keep_flights(folder, planned.flights):
            status.update(f"flying chosen flights again: {done} of {chosen}")


def _report(folder: Path, console: Console) -> None:
    from rich.table import Table

    from gcs.campaigns.report import write_report
    from gcs.campaigns.store import OUTCOMES, read_results

    results = read_results(folder, ["variant", "outcome", "reason"]).to_pydict()
    counts = Counter(zip(results["variant"], results["outcome"], strict=True))
    shown = [name for name in OUTCOMES if any(counts[v, name] for v, _ in list(counts))]
    table = Table("variant", *(name.replace("_", " ") for name in shown))
    for variant in dict.fromkeys(results["variant"]):
        table.add_row(variant, *(str(counts[variant, name]) for name in shown))
    console.print(table)
    with console.status("writing the report"):
        page = write_report(folder)
    console.print(f"results in {folder}; open {page}", soft_wrap=True)
    ended = zip(results["outcome"], results["reason"], strict=True)
    failed = [reason for outcome, reason in ended if outcome == "failed"]
    if failed:
        raise GcsError(
            f"{len(failed)} of {len(results['outcome'])} flights could not be computed: {failed[0]}"
        )


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
