"""``gcs fly``: fly one scenario to its end."""

import asyncio
import contextlib
import os
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from rich.console import Console

from gcs.commands.common import (
    FreePortsOption,
    ProcessesOption,
    QuietOption,
    Restart,
    RestartOption,
    RunFolderOption,
    SetOption,
    WithOption,
    changed_scenario,
    flight_progress,
    warm_up,
    warn_of_one_path,
)
from gcs.commands.options import SigningKeyOption
from gcs.commands.progress import working
from gcs.errors import BadInput, FlightLost, Interrupted
from gcs.extras import load_lab
from gcs.results.choices import Record
from gcs.scenario.model import Scenario
from gcs.scenario.signing_key import signed
from gcs.station.connection import warn_if_exposed
from gcs.terminal import console_of, print_json
from mavlink_defs.endpoint import UdpAddress

if TYPE_CHECKING:
    from gcs.results.figures import FlightSummary
    from gcs.results.recorder import FlightRecorder
    from gcs.results.recording import Ending, Steps

_LARGE = 100e6  # bytes of a recording that are worth a word
_MANY = 4  # autopilots for each core that are worth another

EPILOG = """
Examples:

- gcs fly paper/scenario1
- gcs fly paper/scenario1 --in-process --json | jq .saving
- gcs fly my.yaml --speed 1 --out runs/demo
- gcs fly faults/loe_aileron --with realistic --set sensors.gyro_deg_s.noise_rms=0.1
- gcs fly --campaign runs/robust --row 17 --in-process

Exit status: 0 flown to its end, 1 lost, stopped early or not recorded, 2 bad input, 3 a vehicle
refused something, 4 a vehicle did not answer, 130 Ctrl-C (143 SIGTERM, 129 SIGHUP).
"""


def fly(
    scenario: Annotated[
        Path | None, typer.Argument(help="Scenario: a file, or a bundled one.", metavar="SCENARIO")
    ] = None,
    additions: WithOption = None,
    settings: SetOption = None,
    out: RunFolderOption = None,
    speed: Annotated[
        float | None,
        typer.Option(
            help="Real-time factor: 1 is real time, 0.5 half of it. "
            "Without it: lockstep, as fast as the machine allows.",
            metavar="FACTOR",
        ),
    ] = None,
    in_process: Annotated[
        bool,
        typer.Option("--in-process", help="Plant and controllers in one process, without links."),
    ] = False,
    restart: RestartOption = Restart.NEVER,
    processes: ProcessesOption = None,
    free_ports: FreePortsOption = False,
    record: Annotated[
        Record,
        typer.Option(
            help="What is kept of the steps: all at full rate, the main signals at 50 Hz, all as "
            ".npz (in memory until the end), or nothing."
        ),
    ] = Record.LIGHT,
    quiet: QuietOption = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print summary.json on standard output instead.")
    ] = False,
    signing_key: SigningKeyOption = None,
    campaign: Annotated[
        Path | None,
        typer.Option(help="Folder of a campaign, instead of a scenario.", metavar="FOLDER"),
    ] = None,
    row: Annotated[
        int | None,
        typer.Option(
            help="Row of the campaign's table: the flight to fly again.", metavar="NUMBER"
        ),
    ] = None,
) -> None:
    """Fly a scenario to its end and record it.

    Starts one plant and an autopilot process for each UAV, uploads profile or mission, sets the
    faults, starts the missions and arms, all by MAVLink over UDP. The run folder gets summary.json,
    flight.tlog (the GCS link), events.arrows, trajectory.arrows, flight.png and flight.svg;
    with a mission mission.png and mission.svg, too.

    The figures of summary.json are those of every step, whatever is recorded.

    With --campaign and --row, a flight of a campaign is flown again, over the wire or in process,
    and compared with its row of the table, bit for bit.
    """
    if speed is not None and not 0.0 < speed < float("inf"):
        raise BadInput(f"--speed is {speed:g}, expected a factor above 0", "1 is real time")
    again = restart is Restart.ON_FAILURE
    if again and in_process:
        text = "--restart is about processes; --in-process has none"
        raise BadInput(text, "leave one of them out")
    if speed is not None and in_process:
        raise BadInput("--speed paces processes; --in-process has none", "leave one of them out")
    if processes is not None and (in_process or speed is not None or again):
        raise BadInput(
            f"--autopilot-processes is {processes}: autopilots share processes only in lockstep "
            "over UDP, where a step waits for all of them, and end together",
            "leave it out, or --in-process, --speed or --restart",
        )
    from gcs.fleet.in_process import fly_in_steps
    from gcs.fleet.processes import check_ports
    from gcs.results.disk_space import check_space
    from gcs.results.recorder import FlightRecorder, trajectory_bytes
    from gcs.results.run_folder import make_run_folder

    if campaign is None and row is None and scenario is not None:
        chosen = changed_scenario(scenario, additions, settings)
    else:
        chosen = _of_campaign(scenario, campaign, row, [*(additions or ()), *(settings or ())])
    loaded = signed(chosen, signing_key)
    if in_process and loaded.links.impairments is not None:
        text = "links.impairments are about the wire; --in-process has none"
        raise BadInput(text, "leave one of them out")
    if not (free_ports or in_process):
        check_ports(loaded)
    folder = make_run_folder(out, loaded.name)
    console = console_of(quiet=quiet)
    try:
        check_space(folder, loaded, record, over_udp=not in_process, restart=again)
        recorder = FlightRecorder(loaded, folder, record)
        if (size := trajectory_bytes(loaded, record)) > _LARGE:
            console.print(f"recording the trajectory takes up to {size / 1e6:.0f} MB")
        with contextlib.closing(recorder):
            warn_of_one_path(loaded, console)
            warm_up(loaded, console)
            if not in_process and speed is None and not again and processes is None:
                _tell_faster_way(len(loaded.uavs), console)
            with flight_progress(loaded, console) as on_progress:
                if in_process:
                    recorder.load_code()
                    ending = fly_in_steps(loaded, recorder.add, on_progress)
                else:
                    threading.Thread(target=_load_ahead, args=(recorder,), daemon=True).start()
                    options = {"restart": again, "autopilot_processes": processes}
                    ending = _over_udp(
                        loaded, folder, recorder.add, speed, free_ports, on_progress, options
                    )
            flown = None if speed is not None or campaign is None else (campaign, row or 0)
            _report(recorder, ending, loaded, folder, console, as_json, flown)
    except KeyboardInterrupt:
        raise Interrupted(f"interrupted; what was recorded is in {folder}") from None
    except FlightLost as problem:
        problem.hint = f"what was recorded is in {folder}"
        raise


