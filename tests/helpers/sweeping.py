"""Flying the runs that the folder of a sweep lacks."""

from pathlib import Path

from gcs.sweeps.flying import fly_runs
from gcs.sweeps.folder import Result, known_results
from gcs.sweeps.grid import Run


def flown(runs: list[Run], folder: Path, jobs: int = 2) -> list[Result]:
    """Fly what is missing; return only the results of those flights."""
    known = known_results(runs, folder)
    results: list[Result] = []
    fly_runs([run for run in runs if run.digest not in known], folder, jobs, results.append)
    return results
