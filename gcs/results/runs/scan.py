"""Searching a folder for runs, by the names of the files in its folders."""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from gcs.results.flight_mark import FLIGHT
from gcs.results.runs.run import Kind
from gcs.results.store import EVENTS, TRAJECTORY
from mavlink_defs.config.problems import counted

NOTE = "note.txt"
"""The user's note on a run, in its folder."""
SUMMARY = "summary.json"
_CAMPAIGN, _BASELINE = "request.yaml", "baseline.json"
_REPRODUCE = {"data", "figures"}
_FLIGHT = {FLIGHT, SUMMARY, TRAJECTORY, EVENTS, "trajectory.npz", "flight.tlog", "processes"}
_STAMPED = {FLIGHT, SUMMARY, _CAMPAIGN, _BASELINE, NOTE, "draws.parquet", "results", "until.json"}
_STAMPED |= {"report.md", EVENTS}
_LOGS = (".tlog", ".bin", ".ulg", ".mat")
_DEEPEST = 5
"""Folders in folders that are searched."""


@dataclass(frozen=True)
class Found:
    """A folder of results.

    Attributes:
        name: Relative to the folder that is searched.
        path: The folder.
        kind: What made it; "flight" also stands for a fleet and for flights by ArduPilot.
        stamp: Names, times, sizes and inodes of the files that its entry is made of. Another entry
            has another stamp, unless a file was changed in place within the file system's clock.
    """

    name: str
    path: Path
    kind: Kind
    stamp: str


@dataclass(frozen=True)
class Foreign:
    """What is no run.

    Attributes:
        name: Relative to the folder that is searched.
        reason: Why not.
    """

    name: str
    reason: str


def scan(root: Path) -> Iterator[Found | Foreign]:
    """Yield the runs in a folder, or the folder itself if it is one; what is inside a run is its.

    Raises:
        OSError: The folder cannot be read.
    """
    entries = _entries(root)
    kind = _kind_of({entry.name for entry in entries})
    if kind is not None:
        yield Found(root.name or str(root), root, kind, _stamp(entries))
        return
    for entry in entries:
        if entry.name.startswith("."):
            continue
        if entry.is_dir():
            yield from _scan(Path(entry.path), entry.name, _DEEPEST)


def _scan(path: Path, name: str, depth: int) -> Iterator[Found | Foreign]:
    try:
        entries = _entries(path)
        kind = _kind_of({entry.name for entry in entries})
        stamp = "" if kind is None else _stamp(entries)
    except OSError as problem:
        yield Foreign(name, f"cannot be read: {problem.strerror}")
        return
    if kind is not None:
        yield Found(name, path, kind, stamp)
        return
    folders = [entry for entry in entries if not entry.name.startswith(".") and entry.is_dir()]
    if not folders or depth == 0:
        yield Foreign(name, _reason(entries))
        return
    for entry in folders:
        yield from _scan(Path(entry.path), f"{name}/{entry.name}", depth - 1)


def _reason(entries: list[os.DirEntry[str]]) -> str:
    """Return why a folder is no run."""
    logs = [entry.name for entry in entries if entry.name.lower().endswith(_LOGS)]
    if logs:
        return (
            f"no run: {counted(len(logs), 'log')}, such as {logs[0]}; gcs log lists what is in one"
        )
    return "no run: it has no results of gcs" if entries else "empty"


def _entries(path: Path) -> list[os.DirEntry[str]]:
    with os.scandir(path) as found:
        return sorted(found, key=lambda entry: entry.name)


def _kind_of(names: set[str]) -> Kind | None:
    if _CAMPAIGN in names:
        return "campaign"
    if _BASELINE in names:
        return "baseline"
    if names & _FLIGHT:
        return "flight"
    return "reproduce" if names >= _REPRODUCE else None


def _stamp(entries: list[os.DirEntry[str]]) -> str:
    parts = []
    for entry in entries:
        if entry.name in _STAMPED:
            status = entry.stat()
            parts.append(f"{entry.name}:{status.st_mtime_ns}:{status.st_size}:{status.st_ino}")
    return "|".join(parts)
