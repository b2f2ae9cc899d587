"""The folder of a campaign: what is stored is read back, and nothing by half."""

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from ftc_lab.campaigns.mark import Mark, mark_of, write_mark
from ftc_lab.campaigns.model import Campaign
from ftc_lab.campaigns.store import (
    alone_in,
    append_results,
    read_draws,
    read_results,
    results_schema,
    write_draws,
)
from gcs.console.errors import BadInput

CAMPAIGN = Campaign.model_validate(
    {
        "name": "A campaign",
        "scenario": "paper/scenario1",
        "draws": 2,
        "factors": {
            "uncertainty.mass": {"draw": {"kind": "uniform", "low": 0.8, "high": 1.2}},
            "mode": {
                "key": "trigger.mode",
                "draw": {"kind": "choice", "values": ["joint", "periodic"]},
            },
            "network": {"draw": {"kind": "choice", "values": [{"leader_access": {1: 0.5}}, None]}},
        },
        "variants": {"base": {}, "nearer": {"network": {"leader_access": {1: 2.0}}}},
    }
)
SCENARIO = {"uavs": [{"id": 3}], "leader_access": {1: 0.1}}
MARK = Mark(CAMPAIGN, "my.yaml", SCENARIO, [3], "0.1.0", "abc")
DRAWS = pa.table(
    {
        "row": pa.array([0, 1, 2], pa.int64()),
        "variant": ["base"] * 3,
        "draw": pa.array([0, 1, 2], pa.int64()),
        "seed": pa.array([5, 6, 7], pa.int64()),
        "factor.uncertainty.mass": [0.9, 1.1, 1.0],
    }
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_mark(tmp_path, MARK)
    write_draws(tmp_path, DRAWS)
    return tmp_path


def results(*rows: int) -> pa.Table:
    schema = results_schema(DRAWS.schema, [3])
    picked = DRAWS.take(list(rows)).to_pylist()
    return pa.Table.from_pylist([{**row, "outcome": "completed"} for row in picked], schema)


def test_mark_and_draws_are_read_back(folder: Path) -> None:
    assert mark_of(folder) == MARK
    assert mark_of(folder).campaign == CAMPAIGN
    assert read_draws(folder) == DRAWS


def test_results_grow_by_files_and_are_ordered_by_row(folder: Path) -> None:
    append_results(folder, results(2, 0))
    before = (folder / "results" / "part-00000.parquet").read_bytes()
    append_results(folder, results(1))
    assert (folder / "results" / "part-00000.parquet").read_bytes() == before
    assert read_results(folder).column("row").to_pylist() == [0, 1, 2]
    assert read_results(folder, ["outcome", "seed"]).to_pydict() == {
        "outcome": ["completed"] * 3,
        "seed": [5, 6, 7],
    }


def test_half_a_file_is_not_read(folder: Path) -> None:
    append_results(folder, results(0))
    (folder / "results" / ".part-00001.parquet.part").write_bytes(b"PAR1")
    assert read_results(folder).num_rows == 1
    assert pq.read_table(folder / "results").num_rows == 1  # as pandas does


def test_a_campaign_without_results_has_their_columns(folder: Path) -> None:
    assert read_results(folder).schema == results_schema(DRAWS.schema, [3])
    assert read_results(folder, ["uav3.iae_roll"]).num_rows == 0


def test_a_write_that_fails_leaves_nothing(folder: Path) -> None:
    (folder / "draws.parquet").unlink()
    (folder / "draws.parquet").mkdir()  # in the way
    before = set(folder.iterdir())
    with pytest.raises(OSError, match=r"draws\.parquet"):
        write_draws(folder, DRAWS)
    assert set(folder.iterdir()) == before


def test_two_commands_do_not_write_to_one_folder(folder: Path) -> None:
    with alone_in(folder), pytest.raises(BadInput, match="another command"), alone_in(folder):
        pass
    with alone_in(folder):
        pass


def test_unknown_column_is_named(folder: Path) -> None:
    with pytest.raises(BadInput, match=r"uav9\.iae_roll"):
        read_results(folder, ["row", "uav9.iae_roll"])


def test_another_folder_is_refused(tmp_path: Path) -> None:
    for read in (mark_of, read_draws, read_results):
        with pytest.raises(BadInput, match="not the folder of a campaign"):
            read(tmp_path)


def test_another_layout_is_refused(folder: Path) -> None:
    text = (folder / "request.yaml").read_text()
    (folder / "request.yaml").write_text(text.replace("schema: 2", "schema: 3"))
    with pytest.raises(BadInput, match="layout 3, this version reads 2"):
        mark_of(folder)
