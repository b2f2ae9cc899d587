"""A campaign from Python: what ``gcs campaign`` does, without the terminal.

Worker processes import the program that starts them, so a script needs the usual guard::

    if __name__ == "__main__":
        page = run_campaign(load_plan(Path("my.yaml")), Path("runs/mine"))
        table = read_results(Path("runs/mine")).to_pandas()
"""

import contextlib
import os
from collections.abc import Callable
from pathlib import Path

from gcs.lab.campaigns.cluster import cluster_elsewhere, local_cluster, prepare
from gcs.lab.campaigns.engine import Flown, fly, missing_rows
from gcs.lab.campaigns.folder import open_folder
from gcs.lab.campaigns.keep import keep_flights
from gcs.lab.campaigns.plan import Plan, rows_of
from gcs.lab.campaigns.report import write_report
from gcs.lab.campaigns.store import alone_in
from gcs.lab.campaigns.until import is_decided, note_condition, stopping_condition


def run_campaign(
    planned: Plan,
    folder: Path,
    scheduler: str | None = None,
    jobs: int | None = None,
    until: str | None = None,
    on_flown: Callable[[Flown], None] = lambda _: None,
) -> Path:
    """Fly what a campaign's folder lacks, keep the chosen trajectories, and write the report.

    Args:
        planned: The campaign, as `gcs.lab.campaigns.plan.load_plan` returns it.
        folder: Its folder, new or to continue.
        scheduler: Address of a dask scheduler whose workers fly; None for workers here.
        jobs: Worker processes here; None for as many as there are cores.
        until: Condition that ends the campaign as soon as it is decided for every variant, as in
            "p(attitude_lost) < 0.05 at 95 %"; None to fly every draw.
        on_flown: Called with each batch that ended.

    Returns:
        The path of report.html. The table is read by `gcs.lab.campaigns.store.read_results`.

    Raises:
        BadInput: The folder is another campaign's, or the condition, the scheduler or a worker
            cannot be used.
        GcsError: The scheduler was lost; what was flown is stored.
        OSError: A file cannot be written; it is named.
    """
    enough = begin_campaign(planned, folder, until)
    if not enough():
        fly_missing(planned, folder, scheduler, jobs, on_flown, enough)
    for _ in keep_flights(folder, planned.flights):
        pass
    return write_report(folder)


def begin_campaign(planned: Plan, folder: Path, until: str | None) -> Callable[[], bool]:
    """Make or open the folder of a campaign; arguments and errors as of `run_campaign`.

    Returns:
        A function that tells from the stored flights whether the condition is decided.
    """
    campaign = planned.mark.campaign
    condition = None if until is None else stopping_condition(until, campaign)
    open_folder(folder, planned)
    if condition is not None:
        note_condition(folder, condition)
    return lambda: condition is not None and is_decided(folder, campaign, condition)


def fly_missing(
    planned: Plan,
    folder: Path,
    scheduler: str | None,
    jobs: int | None,
    on_flown: Callable[[Flown], None],
    enough: Callable[[], bool] = lambda: False,
) -> None:
    """Fly the rows that an open folder lacks; arguments and errors as of `run_campaign`."""
    with alone_in(folder), contextlib.ExitStack() as stack:
        missing = missing_rows(folder, planned.draws.num_rows)
        if not len(missing):
            return
        workers = min(jobs or os.cpu_count() or 1, len(missing))
        cluster = local_cluster(workers) if scheduler is None else cluster_elsewhere(scheduler)
        client = stack.enter_context(cluster)
        prepare(client, planned.example)
        rows = rows_of(planned.draws.take(missing))
        fly(client, planned.flights, rows, len(missing), folder, on_flown, enough)
