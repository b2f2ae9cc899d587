"""The plan of a campaign: its draws, each checked to be a scenario before the first flight."""

import copy
import difflib
import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ftc_lab.campaigns.distributions import Choice, support
from ftc_lab.campaigns.draws import draw_table
from ftc_lab.campaigns.faults import DrawnFault
from ftc_lab.campaigns.flights import Flights, Row, variant_trees
from ftc_lab.campaigns.mark import Mark
from ftc_lab.campaigns.model import NO_PROGRAMS, Campaign, campaign_tree
from ftc_lab.campaigns.store import results_schema
from gcs.scenario.bundled import base_of
from gcs.scenario.code import code_digest, code_version
from gcs.scenario.model import Scenario, scenario_of, scenario_tree
from gcs.scenario.plugins import with_choices, with_plugins
from gcs.scenario.settings import is_number, plain
from mavlink_defs.config.files import validate
from mavlink_defs.config.inherit import PlaceError, value_at
from mavlink_defs.config.models import ConfigError, Loc, Problem, ProblemKind
from mavlink_defs.config.renamed import present
from mavlink_defs.config.written import located

if TYPE_CHECKING:
    import pyarrow as pa

_SHOWN = 20
"""Problems of draws that are listed; further ones are counted."""
_SLICE = 1000
"""Rows that are plain Python data at a time."""


@dataclass(frozen=True)
class Plan:
    """A campaign that can be flown.

    Attributes:
        mark: What identifies it.
        flights: From rows to flights.
        draws: The planned flights.
        example: One of the scenarios, with which the numeric core is compiled; None if no row of a
            sweep has one.
    """

    mark: Mark
    flights: Flights
    draws: "pa.Table"
    example: Scenario | None


def load_plan(
    path: Path, draws: int | None = None, programs: Mapping[str, str] = NO_PROGRAMS
) -> Plan:
    """Read a campaign file, draw its flights and check each of them.

    Args:
        path: The file; its scenario is searched for beside it.
        draws: Number of draws instead of the file's.
        programs: Files of foreign autopilots, by kind, for the variants that they fly.

    Raises:
        ConfigError: It cannot be flown; every problem of the file is named.
    """
    tree = rest = campaign_tree(path, draws, programs)
    problems: list[Problem] = []
    whole = True
    while True:
        try:
            campaign = validate(path, rest, Campaign)
            break
        except ConfigError as error:
            problems = list(dict.fromkeys([*problems, *located(tree, error.problems)]))
            before, rest = rest, _without_unknown_keys(rest, error.problems)
            if rest == before:
                rest, whole = _without(rest, error.problems), False
            if "scenario" not in rest or rest == before:  # nothing more can be checked
                raise ConfigError(path, problems) from error
    try:
        planned, more = _planned(campaign, path)
    except ConfigError as error:
        raise ConfigError(path, located(tree, [*problems, *error.problems])) from error
    problems += more
    problems += _of_draws(planned, more) if whole else _of_left_out_keys(planned.flights, tree)
    if problems:
        raise ConfigError(path, located(tree, problems))
    return planned


def plan(campaign: Campaign, path: Path) -> Plan:
    """Draw the flights of a campaign and check each of them.

    Args:
        campaign: The campaign.
        path: Its file: the scenario is searched for beside it, and messages name it.

    Raises:
        ConfigError: Its scenario, a variant, a factor or a draw cannot be used; all are named.
    """
    planned, problems = _planned(campaign, path)
    problems += _of_draws(planned, problems)
    if problems:
        raise ConfigError(path, problems)
    return planned


def _planned(campaign: Campaign, path: Path) -> tuple[Plan, list[Problem]]:
    """Return the plan of the variants that can be used, and all problems except with draws."""
    campaign = _with_plugins(campaign, path)
    try:
        file = base_of(path.parent, campaign.scenario)
        tree = with_choices(file, scenario_tree(file, is_base=True), _choices(campaign))
        scenario = scenario_of(file, tree)
    except ConfigError as error:
        problems = [Problem(("scenario",), line) for line in error.lines]
        raise ConfigError(path, problems) from error
    if scenario.links.impairments is not None:
        text = f"{file}: links.impairments apply to the wire; campaigns fly in process"
        raise ConfigError(path, [Problem(("scenario",), text)])
    ids = [uav.id for uav in scenario.uavs]
    draws = draw_table(campaign, ids)
    trees, filled, of_variants = variant_trees(campaign, str(file), tree)
    problems = [
        problem._replace(loc=("variants", name, *problem.loc), source="")
        for name, found in of_variants.items()
        for problem in found
    ]
    if not filled:  # what does not depend on the variants can be checked nevertheless
        trees, filled = {"": tree}, {"": plain(scenario.model_dump())}
    flown = sorted({uav["id"] for own in filled.values() for uav in own["uavs"]})
    mark = Mark(campaign, str(file), tree, flown, code_version(), code_digest())
    schema = results_schema(draws.schema, flown)
    flights = Flights(campaign, mark.file, trees, filled, schema)
    problems += [*_of_faults(campaign, scenario), *_of_factors(flights)]
    if not of_variants:  # they decide which columns there are
        problems += _of_figures(flights)
    return Plan(mark, flights, draws, scenario), problems


