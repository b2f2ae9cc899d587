"""``gcs reproduce``: the paper's scenarios, tables and figures."""

import os
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gcs.commands.common import QuietOption
from gcs.commands.options import options_of, with_options
from gcs.console.errors import FlightLost, Interrupted
from gcs.console.progress import working
from gcs.console.terminal import console_of
from gcs.fleet.warm_up import warm_up
from gcs.scenario.bundled import SCENARIOS

if TYPE_CHECKING:
    from collections.abc import Callable

    from gcs.results.recording import Recording
    from gcs.scenario.model import Scenario


@dataclass(frozen=True)
class ReproduceOptions:
    """Options of ``gcs reproduce``.

    Attributes:
        out: Folder, new or empty; runs/reproduce-DATE-TIME by default.
        over_wire: Fly with processes over MAVLink, one after the other.
        faults: Also fly every bundled fault file with every law and trigger: takes minutes.
        scenarios: Folder with the paper's scenario files; the bundled ones by default.
    """

    out: Annotated[Path | None, typer.Option(metavar="FOLDER")] = None
    over_wire: Annotated[bool, typer.Option("--over-wire")] = False
    faults: Annotated[bool, typer.Option("--faults")] = False
    scenarios: Annotated[Path, typer.Option(show_default=False, metavar="FOLDER")] = (
        SCENARIOS / "paper"
    )
    quiet: QuietOption = False


@with_options("options", options_of(ReproduceOptions), ReproduceOptions)
def reproduce(*, options: ReproduceOptions) -> None:
    """Fly the paper's scenarios, compare with its results.

    For a second chapter of the report, every law is flown with every trigger, on ideal and on
    realistic aircraft, always in process. Writes one folder: report.html (self-contained) and
    report.md, figures/ (Fig. 5 to 11 and combinations, as PNG and SVG), data/ (each of the paper's
    flights as .npz and .csv, its summary, theory.json, combinations.csv).

    Examples:
        - gcs reproduce
        - gcs reproduce --out results && xdg-open results/report.html
        - gcs reproduce --over-wire
        - gcs reproduce --faults

    Exit status: 0 everything flown to its end, 1 a flight was lost (the report says which) or a
    file cannot be written, 2 bad input, 130 Ctrl-C.
    """
    from ftc_lab import reproduce as work
    from gcs.results.run_folder import make_run_folder

    loaded = work.load_all(options.scenarios)
    folder = make_run_folder(options.out, "reproduce")
    console = console_of(quiet=options.quiet)
    warm_up(None, console)
    begin = time.monotonic()
    try:
        with working(console) as shown:
            task = shown.add("flying and drawing", work.steps(loaded), "steps")
            done = work.reproduce(
                loaded,
                _over_wire(folder) if options.over_wire else _in_process,
                1 if options.over_wire else os.cpu_count() or 1,
                folder,
                task.advance,
                faults=options.faults,
            )
    except KeyboardInterrupt:
        raise Interrupted(f"interrupted; finished flights are in {folder}") from None
    seconds = time.monotonic() - begin
    console_of(stderr=False, quiet=options.quiet).print(
        f"{done.flights} flights, {len(done.summaries)} of them the paper's, in {seconds:.1f} s; "
        f"open {folder}/report.html",
        soft_wrap=True,
    )
    lost = [f"{s.scenario}: {s.loss}" for s in done.summaries.values() if s.loss]
    if lost:
        raise FlightLost("; ".join(lost), f"the report is in {folder}")


def _in_process(file: str, scenario: "Scenario") -> "Recording":
    from gcs.fleet.in_process import fly_in_process

    return fly_in_process(scenario)


def _over_wire(folder: Path) -> "Callable[[str, Scenario], Recording]":
    """Fly with processes; each flight's tlog and logs go into a folder of its own."""
    from gcs.fleet.flight import fly_and_record

    def fly(file: str, scenario: "Scenario") -> "Recording":
        own = folder / "wire" / file
        own.mkdir(parents=True)
        return fly_and_record(scenario, own)

    return fly
