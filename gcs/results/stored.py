"""Reading the recording of a run folder, also one that a crash has torn."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gcs.errors import BadInput
from gcs.results.columns import COLUMNS
from gcs.results.figures import FlightSummary
from gcs.results.recording import Recording
from gcs.results.steps import Ending, Steps
from mavlink_defs.config.user_files import open_file
from mavlink_defs.constants import ACTUATORS

if TYPE_CHECKING:
    import pyarrow as pa

EVENTS, TRAJECTORY = "events.arrows", "trajectory.arrows"
_END = b"\xff\xff\xff\xff\x00\x00\x00\x00"
"""Ends a stream whose writer closed it."""


def is_complete(path: Path | str) -> bool:
    """Return whether a recording was written to its end; a torn one is read up to its tear."""
    with Path(path).open("rb") as file:
        file.seek(0, 2)
        file.seek(max(file.tell() - len(_END), 0))
        return file.read() == _END


def batches(path: Path | str) -> Iterator["pa.RecordBatch"]:
    """Yield what was recorded, up to the last complete batch.

    Raises:
        BadInput: There is no such file, or it is no recording.
    """
    import pyarrow as pa

    try:
        path = Path(path)
        file = open_file(path)
    except OSError as problem:
        raise BadInput(
            f"cannot read {path}: {problem.strerror}",
            "gcs fly writes it with --record light or full",
        ) from None
    with file:
        try:
            reader = pa.ipc.open_stream(file)
        except (pa.ArrowInvalid, OSError) as problem:
            raise BadInput(f"{path} is no recording: {problem}") from None
        while True:
            try:
                yield reader.read_next_batch()
            except (StopIteration, pa.ArrowInvalid, OSError):  # its end, or where it was torn
                return


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


def read_recording(folder: Path | str) -> Recording:
    """Read the full recording of a run folder into memory, as `gcs.lab.theory` needs it.

    Raises:
        BadInput: There is none, it is not a full one, or it is torn.
    """
    path, summary = Path(folder) / TRAJECTORY, read_summary(folder)
    n = len(summary.uavs)
    steps = Steps.room(summary.steps, n)
    row = 0
    for batch in batches(path):
        missing = [column.name for column in COLUMNS if column.name not in batch.schema.names]
        if missing or batch.schema.metadata[b"every"] != b"1":
            raise BadInput(f"{path} is no full recording", "fly again with --record full")
        count = len(batch) // n
        part = steps.part(row, row + count)
        for column in COLUMNS:
            column.of(part)[:] = batch.column(column.name).to_numpy().reshape(count, n)
        row += count
    if row < summary.steps:
        raise BadInput(f"{path} ends after {row} of {summary.steps} steps", "fly again")
    repeats = [[uav.channels[name].repeats for name in ACTUATORS] for uav in summary.uavs]
    ending = Ending(summary.mode, row, np.array(repeats), summary.wall_s, summary.loss)
    step_us = round(summary.duration_s * 1e6 / max(row, 1))
    return Recording.of(steps, ending, tuple(uav.id for uav in summary.uavs), step_us)
