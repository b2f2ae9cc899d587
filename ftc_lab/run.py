"""A campaign from Python: what ``gcs campaign`` does, without the terminal.

`gcs.campaign` is simpler. As in::

    page = run_campaign(load_plan(Path("my.yaml")), Path("runs/mine"))
    table = read_results(Path("runs/mine")).to_pandas()
"""

from collections.abc import Callable
from pathlib import Path

from ftc_lab.campaigns.again import keep_flights
from ftc_lab.campaigns.engine import fly_missing
from ftc_lab.campaigns.plan import Plan
from ftc_lab.campaigns.until import begin_campaign
from ftc_lab.campaigns.workers import Flown
from ftc_lab.reports.campaign import write_report


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
        planned: The campaign, as `ftc_lab.campaigns.plan.load_plan` returns it.
        folder: Its folder, new or to continue.
        scheduler: Address of a dask scheduler whose workers fly; None for workers here.
        jobs: Worker processes here; None for as many as there are cores.
        until: Condition that ends the campaign as soon as it is decided for every variant, as in
            "p(attitude_lost) < 0.05 at 95 %"; None to fly every draw.
        on_flown: Called with each batch that ended.

    Returns:
        The path of report.html. The table is read by `ftc_lab.campaigns.store.read_results`.

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
