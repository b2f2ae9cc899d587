"""A flight of a campaign flown again: its scenario, and whether it was the same flight."""

from pathlib import Path

from gcs.errors import BadInput, GcsError
from gcs.lab.campaigns.flights import figures_of, flights_of, outcome_of
from gcs.lab.campaigns.mark import mark_of
from gcs.lab.campaigns.plan import row_of
from gcs.lab.campaigns.store import Results, read_draws, read_results
from gcs.results.figures import FlightSummary
from gcs.scenario.code import code_digest
from gcs.scenario.model import Scenario


def scenario_of_row(folder: Path, row: int) -> Scenario:
    """Return the scenario of one planned flight.

    Raises:
        BadInput: It is not the folder of a campaign, or has no such row.
    """
    mark, draws = mark_of(folder), read_draws(folder)
    if not 0 <= row < draws.num_rows:
        raise BadInput(f"--row is {row}, expected 0 to {draws.num_rows - 1} in {folder}")
    return flights_of(mark, draws.schema).scenario(row_of(draws, row))


def foreign_code(folder: Path) -> str | None:
    """Return digests of the code that flew a campaign and of ours if they differ; else None."""
    there, ours = mark_of(folder).digest, code_digest()
    return None if there == ours else f"flown by code with digest {there}, this is {ours}"


def check_same(folder: Path, row: int, summary: FlightSummary) -> None:
    """Compare a flight flown again with its row of the results; the wall time may differ.

    Raises:
        GcsError: They differ, or the row was not flown.
    """
    import pyarrow.compute as pc

    figures = figures_of(summary) | {"outcome": outcome_of(summary)[0]}
    stored_names = Results(folder).schema.names  # an earlier version has fewer
    names = [name for name in figures if name != "wall_s" and name in stored_names]
    table = read_results(folder, ["row", *names])
    stored = table.filter(pc.equal(table.column("row"), row)).select(names).to_pylist()
    if not stored:
        raise GcsError(f"row {row} of {folder} was not flown yet: nothing to compare it with")
    differing = [name for name in names if stored[0][name] != figures[name]]
    if differing:
        name = differing[0]
        raise GcsError(
            f"row {row} of {folder} was flown otherwise: {name} is {figures[name]!r}, "
            f"the table has {stored[0][name]!r} ({len(differing)} figures differ)",
            "the same code on the same kind of machine flies it bit for bit",
        )
