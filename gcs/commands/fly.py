"""``gcs fly``: fly one scenario to its end."""

import contextlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from gcs.commands import common
from gcs.commands.drawing import FlightDrawing, drawn
from gcs.commands.options import options_of, with_options
from gcs.console.errors import BadInput, FlightLost, Interrupted
from gcs.console.extras import load_lab
from gcs.console.lines import print_json
from gcs.console.progress import working
from gcs.console.terminal import console_of
from gcs.results.choices import Record
from gcs.scenario.model import Scenario

if TYPE_CHECKING:
    from gcs.fleet.preparation import Prepared
    from gcs.results.figures import FlightSummary
    from gcs.results.recorder import FlightRecorder
    from gcs.results.recording import Ending


@dataclass(frozen=True)
class FlyOptions(common.FleetOptions):
    """Options of ``gcs fly``.

    Attributes:
        speed: Real-time factor: 1 is real time, 0.5 half of it. Without it: lockstep, as fast as
            the machine allows.
        in_process: Plant and controllers in one process, without links.
        record: What is recorded of the steps: all at full rate, the main signals at 50 Hz, all as
            .npz (in memory until the end), or nothing.
        no_figures: Draw no figures, which saves about a second.
        as_json: Print summary.json on standard output instead.
        campaign: Folder of a campaign, instead of a scenario.
        row: Row of the campaign's table: the flight to fly again.
    """

    speed: Annotated[float | None, typer.Option(metavar="FACTOR")] = None
    in_process: Annotated[bool, typer.Option("--in-process")] = False
    restart: common.RestartOption = common.Restart.NEVER
    record: Annotated[Record, typer.Option()] = Record.LIGHT
    no_figures: Annotated[bool, typer.Option("--no-figures", envvar="FTC_SITL_NO_FIGURES")] = False
    as_json: Annotated[bool, typer.Option("--json")] = False
    campaign: Annotated[Path | None, typer.Option(metavar="FOLDER")] = None
    row: Annotated[int | None, typer.Option(metavar="NUMBER")] = None


@with_options("options", options_of(FlyOptions), FlyOptions)
def fly(
    scenario: Annotated[Path | None, typer.Argument(metavar="SCENARIO")] = None,
    *,
    options: FlyOptions,
) -> None:
    """Fly a scenario to its end and record it.

    Starts a plant and an autopilot process for each UAV, uploads profile or mission, sets the
    faults, starts the missions and arms, all by MAVLink over UDP. The run folder gets
    scenario.yaml, summary.json (of every step), flight.tlog (the GCS link), events.arrows,
    trajectory.arrows and the figures. With --campaign and --row, a flight of a campaign is flown
    again, and compared with its row of the table, bit for bit.

    Args:
        scenario: Scenario: a file, or a bundled one.

    Examples:
        - gcs fly paper/scenario1
        - gcs fly paper/scenario1 --in-process --json | jq .saving
        - gcs fly my.yaml --speed 1 --out runs/demo
        - gcs fly faults/loe_aileron --with realistic --set trigger.b2_deg=0.5
        - gcs fly --campaign runs/robust --row 17 --in-process

    Exit status: 0 flown to its end, 1 lost, stopped early or not recorded, 2 bad input, 3 a vehicle
    refused something, 4 a vehicle did not answer, 130 Ctrl-C (143 SIGTERM, 129 SIGHUP).
    """
    from gcs.results.run_folder import make_run_folder

    flight = common.prepared(
        _scenario(scenario, options),
        options,
        "fly",
        f"{options.campaign} row {options.row}" if scenario is None else str(scenario),
        over_udp=not options.in_process,
        speed=options.speed,
        restart=options.restart is common.Restart.ON_FAILURE,
        record=options.record,
    )
    folder = make_run_folder(options.out, flight.scenario.name)
    try:
        _fly(flight, folder, options)
    except KeyboardInterrupt:
        raise Interrupted(f"interrupted; what was recorded is in {folder}") from None
    except FlightLost as problem:
        problem.hint = f"what was recorded is in {folder}"
        raise


def _scenario(scenario: Path | None, options: FlyOptions) -> Scenario | Path:
    """Return the scenario to fly, or a campaign row's, which is flown as it was."""
    if options.campaign is None and options.row is None and scenario is not None:
        return scenario
    if scenario is not None or options.campaign is None or options.row is None:
        raise BadInput(
            "expected either a SCENARIO, or --campaign FOLDER and --row NUMBER",
            "as in gcs fly paper/scenario1, or gcs fly --campaign runs/robust --row 17",
        )
    if options.additions or options.settings:
        raise BadInput(
            "--with and --set change a SCENARIO; a row of a campaign is flown as it was",
            "leave them out",
        )
    again: Scenario = load_lab("campaigns.again").scenario_of_row(options.campaign, options.row)
    return again


def _fly(flight: "Prepared", folder: Path, options: FlyOptions) -> None:
    from gcs.fleet.flying import fly as fly_prepared
    from gcs.fleet.flying import recorded
    from gcs.fleet.warm_up import warm_up

    scenario, console = flight.scenario, console_of(quiet=options.quiet)
    with (
        contextlib.nullcontext() if options.no_figures else drawn(scenario, folder) as drawing,
        recorded(flight, folder) as recorder,
    ):
        common.tell(flight.remarks, console)
        warm_up(scenario, console, in_process=options.in_process)
        with common.flight_progress(scenario, console) as shown:
            ending = fly_prepared(flight, recorder, folder, shown, shown.starts)
        _report(recorder, ending, scenario, folder, console, options, drawing)


def _report(
    recorder: "FlightRecorder",
    ending: "Ending",
    scenario: Scenario,
    folder: Path,
    console: Console,
    options: FlyOptions,
    drawing: FlightDrawing | None,
) -> None:
    from gcs.reports.flight import flight_tables

    summary = recorder.finish(ending)
    if drawing is not None:
        drawing.begin(recorder.preview.recording(ending), recorder.preview.gaps())
    output = console_of(stderr=options.as_json, quiet=console.quiet)  # --json leaves no room for it
    if options.as_json:
        print_json(summary.to_json(), indent=2)
    else:
        output.print(*flight_tables(summary, scenario), sep="\n")
    output.print(f"results in {folder}", soft_wrap=True)
    if drawing is not None:
        with working(console, "drawing the flight"):
            drawing.finish()
    if options.campaign is not None and options.speed is None:
        _compare(options.campaign, options.row or 0, summary, output)
    if summary.loss is not None:
        raise FlightLost(summary.loss)


def _compare(campaign: Path, row: int, summary: "FlightSummary", console: Console) -> None:
    """Compare a flight flown again with the campaign's table; other code may fly otherwise."""
    again = load_lab("campaigns.again")
    if (foreign := again.foreign_code(campaign)) is not None:
        console.print(f"not compared with {campaign}: {foreign}", soft_wrap=True)
        return
    again.check_same(campaign, row, summary)
    console.print(f"the same as row {row} of {campaign}, bit for bit", soft_wrap=True)
