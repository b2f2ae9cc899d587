"""Flights of a campaign flown again: one row for the user, and those whose trajectories are kept.

A flight in process is repeated bit for bit, so nothing has to be kept on the way.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ftc_lab.campaigns.flights import Flights, figures_of, flights_of, outcome_of
from ftc_lab.campaigns.mark import mark_of
from ftc_lab.campaigns.model import Kept
from ftc_lab.campaigns.plan import row_of
from ftc_lab.campaigns.store import OUTCOMES, Results, read_draws, read_results
from gcs.console.errors import BadInput, GcsError
from gcs.results.figures import FlightSummary
from gcs.scenario.code import code_digest
from gcs.scenario.model import Scenario
from mavlink_defs.config.files import dump

_NO_FLIGHT = {"crashed", "failed", "invalid"}
"""Outcomes that leave nothing to keep."""


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


def chosen_rows(folder: Path, kept: Kept) -> list[int]:
    """Return the rows whose trajectories are kept, in order."""
    import pyarrow.compute as pc

    table = read_results(folder, ["row", "draw", "variant", "seed", "outcome"])
    chosen: set[int] = set()
    rows, outcomes = table.column("row"), table.column("outcome")
    for outcome in OUTCOMES[1:]:
        if outcome not in _NO_FLIGHT:
            chosen.update(rows.filter(pc.equal(outcomes, outcome)).to_pylist()[: kept.failures])
    # the seeds are uniform over 63 bits: the same share, whatever flies and in which order
    low = table.column("seed").to_numpy() < kept.share * 2.0**63
    flown = ~np.isin(outcomes.to_numpy(zero_copy_only=False), list(_NO_FLIGHT))
    chosen.update(rows.to_numpy()[low & flown].tolist())
    for figure in kept.figures if kept.worst else ():
        values = read_results(folder, ["row", "variant", figure])
        ranked = values.filter(pc.is_valid(values.column(figure))).sort_by([(figure, "descending")])
        for variant in pc.unique(ranked.column("variant")):
            of_variant = ranked.filter(pc.equal(ranked.column("variant"), variant))
            chosen.update(of_variant.column("row").to_pylist()[: kept.worst])
    return sorted(chosen)


def keep_flights(folder: Path, flights: Flights) -> Iterator[tuple[int, int]]:
    """Fly the chosen flights again and write their trajectories; yields how many are done, of all.

    What foreign autopilots flew is left out: they may fly otherwise each time.

    Raises:
        GcsError: A flight is not the one in the table.
        OSError: A file cannot be written; it is named.
    """
    from gcs.fleet.in_process import fly_in_process
    from gcs.results.export import save_arrays_of
    from gcs.results.run_folder import save_summary
    from gcs.results.summary import summarise

    rows, draws = chosen_rows(folder, flights.campaign.keep), read_draws(folder)
    for done, number in enumerate(rows):
        yield done, len(rows)
        target = folder / "flights" / str(number)
        if (target / "trajectory.npz").exists():  # the last file of a flight
            continue
        scenario = flights.scenario(row_of(draws, number))
        if scenario.foreign:
            continue
        recording = fly_in_process(scenario)
        summary = summarise(recording, scenario)
        check_same(folder, number, summary)
        target.mkdir(parents=True, exist_ok=True)
        dump(scenario, target / "scenario.yaml")
        save_summary(summary, target)
        save_arrays_of(recording, target)
    yield len(rows), len(rows)
