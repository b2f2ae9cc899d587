"""The numeric core is compiled before a flight needs it."""

import contextlib
import threading
from collections.abc import Iterator

from rich.console import Console

from ftc_autopilot.config import parts_of as parts_of_controller
from ftc_autopilot.kinds import Px4Autopilot
from gcs.console.progress import Task, working
from gcs.scenario.model import Scenario
from mavlink_defs.runtime.jit import EVERYTHING, cold_parts

_COUNT_S = 1.0


def warm_up(
    scenario: Scenario | None,
    console: Console,
    *,
    in_process: bool = False,
    standing: bool = False,
) -> None:
    """Compile what a flight needs of the numeric core before its processes do, unless it is cached.

    Args:
        scenario: What is to be flown; None if that may be anything.
        console: Where progress is shown.
        in_process: Whether it is flown in one process, else over UDP.
        standing: Whether stations may give it missions and keys in flight.
    """
    if scenario is None:
        parts = [EVERYTHING]
    else:
        parts = parts_of(scenario, in_process=in_process, standing=standing)
    if not cold_parts(parts):
        return
    from gcs.fleet.precompile import PARTS, compile_parts, ctrl_c_while_compiling

    cold = cold_parts(PARTS if scenario is None else parts)
    console.print("compiling the numeric core for this machine, once after an install")
    with working(console) as work, ctrl_c_while_compiling():
        task = work.add("compiling", len(cold), "parts", rated=False)
        with _counting(task):
            compile_parts(None if scenario is None else cold, task.show)


@contextlib.contextmanager
def _counting(task: Task) -> Iterator[None]:
    """Show how many functions are compiled, whichever process compiles them."""
    from mavlink_defs.runtime.cache_folder import compiled_functions

    over, before = threading.Event(), compiled_functions()

    def count() -> None:
        while not over.wait(_COUNT_S):
            task.show(task.done, f"{compiled_functions() - before} functions")

    thread = threading.Thread(target=count, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def parts_of(scenario: Scenario, *, in_process: bool, standing: bool = False) -> list[str]:
    """Return the parts of the numeric core, as `gcs.fleet.precompile` names them, of a flight.

    A plug-in is none of them. Arguments as of `warm_up`.
    """
    law, on_path = scenario.controller, standing or scenario.mission is not None
    has_gear = any(scenario.aircraft_of(uav.id).gear is not None for uav in scenario.uavs)
    sends_sensors = any(isinstance(one, Px4Autopilot) for one in scenario.foreign.values())
    controller = parts_of_controller(law, scenario.navigation, on_path=on_path, has_gear=has_gear)
    uses = {
        **dict.fromkeys(controller, True),
        "ground": has_gear,
        "sensors": scenario.navigation == "estimated" or sends_sensors,
        "signing": standing or (not in_process and scenario.links.signing_key is not None),
        "turbulence": scenario.wind.turbulence != "none",
        "relay": not in_process and scenario.links.impairments is not None,
        "in process": in_process,
        "results": True,
        **dict.fromkeys(("autopilot", "plant", "messages"), not in_process),
    }
    return [name for name, used in uses.items() if used]
