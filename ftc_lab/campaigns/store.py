"""The folder of a campaign: a table in Parquet that grows by whole files.

It holds::

    request.yaml                the request, and the code that flies it; it marks the folder
    scenario.yaml               the base scenario, with what it extends
    draws.parquet               one row per planned flight, written before the first flight
    results/part-NNNNN.parquet  rows of flights that ended; no file is written twice
    flights/ROW/                trajectories and scenario of chosen flights

A file gets its name only when it is complete, so whatever ends a campaign, the flights that are
stored stay, and none is stored by half.

Columns of the draws: ``row`` (int64), ``variant`` (string), ``draw`` (int64, the same for every
variant that flies it), ``seed`` (int64), ``factor.NAME`` (double; string where a value is none,
with lists and mappings as JSON), and of drawn faults
``fault.NAME.uav`` (int64), ``.actuator``, ``.kind`` (string), ``.start_s``, ``.end_s`` (null for
good), ``.severity`` (double); of a sensor's ``.sensor`` (string), ``.instance`` (int64) and
``.value`` (double) in place of ``.actuator`` and ``.severity``. The results have these and
`results_schema`'s.
"""

import contextlib
import fcntl
import functools
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Literal, get_args

from ftc_lab.campaigns.mark import MARK, mark_of
from gcs.console.errors import BadInput
from gcs.results.figures import FLIGHT_FIGURES, UAV_FIGURES, Figure
from mavlink_defs.config.output_files import naming

if TYPE_CHECKING:
    import pyarrow as pa

Outcome = Literal[
    "completed",
    "heading_lost",
    "attitude_lost",
    "ground",
    "model_left",
    "control_failed",
    "crashed",
    "failed",
    "invalid",
]
OUTCOMES: tuple[Outcome, ...] = get_args(Outcome)
"""From best to worst. A flight has the worst that applies: a UAV's heading was more than 90° off,
its roll or pitch, it hit the ground, the model's validity ended, either of which ends the flight, a
law's command was not finite, the flight killed its process three times. ``failed``: it could not be
computed for another reason. ``invalid``: the values are no scenario, which only points of a sweep
may be."""

_DRAWS = "draws.parquet"
_CELLS, _BLOCKS = 1_000_000, 16  # values that are read at once; how many times as many are kept
_PART = ".part"  # ends the name of a file that is being written


def results_schema(draws: "pa.Schema", uav_ids: Sequence[int]) -> "pa.Schema":
    """Return the columns of the results, given the columns of the draws.

    ``outcome`` is one of `OUTCOMES`, ``reason`` says why it is not ``completed``. Figures are
    defined in `gcs.results.figures`; null where a flight has none. ``events``, ``messages``,
    ``neighbour_messages`` and savings are of the whole fleet, ``uav{k}.…`` of the UAV with id k.
    ``detection_s`` and ``return_s`` are delays of the diagnosis after the beginning and the end of
    a fault, ``false_alarms`` actuators declared lost in which no fault had begun.
    """
    import pyarrow as pa

    def columns(figures: Sequence[Figure[Any]], prefix: str = "") -> Iterator[pa.Field]:
        for figure in figures:
            yield pa.field(prefix + figure.name, pa.int64() if figure.whole else pa.float64())

    fields = [pa.field(name, pa.string()) for name in ("outcome", "reason")]
    fields += columns(FLIGHT_FIGURES)
    for uav_id in uav_ids:
        fields += columns(UAV_FIGURES, f"uav{uav_id}.")
    fields += [pa.field(name, pa.string()) for name in ("version", "digest")]
    return pa.schema([*draws, *fields])


def write_draws(folder: Path, draws: "pa.Table") -> None:
    """Write the planned flights.

    Raises:
        OSError: They cannot be written; the file is named.
    """
    _write_table(folder / _DRAWS, draws)


def read_draws(folder: Path) -> "pa.Table":
    """Read the planned flights, ordered by row.

    Raises:
        BadInput: The folder has none, or they cannot be read.
    """
    import pyarrow.parquet as pq

    with _reading_draws(folder):
        return pq.read_table(folder / _DRAWS)


def planned_rows(folder: Path) -> int:
    """Return the number of planned flights.

    Raises:
        BadInput: As of `read_draws`.
    """
    import pyarrow.parquet as pq

    with _reading_draws(folder):
        return int(pq.read_metadata(folder / _DRAWS).num_rows)


@contextlib.contextmanager
def _reading_draws(folder: Path) -> Iterator[None]:
    import pyarrow as pa

    try:
        yield
    except FileNotFoundError:
        mark_of(folder)  # says so if it is no campaign at all
        raise BadInput(
            f"the campaign in {folder} has no draws yet", "the command that began it continues it"
        ) from None
    except (OSError, pa.ArrowException) as problem:
        raise BadInput(f"{folder / _DRAWS} cannot be read: {problem}") from problem


