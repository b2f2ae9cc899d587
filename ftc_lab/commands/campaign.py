"""``gcs campaign``: fly many draws of a scenario, here or on a cluster."""

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from ftc_lab.commands.flights import JobsOption, fly_plan, interruptible
from gcs.commands.common import QuietOption, option, tell
from gcs.console.errors import BadInput, GcsError
from gcs.console.progress import working
from gcs.console.terminal import Terminal, console_of, numbers, table_of, texts

if TYPE_CHECKING:
    from ftc_lab.campaigns.plan import Plan


def campaign(
    file: Annotated[Path, typer.Argument(metavar="CAMPAIGN")],
    out: Annotated[Path | None, typer.Option(metavar="FOLDER")] = None,
    draws: Annotated[int | None, typer.Option(min=1, metavar="NUMBER")] = None,
    jobs: JobsOption = None,
    scheduler: Annotated[str | None, typer.Option(metavar="tcp://HOST:PORT")] = None,
    until: Annotated[str | None, typer.Option(metavar="CONDITION")] = None,
    autopilot: Annotated[list[str] | None, typer.Option(metavar="KIND=PATH")] = None,
    quiet: QuietOption = False,
) -> None:
    """Fly every draw of a campaign, on all cores or a cluster.

    All draws are checked before the first flight. The folder gets a table in Parquet, one row per
    flight, stored every few seconds: after any interruption, the same command continues there.

    Args:
        file: Campaign: a file, or a bundled one.
        out: Folder of the campaign, new or to continue; runs/campaign-NAME-DIGEST by default, the
            same for the same campaign and code.
        draws: Draws per variant instead of the file's.
        scheduler: Dask scheduler whose workers fly, instead of this machine.
        until: Stop as soon as this is shown or refuted for every variant, as in 'p(attitude_lost) <
            0.05 at 95 %'.
        autopilot: Program of a foreign autopilot, such as ardupilot=PATH, for the variants that it
            flies; may be repeated.

    Examples:
        - gcs campaign campaigns/uncertainty
        - gcs campaign my.yaml --draws 59 --out runs/robust
        - gcs campaign my.yaml --scheduler tcp://cluster:8786
        - gcs campaign my.yaml --until 'p(attitude_lost) < 0.05 at 95 %'
        - gcs campaign campaigns/autopilots --autopilot ardupilot=./arduplane
        - gcs fly --campaign runs/robust --row 17

    Exit status: 0 every draw is flown (lost flights are results, too), 1 a flight could not be
    computed, the scheduler was lost or results cannot be written, 2 bad input, 70 a defect of
    ftc-sitl, 130 Ctrl-C; the same command continues.
    """
    from ftc_lab.campaigns.folder import default_folder
    from ftc_lab.campaigns.until import begin_campaign, stopping_condition, verdict_lines
    from ftc_lab.run import check_workers, planned_campaign

    check_workers(jobs, scheduler, option)
    programs = dict(map(_program, autopilot or ()))
    console = console_of(quiet=quiet)
    with working(console, "checking every draw"):
        planned, remarks = planned_campaign(file, draws, programs)
    tell(remarks, console)
    folder = out or default_folder(planned.mark)
    enough = begin_campaign(planned, folder, until)
    with interruptible(folder, planned.draws.num_rows):
        if not enough():
            fly_plan(planned, folder, jobs, console, scheduler, enough)
        _keep(planned, folder, console)
    if until is not None:
        output = console_of(stderr=False, quiet=quiet)
        for line in verdict_lines(folder, stopping_condition(until, planned.mark.campaign)):
            output.print(line, soft_wrap=True)
    _report(folder, console)


def _program(text: str) -> tuple[str, str]:
    kind, separator, path = text.partition("=")
    if not (kind and separator and path):
        expected = "expected KIND=PATH, such as ardupilot=./arduplane"
        raise BadInput(f"--autopilot is {text!r}, {expected}")
    return kind, str(Path(path).expanduser().absolute())


def _keep(planned: "Plan", folder: Path, console: Terminal) -> None:
    from ftc_lab.campaigns.again import keep_flights

    with working(console) as work:
        task = work.add("flying chosen flights again, for their trajectories", unit="flights")
        for done, chosen in keep_flights(folder, planned.flights):
            task.show(done, total=chosen)


def _report(folder: Path, console: Terminal) -> None:
    from ftc_lab.campaigns.findings import findings_of
    from ftc_lab.campaigns.store import OUTCOMES
    from ftc_lab.reports.campaign import write_report
    from ftc_lab.reports.campaign_laws import hint, same_flights
    from ftc_lab.reports.laws import law_terminal

    found = findings_of(folder)
    samples = found.ended
    counts = {name: Counter(own.outcome.tolist()) for name, own in samples.items()}
    shown = [name for name in OUTCOMES if any(own[name] for own in counts.values())]
    table = table_of(texts("variant"), *(numbers(name.replace("_", " ")) for name in shown))
    for variant, own in counts.items():
        table.add_row(variant, *(str(own[name]) for name in shown))
    output = console_of(stderr=False, quiet=console.quiet)
    output.print(f"All {sum(map(len, samples.values()))} flights that ended:")
    output.print(table)
    for group in same_flights(found):
        output.print(law_terminal([f"of {group.draws} draws"], group.rows, group.laws))
    if add_simpler := hint(found):
        output.print(add_simpler)
    with working(console, "writing the report"):
        page = write_report(found)
    output.print(f"results in {folder}; open {page}", soft_wrap=True)
    failed = [own.take(np.flatnonzero(own.outcome == "failed")) for own in samples.values()]
    if count := sum(map(len, failed)):
        reason = next(own.texts("reason")[0] for own in failed if len(own))
        total = sum(map(len, samples.values()))
        raise GcsError(f"{count} of {total} flights could not be computed: {reason}")