def _with_plugins(campaign: Campaign, path: Path) -> Campaign:
    """Return a campaign whose variants name their plug-ins from the root, with their digests.

    Raises:
        ConfigError: One cannot be used.
    """
    variants = {}
    for name, changes in campaign.variants.items():
        try:
            variants[name] = with_plugins(path, changes)
        except ConfigError as error:
            problems = [p._replace(loc=("variants", name, *p.loc)) for p in error.problems]
            raise ConfigError(path, problems) from error
    return campaign.model_copy(update={"variants": variants})


def _choices(campaign: Campaign) -> dict[str, Sequence[Any]]:
    """Return the values of the factors that choose among some, by key."""
    return {
        factor.key or name: factor.draw.values
        for name, factor in campaign.factors.items()
        if isinstance(factor.draw, Choice)
    }


_HARMLESS = {"duration_s": {"draw": {"kind": "choice", "values": [1.0]}, "relative": True}}


def _without_unknown_keys(tree: dict[Any, Any], problems: list[Problem]) -> dict[Any, Any]:
    """Return a campaign's plain data without its unknown keys."""
    rest = copy.deepcopy(tree)
    for problem in problems:
        if problem.kind is ProblemKind.UNKNOWN_KEY:
            here: Any = rest
            for key in problem.loc[:-1]:
                here = here.get(key, {}) if isinstance(here, dict) else here[int(key)]
            here.pop(problem.loc[-1], None)
    return rest


def _without(tree: dict[Any, Any], problems: list[Problem]) -> dict[Any, Any]:
    """Return a campaign's plain data without the parts that have problems.

    Entries of factors, faults and variants are parts of their own. What a campaign must have, but
    for its scenario, is replaced by something that has no problems of its own.
    """
    wrong = {problem.loc[:2] for problem in problems if problem.loc}
    rest = dict(tree)
    for key, *entry in wrong:
        part = rest.get(key)
        if entry and key in _NAMED and isinstance(part, dict):
            rest[key] = {name: value for name, value in part.items() if str(name) != entry[0]}
        else:
            rest.pop(key, None)
    rest = {key: value for key, value in rest.items() if key not in _NAMED or value}
    if not rest.keys() & {"factors", "faults"} and {"factors", "faults"} & {
        loc[0] for loc in wrong
    }:
        rest["factors"] = _HARMLESS
    substitutes = {"name": "-"} if rest.get("design") == "grid" else {"name": "-", "draws": 1}
    return rest | {key: value for key, value in substitutes.items() if (key,) in wrong}


_NAMED = ("factors", "faults", "variants")


def _of_left_out_keys(flights: Flights, tree: dict[Any, Any]) -> Iterator[Problem]:
    """Check that the keys of factors exist which `_without` has left out, whatever their values."""
    factors = tree.get("factors")
    for name, factor in factors.items() if isinstance(factors, dict) else ():
        if str(name) not in flights.campaign.factors and isinstance(factor, dict):
            yield from _of_key(flights, str(name), str(factor.get("key") or name))


def row_of(draws: "pa.Table", row: int) -> Row:
    """Return one row of the draws as plain data."""
    found: Row = draws.slice(row, 1).to_pylist()[0]
    return found


def _of_faults(campaign: Campaign, scenario: Scenario) -> Iterator[Problem]:
    limits = {uav.id: scenario.aircraft_of(uav.id).fault_limits for uav in scenario.uavs}
    ids = list(limits)
    for name, fault in campaign.faults.items():
        for i, actuator in enumerate(fault.actuators if isinstance(fault, DrawnFault) else ()):
            hit = [uav for uav in fault.uavs or ids if uav in limits]
            without = [str(uav) for uav in hit if not limits[uav].has(actuator)]
            if without:
                text = f"the aircraft of UAV {', '.join(without)} has no {actuator}"
                yield Problem(("faults", name, "actuators", i), text)
        for i, uav in enumerate(fault.uavs):
            if uav not in ids:
                text = f"expected one of the UAVs {', '.join(map(str, ids))}, got {uav}"
                yield Problem(("faults", name, "uavs", i), text)


def _of_figures(flights: Flights) -> Iterator[Problem]:
    """Check that the figures of the worst flights are columns of numbers."""
    names = [field.name for field in flights.schema if str(field.type) in {"double", "int64"}]
    for i, figure in enumerate(flights.campaign.keep.figures):
        if figure not in names:
            close = difflib.get_close_matches(figure, names, n=1)
            meant = f"; did you mean {close[0]!r}?" if close else ""
            text = f"expected a column of numbers in the results, got {figure!r}{meant}"
            yield Problem(("keep", "figures", i), text)


def _of_factors(flights: Flights) -> Iterator[Problem]:
    """Check each factor by itself, at the ends of its distribution."""
    for name in flights.campaign.factors:
        found: dict[str, Problem] = {}
        for variant in flights.filled:
            for problem in _of_factor(flights, name, variant):
                found.setdefault(problem.text, problem)
        yield from (p._replace(loc=("factors", name, *p.loc)) for p in found.values())


