"""From a row of the draws to its scenario, and from its flight to a row of the results."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

from ftc_lab.campaigns.distributions import Choice, Value, value_of
from ftc_lab.campaigns.mark import Mark
from ftc_lab.campaigns.model import Campaign
from ftc_lab.campaigns.store import Outcome, results_schema
from gcs.results.figures import FLIGHT_FIGURES, UAV_FIGURES, FlightSummary
from gcs.scenario.code import code_digest, code_version
from gcs.scenario.model import Scenario, scenario_of
from gcs.scenario.settings import plain
from mavlink_defs.config.files import validate
from mavlink_defs.config.inherit import PlaceError, merged, value_at, with_values
from mavlink_defs.config.models import ConfigError, Problem
from mavlink_defs.config.renamed import RenamedWarning

if TYPE_CHECKING:
    import pyarrow as pa

Row = Mapping[str, Any]
"""One row of a table, by column."""

Trees: TypeAlias = dict[str, dict[str, Any]]
"""Plain data of scenarios, by variant."""


@dataclass(frozen=True)
class Flights:
    """All that the scenario of a row depends on, besides the row.

    Attributes:
        campaign: The campaign.
        file: Origin of the scenario, in messages.
        trees: Plain data of each variant's scenario.
        filled: The same with every default written out; not of variants that are no scenario by
            themselves.
        schema: Columns of the results.
    """

    campaign: Campaign
    file: str
    trees: Mapping[str, dict[str, Any]]
    filled: Mapping[str, dict[str, Any]]
    schema: "pa.Schema"

    def tree(self, row: Row) -> dict[str, Any]:
        """Return the plain data of a row's scenario.

        Raises:
            PlaceError: A factor's key does not exist.
        """
        tree = self.laid(row["variant"], self.values(row))
        if not self.campaign.faults:
            return tree
        common = {**self.filled[row["variant"]]["aircraft"], **tree["aircraft"]}
        own = {uav["id"]: uav.get("aircraft") for uav in tree["uavs"]}
        faults = []
        for name, fault in self.campaign.faults.items():
            start = f"fault.{name}."
            drawn = {key.removeprefix(start): row[key] for key in row if key.startswith(start)}
            faults.append(fault.fault(drawn, own.get(drawn["uav"]) or common))
        return {**tree, "faults": [*tree.get("faults", []), *faults]}

    def laid(self, variant: str, values: Mapping[str, Value]) -> dict[str, Any]:
        """Return the plain data of a variant's scenario with values laid over it, by key.

        Raises:
            PlaceError: A key does not exist.
        """
        tree = self.trees[variant]
        for key, value in values.items():
            whole, index, _ = key.partition("[")
            try:
                tree = with_values(tree, {key: value})
            except PlaceError:
                if not index or variant not in self.filled:
                    raise
                default = value_at(self.filled[variant], whole)  # of which one entry is replaced
                tree = with_values(with_values(tree, {whole: default}), {key: value})
        return tree

    def scenario(self, row: Row) -> Scenario:
        """Return the scenario of a row.

        Raises:
            ConfigError: The drawn values are none that a scenario can have.
            PlaceError: A factor's key does not exist.
        """
        return scenario_of(self.file, self.tree(row))

    def values(self, row: Row) -> dict[str, Value]:
        """Return what a row lays over the scenario of its variant, by key."""
        return {
            factor.key or name: self.value(name, row[f"factor.{name}"], row["variant"])
            for name, factor in self.campaign.factors.items()
        }

    def value(self, name: str, drawn: float | str, variant: str) -> Value:
        """Return what a drawn value of a factor makes of its key.

        Raises:
            PlaceError: A relative factor's key does not exist.
        """
        factor = self.campaign.factors[name]
        if factor.relative:
            return float(value_at(self.filled[variant], factor.key or name)) * float(drawn)
        return value_of(factor.draw, drawn) if isinstance(factor.draw, Choice) else drawn


def variant_trees(
    campaign: Campaign, file: str, base: dict[str, Any]
) -> tuple[Trees, Trees, dict[str, list[Problem]]]:
    """Return the plain data of each variant's scenario, and what is wrong with it.

    Args:
        campaign: The campaign.
        file: Origin of the scenario, for messages.
        base: Plain data of the base scenario, with what it extends.

    Returns:
        `trees` and `filled` of `Flights`, and the problems of variants that are no scenario by
        themselves.
    """
    trees: Trees = {}
    filled: Trees = {}
    problems: dict[str, list[Problem]] = {}
    for name, changes in campaign.variants.items():
        trees[name] = merged(base, changes)
        try:
            filled[name] = plain(validate(file, trees[name], Scenario).model_dump())
        except ConfigError as error:
            problems[name] = error.problems
    return trees, filled, problems


def flights_of(mark: Mark, draws: "pa.Schema") -> Flights:
    """Return the flights of a campaign.

    Args:
        mark: The campaign.
        draws: Columns of its draws.
    """
    trees, filled, _ = variant_trees(mark.campaign, mark.file, mark.scenario)
    return Flights(mark.campaign, mark.file, trees, filled, results_schema(draws, mark.uav_ids))


def fly_rows(flights: Flights, rows: Sequence[Row]) -> "pa.Table":
    """Fly rows in this process, one after the other; each becomes a row of the results.

    A flight that cannot be computed is one of them: its outcome is ``failed``. Names of before were
    warned of when the campaign was planned.
    """
    import pyarrow as pa

    with warnings.catch_warnings(action="ignore", category=RenamedWarning):
        return pa.Table.from_pylist([_fly(flights, row) for row in rows], flights.schema)


def _fly(flights: Flights, row: Row) -> dict[str, Any]:
    from gcs.fleet.flying import figures_of_flight

    try:
        summary = figures_of_flight(flights.scenario(row))
    except ConfigError as error:
        return ended(row, "invalid", "; ".join(map(str, error.problems)))
    except PlaceError as error:
        return ended(row, "invalid", str(error))
    except Exception as problem:  # the row says why; the others fly
        return ended(row, "failed", f"{type(problem).__name__}: {problem}")
    outcome, reason = outcome_of(summary)
    return {**ended(row, outcome, reason), **figures_of(summary)}


def ended(row: Row, outcome: Outcome, reason: str) -> dict[str, Any]:
    """Return the row of the results of a flight that has no figures."""
    code = {"version": code_version(), "digest": code_digest()}
    return {**row, "outcome": outcome, "reason": reason, **code}


def outcome_of(summary: FlightSummary) -> tuple[Outcome, str]:
    """Return how a flight ended, and why not better; the worst that applies."""
    if summary.loss is not None:
        if summary.control_failed:
            return "control_failed", summary.loss
        return ("ground" if summary.hit_ground else "model_left"), summary.loss
    return summary.departure or ("completed", "")


def figures_of(summary: FlightSummary) -> dict[str, Any]:
    """Return the figures of a flight, by column of the results."""
    figures: dict[str, Any] = {figure.name: figure.of(summary) for figure in FLIGHT_FIGURES}
    for uav in summary.uavs:
        figures |= {f"uav{uav.id}.{figure.name}": figure.of(uav) for figure in UAV_FIGURES}
    return figures
