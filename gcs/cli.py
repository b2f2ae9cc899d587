"""The command line: ``gcs``."""

import asyncio
import contextlib
import json
import os
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from gcs.errors import BadInput, FlightLost, GcsError, Interrupted
from gcs.scenario import Scenario, load_scenario
from mavlink_defs.config import ConfigError
from mavlink_defs.jit import cache_is_cold, mark_cache_warm

__all__ = ["app", "main"]

_EXIT_DEFECT = 70

app = typer.Typer(
    help="Ground station of ftc-sitl: fly a UAV formation over real MAVLink.",
    no_args_is_help=True,
    add_completion=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
)


@app.callback()
def gcs() -> None:
    """Ground station of ftc-sitl: fly a UAV formation over real MAVLink."""


@app.command(
    epilog="""
Examples:

- gcs fly scenarios/paper/scenario1.yaml
- gcs fly scenarios/paper/scenario1.yaml --in-process --json | jq .saving
- gcs fly my.yaml --speed 1 --out runs/demo

Exit status: 0 flown to its end, 1 lost or stopped early, 2 bad input, 130 Ctrl-C.
"""
)
def fly(
    scenario: Annotated[Path, typer.Argument(help="Scenario file (YAML).", metavar="SCENARIO")],
    out: Annotated[
        Path | None,
        typer.Option(help="Run folder, new or empty; runs/NAME-DATE-TIME by default."),
    ] = None,
    speed: Annotated[
        float | None,
        typer.Option(
            help="Real-time factor: 1 is real time, 0.5 half of it. "
            "Without it: lockstep, as fast as the machine goes.",
            metavar="FACTOR",
        ),
    ] = None,
    in_process: Annotated[
        bool, typer.Option("--in-process", help="Plant and controllers in one process, no wire.")
    ] = False,
    free_ports: Annotated[
        bool,
        typer.Option("--free-ports", help="Use free UDP ports instead of the scenario's."),
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print summary.json on standard output instead.")
    ] = False,
) -> None:
    """Fly a scenario to its end and write down everything.

    Starts one plant and one autopilot process per UAV, uploads the profiles, sets the faults,
    starts the missions and arms, all by MAVLink over UDP. The run folder gets summary.json,
    flight.tlog (the GCS link), events.npz, trajectory.npz and flight.png.
    """
    if speed is not None and not 0.0 < speed < float("inf"):
        raise BadInput(f"--speed is {speed:g}, expected a factor above 0", "1 is real time")
    if speed is not None and in_process:
        raise BadInput("--speed paces processes; --in-process has none", "leave one of them out")
    from gcs.launcher import check_ports, on_free_ports  # noqa: PLC0415 - numba comes with it
    from gcs.run_folder import make_run_folder  # noqa: PLC0415

    loaded = load_scenario(scenario)
    if free_ports:
        loaded = on_free_ports(loaded)
    elif not in_process:
        check_ports(loaded)
    folder = make_run_folder(out, loaded.name)
    console = Console(stderr=True, quiet=quiet or as_json)
    try:
        _fly(loaded, folder, speed, in_process, console, as_json)
    except KeyboardInterrupt:
        raise Interrupted(f"interrupted; what was recorded is in {folder}") from None


def _fly(
    scenario: Scenario,
    folder: Path,
    speed: float | None,
    in_process: bool,
    console: Console,
    as_json: bool,
) -> None:
    from gcs.closed_loop import fly_in_process  # noqa: PLC0415 - numba comes with it
    from gcs.figure import draw_flight  # noqa: PLC0415
    from gcs.flight import fly_over_udp  # noqa: PLC0415
    from gcs.report import flight_tables  # noqa: PLC0415
    from gcs.run_folder import save_flight  # noqa: PLC0415
    from gcs.summary import summarise  # noqa: PLC0415

    _warm_up(scenario, console)
    with _progress(scenario, console) as on_progress:
        if in_process:
            recording = fly_in_process(scenario, on_progress)
        else:
            recording = asyncio.run(fly_over_udp(scenario, folder, speed, on_progress))
    summary = summarise(recording, scenario.name)
    save_flight(recording, summary, folder)
    with console.status("drawing flight.png"):
        draw_flight(recording, scenario, folder / "flight.png")
    console.print(*flight_tables(summary, scenario), sep="\n")
    console.print(f"results in [bold]{folder}[/bold]", highlight=False)
    if as_json:
        print(json.dumps(summary, indent=2))
    if recording.loss is not None:
        raise FlightLost(recording.loss, f"what was recorded is in {folder}")


def _warm_up(scenario: Scenario, console: Console) -> None:
    """Compile the numeric core before processes need it, if that was not done before."""
    if not cache_is_cold():
        return
    from gcs.warm_up import compile_everything  # noqa: PLC0415

    message = "compiling the numeric core (only the first run after an install pays this)"
    console.print(message)
    with console.status(message):
        compile_everything(scenario)
    mark_cache_warm()


@contextlib.contextmanager
def _progress(
    scenario: Scenario, console: Console
) -> Iterator[Callable[[float, np.ndarray], None]]:
    """A progress bar with simulated time, real-time factor and event counts."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:5.1f} / {task.total:g} s"),
        TextColumn("{task.fields[factor]:5.1f}× real time"),
        TextColumn("{task.fields[events]} events"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task(scenario.name, total=scenario.duration_s, factor=0.0, events=0)
        begin = time.monotonic()

        def show(time_s: float, events: np.ndarray) -> None:
            nonlocal begin
            if time_s <= 0.0:
                begin = time.monotonic()
            factor = time_s / max(time.monotonic() - begin, 1e-3)
            progress.update(task, completed=time_s, factor=factor, events=int(events.sum()))

        yield show


def main() -> None:
    """Run the command line; turn exceptions into one plain message and an exit status."""
    try:
        app()
    except ConfigError as problem:
        _complain(str(problem))
        sys.exit(BadInput.exit_status)
    except GcsError as problem:
        prefix = "" if isinstance(problem, Interrupted) else "error: "
        _complain(f"{prefix}{problem}", problem.hint)
        sys.exit(problem.exit_status)
    except BrokenPipeError:  # the reader of our output has gone: nothing left to say
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except Exception as defect:
        if os.environ.get("FTC_SITL_DEBUG"):
            raise
        _complain(
            f"error: this is a defect of ftc-sitl: {type(defect).__name__}: {defect}",
            "run again with FTC_SITL_DEBUG=1 for a traceback, and report it",
        )
        sys.exit(_EXIT_DEFECT)


def _complain(text: str, hint: str = "") -> None:
    print(text, file=sys.stderr)
    if hint:
        print(f"hint: {hint}", file=sys.stderr)
