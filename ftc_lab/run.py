"""A campaign, for the command line and for Python: planned and checked, and flown.

`gcs.campaign` is simpler. As in::

    page = run_campaign(load_plan(Path("my.yaml")), Path("runs/mine"))
    table = read_results(Path("runs/mine")).to_pandas()
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from ftc_lab.campaigns.again import keep_flights
from ftc_lab.campaigns.engine import fly_missing
from ftc_lab.campaigns.findings import findings_of
from ftc_lab.campaigns.model import NO_PROGRAMS, Campaign
from ftc_lab.campaigns.plan import Plan, load_plan, plan
from ftc_lab.campaigns.until import begin_campaign
from ftc_lab.campaigns.workers import Flown, check_scheduler
from ftc_lab.reports.campaign import write_report
from gcs.console.errors import BadInput
from gcs.fleet.foreign import check_foreign
from gcs.fleet.preparation import checked
from gcs.scenario.bundled import find_scenario
from gcs.scenario.model import Scenario
from gcs.scenario.settings import plain
from mavlink_defs.config.files import validate


def check_workers(
    jobs: int | None, scheduler: str | None, named: Callable[[str], str] = str
) -> None:
    """Check what is to fly a campaign; arguments as of `run_campaign` and `How`.

    Raises:
        BadInput: It is asked for workers here and elsewhere, or there is no such scheduler.
    """
    if jobs is not None and scheduler is not None:
        text = f"{named('jobs')} starts workers here; {named('scheduler')} has its own"
        raise BadInput(text, "leave one out")
    if scheduler is not None:
        check_scheduler(scheduler)


def planned_campaign(
    campaign: Path | str | Mapping[str, Any],
    draws: int | None = None,
    programs: Mapping[str, str] = NO_PROGRAMS,
) -> tuple[Plan, list[str]]:
    """Return a campaign with all its draws checked, and the remarks on its scenario.

    Args:
        campaign: A file, the name of a bundled one, or what a file has, as a mapping.
        draws: Number of draws instead of the campaign's.
        programs: Files of foreign autopilots, by kind, for the variants of a file that they fly.

    Raises:
        BadInput: It is none of these, or a simulator, a plug-in or a program cannot fly it.
        ConfigError: It cannot be flown; every problem is named.
    """
    if isinstance(campaign, Mapping):
        tree = plain(campaign) | ({} if draws is None else {"draws": draws})
        planned = plan(validate("campaign", tree, Campaign), Path("campaign"))
    elif isinstance(campaign, Path | str):
        planned = load_plan(find_scenario(campaign), draws, programs)
    else:
        kind = type(campaign).__name__
        raise BadInput(f"campaign: expected a name, a path or a mapping, got {kind}")
    for tree in planned.flights.filled.values():
        flying = [tree["autopilot"], *(uav["autopilot"] or {} for uav in tree["uavs"])]
        if any(own.get("kind", "ftc") != "ftc" for own in flying):
            check_foreign(Scenario.model_validate(tree), over_udp=True)
    return planned, [] if planned.example is None else checked(planned.example)


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
    return write_report(findings_of(folder))