def _of_key(flights: Flights, name: str, key: str) -> list[Problem]:
    """Check that the key of a factor exists in every variant, whatever its values."""
    found: dict[str, Problem] = {}
    for variant in flights.filled:
        try:
            scenario_of(flights.file, flights.laid(variant, {key: 1.0}))
        except PlaceError as error:
            found[str(error)] = _of_name(error, key == name)._replace(loc=("factors", name))
        except ConfigError as error:
            for problem in error.problems:
                if problem.kind is ProblemKind.UNKNOWN_KEY:
                    own = _of_name(problem, key == name)
                    found[str(problem)] = own._replace(loc=("factors", name))
    return list(found.values())


def _of_name(problem: Problem | PlaceError, by_name: bool) -> Problem:
    """Return the problem that there is no such key; `by_name` if it is but the factor's name."""
    if not by_name:
        return Problem((), str(problem))
    return Problem((), f"{problem}; a factor sets the key of its name, unless it has `key:`")


def _of_factor(flights: Flights, name: str, variant: str) -> Iterator[Problem]:
    factor = flights.campaign.factors[name]
    key = factor.key or name
    if factor.relative:
        try:
            base = value_at(flights.filled[variant], key)
        except PlaceError as error:
            yield _of_name(error, factor.key is None)
            return
        if isinstance(base, bool) or not isinstance(base, int | float):
            yield Problem(("relative",), f"{key}: expected a number in the scenario, got {base!r}")
            return
    for end in support(factor.draw):
        if factor.relative and not is_number(end):
            yield Problem(("relative",), f"expected numbers to multiply with, got {end!r}")
            return
        if isinstance(end, float) and abs(end) == float("inf"):
            continue  # what is drawn is checked
        try:
            value = flights.value(name, end, variant)
            scenario_of(flights.file, flights.laid(variant, {key: value}))
        except PlaceError as error:
            yield _of_name(error, factor.key is None)
        except ConfigError as error:
            what = "value" if isinstance(factor.draw, Choice) else "end"
            for problem in error.problems:
                if problem.kind is ProblemKind.UNKNOWN_KEY:
                    yield _of_name(problem, factor.key is None)
                else:
                    yield Problem(("draw",), f"with its {what} {end!r}, {problem}")


@dataclass
class _Repeated:
    """A problem that draws have in common."""

    first: Problem
    draws: set[int] = field(default_factory=set)


def _of_draws(planned: Plan, known: list[Problem]) -> list[Problem]:
    """Check every planned flight; problems of the same factors at the same key are one.

    Factors, faults and variants that have problems already are left out.
    """
    wrong = {problem.loc[:2] for problem in known}
    campaign = planned.mark.campaign
    sound = {
        part: {name: own for name, own in entries.items() if (part, name) not in wrong}
        for part, entries in (("factors", campaign.factors), ("faults", campaign.faults))
    }
    flights = replace(planned.flights, campaign=campaign.model_copy(update=sound))
    found: dict[tuple[Loc, Loc], _Repeated] = {}
    for row in rows_of(planned.draws):
        if row["variant"] not in flights.filled:
            continue
        try:
            flights.scenario(row)
        except ConfigError as error:
            for problem in error.problems:
                loc = _cause(flights, problem)
                text = f"draw {row['draw']} of variant {row['variant']}: {problem}"
                one = found.setdefault((loc, problem.loc), _Repeated(Problem(loc, text)))
                one.draws.add(row["draw"])
    listed = [
        one.first._replace(text=f"{one.first.text} (and {len(one.draws) - 1} more draws)")
        if len(one.draws) > 1
        else one.first
        for one in itertools.islice(found.values(), _SHOWN)
    ]
    if len(found) > _SHOWN:
        listed.append(Problem((), f"{len(found) - _SHOWN} more problems of draws"))
    return listed


def _cause(flights: Flights, problem: Problem) -> Loc:
    """Return the place in the campaign file of the factors or the fault behind a problem."""
    place = str(Problem(problem.loc, "")).rpartition(":")[0]
    base = next(iter(flights.filled.values()))
    match problem.loc:
        case ("faults", int(i), *_) if i >= len(base["faults"]):
            return ("faults", list(flights.campaign.faults)[i - len(base["faults"])])
    keys = {name: present(factor.key or name) for name, factor in flights.campaign.factors.items()}
    names = [name for name, key in keys.items() if _inside(place, key) or _inside(key, place)]
    if not names:
        return ()
    return ("factors", ", ".join(names[:3]) + (", ..." if len(names) > 3 else ""))


def _inside(place: str, outer: str) -> bool:
    return place == outer or place.startswith((f"{outer}.", f"{outer}["))


def rows_of(draws: "pa.Table") -> Iterator[Row]:
    """Yield rows as plain data, a slice of the table at a time."""
    for begin in range(0, draws.num_rows, _SLICE):
        yield from draws.slice(begin, _SLICE).to_pylist()
