"""Campaigns from Python."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gcs.console.errors import python_errors
from gcs.console.extras import load_lab
from gcs.console.progress import working
from gcs.console.terminal import console_of
from gcs.fleet.remarks import warn
from gcs.fleet.warm_up import warm_up

if TYPE_CHECKING:
    import pyarrow as pa


def campaign(
    campaign: Path | str | Mapping[str, Any],
    *,
    out: Path | str | None = None,
    draws: int | None = None,
    jobs: int | None = None,
    scheduler: str | None = None,
    until: str | None = None,
    progress: bool = True,
) -> "pa.Table":
    """Fly a campaign as `gcs campaign` does, and return its results.

    What its folder has already is not flown again. The folder gets a report, too.

    Args:
        campaign: A file, the name of a bundled one, or what a file has, as a mapping.
        out: Its folder, new or to continue; None for the one of the same campaign below `runs`.
        draws: Number of draws instead of the campaign's.
        jobs: Worker processes here; None for as many as there are cores.
        scheduler: Address of a dask scheduler whose workers fly; None for workers here.
        until: Condition that ends the campaign as soon as it is decided, as of ``--until``.
        progress: Whether progress is shown on standard error.

    Returns:
        The results, one row per flight: what was drawn, `outcome`, and figures; see
        `ftc_lab.campaigns.store.results_schema`. ``.to_pandas()`` makes a frame of it.

    Raises:
        BadInput: The campaign or an argument cannot be used, or the extra `lab` is missing; with
            the text of the command line.
        GcsError: The scheduler was lost; what was flown is stored.
        OSError: A file cannot be written; it is named.
    """
    with python_errors():
        run = load_lab("run", "gcs.campaign")
        run.check_workers(jobs, scheduler)
        planned, remarks = run.planned_campaign(campaign, draws)
        warn(remarks)
        console = console_of(quiet=not progress)
        if planned.example is not None:
            warm_up(None, console)
        folder = Path(out or load_lab("campaigns.folder").default_folder(planned.mark))
        with working(console) as work:
            task = work.add("flying", planned.draws.num_rows, "flights")

            def count(flown: Any) -> None:
                task.show(task.done + flown.rows.num_rows)

            run.run_campaign(planned, folder, scheduler, jobs, until, count)
        return load_lab("campaigns.store").read_results(folder)
