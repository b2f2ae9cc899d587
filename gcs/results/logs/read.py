"""Reading a log, of whatever kind, into the table of a flight."""

import contextlib
from dataclasses import replace
from pathlib import Path

import numpy as np

from gcs.console.errors import BadInput
from gcs.results.logs.column_map import read_map
from gcs.results.logs.outputs import with_columns, with_shares
from gcs.results.logs.shortcomings import shortcomings
from gcs.results.logs.table import FlightTable
from gcs.results.store import TRAJECTORY
from mavlink_defs.config.user_files import open_file

KINDS = {
    ".tlog": "tlog",
    ".bin": "bin",
    ".ulg": "ulg",
    ".csv": "csv",
    ".parquet": "parquet",
    ".mat": "mat",
    ".arrows": "recording",
}
"""Kinds of logs by how their files' names end."""
_PACKED = {".xz", ".gz", ".bz2"}
_TABLES = {"csv", "parquet", "mat"}

_BEGINNINGS = {b"\xa3\x95": "bin", b"ULog": "ulg", b"MATLAB": "mat", b"PAR1": "parquet"}
"""How files of some kinds begin, whatever they are called."""


def kind_of(path: Path) -> str | None:
    """Return the kind of a log, by its beginning or its name; a run folder is one, too.

    None if neither says so; it may be a telemetry log, whose beginning is a time.
    """
    if path.is_dir():
        return "recording" if (path / TRAJECTORY).exists() else None
    with contextlib.suppress(OSError), open_file(path) as file:
        head = file.read(8)
        for begin, kind in _BEGINNINGS.items():
            if head.startswith(begin):
                return kind
    suffixes = [one.lower() for one in path.suffixes]
    if suffixes and suffixes[-1] in _PACKED:
        return "csv" if suffixes[-2:-1] == [".csv"] else None
    return KINDS.get(suffixes[-1]) if suffixes else None


def read_flight(path: Path, uav: int | None = None, columns: Path | None = None) -> FlightTable:
    """Read a log.

    Args:
        path: The file, or a run folder.
        uav: System id, where a log has several; None: the one with most to say.
        columns: A column map; None: tables of numbers have our names, or a bundled map fits. Of
            other logs it makes channels of others, as of outputs.

    Returns:
        The flight; its remarks say what is missing in it as well.

    Raises:
        BadInput: It cannot be read, or there is nothing in it.
        ConfigError: The column map is none.
    """
    kind = kind_of(path)
    if columns is not None and (kind == "recording" or path.is_dir()):
        raise BadInput(f"--columns is of logs of others, and {path} is a recording of ours")
    if uav is not None and kind in {"bin", "ulg"}:
        raise BadInput(f"--uav is {uav}, and {path} is of one vehicle", "leave it out")
    with np.errstate(all="ignore"):  # of damaged numbers
        flight = _read(path, kind, uav, columns)
        if columns is not None and kind not in _TABLES:
            flight = with_columns(flight, read_map(columns))
        flight = with_shares(flight)
    return replace(flight, remarks=(*flight.remarks, *shortcomings(flight)))


def _read(path: Path, kind: str | None, uav: int | None, columns: Path | None) -> FlightTable:
    match kind:
        case "recording":
            from gcs.results.logs.recorded import read_recorded

            return read_recorded(path, uav)
        case "tlog" | None if not path.is_dir():
            from gcs.results.logs.telemetry import read_telemetry

            return read_telemetry(path, uav)
        case "bin":
            from gcs.results.logs.dataflash import read_dataflash

            return read_dataflash(path)
        case "ulg":
            from gcs.results.logs.ulog import read_ulog

            return read_ulog(path)
        case None:
            expected = ", ".join((*KINDS, *(f".csv{one}" for one in sorted(_PACKED))))
            text = f"{path} is a folder without a recording"
            raise BadInput(f"{text}, expected a run folder or a log: {expected}")
        case _:
            from gcs.results.logs.number_tables import read_columns

            return read_columns(path, kind, uav, columns)
