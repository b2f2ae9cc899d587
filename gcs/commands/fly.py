"""``gcs fly``: fly one scenario to its end."""

import asyncio
import contextlib
import os
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from gcs.commands.common import (
    FleetOptions,
    Restart,
    RestartOption,
    changed_scenario,
    check_simulators,
    check_speed,
    flight_progress,
    tell_heading,
    warm_up,
    warn_of_one_path,
    warn_of_sensors,
)
from gcs.commands.options import options_of, with_options
from gcs.commands.progress import working
from gcs.errors import BadInput, FlightLost, Interrupted
from gcs.extras import load_lab
from gcs.results.choices import Record
from gcs.scenario.model import Scenario
from gcs.scenario.settings import values_of
from gcs.scenario.signing_key import signed
from gcs.station.connection import warn_if_exposed
from gcs.terminal import console_of, print_json
from mavlink_defs.endpoint import UdpAddress

if TYPE_CHECKING:
    from gcs.results.figures import FlightSummary
    from gcs.results.recorder import FlightRecorder
    from gcs.results.recording import Ending

_LARGE = 100e6  # bytes of a recording that are worth a word
_MANY = 4  # autopilots for each core that are worth another

EPILOG = """
Examples:

- gcs fly paper/scenario1
- gcs fly paper/scenario1 --in-process --json | jq .saving
- gcs fly my.yaml --speed 1 --out runs/demo
- gcs fly faults/loe_aileron --with realistic --set trigger.b2_deg=0.5
- gcs fly --campaign runs/robust --row 17 --in-process

Exit status: 0 flown to its end, 1 lost, stopped early or not recorded, 2 bad input, 3 a vehicle
refused something, 4 a vehicle did not answer, 130 Ctrl-C (143 SIGTERM, 129 SIGHUP).
"""


@dataclass(frozen=True)
class FlyOptions(FleetOptions):
    """Options of ``gcs fly``."""

    speed: Annotated[
        float | None,
        typer.Option(
            help="Real-time factor: 1 is real time, 0.5 half of it. "
            "Without it: lockstep, as fast as the machine allows.",
            metavar="FACTOR",
        ),
    ] = None
    in_process: Annotated[
        bool,
        typer.Option("--in-process", help="Plant and controllers in one process, without links."),
    ] = False
    restart: RestartOption = Restart.NEVER
    record: Annotated[
        Record,
        typer.Option(
            help="What is recorded of the steps: all at full rate, the main signals at 50 Hz, all "
            "as .npz (in memory until the end), or nothing."
        ),
    ] = Record.LIGHT
    no_figures: Annotated[
        bool,
        typer.Option(
            "--no-figures",
            envvar="FTC_SITL_NO_FIGURES",
            help="Draw no figures, which saves about a second.",
        ),
    ] = False
    as_json: Annotated[
        bool, typer.Option("--json", help="Print summary.json on standard output instead.")
    ] = False
    campaign: Annotated[
        Path | None,
        typer.Option(help="Folder of a campaign, instead of a scenario.", metavar="FOLDER"),
    ] = None
    row: Annotated[
        int | None,
        typer.Option(
            help="Row of the campaign's table: the flight to fly again.", metavar="NUMBER"
        ),
    ] = None

    @property
    def restarts(self) -> bool:
        """Whether autopilots that fail are started again."""
        return self.restart is Restart.ON_FAILURE

    @property
    def can_share(self) -> bool:
        """Whether autopilots can share processes: in lockstep over UDP, without restarts."""
        return not (self.in_process or self.restarts) and self.speed is None

    def check(self) -> None:
        """Check that the options go together.

        Raises:
            BadInput: They do not.
        """
        check_speed(self.speed)
        if self.restarts and self.in_process:
            text = "--restart applies to processes; --in-process has none"
            raise BadInput(text, "leave one of them out")
        if self.speed is not None and self.in_process:
            text = "--speed paces processes; --in-process has none"
            raise BadInput(text, "leave one of them out")
        if self.processes is not None and not self.can_share:
            raise BadInput(
                f"--autopilot-processes is {self.processes}: autopilots share processes only in "
                "lockstep over UDP, where a step waits for all of them, and end together",
                "leave it out, or --in-process, --speed or --restart",
            )


