"""Options and output shared by several subcommands."""

import contextlib
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console

from ftc_autopilot.control.laws.pid import Pid
from ftc_autopilot.control.triggers.static import PerChannel
from ftc_autopilot.guidance.laws.path_following import PathFollowing
from ftc_autopilot.plugins.loading import calling
from gcs.commands.options import SigningKeyOption
from gcs.commands.progress import Task, working
from gcs.errors import BadInput
from gcs.scenario.changes import with_changes
from gcs.scenario.model import Scenario
from gcs.scenario.plugins import prepare_plugins
from gcs.scenario.settings import values_of
from sitl_plant.sensing.observability import observability_warnings
from sitl_plant.simulators.config import OwnPlant

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


def check_speed(speed: float | None) -> None:
    """Check a real-time factor.

    Raises:
        BadInput: It is not above 0, or infinite.
    """
    if speed is not None and not 0.0 < speed < math.inf:
        raise BadInput(f"--speed is {speed:g}, expected a factor above 0", "1 is real time")


def changed_scenario(
    scenario: Path, additions: list[str] | None, settings: list[str] | None
) -> Scenario:
    """Read a scenario, merge additions into it, and set keys.

    The name of the flight says what was changed.

    Args:
        scenario: A file, or the name of a bundled scenario.
        additions: Files or bundled additions, each merged into the ones before it.
        settings: As in ``--set KEY=VALUE``.

    Raises:
        BadInput: A setting is not of that form, or its key does not exist.
        ConfigError: A file cannot be used, or the result is no valid scenario.
    """
    return with_changes(scenario, additions or (), values_of(settings or ()), "--set")


def check_simulators(scenario: Scenario) -> None:
    """Load what flies the aircraft in place of the plant's own equations, if anything does.

    Raises:
        BadInput: It cannot fly one of them.
    """
    plant = scenario.plant_config()
    flown = [uav for uav in plant.uavs if not isinstance(uav.plant, OwnPlant)]
    if not flown:
        return
    from sitl_plant.loop.simulators import simulator_of
    from sitl_plant.simulators.base import SimulatorError

    try:
        for uav in flown:
            simulator_of(uav, plant.step_us)
    except SimulatorError as problem:
        raise BadInput(str(problem), problem.hint) from problem


def warn_of_one_path(scenario: Scenario, console: Console) -> None:
    """Warn if several UAVs fly one mission without slots: nothing keeps them apart."""
    if scenario.mission is None or scenario.formation is not None or len(scenario.uavs) < 2:
        return
    uavs = ", ".join(str(uav.id) for uav in scenario.uavs)
    console.print(
        f"warning: UAVs {uavs} fly one path, and nothing keeps them apart: "
        "give each a slot in the section formation, as missions/hexagon does",
        soft_wrap=True,
    )


def warn_of_sensors(scenario: Scenario, console: Console) -> None:
    """Warn of what the sensors that an autopilot navigates by do not observe at all times."""
    if scenario.navigation == "true_state":
        return
    for loc, text in observability_warnings(scenario.sensors.navigation):
        key = ".".join(["sensors", "navigation", *map(str, loc)])
        console.print(f"warning: {key} is false: {text}", soft_wrap=True)


def tell_heading(scenario: Scenario, console: Console) -> None:
    """Tell of which UAVs the heading is held by bank, and why."""
    uavs: dict[str, list[int]] = {}
    for uav in scenario.uavs:
        with calling(type(scenario.controller), "holds_heading_by_bank"):
            reason = scenario.controller.holds_heading_by_bank(scenario.aircraft_of(uav.id))
        if reason is not None:
            uavs.setdefault(reason, []).append(uav.id)
    for reason, ids in uavs.items():
        named = ", ".join(map(str, ids))
        console.print(f"UAV {named}: heading is held by bank ({reason})", soft_wrap=True)


def warm_up(scenario: Scenario, console: Console, *, law: bool = True) -> None:
    """Compile the numeric core, and plug-ins, before processes need them, unless they are cached.

    Args:
        scenario: What is to be flown.
        console: For remarks.
        law: Whether its law, trigger and guidance law are; without, ours are compiled.

    Raises:
        BadInput: A plug-in cannot be used.
    """
    from mavlink_defs.runtime.code_cache import cache_is_cold

    if not law:
        own: dict[str, Any] = {"controller": Pid(), "trigger": PerChannel()}
        scenario = scenario.model_copy(update={**own, "guidance": PathFollowing()})
    for text in prepare_plugins(scenario):
        console.print(text, soft_wrap=True)
    if not cache_is_cold():
        return
    from gcs.fleet.precompile import compile_everything, ctrl_c_while_compiling

    message = "compiling the numeric core: about a minute on two cores, once after an install"
    console.print(message)
    with working(console, message), ctrl_c_while_compiling():
        compile_everything(scenario)


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