def _tell_faster_way(uavs: int, console: Console) -> None:
    """Tell how a large fleet flies faster than with a process for each autopilot."""
    cores = os.cpu_count() or 1
    if uavs >= _MANY * cores:
        console.print(
            f"{uavs} autopilots share {cores} cores: they fly faster with "
            f"--autopilot-processes {cores}",
            highlight=False,
        )


def _of_campaign(
    scenario: Path | None, campaign: Path | None, row: int | None, changes: list[str]
) -> Scenario:
    """Return the scenario of a campaign's row, which is flown as it was."""
    if scenario is not None or campaign is None or row is None:
        raise BadInput(
            "expected either a SCENARIO, or --campaign FOLDER and --row NUMBER",
            "as in gcs fly paper/scenario1, or gcs fly --campaign runs/robust --row 17",
        )
    if changes:
        raise BadInput(
            "--with and --set change a SCENARIO; a row of a campaign is flown as it was",
            "leave them out",
        )
    again: Scenario = load_lab("campaigns.again").scenario_of_row(campaign, row)
    return again


def _load_ahead(recorder: "FlightRecorder") -> None:
    """Load the recorder's code while the fleet starts; what fails is told when it is needed."""
    with contextlib.suppress(Exception):
        recorder.load_code()


def _over_udp(
    scenario: Scenario,
    folder: Path,
    on_steps: Callable[["Steps"], None],
    speed: float | None,
    free_ports: bool,
    on_progress: Callable[[float, np.ndarray], None],
    options: dict[str, Any],
) -> "Ending":
    from gcs.fleet.flight import fly_over_udp
    from gcs.fleet.processes import on_free_ports

    def flown(scenario: Scenario, _hub: UdpAddress | None = None) -> "Ending":
        links = scenario.links
        warn_if_exposed(UdpAddress(links.host, links.gcs_port), links.signing_key is not None)
        return asyncio.run(fly_over_udp(scenario, folder, on_steps, speed, on_progress, **options))

    return on_free_ports(scenario, flown) if free_ports else flown(scenario)


def _report(
    recorder: "FlightRecorder",
    ending: "Ending",
    scenario: Scenario,
    folder: Path,
    console: Console,
    as_json: bool,
    again: tuple[Path, int] | None,
) -> None:
    from gcs.figures.mission import draw_mission
    from gcs.figures.overview import draw_flight
    from gcs.reports.flight import flight_tables
    from gcs.results.path_following import leaders_of, paths_of

    summary = recorder.finish(ending)
    with working(console, "drawing the flight"):
        preview = recorder.preview
        shown = preview.recording(ending)
        draw_flight(shown, scenario, preview.gaps(), folder)
        if (paths := paths_of(scenario)) is not None:
            draw_mission(shown, scenario, paths, leaders_of(scenario), folder)
    output = console_of(stderr=as_json, quiet=console.quiet)  # --json leaves no room for it
    if as_json:
        print_json(summary.to_json(), indent=2)
    else:
        output.print(*flight_tables(summary, scenario), sep="\n")
    output.print(f"results in {folder}", soft_wrap=True)
    if again is not None:
        _compare(*again, summary, output)
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
