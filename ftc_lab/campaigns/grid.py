"""The grid of a sweep, as a campaign: its files are variants, its axes factors with choices."""

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ftc_lab.campaigns.distributions import Choice
from ftc_lab.campaigns.draws import draw_table
from ftc_lab.campaigns.flights import Flights, Row, flights_of
from ftc_lab.campaigns.mark import Mark
from ftc_lab.campaigns.model import Campaign, Factor
from ftc_lab.campaigns.plan import Plan, rows_of
from ftc_lab.campaigns.store import results_schema
from gcs.console.errors import BadInput
from gcs.scenario.code import code_digest, code_version
from gcs.scenario.model import Scenario, scenario_of, scenario_tree
from gcs.scenario.plugins import with_choices
from gcs.scenario.settings import Axis, label
from mavlink_defs.config.inherit import PlaceError, check_place, difference, with_values
from mavlink_defs.config.models import ConfigError, Problem, ProblemKind


@dataclass(frozen=True)
class SweepGrid:
    """The points of a sweep.

    Attributes:
        plan: Plan of the campaign that flies them.
        scenarios: Scenario of each row; None where the values are none.
    """

    plan: Plan
    scenarios: Sequence[Scenario | None]


def plan_grid(files: Sequence[Path], axes: Sequence[Axis]) -> SweepGrid:
    """Return every combination of the axes' values for every file.

    A combination that is not a valid scenario stays in the grid; its flight ends as ``invalid``.

    Raises:
        ConfigError: A file cannot be read, or has a problem that no combination fixes.
        BadInput: A key is wrong in every file, whatever the values, or no combination is valid.
    """
    _check_keys(axes)
    named = _named(files)
    trees = {name: scenario_tree(file) for name, file in named.items()}
    choices = {axis.key: axis.values for axis in axes}
    trees = {name: with_choices(named[name], tree, choices) for name, tree in trees.items()}
    first, base = next(iter(trees.items()))
    campaign = Campaign(
        name=named[first].stem,
        scenario=str(named[first]),
        design="grid",
        factors={axis.key: Factor(draw=Choice(kind="choice", values=axis.values)) for axis in axes},
        variants={name: difference(base, tree) for name, tree in trees.items()},
    )
    draws = draw_table(campaign, [])
    mark = Mark(campaign, str(named[first]), base, [], code_version(), code_digest())
    flights = flights_of(mark, draws.schema)
    points = [_checked(flights, row) for row in rows_of(draws)]
    for k, (name, file) in enumerate(named.items()):
        own = _problems_of(file, trees[name])
        shared = _shared(found for _, found in points[k :: len(named)])
        lasting = [problem for problem in own if problem in shared]
        if lasting:
            raise ConfigError(file, lasting)
    unknown = ([p for p in found if p.kind is ProblemKind.UNKNOWN_KEY] for _, found in points)
    if mistyped := _shared(unknown):
        raise BadInput("\n".join(f"--set {problem}" for problem in mistyped))
    scenarios = [scenario for scenario, _ in points]
    good = [scenario for scenario in scenarios if scenario is not None]
    if not good:
        raise BadInput(_no_valid(axes, named, trees, points[0][1]))
    ids = sorted({uav.id for scenario in good for uav in scenario.uavs})
    flights = replace(flights, schema=results_schema(draws.schema, ids))
    plan = Plan(replace(mark, uav_ids=ids), flights, draws, next(iter(good), None))
    return SweepGrid(plan, scenarios)


def _check_keys(axes: Iterable[Axis]) -> None:
    problems = []
    for axis in axes:
        try:
            check_place(axis.key)
        except PlaceError as problem:
            problems.append(f"--set {problem}")
    if problems:
        raise BadInput("\n".join(problems))


def _named(files: Sequence[Path]) -> dict[str, Path]:
    """Return the files by name: their stem, or the whole path if others have the same stem."""
    different = list(dict.fromkeys(files))
    stems = Counter(file.stem for file in different)
    named = {}
    for file in different:
        name = file.stem if stems[file.stem] == 1 else str(file)
        named[re.sub(r"[`|\x00-\x1f]", "-", name)] = file
    return named


def _checked(flights: Flights, row: Row) -> tuple[Scenario | None, list[Problem]]:
    """Return the scenario of a row, or why there is none."""
    try:
        return flights.scenario(row), []
    except PlaceError as error:
        return None, [Problem((), str(error), ProblemKind.UNKNOWN_KEY)]
    except ConfigError as error:
        return None, error.problems


def _problems_of(file: Path, tree: dict[str, object]) -> list[Problem]:
    """Return the problems that a file has by itself."""
    try:
        scenario_of(file, tree)
    except ConfigError as error:
        return error.problems
    return []


def _no_valid(
    axes: Sequence[Axis],
    files: Mapping[str, Path],
    trees: Mapping[str, dict[str, object]],
    of_first: Sequence[Problem],
) -> str:
    """Return which axes have no valid value in any file, with a problem; or that none fits."""
    lines = []
    for axis in axes:
        found = [
            _problems_of(file, with_values(trees[name], {axis.key: value}))
            for value in axis.values
            for name, file in files.items()
        ]
        if all(found):
            values = ",".join(map(label, axis.values))
            lines.append(f"--set {axis.key}={values}: no value is valid: {found[0][0]}")
    return "\n".join(lines) or f"no combination of the values is valid: {of_first[0]}"


def _shared(groups: Iterable[list[Problem]]) -> list[Problem]:
    """Return the problems that every group has."""
    first, *others = groups
    return [problem for problem in first if all(problem in other for other in others)]
