"""Tables of numbers, CSV, Parquet and MAT, by a column map or with our own names."""

import bz2
import gzip
import io
import lzma
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from gcs.console.errors import BadInput
from gcs.results.logs.clocks import longest_stretch, utc
from gcs.results.logs.column_map import ColumnMap, MappedColumn, TimeColumn, bundled_maps, read_map
from gcs.results.logs.mat_file import mat_vectors
from gcs.results.logs.names import UNITS, factor
from gcs.results.logs.reading import chosen_vehicle, reading
from gcs.results.logs.table import FlightTable, by_name
from mavlink_defs.config.problems import counted
from mavlink_defs.config.user_files import open_file
from mavlink_defs.visible import visible

if TYPE_CHECKING:
    import pyarrow as pa

_PACKED: Mapping[str, Callable[[BinaryIO], Any]] = {
    ".xz": lzma.open,
    ".gz": gzip.open,
    ".bz2": bz2.open,
}
_SEPARATORS = ",;\t"
_LEAST_NUMBERS = 0.5  # of a column; else it is one of texts
_LONGEST_S = 2**32 / 1e3  # simulated time in messages; what is more is a date
_SHOWN = 12  # columns that a message names

_Columns = Mapping[str, np.ndarray]


def read_columns(path: Path, kind: str, uav: int | None, map_file: Path | None) -> FlightTable:
    """Read a table of numbers.

    Args:
        path: The file.
        kind: "csv", "parquet" or "mat".
        uav: System id, of a table with a column `uav`; None: the first one.
        map_file: A column map; None: the table has our names, or a bundled map fits.

    Raises:
        BadInput: It cannot be read, or no map fits.
        ConfigError: The column map is none.
    """
    remarks: list[str] = []
    if kind == "csv":
        columns = _of_csv(path, remarks)
    else:
        columns = _of_parquet(path) if kind == "parquet" else mat_vectors(path)
    if not any(map(len, columns.values())):
        text = f"{path} has no column of numbers"
        raise BadInput(text, "rows of numbers, apart by , ; or tabs, with decimal points, in UTF-8")
    chosen = _map_of(path, columns, map_file)
    columns = _beside(chosen.time.column, columns)
    columns = _of_one(path, columns, uav, remarks)
    time_s, clock, since_s = _times(path, columns, chosen.time)
    absent = [one.column for one in chosen.channels.values() if one.column not in columns]
    if absent:
        remarks.append(f"it has no column {', '.join(map(repr, absent))}")
    rows = np.flatnonzero(np.isfinite(time_s))
    stretch, jumps = longest_stretch(time_s[rows])
    rows = rows[stretch]
    remarks += jumps
    begin = 0.0 if clock == "simulated" else float(time_s[rows[0]])
    channels = by_name(
        one.channel(name, time_s[rows] - begin, columns[one.column][rows], clock)
        for name, one in chosen.channels.items()
        if one.column in columns
    )
    if not channels:
        raise BadInput(f"{path} has no numbers in its columns")
    return FlightTable(
        title=f"{visible(path.name)}, {chosen.title}" if chosen.title else visible(path.name),
        kind=kind,
        channels=channels,
        started=utc(since_s + begin) if clock == "UTC" else None,
        remarks=tuple(remarks),
    )


def _map_of(path: Path, columns: _Columns, map_file: Path | None) -> ColumnMap:
    """Return the map that is named, or the first that fits."""
    shown = ", ".join(list(columns)[:_SHOWN]) + (", ..." if len(columns) > _SHOWN else "")
    if map_file is not None:
        found = read_map(map_file)
        if absent := found.missing(columns):
            named = ", ".join(map(repr, absent))
            text = f"{path} has no column of numbers {named}, which {map_file} names"
            raise BadInput(text, f"it has {shown}")
        return found
    own = {name: MappedColumn(column=name) for name in columns if name in UNITS}
    if "time_s" in columns and own:
        return ColumnMap(time=TimeColumn(column="time_s"), channels=own)
    fitting = next((one for one in bundled_maps() if one.fits(columns)), None)
    if fitting is None:
        raise BadInput(
            f"{path}: nobody says what its columns are: it has {shown}",
            "write a column map and name it with --columns; docs/how-to/read-logs.md has one",
        )
    return fitting


