"""The exit status of `gcs sweep`."""

from pathlib import Path

import pyarrow as pa
import pytest

from ftc_lab.campaigns.flights import ended
from ftc_lab.campaigns.folder import open_folder
from ftc_lab.campaigns.grid import plan_grid
from ftc_lab.campaigns.plan import rows_of
from ftc_lab.campaigns.store import append_results
from ftc_lab.commands.sweep import sweep
from gcs.console.errors import GcsError
from gcs.scenario.settings import parse_axes


def test_a_flight_that_could_not_be_computed_is_reported_at_the_end(
    short: Path, tmp_path: Path
) -> None:
    """The others have their rows in the tables."""
    folder, axes = tmp_path / "out", ["duration_s=0.04,0.05"]
    plan = plan_grid([short], parse_axes(axes)).plan
    open_folder(folder, plan)
    lost, _ = (ended(row, "failed", "MemoryError: too long") for row in rows_of(plan.draws))
    append_results(folder, pa.Table.from_pylist([lost], plan.flights.schema))
    with pytest.raises(GcsError, match="1 of 2 flights could not be computed: MemoryError"):
        sweep([short], axes, folder, 1, None, quiet=True)
    table = (folder / "table.csv").read_text()
    assert "failed,MemoryError: too long" in table
    assert table.count(",completed,") == 3
