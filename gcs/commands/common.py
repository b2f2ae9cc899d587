"""Output shared by several subcommands: compilation and progress of a flight."""

import contextlib
import time
from collections.abc import Callable, Iterator

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from gcs.scenario.model import Scenario

__all__ = ["console_of", "flight_progress", "warm_up"]


def console_of(stderr: bool = True, quiet: bool = False) -> Console:
    """Return a console that prints text as it is: users' names and paths are not markup."""
    return Console(stderr=stderr, quiet=quiet, markup=False, emoji=False, highlight=False)


def warm_up(scenario: Scenario, console: Console) -> None:
    """Compile the numeric core before processes need it, unless it is cached."""
    from mavlink_defs.runtime.jit import cache_is_cold

    if not cache_is_cold():
        return
    from gcs.fleet.precompile import compile_everything

    message = "compiling the numeric core (only the first run after an install pays this)"
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
