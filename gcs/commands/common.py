"""Options and output shared by several subcommands."""

import contextlib
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from gcs.scenario.model import Scenario

__all__ = [
    "FreePortsOption",
    "QuietOption",
    "RunFolderOption",
    "ScenarioArgument",
    "console_of",
    "flight_progress",
    "warm_up",
]

ScenarioArgument = Annotated[
    Path, typer.Argument(help="Scenario: a file, or a bundled one.", metavar="SCENARIO")
]
RunFolderOption = Annotated[
    Path | None, typer.Option(help="Run folder, new or empty; runs/NAME-DATE-TIME by default.")
]
FreePortsOption = Annotated[
    bool, typer.Option("--free-ports", help="Use free UDP ports instead of the scenario's.")
]
QuietOption = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")]


def console_of(stderr: bool = True, quiet: bool = False) -> Console:
    """Return a console that prints text as it is: users' names and paths are not markup."""
    return Console(stderr=stderr, quiet=quiet, markup=False, emoji=False, highlight=False)


def warm_up(scenario: Scenario, console: Console) -> None:
    """Compile the numeric core before processes need it, unless it is cached."""
    from mavlink_defs.runtime.jit import cache_is_cold

    if not cache_is_cold():
        return
    from gcs.fleet.precompile import compile_everything

    message = "compiling the numeric core (on the first run after an install only)"
    console.print(message)
    with console.status(message):
        compile_everything(scenario)


@contextlib.contextmanager
def flight_progress(
    scenario: Scenario, console: Console
) -> Iterator[Callable[[float, np.ndarray], None]]:
    """Show a progress bar with simulated time, real-time factor and event counts."""
    columns = (
        TextColumn("{task.description}", markup=False),
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
