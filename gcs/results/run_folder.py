"""The folder of a flight's results."""

import errno
import json
import os
import re
from datetime import datetime
from pathlib import Path

import numpy as np

from gcs.errors import BadInput
from gcs.results.figures import FlightSummary
from gcs.results.recording import Recording
from gcs.results.summary import event_table
from mavlink_defs.runtime.files import save_arrays, write_text


def make_run_folder(wanted: Path | None, scenario_name: str) -> Path:
    """Make the run folder.

    Args:
        wanted: The folder; None for a new one below `runs`.
        scenario_name: Part of the name of a new folder.

    Raises:
        BadInput: It is not empty, or cannot be made.
    """
    now = datetime.now().astimezone().strftime("%Y%m%d-%H%M%S")
    name = re.sub(r"[^\w.-]+", "-", scenario_name)
    folder = wanted or Path("runs") / f"{name}-{now}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
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


def save_flight(recording: Recording, summary: FlightSummary, folder: Path) -> None:
    """Write `summary.json`, `events.npz` and `trajectory.npz`.

    Raises:
        OSError: One of them cannot be written; it is named.
    """
    save_summary(summary, folder)
    save_arrays_of(recording, folder)


def save_arrays_of(recording: Recording, folder: Path) -> None:
    """Write `events.npz` and `trajectory.npz`.

    Raises:
        OSError: One of them cannot be written; it is named.
    """
    save_arrays(folder / "events.npz", event_table(recording))
    signals = recording.signals
    trajectory = {
        "uav": np.array(recording.uav_ids),
        "time_s": recording.time_s,
        "state": recording.states,
        "wind": recording.wind,
        "applied": recording.applied,
    }
    trajectory |= {name: signals[name] for name in (signals.dtype.names or ())}
    save_arrays(folder / "trajectory.npz", trajectory)


def save_summary(summary: FlightSummary, folder: Path) -> None:
    """Write `summary.json`.

    Raises:
        OSError: It cannot be written; it is named.
    """
    write_text(folder / "summary.json", json.dumps(summary.to_json(), indent=2) + "\n")
