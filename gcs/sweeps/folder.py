"""The folder of a sweep, in which an interrupted sweep can be continued.

It holds::

    sweep.json          files and axes; it marks the folder as that of a sweep
    runs/DIGEST.json    one flown run: its values, its whole scenario, its summary

A run that has a file is not flown again. A file gets its name only when it is complete, so
however a sweep ends, only the flights in progress are lost.
"""

import hashlib
import json
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from gcs.errors import BadInput, GcsError
from gcs.results.summary import FlightSummary
from gcs.sweeps.axes import Axis
from gcs.sweeps.grid import Run

__all__ = [
    "Result",
    "default_folder",
    "flown_result",
    "keep_result",
    "known_results",
    "open_folder",
    "result_of",
]

_MARK = "sweep.json"
_PART = ".part"  # ends the name of a file that is being written


@dataclass(frozen=True)
class Result:
    """The outcome of a run.

    Attributes:
        run: The run.
        outcome: Flown to its end; lost on the way; not a scenario; not flown for another reason.
        reason: Why it was not flown to its end; else empty.
        summary: Of the part that was flown; None if nothing was.
        defect: The exception, if it is a defect of ours.
    """

    run: Run
    outcome: Literal["completed", "lost", "invalid", "failed"]
    reason: str = ""
    summary: FlightSummary | None = None
    defect: Exception | None = None


def flown_result(run: Run, summary: FlightSummary) -> Result:
    """Return the result of a run that was flown, to its end or not."""
    if summary.loss is None:
        return Result(run, "completed", summary=summary)
    return Result(run, "lost", summary.loss, summary)


def default_folder(files: Sequence[Path], axes: Sequence[Axis]) -> Path:
    """Return a folder below `runs`, the same one for the same files and axes."""
    digest = hashlib.sha256(json.dumps(_request(files, axes)).encode()).hexdigest()[:8]
    name = re.sub(r"[^\w.-]+", "-", files[0].stem)
    return Path("runs") / f"sweep-{name}-{digest}"


def _request(files: Sequence[Path], axes: Sequence[Axis]) -> dict[str, Any]:
    return {"scenarios": [str(f) for f in files], "set": {axis.key: axis.values for axis in axes}}


def open_folder(folder: Path, files: Sequence[Path], axes: Sequence[Axis]) -> None:
    """Make the folder of a sweep, or open an existing one; its finished runs stay.

    Raises:
        BadInput: It holds something else, or cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        names = {path.name for path in folder.iterdir()}
        if names - {_MARK + _PART} and _MARK not in names:
            raise BadInput(
                f"the folder {folder} holds something that is not a sweep",
                "choose another with --out, or remove it",
            )
        _write(folder / _MARK, _request(files, axes))
        (folder / "runs").mkdir(exist_ok=True)
    except OSError as problem:
        raise BadInput(
            f"cannot make the folder {folder}: {problem.strerror}", "choose another with --out"
        ) from problem


def keep_result(run: Run, summary: FlightSummary, folder: Path) -> None:
    """Write the file of a run that was flown.

    Raises:
        GcsError: It cannot be written.
    """
    kept = {
        "file": str(run.file),
        "set": run.values,
        "summary": summary.to_json(),
        "scenario": run.scenario and run.scenario.model_dump(mode="json"),
    }
    try:
        _write(_path(run, folder), kept)
    except OSError as problem:
        raise GcsError(f"cannot write to {folder}: {problem.strerror}") from problem


def known_results(runs: Iterable[Run], folder: Path) -> dict[str, Result]:
    """Return the results of runs that were flown before, by digest."""
    known: dict[str, Result] = {}
    for run in runs:
        try:
            kept = json.loads(_path(run, folder).read_bytes())
            known[run.digest] = flown_result(run, FlightSummary.from_json(kept["summary"]))
        except (OSError, ValueError, KeyError, TypeError):  # not flown, or the file is damaged
            continue
    return known


def result_of(run: Run, flown: dict[str, Result]) -> Result:
    """Return the result of one point of the grid, given those of all flights by digest."""
    if run.scenario is None:
        return Result(run, "invalid", "; ".join(map(str, run.problems)))
    return replace(flown[run.digest], run=run)  # two points may mean the same flight


def _path(run: Run, folder: Path) -> Path:
    return folder / "runs" / f"{run.digest}.json"


def _write(path: Path, tree: dict[str, Any]) -> None:
    """Write a file that exists either complete or not at all."""
    part = path.with_name(path.name + _PART)
    part.write_text(json.dumps(tree, indent=1) + "\n")
    part.replace(path)
