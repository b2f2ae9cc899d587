"""The flights of a campaign whose trajectories are kept: chosen at its end, and flown again.

A flight in process is repeated bit for bit, so nothing has to be kept on the way.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gcs.lab.campaigns.again import check_same
from gcs.lab.campaigns.flights import Flights
from gcs.lab.campaigns.model import Kept
from gcs.lab.campaigns.plan import row_of
from gcs.lab.campaigns.store import OUTCOMES, read_draws, read_results
from mavlink_defs.config.files import dump

_NO_FLIGHT = {"crashed", "failed", "invalid"}
"""Outcomes that leave nothing to keep."""


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
        recording = fly_in_process(scenario)
        summary = summarise(recording, scenario)
        check_same(folder, number, summary)
        target.mkdir(parents=True, exist_ok=True)
        dump(scenario, target / "scenario.yaml")
        save_summary(summary, target)
        save_arrays_of(recording, target)
    yield len(rows), len(rows)
