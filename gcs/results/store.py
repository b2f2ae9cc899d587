"""Recordings, on disk or in memory: Arrow's IPC stream, written while the flight goes on.

Of the formats that many programs read, it is the one that needs no end: a file that was torn by a
crash has everything up to its last complete batch. Parquet and HDF5 lose all of it.
"""

import contextlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from gcs.console.errors import BadInput
from gcs.results.columns import COLUMNS, ESTIMATES, Column
from gcs.results.recording import Ending, Events, Recording, Steps
from gcs.results.run_folder import read_summary
from mavlink_defs.config.output_files import naming
from mavlink_defs.config.user_files import open_file
from mavlink_defs.constants import ACTUATORS

if TYPE_CHECKING:
    import pyarrow as pa

_BATCH_ROWS = 1024
_EVENT = ("time_s", "step", "uav", "channel", "value")


def row_size(columns: tuple[Column, ...]) -> int:
    """Return the bytes of a row of a trajectory before compression."""
    return 10 + sum(column.dtype.itemsize for column in columns)


def _arrow(numbers: np.ndarray) -> "pa.Array":
    """Return numbers as Arrow's, without a copy.

    `pa.array` would load pandas first where that is installed, a third of a second in mid-flight.
    """
    import pyarrow as pa

    content = pa.py_buffer(np.ascontiguousarray(numbers))
    return pa.Array.from_buffers(pa.from_numpy_dtype(numbers.dtype), len(numbers), [None, content])


class _Stream:
    """A file of batches of rows, each on its way to the disk when it is complete."""

    def __init__(self, path: Path | None, schema: "pa.Schema", compressed: bool) -> None:
        import pyarrow as pa

        self._path, self._schema = path or Path("memory"), schema
        self._waiting: list[list[np.ndarray]] = []
        self._rows = 0
        codec = "lz4" if compressed else None
        options = pa.ipc.IpcWriteOptions(compression=codec, use_threads=False)
        with naming(self._path):
            self._file: Any = pa.BufferOutputStream() if path is None else path.open("wb")
            try:
                self._writer = pa.ipc.new_stream(self._file, schema, options=options)
                self._file.flush()
            except BaseException:
                self._file.close()
                raise

    def close(self) -> None:
        """Write what waits, and the end; OSError with the file's name if it cannot."""
        try:
            self._flush()
        finally:
            with naming(self._path), self._file:
                self._writer.close()

    def content(self) -> "pa.Buffer":
        """Return what was written to memory, once it is closed."""
        return self._file.getvalue()

    def _append(self, columns: list[np.ndarray]) -> None:
        self._waiting.append(columns)
        self._rows += len(columns[0])
        if self._rows >= _BATCH_ROWS:
            self._flush()

    def _flush(self) -> None:
        import pyarrow as pa

        if not self._rows:
            return
        parts, self._waiting, self._rows = self._waiting, [], 0
        columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
        with naming(self._path):
            self._writer.write_batch(pa.record_batch(self._arrays(columns), schema=self._schema))
            self._file.flush()

    def _arrays(self, columns: list[np.ndarray]) -> "list[pa.Array]":
        return [_arrow(column) for column in columns]


