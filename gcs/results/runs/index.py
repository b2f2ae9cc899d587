"""The list of runs below a folder, with an index that saves reading again what has not changed.

The index is a file of SQLite in the folder. It holds nothing that the folders do not: an entry
counts as long as the stamp of its folder's files is the same, whatever does not fit is read again,
and where the file cannot be read or written the list is made without it.
"""

import contextlib
import json
import sqlite3
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from gcs.console.errors import BadInput, GcsError
from gcs.results.figures import FlightSummary
from gcs.results.runs.read import read_run
from gcs.results.runs.run import Run
from gcs.results.runs.scan import Foreign, Found, scan

INDEX = ".runs.sqlite"
_LAYOUT = 4
"""Number of this layout, and of what entries say; an index of another one is made again."""
_PATIENCE_S = 2.0  # for another command that writes the index


@dataclass(frozen=True)
class Listing:
    """What is below a folder.

    Attributes:
        runs: The newest first.
        foreign: Folders that are no runs, or damaged ones, by name.
        read: How many folders were read; the others are as the index has them.
    """

    runs: list[Run]
    foreign: list[Foreign]
    read: int


def list_runs(
    root: Path, *, rebuild: bool = False, on_read: Callable[[int, int], None] | None = None
) -> Listing:
    """List the runs below a folder.

    Args:
        root: The folder.
        rebuild: Read every folder, whatever the index has.
        on_read: Called with how many folders were read, of how many.

    Raises:
        BadInput: There is no such folder, or it cannot be read.
    """
    try:
        entries = list(scan(root))
    except OSError as problem:
        raise BadInput(
            f"cannot list the runs in {root}: {problem.strerror}",
            "gcs fly makes the folder runs; name another one",
        ) from None
    found = [entry for entry in entries if isinstance(entry, Found)]
    foreign = [entry for entry in entries if isinstance(entry, Foreign)]
    indexed = not any(one.path == root for one in found)  # a run's own folder gets no index
    known = {} if rebuild or not indexed else _known(root)
    runs: list[Run] = []
    new: dict[str, tuple[str, Run]] = {}
    waiting = []
    for one in found:
        stamp, run = known.get(one.name, ("", None))
        if run is not None and stamp == one.stamp:
            runs.append(run)
        else:
            waiting.append(one)
    for number, one in enumerate(waiting):
        if on_read is not None:
            on_read(number, len(waiting))
        try:
            run = read_run(one)
        except (GcsError, OSError) as problem:
            foreign.append(Foreign(one.name, _line(problem)))
            continue
        runs.append(run)
        if run.is_settled:
            new[one.name] = (one.stamp, run)
    gone = known.keys() - {run.name for run in runs}
    if indexed and (new or gone or rebuild):
        _store(root, new, gone, rebuild)
    runs.sort(key=lambda run: (run.time, run.name), reverse=True)
    return Listing(runs, sorted(foreign, key=lambda one: one.name), len(waiting))


def _line(problem: Exception) -> str:
    text = problem.strerror if isinstance(problem, OSError) else None
    return f"cannot be read: {text}" if text else str(problem).partition("\n")[0]


def _known(root: Path) -> Mapping[str, tuple[str, Run | None]]:
    """Return stamp and entry of each folder that the index has; nothing if it cannot be used."""
    if not (root / INDEX).is_file():
        return {}
    with contextlib.suppress(sqlite3.Error), _database(root, "ro") as database:
        if database.execute("PRAGMA user_version").fetchone()[0] != _layout():
            return {}
        rows = database.execute("SELECT name, stamp, entry FROM runs").fetchall()
        return {name: (stamp, _run_of(name, entry)) for name, stamp, entry in rows}
    return {}


def _run_of(name: str, entry: str) -> Run | None:
    with contextlib.suppress(ValueError, TypeError, KeyError):
        run = Run.from_json(json.loads(entry))
        return run if run.name == name else None
    return None


def _store(
    root: Path, new: Mapping[str, tuple[str, Run]], gone: Iterable[str], rebuild: bool
) -> None:
    """Write entries to the index, all of them or none; without a word if it cannot be written."""
    rows = [(name, stamp, json.dumps(run.to_json())) for name, (stamp, run) in new.items()]
    for attempt in range(2):
        try:
            with _database(root, "rwc") as database, database:
                database.execute("BEGIN IMMEDIATE")
                if rebuild or database.execute("PRAGMA user_version").fetchone()[0] != _layout():
                    database.execute("DROP TABLE IF EXISTS runs")
                    database.execute(f"PRAGMA user_version = {_layout()}")
                database.execute(
                    "CREATE TABLE IF NOT EXISTS runs "
                    "(name TEXT PRIMARY KEY, stamp TEXT NOT NULL, entry TEXT NOT NULL)"
                )
                database.executemany("DELETE FROM runs WHERE name = ?", [(name,) for name in gone])
                database.executemany("INSERT OR REPLACE INTO runs VALUES (?, ?, ?)", rows)
            return
        except sqlite3.OperationalError:  # locked by another command, read-only, a full disk
            return
        except (sqlite3.Error, OverflowError, UnicodeError):  # no database, or a damaged one
            if attempt:
                return
            with contextlib.suppress(OSError):
                (root / INDEX).unlink()


@contextlib.contextmanager
def _database(root: Path, mode: str) -> Iterator[sqlite3.Connection]:
    address = f"{(root / INDEX).absolute().as_uri()}?mode={mode}"
    database = sqlite3.connect(address, _PATIENCE_S, isolation_level=None, uri=True)
    try:
        yield database
    finally:
        database.close()


def _layout() -> int:
    """Return a number of the layout that also changes with the attributes of an entry."""
    names = "".join(sorted((*Run.__dataclass_fields__, *FlightSummary.__dataclass_fields__)))
    return _LAYOUT * 1_000_000 + sum(map(ord, names)) % 1_000_000
