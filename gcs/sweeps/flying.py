"""Flying the runs of a sweep in process, several at a time."""

import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

import numpy as np

from gcs.fleet.in_process import fly_in_process
from gcs.results.summary import summarise
from gcs.scenario.model import Scenario
from gcs.sweeps.folder import Result, flown_result, keep_result
from gcs.sweeps.grid import Run

__all__ = ["fly_runs"]


class _Stopped(Exception):  # noqa: N818 - not an error
    """The sweep ends before this flight does."""


def fly_runs(
    runs: Iterable[Run], folder: Path, jobs: int, on_result: Callable[[Result], None]
) -> None:
    """Fly the runs that have a scenario, and keep each result as soon as it is known.

    The flights share threads: the compiled loop runs without the interpreter's lock. A flight
    that cannot be computed becomes a failed result, which is not kept, so that the next sweep
    tries it again. When this function is left early, it waits for the flights in progress to stop.

    Args:
        runs: Points of a grid.
        folder: Folder that `open_folder` has made.
        jobs: How many fly at a time; each needs memory for its recording.
        on_result: Called with each result, in the caller's thread.

    Raises:
        GcsError: A result cannot be written.
    """
    stop = threading.Event()
    with ThreadPoolExecutor(jobs) as pool:
        futures = [
            pool.submit(_fly, run, run.scenario, folder, stop)
            for run in runs
            if run.scenario is not None
        ]
        try:
            for future in as_completed(futures):
                on_result(future.result())
        finally:
            stop.set()
            pool.shutdown(cancel_futures=True)


def _fly(run: Run, scenario: Scenario, folder: Path, stop: threading.Event) -> Result:
    def go_on(_time_s: float, _events: np.ndarray) -> None:
        if stop.is_set():
            raise _Stopped

    try:
        summary = summarise(fly_in_process(scenario, go_on), scenario)
    except _Stopped:
        raise
    except MemoryError as problem:
        return Result(run, "failed", f"not enough memory: {problem}")
    except Exception as defect:  # the other flights go on; the command ends with it
        return Result(run, "failed", f"{type(defect).__name__}: {defect}", defect=defect)
    keep_result(run, summary, folder)
    return flown_result(run, summary)
