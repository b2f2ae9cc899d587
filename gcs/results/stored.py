"""Reading the recording of a run folder, as a whole or thinned out."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ftc_autopilot.control.controller import no_signals
from gcs.errors import BadInput
from gcs.results.columns import COLUMNS
from gcs.results.recording import Recording
from gcs.results.steps import Ending, Mode, Steps

if TYPE_CHECKING:
    import pyarrow as pa

__all__ = ["EVENTS", "TRAJECTORY", "batches", "is_complete", "read_events", "read_recording"]

EVENTS, TRAJECTORY = "events.arrows", "trajectory.arrows"
_END = b"\xff\xff\xff\xff\x00\x00\x00\x00"
"""Ends a stream whose writer closed it."""


def is_complete(path: Path) -> bool:
    """Return whether a recording was written to its end; a torn one is read up to its tear."""
    with path.open("rb") as file:
        file.seek(0, 2)
        file.seek(max(file.tell() - len(_END), 0))
        return file.read() == _END


def batches(path: Path) -> Iterator["pa.RecordBatch"]:
    """Yield what was recorded, up to the last complete batch.

    Raises:
        BadInput: There is no such file, or it is no recording.
    """
    import pyarrow as pa

    if not path.exists():
        raise BadInput(
            f"{path} does not exist",
            "gcs fly writes it unless --record is npz or none",
        )
    with path.open("rb") as file:
        try:
            reader = pa.ipc.open_stream(file)
        except (pa.ArrowInvalid, OSError) as problem:
            raise BadInput(f"{path} is no recording: {problem}") from None
        while True:
            try:
                yield reader.read_next_batch()
            except (StopIteration, pa.ArrowInvalid, OSError):  # its end, or where it was torn
                return


def schema_of(path: Path) -> "pa.Schema":
    """Return the columns of a file that `batches` reads."""
    import pyarrow as pa

    with path.open("rb") as file:
        return pa.ipc.open_stream(file).schema


def read_recording(folder: Path, mode: Mode, loss: str | None, most_rows: int = 2**62) -> Recording:
    """Read the trajectory of a run folder.

    Where a light recording, or a thinned one, has no value, there is NaN.

    Args:
        folder: Run folder.
        mode: How it was flown.
        loss: Why the flight was lost, or None.
        most_rows: Thin it out to at most so many rows, with its period as `step_us`.

    Raises:
        BadInput: There is none, or it cannot be read.
    """
    path = folder / TRAJECTORY
    total = 0
    ids: list[int] = []
    for batch in batches(path):
        total += len(batch)
        if not ids:
            first = batch.column("time_s").to_numpy() == batch.column("time_s")[0].as_py()
            ids = batch.column("uav").to_numpy()[first].tolist()
    if not ids:
        raise BadInput(f"{path} has no steps")
    n, stride = len(ids), max(-(-total // most_rows), 1)
    count = -(-(total // n) // stride)
    steps = Steps.room(count, n)._replace(signals=no_signals(count * n).reshape(count, n))
    for _, _, array in (("", "", steps.states), ("", "", steps.wind), ("", "", steps.applied)):
        array[:] = np.nan
    schema = schema_of(path)
    row = 0
    for batch in batches(path):
        chosen = (row + np.arange(len(batch))) // n
        uav = (row + np.arange(len(batch))) % n
        row += len(batch)
        kept = (chosen % stride == 0) & (chosen // stride < count)
        for column in COLUMNS:
            if column.name in schema.names:
                values = batch.column(column.name).to_numpy()
                column.of(steps)[chosen[kept] // stride, uav[kept]] = values[kept]
    period = int(schema.metadata[b"step_us"]) * int(schema.metadata[b"every"]) * stride
    ending = Ending(mode, count, np.zeros((n, 4), np.int64), 0.0, loss)
    return Recording.of(steps, ending, tuple(ids), period)


def read_events(folder: Path) -> Iterator["pa.RecordBatch"]:
    """Yield the events of a run folder; raises as `batches`."""
    yield from batches(folder / EVENTS)
