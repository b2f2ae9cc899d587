"""``gcs baseline``: what a trigger saves against periodic senders that are as good."""

import json
import math
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich import box

from ftc_lab.commands.flights import JobsOption
from gcs.commands import common
from gcs.commands.options import options_of, with_options
from gcs.console.errors import BadInput, FlightLost, Interrupted
from gcs.console.lines import print_json
from gcs.console.progress import working
from gcs.console.terminal import console_of, numbers, table_of, texts

if TYPE_CHECKING:
    from ftc_lab.baselines.baseline import Baseline, Uncertain
    from gcs.results.figures import FlightSummary
    from gcs.scenario.model import Scenario

_MAX_PERIOD_US = 1_000_000


@dataclass(frozen=True)
class BaselineOptions:
    """Options of ``gcs baseline``.

    Attributes:
        against: A key of the scenario and its value for the periodic senders, such as their law.
        tolerance: By how much an IAE against the filtered reference may exceed the triggered
            flight's [%].
        longest: Longest period that is flown [ms], 1000 by default; at most the whole flight.
        no_per_channel: Do not search for a period for each channel.
        aircraft: Number of uncertain aircraft to fly as well.
        campaign: Campaign that draws those aircraft: a file, or a bundled one;
            campaigns/uncertainty by default.
        keep: Share of those aircraft that must be kept [%].
        within: An aircraft is kept if no IAE against the filtered reference is larger than this
            multiple of the IAE in the nominal aircraft's triggered flight.
        out: Folder, new or empty; runs/baseline-NAME-DATE-TIME by default.
        as_json: Print baseline.json on standard output instead.
    """

    additions: common.WithOption = None
    settings: common.SetOption = None
    against: Annotated[list[str] | None, typer.Option(metavar="KEY=VALUE")] = None
    tolerance: Annotated[float, typer.Option(min=0.0, metavar="%")] = 1.0
    longest: Annotated[float | None, typer.Option(metavar="MS")] = None
    no_per_channel: Annotated[bool, typer.Option("--no-per-channel")] = False
    aircraft: Annotated[int, typer.Option(min=0, metavar="NUMBER")] = 0
    campaign: Annotated[Path | None, typer.Option(metavar="CAMPAIGN")] = None
    keep: Annotated[float, typer.Option(min=0.0, max=100.0, metavar="%")] = 95.0
    within: Annotated[float, typer.Option(min=1.0, metavar="FACTOR")] = 2.0
    jobs: JobsOption = None
    out: Annotated[Path | None, typer.Option(metavar="FOLDER")] = None
    quiet: common.QuietOption = False
    as_json: Annotated[bool, typer.Option("--json")] = False


@with_options("options", options_of(BaselineOptions), BaselineOptions)
def baseline(scenario: common.ScenarioArgument, *, options: BaselineOptions) -> None:
    """Find the slowest periodic senders that match a flight.

    Flies the scenario with its trigger, then the same law sending by the clock: with one period
    for all channels, with one for each, and, with --aircraft, on aircraft that differ from the
    nominal one. All in process. The folder gets baseline.json and baseline.md.

    Examples:
        - gcs baseline paper/scenario1
        - gcs baseline paper/scenario1 --set controller.kind=pid --no-per-channel
        - gcs baseline paper/scenario1 --against controller.kind=pid
        - gcs baseline paper/scenario1 --aircraft 40 --json | jq .saved

    Exit status: 0 done (that no periodic sender is as good is a result, too), 1 the triggered
    flight was lost or a file cannot be written, 2 bad input, 130 Ctrl-C.
    """
    from ftc_lab.baselines.baseline import Search, find_baseline, find_robust
    from ftc_lab.baselines.senders import periodic_base
    from gcs.fleet.preparation import checked
    from gcs.fleet.warm_up import warm_up
    from gcs.results.run_folder import make_run_folder
    from gcs.scenario.settings import values_of

    console = console_of(quiet=options.quiet)
    triggered = common.changed_scenario(scenario, options.additions, options.settings)
    base = periodic_base(triggered, scenario, values_of(options.against or (), "--against"))
    longest = _longest(triggered, options.longest)
    uncertain = _uncertain(options)
    remarks = checked(triggered)
    folder = make_run_folder(options.out, f"baseline-{triggered.name}")
    common.tell(remarks, console)
    warm_up(None, console)
    pool = ThreadPoolExecutor(options.jobs or os.cpu_count() or 1)
    try:
        with working(console) as work:
            task = work.add("searching for the slowest equal senders", unit="flights")
            reference, ratio = _fly_triggered(triggered), 1.0 + options.tolerance / 100.0
            search = Search(base, reference, ratio, partial(pool.map, _fly), task.advance)
            by_channel = not options.no_per_channel
            found = find_baseline(triggered, search, longest, each_channel=by_channel)
            if uncertain is not None:
                robust = find_robust(triggered, search, uncertain, longest)
                found = replace(found, robustness=robust)
    except KeyboardInterrupt:
        raise Interrupted("interrupted; nothing is stored") from None
    finally:
        pool.shutdown(cancel_futures=True)
    _report(found, folder, options)


