"""Time to list and to draw many runs, with and without the index.

``python -m benchmarks.runs_index [RUNS]``
"""

import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from gcs.fleet.in_process import fly_in_steps
from gcs.results.choices import Record
from gcs.results.flight_mark import FlightMark, marked
from gcs.results.recorder import FlightRecorder
from gcs.results.run_folder import save_summary
from gcs.results.runs.index import INDEX, list_runs
from gcs.results.runs.page import save_page
from gcs.scenario.model import load_scenario

SCENARIO = Path(__file__).parent.parent / "scenarios" / "paper" / "scenario1.yaml"


def main() -> None:
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder) / "runs"
        make(root, runs)
        print(f"{runs} flights of three UAVs; wall-clock time [s]")
        timed("list without an index, and write it", lambda: list_runs(root))
        print(f"{'':40s} index {(root / INDEX).stat().st_size / 1e6:.1f} MB")
        timed("list with the index", lambda: list_runs(root))
        (root / "0" / "note.txt").write_text("one is changed")
        timed("list with the index, one run changed", lambda: list_runs(root))
        listing = list_runs(root)
        page = root / "index.html"
        timed(
            "page, curves and keys of 200 runs",
            lambda: save_page(page, root, listing.runs, [], [], 200),
        )
        print(f"{'':40s} page {page.stat().st_size / 1e6:.1f} MB")


def make(root: Path, runs: int) -> None:
    """Make run folders of one short flight, each with a saving of its own."""
    scenario = load_scenario(SCENARIO).model_copy(update={"duration_s": 0.2})
    template = root.parent / "template"
    template.mkdir()
    with marked(template, scenario, FlightMark.of("fly", "paper/scenario1", scenario)):
        recorder = FlightRecorder(scenario, template, Record.LIGHT)
        summary = recorder.finish(fly_in_steps(scenario, recorder.add))
    for number in range(runs):
        folder = shutil.copytree(template, root / str(number))
        save_summary(replace(summary, saving=number / runs), Path(folder))


def timed(what: str, work: Callable[[], object]) -> None:
    """Print how long something takes."""
    begin = time.perf_counter()
    work()
    print(f"{what:40s} {time.perf_counter() - begin:8.2f}")


if __name__ == "__main__":
    main()
