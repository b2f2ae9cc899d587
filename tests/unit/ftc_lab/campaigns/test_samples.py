"""Samples: what they take from a folder's files is what they take from a table in memory."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from campaign_tables import campaign, draws_table, results_table, write_campaign

from ftc_lab.campaigns import store
from ftc_lab.campaigns.samples import Sample, read_samples, samples_of
from ftc_lab.campaigns.store import Results, read_results
from gcs.console.errors import BadInput

VARIANTS = ["b", "a"]
OUTCOMES = ["completed", "completed", "attitude_lost", "completed", "failed", "completed"]
FAULT = {
    "fault.f.uav": pa.array([3, 1, 2] * 4, pa.int64()),
    "fault.f.kind": pa.array(["loss", "bias", "stuck", "loss"] * 3),
    "fault.f.actuator": pa.array(["rudder"] * 12),
    "fault.f.end_s": pa.array([None, 7.5, None] * 4, pa.float64()),
    "fault.f.severity": pa.array([-0.5, 0.25] * 6),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve flights, in files whose rows are in no order."""
    draws = draws_table(VARIANTS, 6)
    for name, column in FAULT.items():
        draws = draws.append_column(name, column)
    iae = [1.0, None, *np.arange(10.0)]
    results = results_table(
        draws,
        dict.fromkeys(VARIANTS, OUTCOMES),
        {"uav1.iae_roll": iae, "uav2.iae_roll": [0.5] * 12},
    )
    at = tmp_path_factory.mktemp("campaign")
    return write_campaign(
        at, campaign(VARIANTS, 6), draws, results.take([5, 0, 11, *range(1, 5), *range(6, 11)])
    )


@pytest.fixture(params=["files", "table"])
def samples(folder: Path, request: pytest.FixtureRequest) -> dict[str, Sample]:
    if request.param == "files":
        return read_samples(folder)
    return samples_of(read_results(folder), folder)


def test_flights_are_divided_by_variant_in_the_order_of_draws(samples: dict[str, Sample]) -> None:
    assert list(samples) == ["b", "a"]
    for k, own in enumerate(samples.values()):
        assert own.draw.tolist() == list(range(6))
        assert own.row.tolist() == [2 * draw + k for draw in range(6)]
        assert own.outcome.tolist() == OUTCOMES
        assert own.success.tolist() == [outcome == "completed" for outcome in OUTCOMES]


def test_some_flights_are_those_flights(samples: dict[str, Sample]) -> None:
    some = samples["a"].take(np.array([4, 2]))
    assert some.row.tolist() == [9, 5]
    assert some.texts("reason").tolist() == ["failed | because", "attitude_lost | because"]


def test_costs_are_of_the_worst_uav_and_infinite_without_a_figure(
    samples: dict[str, Sample],
) -> None:
    """Flight b/0 has 1 and 0.5; a/0 has none; b/2 and a/2 failed."""
    assert samples["b"].cost("iae_roll").tolist() == [1.0, 0.5, np.inf, 4.0, np.inf, 8.0]
    assert samples["a"].cost("uav1.iae_roll").tolist() == [np.inf, 1.0, np.inf, 5.0, np.inf, 9.0]
    with pytest.raises(BadInput, match="no figure 'iae_role'"):
        samples["a"].cost("iae_role")


def test_factors_are_numbers_or_texts_without_an_order(samples: dict[str, Sample]) -> None:
    factors = dict(samples["b"].factors())
    assert list(factors) == [
        *("mass", "cl_alpha", "idle"),
        *("fault.f.uav", "fault.f.kind", "fault.f.actuator", "fault.f.end_s"),
        *(f"fault.f.severity[{kind}]" for kind in ("bias", "loss", "stuck")),
    ]
    assert factors["fault.f.uav"].tolist() == ["3", "2", "1"] * 2
    assert factors["fault.f.uav"].dtype == object
    assert factors["fault.f.kind"].tolist() == ["loss", "stuck"] * 3
    assert factors["fault.f.end_s"].tolist() == [np.inf, np.inf, 7.5] * 2  # for good
    np.testing.assert_equal(factors["fault.f.severity[loss]"], [0.5, np.nan] * 3)
    assert np.isnan(factors["fault.f.severity[bias]"]).all()  # those flights are of the other
    for name, values in factors.items():
        np.testing.assert_equal(samples["b"].factor(name), values)


def test_only_a_few_columns_stay_in_memory(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = read_results(folder)
    monkeypatch.setattr(store, "_CELLS", 2 * whole.num_rows + 1)
    results = Results(folder)
    for name in results.schema.names:
        assert sorted(results.column(name).to_pylist(), key=str) == sorted(
            whole.column(name).to_pylist(), key=str
        )
    kept = results._block.cache_info()
    assert kept.misses == -(-len(results.schema.names) // 2)
    assert kept.currsize == kept.maxsize
    assert 2 * kept.currsize < len(results.schema.names) / 2


def test_a_damaged_file_is_named(folder: Path) -> None:
    results = Results(folder)
    last = max((folder / "results").iterdir())
    whole = last.read_bytes()
    try:
        last.write_bytes(whole[:200])
        with pytest.raises(BadInput, match="cannot be read"):
            results.column("row")
    finally:
        last.write_bytes(whole)
