"""Options and output shared by several subcommands."""

import contextlib
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from rich.console import Console

from gcs.commands.options import SigningKeyOption
from gcs.console.progress import Task, working
from gcs.console.terminal import console_of
from gcs.fleet.remarks import ExposureRemark
from gcs.scenario.changes import with_changes
from gcs.scenario.model import Scenario
from gcs.scenario.settings import values_of

if TYPE_CHECKING:
    from gcs.fleet.preparation import Prepared

ScenarioArgument = Annotated[
    Path, typer.Argument(help="Scenario: a file, or a bundled one.", metavar="SCENARIO")
]
RunFolderOption = Annotated[
    Path | None,
    typer.Option(
        help="Run folder, new or empty; runs/NAME-DATE-TIME by default.", metavar="FOLDER"
    ),
]
FreePortsOption = Annotated[
    bool, typer.Option("--free-ports", help="Use free UDP ports instead of the scenario's.")
]
ProcessesOption = Annotated[
    int | None,
    typer.Option(
        "--autopilot-processes",
        min=1,
        help="Number of processes that the autopilots share, instead of one each. In lockstep a "
        "large fleet flies faster in as many as there are cores; its messages are the same.",
        metavar="NUMBER",
    ),
]
WithOption = Annotated[
    list[str] | None,
    typer.Option(
        "--with",
        help="File, or bundled addition such as realistic, to merge into the scenario; may be "
        "repeated: later ones win.",
        metavar="NAME",
    ),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        help="Key of the scenario and its new value in YAML, such as trigger.b2_deg=0.5; may be "
        "repeated.",
        metavar="KEY=VALUE",
    ),
]


class Restart(StrEnum):
    """Whether autopilots that fail are started again."""

    ON_FAILURE = "on-failure"
    NEVER = "never"


RestartOption = Annotated[
    Restart,
    typer.Option(help="Whether autopilots that fail are started again; they resume their flight."),
]
QuietOption = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")]


@dataclass(frozen=True)
class FleetOptions:
    """Options of the commands that start a fleet."""

    additions: WithOption = None
    settings: SetOption = None
    out: RunFolderOption = None
    processes: ProcessesOption = None
    free_ports: FreePortsOption = False
    quiet: QuietOption = False
    signing_key: SigningKeyOption = None


def option(name: str) -> str:
    """Return what a keyword argument of Python is called on the command line."""
    return "--set" if name == "changes" else "--" + name.replace("_", "-")


def changed_scenario(
    scenario: Path, additions: list[str] | None, settings: list[str] | None
) -> Scenario:
    """Return a scenario with what ``--with`` and ``--set`` say; errors as of `with_changes`."""
    return with_changes(scenario, additions or (), values_of(settings or ()), "--set")


def prepared(
    scenario: Scenario | Path, options: FleetOptions, command: str, name: str = "", **how: Any
) -> "Prepared":
    """Prepare the flight of a command; arguments and errors as of `prepare` and `How`."""
    from gcs.fleet.preparation import How, prepare

    asked = How(
        free_ports=options.free_ports, autopilot_processes=options.processes, named=option, **how
    )
    return prepare(
        scenario,
        asked,
        additions=options.additions or (),
        values=values_of(options.settings or ()),
        signing_key=options.signing_key,
        command=command,
        name=name,
    )


def tell(remarks: Iterable[str], console: Console) -> None:
    """Print remarks on a flight, a line each; that others can reach it also with ``--quiet``."""
    for text in remarks:
        output = console_of() if isinstance(text, ExposureRemark) else console
        output.print(text, soft_wrap=True)


class FlightProgress:
    """Shows the progress of a flight: simulated time, real-time factor and event counts."""

    def __init__(self, task: Task) -> None:
        self._task = task
        self._begin = time.monotonic()

    def __call__(self, time_s: float, events: np.ndarray) -> None:
        """Show a simulated time [s] and the counts."""
        if time_s <= 0.0:  # it starts yet
            self._begin = time.monotonic()
            return
        factor = time_s / max(time.monotonic() - self._begin, 1e-3)
        self._task.show(time_s, f"{factor:.1f}× real time, {int(events.sum())} events")

    def starts(self, text: str) -> None:
        """Show how far the start is."""
        self._task.show(0.0, text)


@contextlib.contextmanager
def flight_progress(scenario: Scenario, console: Console) -> Iterator[FlightProgress]:
    """Show the progress of a flight."""
    with working(console) as work:
        yield FlightProgress(work.add(scenario.name, scenario.duration_s, "s", rated=False))
