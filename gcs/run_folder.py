"""The folder that a flight's results go into."""

import json
import re
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from gcs.errors import BadInput
from gcs.recording import Recording
from gcs.summary import event_table

__all__ = ["make_run_folder", "save_flight"]


def make_run_folder(wanted: Path | None, scenario_name: str) -> Path:
    """Make the run folder.

    Args:
        wanted: Where; None for a new folder below `runs`.
        scenario_name: Part of the name of a new folder.

    Raises:
        BadInput: It holds something already, or cannot be made.
    """
    now = datetime.now().astimezone().strftime("%Y%m%d-%H%M%S")
    name = re.sub(r"[^\w.-]+", "-", scenario_name)
    folder = wanted or Path("runs") / f"{name}-{now}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        occupied = any(folder.iterdir())
    except OSError as problem:
        raise BadInput(
            f"cannot make the run folder {folder}: {problem.strerror}", "choose another with --out"
        ) from problem
    if occupied:
        raise BadInput(
            f"the run folder {folder} is not empty", "choose another with --out, or remove it"
        )
    return folder


def save_flight(recording: Recording, summary: dict[str, Any], folder: Path) -> None:
    """Write `summary.json`, `events.npz` and `trajectory.npz`."""
    (folder / "summary.json").write_text(json.dumps(summary, indent=2) + "\n")
    _save(folder / "events.npz", event_table(recording))
    signals = recording.signals
    trajectory = {
        "uav": np.array(recording.uav_ids),
        "time_s": recording.time_s,
        "state": recording.states,
        "applied": recording.applied,
    }
    trajectory |= {name: signals[name] for name in (signals.dtype.names or ())}
    _save(folder / "trajectory.npz", trajectory)


def _save(path: Path, arrays: dict[str, Any]) -> None:
    np.savez(path, **arrays)
