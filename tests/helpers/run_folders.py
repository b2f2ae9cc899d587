"""Run folders of short flights, made without a command."""

import functools
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

from gcs.fleet.in_process import fly_in_steps
from gcs.results.choices import Record
from gcs.results.flight_mark import FlightMark, marked
from gcs.results.recorder import FlightRecorder
from gcs.results.run_folder import read_summary, save_summary
from gcs.scenario.model import load_scenario

SCENARIO_1 = Path(__file__).parents[2] / "scenarios" / "paper" / "scenario1.yaml"


@functools.cache
def _template(cache: Path) -> Path:
    folder = cache / "template"
    folder.mkdir()
    scenario = load_scenario(SCENARIO_1).model_copy(update={"duration_s": 0.05, "name": "short"})
    mark = FlightMark.of("fly", "paper/scenario1", scenario, None, {"duration_s": 0.05})
    with marked(folder, scenario, mark):
        recorder = FlightRecorder(scenario, folder, Record.LIGHT)
        recorder.finish(fly_in_steps(scenario, recorder.add))
    return folder


def make_run(cache: Path, folder: Path, **summary: Any) -> Path:
    """Copy a flight of 50 ms to a folder, with attributes of its summary replaced.

    Args:
        cache: Folder for the flight itself, the same for all calls.
        folder: The run folder, new.
        summary: Attributes of `FlightSummary`.
    """
    shutil.copytree(_template(cache), folder)
    if summary:
        save_summary(replace(read_summary(folder), **summary), folder)
    return folder
