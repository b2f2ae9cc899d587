"""The grid of a sweep: one run for every combination of the axes' values.

A run's digest covers its scenario with all defaults and the code that flies it.
"""

import hashlib
import itertools
import json
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from gcs.errors import BadInput
from gcs.scenario.code import code_digest
from gcs.scenario.model import Scenario, scenario_of, scenario_tree
from gcs.sweeps.axes import Axis
from mavlink_defs.config.inherit import PlaceError, with_values
from mavlink_defs.config.models import ConfigError, Problem, ProblemKind

__all__ = ["Run", "identity", "plan"]


@dataclass(frozen=True)
class Run:
    """One point of the grid.

    Attributes:
        file: Scenario file.
        name: Name of the file among those of the sweep.
        values: Values laid over it, by key.
        scenario: File and values together; None if they are not a valid scenario.
        problems: Why they do not.
        misplaced: Those problems that are about a key, whatever its value.
        digest: As `identity` returns it; empty without a scenario.
    """

    file: Path
    name: str
    values: dict[str, Any]
    scenario: Scenario | None
    problems: tuple[Problem, ...] = ()
    misplaced: tuple[Problem, ...] = ()
    digest: str = ""


def plan(files: Sequence[Path], axes: Sequence[Axis]) -> list[Run]:
    """Return the grid: every combination of the axes' values for every file.

    A combination that is not a valid scenario stays in it, with its problems.

    Raises:
        ConfigError: A file cannot be read, or has a problem that no combination fixes.
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
    """Return a run with its scenario or its problems, given the plain data of its file."""
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
    """Return a digest of everything that a flight's summary depends on: scenario and code."""
    tree = json.dumps(scenario.model_dump(mode="json"), sort_keys=True)
    return hashlib.sha256(f"{code_digest()} {tree}".encode()).hexdigest()[:16]