@contextlib.contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Keep other commands from writing results to a folder; a lock that ends with the process.

    Raises:
        BadInput: Another command writes there.
    """
    with (folder / MARK).open("rb") as file:
        while not _locked(file, fcntl.LOCK_EX):
            if not _locked(file, fcntl.LOCK_SH):
                raise BadInput(
                    f"another command flies the campaign in {folder}",
                    "wait for its end, or choose another folder with --out",
                )
            # nobody flies it: `gcs runs` looks at the lock, which takes it for a moment
        yield


def _locked(file: BinaryIO, kind: int) -> bool:
    """Take a lock on a file if nobody holds another one; return whether it is taken."""
    try:
        fcntl.flock(file, kind | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def append_results(folder: Path, rows: "pa.Table") -> None:
    """Store rows in a file of their own.

    Raises:
        OSError: It cannot be written; it is named.
    """
    parts = folder / "results"
    with naming(parts):
        parts.mkdir(exist_ok=True)
    numbers = (int(path.stem.rpartition("-")[2]) for path in _parts(folder))
    _write_table(parts / f"part-{max(numbers, default=-1) + 1:05d}.parquet", rows)


def read_results(folder: Path, columns: Sequence[str] | None = None) -> "pa.Table":
    """Read the flights that ended so far, ordered by row; columns in the order of the files.

    Args:
        folder: Folder of a campaign.
        columns: Their names; None for all.

    Raises:
        BadInput: It is no campaign, a column does not exist, or a file cannot be read.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    schema = _schema(folder)
    if unknown := [name for name in columns or () if name not in schema.names]:
        raise BadInput(
            f"the results in {folder} have no column {', '.join(map(repr, unknown))}",
            f"they have {', '.join(schema.names)}",
        )
    known = list(schema.names if columns is None else columns)
    needed = [*known, *({"row"} - set(known))]
    tables = [pa.schema([schema.field(name) for name in needed]).empty_table()]
    with _reading(folder):
        tables += (pq.read_table(path, columns=needed) for path in _parts(folder))
    return pa.concat_tables(tables).sort_by("row").select(known)


class Results:
    """The results of a campaign, read by blocks of columns: all of a million flights are much.

    Rows are in the order of the files; those that are written later are not seen.

    Attributes:
        schema: Their columns.

    Raises:
        BadInput: The folder is no campaign, or a file cannot be read.
    """

    def __init__(self, folder: Path) -> None:
        import pyarrow.parquet as pq

        self.schema = _schema(folder)
        self._folder, self._paths = folder, list(_parts(folder))
        with _reading(folder):
            rows = sum(pq.read_metadata(path).num_rows for path in self._paths)
        self._width = max(1, _CELLS // max(1, rows))
        self._block = functools.lru_cache(maxsize=_BLOCKS)(self._read)

    def column(self, name: str) -> "pa.Array":
        """Return a column; texts as a dictionary.

        Raises:
            BadInput: A file cannot be read.
        """
        block = self._block(self.schema.get_field_index(name) // self._width)
        return block.column(name).unify_dictionaries().combine_chunks()

    def _read(self, block: int) -> "pa.Table":
        import pyarrow as pa
        import pyarrow.parquet as pq

        first = block * self._width
        fields = pa.schema(list(self.schema)[first : first + self._width])
        texts = [field.name for field in fields if pa.types.is_string(field.type)]
        if not self._paths:
            return fields.empty_table()
        with _reading(self._folder):
            return pa.concat_tables(
                pq.read_table(path, columns=fields.names, read_dictionary=texts)
                for path in self._paths
            )


def _schema(folder: Path) -> "pa.Schema":
    """Return the columns of the results, those planned if there are no results yet."""
    import pyarrow.parquet as pq

    for path in _parts(folder):
        with _reading(folder):
            return pq.read_schema(path)
    return results_schema(read_draws(folder).schema, mark_of(folder).uav_ids)


@contextlib.contextmanager
def _reading(folder: Path) -> Iterator[None]:
    """Turn errors of reading the results into ours.

    Raises:
        BadInput: A file cannot be read.
    """
    import pyarrow as pa

    try:
        yield
    except (OSError, pa.ArrowException) as problem:
        raise BadInput(
            f"the results in {folder} cannot be read: {problem}",
            "remove the damaged file; the command that flew the campaign flies its rows again",
        ) from problem


def _parts(folder: Path) -> Iterator[Path]:
    yield from sorted((folder / "results").glob("part-*.parquet"))


def _write_table(path: Path, table: "pa.Table") -> None:
    """Write a table; the name appears when the file is complete."""
    import pyarrow.parquet as pq

    part = path.with_name(f".{path.name}{_PART}")  # readers of whole folders skip hidden files
    try:
        with naming(path):
            pq.write_table(table, part)
            part.replace(path)
    except OSError:
        part.unlink(missing_ok=True)
        raise
