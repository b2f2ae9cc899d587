"""The numeric core is compiled before a flight needs it."""

import contextlib
import threading
from collections.abc import Iterator

from rich.console import Console

from gcs.progress import Task, working
from gcs.scenario.model import Scenario, load_scenario
from mavlink_defs.runtime.code_cache import cache_is_cold, compiled_functions

_COUNT_S = 1.0


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
    done, total = compiled_functions()
    with working(console) as work, ctrl_c_while_compiling():
        task = work.add("numeric core", total, "functions", done=done)
        with _counting(task):
            compile_everything(scenario or load_scenario("paper/scenario1"))


@contextlib.contextmanager
def _counting(task: Task) -> Iterator[None]:
    """Show how many functions are compiled, whichever process compiles them."""
    over = threading.Event()

    def count() -> None:
        while not over.wait(_COUNT_S):
            task.show(compiled_functions()[0])

    thread = threading.Thread(target=count, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
