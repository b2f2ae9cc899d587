"""The folder of a flight's results."""

import errno
import json
import os
import re
from datetime import datetime
from pathlib import Path

from gcs.console.errors import BadInput
from gcs.console.outputs import make_folder
from gcs.results.figures import FlightSummary
from mavlink_defs.config.output_files import write_text
from mavlink_defs.config.user_files import open_file

SCENARIO = "scenario.yaml"


def make_run_folder(chosen: Path | None, scenario_name: str) -> Path:
    """Make the run folder.

    Args:
        chosen: The folder; None for a new one below `runs`.
        scenario_name: Part of the name of a new folder.

    Raises:
        BadInput: It is not empty, or cannot be made.
    """
    now = datetime.now().astimezone().strftime("%Y%m%d-%H%M%S")
    name = re.sub(r"[^\w.-]+", "-", scenario_name)
    folder = chosen or Path("runs") / f"{name}-{now}"
    make_folder(folder)
    try:
        occupied = any(folder.iterdir())
        if not os.access(folder, os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    except OSError as problem:
        raise BadInput(
            f"cannot make the run folder {folder}: {problem.strerror}", "choose another with --out"
        ) from problem
    if occupied:
        raise BadInput(
            f"the run folder {folder} is not empty", "choose another with --out, or remove it"
        )
    return folder


def save_summary(summary: FlightSummary, folder: Path) -> None:
    """Write `summary.json`.

    Raises:
        OSError: It cannot be written; it is named.
    """
    write_text(folder / "summary.json", json.dumps(summary.to_json(), indent=2) + "\n")


def read_summary(folder: Path | str) -> FlightSummary:
    """Read `summary.json` of a run folder.

    Raises:
        BadInput: There is none, or it is something else.
    """
    path = Path(folder) / "summary.json"
    try:
        with open_file(path) as file:
            return FlightSummary.from_json(json.load(file))
    except OSError as problem:
        raise BadInput(f"cannot read {path}: {problem.strerror}") from None
    except ValueError as problem:
        raise BadInput(f"{path} is no summary: {problem}") from None
