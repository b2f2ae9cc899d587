"""Sweeps: one in-process flight for every point of a grid of values, on all cores.

A sweep is a folder that can be gone back to::

    sweep.json          what was asked for; by it a folder is known as a sweep
    runs/DIGEST.json    one flown run: its values, its whole scenario, its summary

A run's digest covers its scenario with all defaults and the code that flies it. What has a
file is not flown again; a file appears under its name only when it is complete, so an end in
any manner costs no more than the flights that were in the air.
"""

import functools
import hashlib
import itertools
import json
import re
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numba
import numpy as np
import yaml

from gcs.errors import BadInput, GcsError
from gcs.fleet.in_process import fly_in_process
from gcs.results.summary import FlightSummary, summarise
from gcs.scenario.model import Scenario, scenario_of, scenario_tree
from mavlink_defs.config.inherit import PlaceError, with_values
from mavlink_defs.config.models import ConfigError, Problem, ProblemKind, repeated
from mavlink_defs.config.yaml_text import parse_yaml

__all__ = ["Axis", "Result", "Run", "default_folder", "fly_runs", "identity", "known_results",
           "label", "open_folder", "parse_axes", "plan", "result_of"]  # fmt: skip

_MARK = "sweep.json"
_PART = ".part"  # ends the name of a file that is being written
_ROOT = Path(__file__).parents[2]
_SOURCES = (
    "mavlink_defs/**/*.py", "mavlink_defs/*.xml", "sitl_plant/**/*.py", "ftc_autopilot/**/*.py",
    "gcs/fleet/in_process.py", "gcs/results/*.py", "gcs/scenario/*.py",
)  # fmt: skip
"""What makes a summary out of a scenario, below `_ROOT`."""


@dataclass(frozen=True)
class Axis:
    """A key of the scenario, as in ``trigger.b2_deg`` or ``faults[0].uav``, and its values."""

    key: str
    values: tuple[Any, ...]


@dataclass(frozen=True)
class Run:
    """One point of the grid.

    Attributes:
        file: Scenario file.
        name: What the file is called among those of the sweep.
        values: Values laid over it, by key.
        scenario: The two together; None if they do not make a scenario.
        problems: Why they do not.
        misplaced: Those problems that are about a key, whatever its value.
        digest: What `identity` gives; empty without a scenario.
    """

    file: Path
    name: str
    values: dict[str, Any]
    scenario: Scenario | None
    problems: tuple[Problem, ...] = ()
    misplaced: tuple[Problem, ...] = ()
    digest: str = ""


@dataclass(frozen=True)
class Result:
    """What came of a run.

    Attributes:
        run: The run.
        outcome: Flown to its end; lost on the way; not a scenario; not flown for another reason.
        reason: Why it was not flown to its end; else empty.
        summary: Of the part that was flown; None if nothing was.
    """

    run: Run
    outcome: Literal["completed", "lost", "invalid", "failed"]
    reason: str = ""
    summary: FlightSummary | None = None


class _Stopped(Exception):  # noqa: N818 - nothing is wrong
    """The sweep ends before this flight does."""


def parse_axes(texts: Iterable[str]) -> list[Axis]:
    """Read axes written as ``KEY=VALUE,VALUE``; the values are YAML, as in a list in brackets.

    Raises:
        BadInput: A text is not of this form, or a key or a value is given twice.
    """
    axes: list[Axis] = []
    for text in texts:
        axis = _parse_axis(text)
        if axis.key in (other.key for other in axes):
            raise BadInput(
                f"--set {axis.key} is given twice", "give all its values at once, with commas"
            )
        axes.append(axis)
    return axes


def _parse_axis(text: str) -> Axis:
    key, _, listed = (part.strip() for part in text.partition("="))
    try:
        values = parse_yaml(f"[{listed}]")
        labels = [label(value) for value in values]
    except (yaml.YAMLError, ValueError, TypeError, RecursionError):
        labels = []
    if not key or not labels:
        raise BadInput(
            f"--set is {text!r}, expected KEY=VALUE,VALUE,...",
            "as in --set trigger.b2_deg=0.5,1 or --set 'controller.K1=[40, 40, 40], [50, 50, 50]'",
        )
    for _, problem in repeated(labels):
        raise BadInput(f"--set {key}: {problem}", "leave one of them out")
    return Axis(key, tuple(values))


def label(value: Any) -> str:
    """A value on one line: a text as it is, anything else as JSON."""
    return value if isinstance(value, str) else json.dumps(value)


def plan(files: Sequence[Path], axes: Sequence[Axis]) -> list[Run]:
    """Make the grid: every combination of the axes' values for every file.

    A combination that is no scenario stays in it, with its problems.

    Raises:
        ConfigError: A file cannot be read, or has a problem that no combination mends.
        BadInput: A key is wrong in every file, whatever the values.
    """
    runs: list[Run] = []
    keys = [axis.key for axis in axes]
    stems = Counter(file.stem for file in dict.fromkeys(files))
    for file in dict.fromkeys(files):
        bare = Run(file, file.stem if stems[file.stem] == 1 else str(file), {}, None)
        tree = scenario_tree(file)
        own = _checked(bare, tree).problems
        combinations = itertools.product(*(axis.values for axis in axes))
        points = [replace(bare, values=dict(zip(keys, v, strict=True))) for v in combinations]
        made = [_checked(point, tree) for point in points]
        lasting = [problem for problem in _shared(run.problems for run in made) if problem in own]
        if lasting:
            raise ConfigError(file, lasting)
        runs += made
    if mistyped := _shared(run.misplaced for run in runs):
        raise BadInput("\n".join(f"--set {problem}" for problem in mistyped))
    return runs