class TrajectoryStream(_Stream):
    """`trajectory.arrows`: one row per UAV and recorded step, ordered by time."""

    def __init__(
        self,
        path: Path | None,
        columns: tuple[Column, ...],
        every: int,
        uav_ids: tuple[int, ...],
        step_us: int,
        compressed: bool,
        about: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        """Make the file.

        Args:
            path: The file; None for memory.
            columns: What is recorded.
            every: Record every so many steps.
            uav_ids: System ids, in the order of the steps' arrays.
            step_us: Control period [µs].
            compressed: With LZ4, which takes no longer than to write the rest would.
            about: Metadata of the file, besides `step_us` and `every`.

        Raises:
            OSError: With the file's name.
        """
        import pyarrow as pa

        self._columns, self._every, self._step_us = columns, every, step_us
        self._ids = np.array(uav_ids, np.int16)
        fields = [
            pa.field("time_s", pa.float64(), nullable=False, metadata={"unit": "s"}),
            pa.field("uav", pa.int16(), nullable=False),
            *(
                pa.field(c.name, pa.from_numpy_dtype(c.dtype), False, {"unit": c.unit})
                for c in columns
            ),
        ]
        metadata = {**about, "step_us": str(step_us), "every": str(every)}
        super().__init__(path, pa.schema(fields, metadata), compressed)

    def add(self, steps: Steps) -> None:
        """Record the next steps; OSError with the file's name if it cannot."""
        part = Steps(
            steps.first, *(a[-steps.first % self._every :: self._every] for a in steps[1:])
        )
        if not part.length:
            return
        numbers = np.arange(steps.first, steps.first + steps.length)
        numbers = numbers[numbers % self._every == 0]
        self._append(
            [
                np.repeat(numbers * self._step_us / 1e6, len(self._ids)),
                np.tile(self._ids, len(numbers)),
                *(np.array(column.of(part)).ravel() for column in self._columns),
            ]
        )


class EventStream(_Stream):
    """`events.arrows`: one row per event, ordered by time."""

    def __init__(self, path: Path | None, step_us: int) -> None:
        """Make the file, None for memory; OSError with its name if it cannot."""
        import pyarrow as pa

        fields = [
            pa.field("time_s", pa.float64(), nullable=False, metadata={"unit": "s"}),
            pa.field("step", pa.int64(), nullable=False),
            pa.field("uav", pa.int16(), nullable=False),
            pa.field("actuator", pa.dictionary(pa.int8(), pa.string()), nullable=False),
            pa.field("value", pa.float64(), nullable=False, metadata={"unit": "rad, throttle N"}),
        ]
        names = pa.lib.StringBuilder()  # pa.array would load pandas
        names.append_values(ACTUATORS)
        self._actuators = names.finish()
        super().__init__(path, pa.schema(fields, {"step_us": str(step_us)}), True)

    def add(self, events: Events) -> None:
        """Record the next events; OSError with the file's name if it cannot."""
        time_s, step, uav, channel, value = (events[name] for name in _EVENT)
        self._append([time_s, step, uav.astype(np.int16), channel.astype(np.int8), value])

    def _arrays(self, columns: list[np.ndarray]) -> "list[pa.Array]":
        import pyarrow as pa

        arrays = super()._arrays(columns)
        channel = _EVENT.index("channel")
        arrays[channel] = pa.DictionaryArray.from_arrays(arrays[channel], self._actuators)
        return arrays


def stream_of(table: "pa.Table") -> "pa.Buffer":
    """Return a whole table as the stream that a recording is, in memory."""
    import pyarrow as pa

    stream = pa.BufferOutputStream()
    with pa.ipc.new_stream(stream, table.schema) as writer:
        writer.write_table(table, _BATCH_ROWS)
    return stream.getvalue()


EVENTS, TRAJECTORY = "events.arrows", "trajectory.arrows"
_END = b"\xff\xff\xff\xff\x00\x00\x00\x00"
"""Ends a stream whose writer closed it."""


def is_complete(path: Path | str) -> bool:
    """Return whether a recording was written to its end; a torn one is read up to its tear."""
    with Path(path).open("rb") as file:
        file.seek(0, 2)
        file.seek(max(file.tell() - len(_END), 0))
        return file.read() == _END


def batches(source: "Path | str | pa.Buffer") -> Iterator["pa.RecordBatch"]:
    """Yield what was recorded in a file, or in memory, up to the last complete batch.

    Raises:
        BadInput: There is no such file, or it is no recording.
    """
    with _reader(source) as reader:
        yield from _complete(reader)


def read_table(source: "Path | str | pa.Buffer") -> "pa.Table":
    """Return what was recorded as one table, up to the last complete batch.

    Raises:
        BadInput: As of `batches`.
    """
    import pyarrow as pa

    with _reader(source) as reader:
        return pa.Table.from_batches(_complete(reader), reader.schema)


@contextlib.contextmanager
def _reader(source: "Path | str | pa.Buffer") -> Iterator["pa.ipc.RecordBatchStreamReader"]:
    import pyarrow as pa

    path = source if isinstance(source, pa.Buffer) else Path(source)
    try:
        file: Any = pa.BufferReader(path) if isinstance(path, pa.Buffer) else open_file(path)
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
        yield reader


def _complete(reader: "pa.ipc.RecordBatchStreamReader") -> Iterator["pa.RecordBatch"]:
    import pyarrow as pa

    while True:
        try:
            yield reader.read_next_batch()
        except (StopIteration, pa.ArrowInvalid, OSError):  # its end, or where it was torn
            return


def read_recording(folder: Path | str) -> Recording:
    """Read the full recording of a run folder into memory, as `ftc_lab.theory` needs it.

    Raises:
        BadInput: There is none, it is not a full one, or it is torn.
    """
    path, summary = Path(folder) / TRAJECTORY, read_summary(folder)
    n = len(summary.uavs)
    steps, columns = Steps.room(summary.steps, n), COLUMNS
    row = 0
    for batch in batches(path):
        if row == 0 and ESTIMATES[0].name in batch.schema.names:
            steps, columns = Steps.room(summary.steps, n, estimated=True), (*COLUMNS, *ESTIMATES)
        missing = [column.name for column in columns if column.name not in batch.schema.names]
        if missing or batch.schema.metadata[b"every"] != b"1":
            raise BadInput(f"{path} is no full recording", "fly again with --record full")
        count = len(batch) // n
        part = steps.part(row, row + count)
        for column in columns:
            column.of(part)[:] = batch.column(column.name).to_numpy().reshape(count, n)
        row += count
    if row < summary.steps:
        raise BadInput(f"{path} ends after {row} of {summary.steps} steps", "fly again")
    repeats = [[uav.channels[name].repeats for name in ACTUATORS] for uav in summary.uavs]
    ending = Ending(summary.mode, row, np.array(repeats), summary.wall_s, summary.loss)
    step_us = round(summary.duration_s * 1e6 / max(row, 1))
    return Recording.of(steps, ending, tuple(uav.id for uav in summary.uavs), step_us)