def _uncertain(options: BaselineOptions) -> "Uncertain | None":
    """Return the aircraft to fly as well, if any are.

    Raises:
        BadInput: A campaign draws none of them, or cannot be used.
    """
    from ftc_lab.baselines.baseline import Uncertain
    from ftc_lab.campaigns.model import load_campaign
    from gcs.scenario.bundled import find_scenario

    if options.campaign is not None and not options.aircraft:
        raise BadInput("--campaign draws no aircraft", "give their number with --aircraft")
    if not options.aircraft:
        return None
    file = find_scenario(options.campaign or Path("campaigns/uncertainty"))
    campaign = load_campaign(file, draws=options.aircraft)
    return Uncertain(campaign, file, options.within, options.keep / 100.0)


def _fly_triggered(scenario: "Scenario") -> "FlightSummary":
    """Fly what senders are compared with.

    Raises:
        FlightLost: It did not end well.
    """
    from ftc_lab.baselines.senders import worst_ratio

    reference = _fly(scenario)
    if worst_ratio(reference, reference) is None:
        reason = reference.loss or "it lost its attitude or heading"
        raise FlightLost(
            f"the triggered flight is no reference: {reason}",
            "choose a scenario that its law and trigger complete",
        )
    return reference


def _report(found: "Baseline", folder: Path, options: BaselineOptions) -> None:
    """Write the files of the folder, and print the same."""
    from ftc_lab.reports.baseline import COLUMNS, baseline_report, baseline_rows, baseline_sentences
    from ftc_lab.reports.markdown import save_markdown
    from mavlink_defs.config.output_files import write_text

    write_text(folder / "baseline.json", json.dumps(found.to_json(), indent=2) + "\n")
    save_markdown(folder / "baseline.md", baseline_report(found))
    if options.as_json:
        print_json(found.to_json(), indent=2)
        return
    headings = (texts(COLUMNS[0]), *map(numbers, COLUMNS[1:]))
    shown = table_of(*headings, title=f"Baselines of {found.scenario}", box=box.SIMPLE_HEAD)
    for row in baseline_rows(found):
        shown.add_row(*row)
    output = console_of(stderr=False, quiet=options.quiet)
    output.print(shown)
    for sentence in baseline_sentences(found):
        output.print(sentence)
    output.print(f"results in {folder}", soft_wrap=True)


def _longest(scenario: "Scenario", requested_ms: float | None) -> int:
    """Return the longest period in control periods."""
    if requested_ms is None:
        return min(max(round(_MAX_PERIOD_US / scenario.step_us), 1), scenario.steps)
    ratio = 1e3 * requested_ms / scenario.step_us
    steps = round(ratio) if math.isfinite(ratio) else 0
    if not 1 <= steps <= scenario.steps:
        period, whole = scenario.step_us / 1e3, scenario.duration_s * 1e3
        raise BadInput(
            f"--longest is {requested_ms:g} ms, expected from {period:g} ms, the control period, "
            f"to {whole:g} ms, the flight"
        )
    return steps


def _fly(scenario: "Scenario") -> "FlightSummary":
    from gcs.fleet.in_process import fly_in_process
    from gcs.results.summary import summarise

    return summarise(fly_in_process(scenario), scenario)