def _checked(run: Run, tree: dict[Any, Any]) -> Run:
    """A run with its scenario or its problems, given the plain data of its file."""
    try:
        scenario = scenario_of(run.file, with_values(tree, run.values))
    except PlaceError as error:
        problem = Problem((), str(error), ProblemKind.UNKNOWN_KEY)
        return replace(run, problems=(problem,), misplaced=(problem,))
    except ConfigError as exc:
        unknown = tuple(p for p in exc.problems if p.kind is ProblemKind.UNKNOWN_KEY)
        return replace(run, problems=tuple(exc.problems), misplaced=unknown)
    return replace(run, scenario=scenario, digest=identity(scenario))


def _shared(groups: Iterable[tuple[Problem, ...]]) -> list[Problem]:
    """Return the problems that every group has."""
    first, *others = groups
    return [problem for problem in first if all(problem in other for other in others)]


def identity(scenario: Scenario) -> str:
    """Digest of all that a flight's summary depends on: the scenario and the code."""
    tree = json.dumps(scenario.model_dump(mode="json"), sort_keys=True)
    return hashlib.sha256(f"{_code_digest()} {tree}".encode()).hexdigest()[:16]


@functools.cache
def _code_digest() -> str:
    digest = hashlib.sha256(f"{numba.__version__} {np.__version__}".encode())
    for source in sorted(path for pattern in _SOURCES for path in _ROOT.glob(pattern)):
        digest.update(source.name.encode() + source.read_bytes())
    return digest.hexdigest()


def default_folder(files: Sequence[Path], axes: Sequence[Axis]) -> Path:
    """A folder below `runs` that is the same whenever the same sweep is asked for."""
    digest = hashlib.sha256(json.dumps(_request(files, axes)).encode()).hexdigest()[:8]
    name = re.sub(r"[^\w.-]+", "-", files[0].stem)
    return Path("runs") / f"sweep-{name}-{digest}"


def _request(files: Sequence[Path], axes: Sequence[Axis]) -> dict[str, Any]:
    return {"scenarios": [str(f) for f in files], "set": {axis.key: axis.values for axis in axes}}


def open_folder(folder: Path, files: Sequence[Path], axes: Sequence[Axis]) -> None:
    """Make the folder of a sweep, or go back to one; its finished runs stay.

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


def known_results(runs: Iterable[Run], folder: Path) -> dict[str, Result]:
    """The results of runs that were flown before, by digest."""
    known: dict[str, Result] = {}
    for run in runs:
        try:
            kept = json.loads(_path(run, folder).read_bytes())
            known[run.digest] = _flown(run, FlightSummary.from_json(kept["summary"]))
        except (OSError, ValueError, KeyError, TypeError):  # not flown, or the file is damaged
            continue
    return known


def result_of(run: Run, flown: dict[str, Result]) -> Result:
    """The result of one point of the grid, given those of all flights by digest."""
    if run.scenario is None:
        return Result(run, "invalid", "; ".join(map(str, run.problems)))
    return replace(flown[run.digest], run=run)  # two points may mean the same flight


def fly_runs(
    runs: Iterable[Run], folder: Path, jobs: int, on_result: Callable[[Result], None]
) -> None:
    """Fly runs, several at a time, and keep the result of each as soon as it is there.

    Threads do: the compiled loop leaves the interpreter to the others. A flight that cannot be
    computed becomes a failed result, which is not kept, so that it is tried again next time.
    When this function is left early, it waits for the flights in the air to stop.

    Args:
        runs: Runs with a scenario.
        folder: Folder that `open_folder` has made.
        jobs: How many fly at a time; each needs memory for its recording.
        on_result: Called with each result, in the caller's thread.

    Raises:
        GcsError: A result cannot be written.
    """
    stop = threading.Event()
    with ThreadPoolExecutor(jobs) as pool:
        futures = [pool.submit(_fly, run, folder, stop) for run in runs]
        try:
            for future in as_completed(futures):
                on_result(future.result())
        finally:
            stop.set()
            pool.shutdown(cancel_futures=True)


def _fly(run: Run, folder: Path, stop: threading.Event) -> Result:
    def go_on(_time_s: float, _events: np.ndarray) -> None:
        if stop.is_set():
            raise _Stopped

    assert run.scenario is not None
    try:
        summary = summarise(fly_in_process(run.scenario, go_on), run.scenario)
    except _Stopped:
        raise
    except Exception as problem:
        return Result(run, "failed", f"{type(problem).__name__}: {problem}")
    kept = {
        "file": str(run.file),
        "set": run.values,
        "summary": summary.to_json(),
        "scenario": run.scenario.model_dump(mode="json"),
    }
    try:
        _write(_path(run, folder), kept)
    except OSError as problem:
        raise GcsError(f"cannot write to {folder}: {problem.strerror}") from problem
    return _flown(run, summary)


def _flown(run: Run, summary: FlightSummary) -> Result:
    if summary.loss is None:
        return Result(run, "completed", summary=summary)
    return Result(run, "lost", summary.loss, summary)


def _path(run: Run, folder: Path) -> Path:
    return folder / "runs" / f"{run.digest}.json"


def _write(path: Path, tree: dict[str, Any]) -> None:
    """Write a file that is either there as a whole or not at all."""
    part = path.with_name(path.name + _PART)
    part.write_text(json.dumps(tree, indent=1) + "\n")
    part.replace(path)
