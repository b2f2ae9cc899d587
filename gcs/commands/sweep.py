"""``gcs sweep``: fly a grid of values on all cores."""

import contextlib
import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from gcs.commands.common import QuietOption, console_of, warm_up
from gcs.errors import GcsError, Interrupted

if TYPE_CHECKING:
    from gcs.sweeps.folder import Result
    from gcs.sweeps.grid import Run

__all__ = ["EPILOG", "sweep"]

EPILOG = """
Examples:

- gcs sweep paper/scenario1 --set trigger.b2_deg=0.25,0.5,1,2
- gcs sweep paper/scenario1 --set trigger.mode=per_channel,joint
  --set uncertainty.coefficients=0.8,1,1.2 --out runs/robust
- gcs sweep scenarios/paper/scenario2_*.yaml --set 'faults[0].effectiveness=0.9,0.5,0.1' --uav 3
- gcs sweep my.yaml --set 'controller.K1=[40, 40, 40], [50, 50, 50]' --jobs 2

Exit status: 0 the sweep is complete (lost flights and impossible values are results too),
1 a run could not be computed or written, 2 bad input, 70 a defect of ftc-sitl, 130 Ctrl-C; the
same command continues.
"""


def sweep(
    scenarios: Annotated[
        list[Path], typer.Argument(help="Scenarios: files, or bundled ones.", metavar="SCENARIO")
    ],
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            help="A key of the scenario and its values, in YAML. With several, "
            "every combination is flown.",
            metavar="KEY=VALUE,VALUE,...",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder of the sweep, new or to continue; runs/sweep-NAME-DIGEST by default, "
            "the same for the same files and values."
        ),
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option(min=1, help="Flights at a time; by default as many as there are cores."),
    ] = None,
    uav: Annotated[
        int | None,
        typer.Option(help="UAV in table.md and plot; by default one with a fault, or the last."),
    ] = None,
    quiet: QuietOption = False,
) -> None:
    """Fly every combination of values, in process, on all cores.

    Each finished run is saved at once: after an interruption, the same command continues
    there. Lost flights and impossible values are recorded with their reasons. The folder
    gets table.csv (every UAV), table.md, and sweep.png and sweep.svg: saving against IAE.
    """
    from gcs.reports.sweep import choose_uav
    from gcs.sweeps.axes import parse_axes
    from gcs.sweeps.folder import default_folder, known_results, open_folder
    from gcs.sweeps.grid import plan

    console = console_of(quiet=quiet)
    axes = parse_axes(settings or [])
    runs = plan(scenarios, axes)
    uav_id = choose_uav(runs, uav)
    folder = out or default_folder(scenarios, axes)
    open_folder(folder, scenarios, axes)
    try:
        results = _fly(runs, folder, jobs or os.cpu_count() or 1, console)
        _report(results, uav_id, folder, console)
    except KeyboardInterrupt:
        flights = _flights(runs)
        raise Interrupted(
            f"interrupted with {len(known_results(flights, folder))} of {len(flights)} flights "
            f"in {folder}",
            "the same command continues where it stopped",
        ) from None
    failed = [result for result in results if result.outcome == "failed"]
    if failed:
        for result in failed:
            if result.defect is not None:
                raise result.defect
        raise GcsError(
            f"{len(failed)} of {len(results)} runs could not be computed: {failed[0].reason}",
            "the same command retries them",
        )


def _fly(runs: list["Run"], folder: Path, jobs: int, console: Console) -> list["Result"]:
    """Return the result of each run, in order; fly those that have none yet."""
    from gcs.sweeps.flying import fly_runs
    from gcs.sweeps.folder import known_results, result_of

    flights = _flights(runs)
    flown = known_results(flights, folder)
    missing = [run for run in flights if run.digest not in flown]
    if flown:
        console.print(f"{len(flown)} of {len(flights)} flights already flown")
    if missing and missing[0].scenario is not None:
        warm_up(missing[0].scenario, console)
    with _progress(len(flights), flown, console) as show:

        def keep(result: "Result") -> None:
            flown[result.run.digest] = result
            show()

        fly_runs(missing, folder, jobs, keep)
    return [result_of(run, flown) for run in runs]


def _flights(runs: list["Run"]) -> list["Run"]:
    """Return the runs that can be flown, each flight once."""
    return list({run.digest: run for run in runs if run.scenario is not None}.values())


@contextlib.contextmanager
def _progress(
    total: int, flown: dict[str, "Result"], console: Console
) -> Iterator[Callable[[], None]]:
    """Show a progress bar over flights; yields a function to call after each of them."""
    columns = (
        TextColumn("flying"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[pace]:.1f} flights/s"),
        TextColumn("{task.fields[lost]} not completed"),
        TextColumn("ETA"),
        TimeRemainingColumn(),
    )
    before, begin = len(flown), time.monotonic()
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("", total=total, completed=before, pace=0.0, lost=0)

        def show() -> None:
            pace = (len(flown) - before) / max(time.monotonic() - begin, 1e-3)
            lost = sum(result.outcome != "completed" for result in flown.values())
            progress.update(task, completed=len(flown), pace=pace, lost=lost)

        yield show


def _report(results: list["Result"], uav_id: int | None, folder: Path, console: Console) -> None:
    from gcs.figures.sweep import draw_sweep
    from gcs.reports.sweep import terminal_table, write_csv, write_markdown

    write_csv(results, folder / "table.csv")
    write_markdown(results, uav_id, folder / "table.md")
    with console.status("drawing sweep.png"):
        draw_sweep(results, uav_id, folder)
    console.print(terminal_table(results, uav_id))
    console.print(f"results in {folder}", soft_wrap=True)