@with_options("options", options_of(FlyOptions), FlyOptions)
def fly(
    scenario: Annotated[
        Path | None, typer.Argument(help="Scenario: a file, or a bundled one.", metavar="SCENARIO")
    ] = None,
    *,
    options: FlyOptions,
) -> None:
    """Fly a scenario to its end and record it.

    Starts a plant and an autopilot process for each UAV, uploads profile or mission, sets the
    faults, starts the missions and arms, all by MAVLink over UDP. The run folder gets
    scenario.yaml, summary.json (of every step), flight.tlog (the GCS link), events.arrows,
    trajectory.arrows and the figures. With --campaign and --row, a flight of a campaign is flown
    again, and compared with its row of the table, bit for bit.
    """
    options.check()
    from gcs.fleet.ports import check_ports
    from gcs.results.disk_space import check_space
    from gcs.results.flight_mark import FlightMark, marked
    from gcs.results.recorder import FlightRecorder, trajectory_bytes
    from gcs.results.run_folder import make_run_folder

    loaded = signed(_scenario(scenario, options), options.signing_key)
    named = f"{options.campaign} row {options.row}" if scenario is None else str(scenario)
    values = values_of(options.settings or ())
    mark = FlightMark.of("fly", named, loaded, options.additions, values)
    if options.in_process and loaded.links.impairments is not None:
        text = "links.impairments apply to the wire; --in-process has none"
        raise BadInput(text, "leave one of them out")
    if not (options.free_ports or options.in_process):
        check_ports(loaded)
    check_simulators(loaded)
    folder = make_run_folder(options.out, loaded.name)
    console = console_of(quiet=options.quiet)
    record, over_udp = options.record, not options.in_process
    try:
        check_space(folder, loaded, record, over_udp=over_udp, restart=options.restarts)
        if (size := trajectory_bytes(loaded, record)) > _LARGE:
            console.print(f"recording the trajectory needs up to {size / 1e6:.0f} MB")
        with (
            marked(folder, loaded, mark),
            contextlib.closing(FlightRecorder(loaded, folder, record)) as recorder,
        ):
            warn_of_one_path(loaded, console)
            warn_of_sensors(loaded, console)
            tell_heading(loaded, console)
            warm_up(loaded, console)
            if options.can_share and options.processes is None:
                _suggest_sharing(len(loaded.uavs), console)
            ending = _fly(loaded, folder, recorder, options, console)
            _report(recorder, ending, loaded, folder, console, options)
    except KeyboardInterrupt:
        raise Interrupted(f"interrupted; what was recorded is in {folder}") from None
    except FlightLost as problem:
        problem.hint = f"what was recorded is in {folder}"
        raise


def _suggest_sharing(uavs: int, console: Console) -> None:
    """Say how a large fleet flies faster than with a process for each autopilot."""
    cores = os.cpu_count() or 1
    if uavs >= _MANY * cores:
        console.print(
            f"{uavs} autopilots share {cores} cores: they fly faster with "
            f"--autopilot-processes {cores}",
            highlight=False,
        )


def _scenario(scenario: Path | None, options: FlyOptions) -> Scenario:
    """Return the scenario to fly, or a campaign row's, which is flown as it was."""
    if options.campaign is None and options.row is None and scenario is not None:
        return changed_scenario(scenario, options.additions, options.settings)
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


def _load_ahead(recorder: "FlightRecorder") -> None:
    """Load the recorder's code while the fleet starts; a failure is reported when it is needed."""
    with contextlib.suppress(Exception):
        recorder.load_code()


def _fly(
    scenario: Scenario,
    folder: Path,
    recorder: "FlightRecorder",
    options: FlyOptions,
    console: Console,
) -> "Ending":
    from gcs.fleet.flight import fly_over_udp
    from gcs.fleet.in_process import fly_in_steps
    from gcs.fleet.ports import on_free_ports

    with flight_progress(scenario, console) as on_progress:
        if options.in_process:
            recorder.load_code()
            return fly_in_steps(scenario, recorder.add, on_progress)
        threading.Thread(target=_load_ahead, args=(recorder,), daemon=True).start()

        def flown(scenario: Scenario, _hub: UdpAddress | None = None) -> "Ending":
            links = scenario.links
            gcs = UdpAddress(links.host, links.gcs_port)
            warn_if_exposed(gcs, links.signing_key is not None)
            flight = fly_over_udp(
                scenario,
                folder,
                recorder.add,
                options.speed,
                on_progress,
                on_start=on_progress.starts,
                restart=options.restarts,
                autopilot_processes=options.processes,
            )
            return asyncio.run(flight)

        return on_free_ports(scenario, flown) if options.free_ports else flown(scenario)


def _report(
    recorder: "FlightRecorder",
    ending: "Ending",
    scenario: Scenario,
    folder: Path,
    console: Console,
    options: FlyOptions,
) -> None:
    from gcs.reports.flight import flight_tables

    summary = recorder.finish(ending)
    if not options.no_figures:
        with working(console, "drawing the flight"):
            _draw(recorder, ending, scenario, folder)
    output = console_of(stderr=options.as_json, quiet=console.quiet)  # --json leaves no room for it
    if options.as_json:
        print_json(summary.to_json(), indent=2)
    else:
        output.print(*flight_tables(summary, scenario), sep="\n")
    output.print(f"results in {folder}", soft_wrap=True)
    if options.campaign is not None and options.speed is None:
        _compare(options.campaign, options.row or 0, summary, output)
    if summary.loss is not None:
        raise FlightLost(summary.loss)


def _draw(recorder: "FlightRecorder", ending: "Ending", scenario: Scenario, folder: Path) -> None:
    from gcs.figures.mission import draw_mission
    from gcs.figures.overview import draw_flight
    from gcs.results.path_following import leaders_of, paths_of

    preview = recorder.preview
    shown = preview.recording(ending)
    draw_flight(shown, scenario, preview.gaps(), folder)
    if (paths := paths_of(scenario)) is not None:
        draw_mission(shown, scenario, paths, leaders_of(scenario), folder)


def _compare(campaign: Path, row: int, summary: "FlightSummary", console: Console) -> None:
    """Compare a flight flown again with the campaign's table; other code may fly otherwise."""
    again = load_lab("campaigns.again")
    if (foreign := again.foreign_code(campaign)) is not None:
        console.print(f"not compared with {campaign}: {foreign}", soft_wrap=True)
        return
    again.check_same(campaign, row, summary)
    console.print(f"the same as row {row} of {campaign}, bit for bit", soft_wrap=True)
