"""The numeric core is compiled before a flight needs it."""

from rich.console import Console

from ftc_autopilot.config import parts_of as parts_of_controller
from gcs.console.progress import working
from gcs.scenario.model import Scenario
from mavlink_defs.runtime.code_cache import EVERYTHING, cold_parts


def warm_up(scenario: Scenario | None, console: Console, *, in_process: bool = False) -> None:
    """Compile what a flight needs of the numeric core before its processes do, unless it is cached.

    Args:
        scenario: What is to be flown; None if that may be anything.
        console: Where progress is shown.
        in_process: Whether it is flown in one process, else over UDP.
    """
    parts = [EVERYTHING] if scenario is None else parts_of(scenario, in_process=in_process)
    if not cold_parts(parts):
        return
    from gcs.fleet.precompile import PARTS, compile_parts, ctrl_c_while_compiling

    cold = cold_parts(PARTS if scenario is None else parts)
    console.print("compiling the numeric core for this machine, once after an install")
    with working(console) as work, ctrl_c_while_compiling():
        task = work.add("compiling", len(cold), "parts")
        compile_parts(None if scenario is None else cold, task.show)


def parts_of(scenario: Scenario, *, in_process: bool) -> list[str]:
    """Return the parts of the numeric core, as `gcs.fleet.precompile` names them, of a flight.

    A plug-in is none of them.
    """
    law, on_path = scenario.controller.kind, scenario.mission is not None
    uses = {
        **dict.fromkeys(parts_of_controller(law, scenario.navigation, on_path=on_path), True),
        "turbulence": scenario.wind.turbulence != "none",
        "relay": not in_process and scenario.links.impairments is not None,
        "in process": in_process,
        "results": True,
        **dict.fromkeys(("autopilot", "plant", "messages"), not in_process),
    }
    return [name for name, used in uses.items() if used]
