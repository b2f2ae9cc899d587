"""The numeric core is compiled before a flight needs it."""

from rich.console import Console

from gcs.progress import working
from gcs.scenario.model import Scenario, load_scenario
from mavlink_defs.runtime.jit import cache_is_cold


def warm_up(scenario: Scenario | None, console: Console) -> None:
    """Compile the numeric core before processes need it, unless it is cached.

    Args:
        scenario: What is to be flown; None if none of our laws is.
        console: Where progress is shown.
    """
    if not cache_is_cold():
        return
    from gcs.fleet.precompile import compile_everything, ctrl_c_while_compiling

    message = "compiling the numeric core: about a minute on two cores, once after an install"
    console.print(message)
    with working(console, message), ctrl_c_while_compiling():
        compile_everything(scenario or load_scenario("paper/scenario1"))
