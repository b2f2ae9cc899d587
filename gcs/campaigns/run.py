"""A campaign from Python: what ``gcs campaign`` does, without the terminal.

Worker processes import the program that starts them, so a script needs the usual guard::

    if __name__ == "__main__":
        path = Path("my.yaml")
        planned = plan(load_campaign(path), path)
        run_campaign(planned, Path("runs/mine"))
        table = read_results(Path("runs/mine")).to_pandas()
"""

import contextlib
import os
from collections.abc import Callable
from pathlib import Path

from gcs.campaigns.cluster import cluster_elsewhere, local_cluster, prepare
from gcs.campaigns.engine import Flown, fly, missing_rows
from gcs.campaigns.folder import open_folder
from gcs.campaigns.keep import keep_flights
from gcs.campaigns.plan import Plan, row_of, rows_of
from gcs.campaigns.store import alone_in

__all__ = ["fly_missing", "run_campaign"]


def run_campaign(
    planned: Plan,
    folder: Path,
    scheduler: str | None = None,
    jobs: int | None = None,
    on_flown: Callable[[Flown], None] = lambda _: None,
    enough: Callable[[], bool] = lambda: False,
) -> None:
    """Fly what a campaign's folder lacks, store it, and keep the chosen trajectories.

    Args:
        planned: The campaign.
        folder: Its folder, new or to continue.
        scheduler: Address of a dask scheduler whose workers fly; None for workers here.
        jobs: Worker processes here; None for as many as there are cores.
        on_flown: Called with each batch that ended.
        enough: Asked whenever results were stored; True ends the campaign early.

    Raises:
        BadInput: The folder is another campaign's, or the scheduler or a worker cannot be used.
        GcsError: The scheduler was lost; what was flown is stored.
        OSError: A file cannot be written; it is named.
    """
    open_folder(folder, planned)
    fly_missing(planned, folder, scheduler, jobs, on_flown, enough)
    for _ in keep_flights(folder, planned.flights):
        pass


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
        prepare(client, planned.flights.scenario(row_of(planned.draws, int(missing[0]))))
        rows = rows_of(planned.draws.take(missing))
        fly(client, planned.flights, rows, len(missing), folder, on_flown, enough)