def _beside(time: str, columns: _Columns) -> _Columns:
    """Return numbers for each time: MAT files have columns of other lengths, too."""
    return {
        name: values
        for name, values in columns.items()
        if len(values) == len(columns[time]) and (values.dtype.kind != "M" or name == time)
    }


def _of_one(path: Path, columns: _Columns, uav: int | None, remarks: list[str]) -> _Columns:
    """Return the rows of one UAV, of a table that has several."""
    if "uav" not in columns:
        if uav is not None:
            raise BadInput(f"--uav is {uav}, and {path} does not say whose it is: no column 'uav'")
        return columns
    ids = [int(one) for one in np.unique(columns["uav"]) if np.isfinite(one)]
    chosen, others = chosen_vehicle(path, ids, uav, ids[0])
    remarks += others
    rows = columns["uav"] == chosen
    return {name: values[rows] for name, values in columns.items()}


def _times(path: Path, columns: _Columns, of: TimeColumn) -> tuple[np.ndarray, str, float]:
    """Return times [s], NaN in rows without one, their clock, and when 0 was, since 1970 [s]."""
    raw = columns[of.column]
    if raw.dtype.kind == "M":
        since = raw.astype("datetime64[ns]")
        first = since[~np.isnat(since)].min()
        time_s = (since - first) / np.timedelta64(1, "s")
        return time_s, "UTC", float(first.astype(np.int64) / 1e9)
    time_s = raw * (factor(of.unit, "s") or 1.0)
    if np.isfinite(time_s).sum() < max(2, len(time_s) // 2):
        text = f"{path}: its column {of.column!r} is no time"
        raise BadInput(f"{text}, expected dates or numbers in {of.unit}")
    known = time_s[np.isfinite(time_s)]
    is_ours = "uav" in columns and known.min() >= 0.0 and known.max() < _LONGEST_S
    return time_s, "simulated" if is_ours else "log", 0.0


# files


def _of_csv(path: Path, remarks: list[str]) -> _Columns:
    """Return the columns of a CSV file, packed or not, of which the first of each name counts."""
    from pyarrow import csv

    with reading(path, "is cut off, or not packed as its name says"), open_file(path) as file:
        packed = _PACKED.get(path.suffix.lower())
        data = file.read() if packed is None else packed(file).read()
    data = data.decode("utf-8-sig", "replace").encode()  # a broken byte costs its cell only
    head = data[: data.find(b"\n")].decode()
    separator = max(_SEPARATORS, key=head.count)
    wrong: list[int] = []

    def skip(row: csv.InvalidRow) -> str:
        wrong.append(row.actual_columns)
        return "skip"

    options = csv.ParseOptions(delimiter=separator, invalid_row_handler=skip)
    with reading(path, "is no table of numbers"):
        table = csv.read_csv(io.BytesIO(data), parse_options=options)
    if wrong:
        remarks.append(f"{counted(len(wrong), 'row')} with more or fewer columns left out")
    return _of_table(table)


def _of_parquet(path: Path) -> _Columns:
    from pyarrow import parquet

    with reading(path, "is no Parquet file"), open_file(path) as file:
        return _of_table(parquet.read_table(file))


def _of_table(table: "pa.Table") -> _Columns:
    """Return the columns of numbers and dates, with NaN where they have something else."""
    found: dict[str, np.ndarray] = {}
    for field, column in zip(table.schema, table.columns, strict=True):
        values = column.to_numpy()
        if values.dtype.kind == "O":
            values = np.array([_number(one) for one in values.tolist()])
            if np.isfinite(values).sum() <= _LEAST_NUMBERS * len(values):
                continue
        if values.dtype.kind in "fiubM" and field.name not in found:
            found[field.name] = values if values.dtype.kind == "M" else values.astype(float)
    return found


def _number(text: object) -> float:
    try:
        return float(str(text))
    except ValueError:
        return float("nan")
