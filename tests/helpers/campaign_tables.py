"""Campaigns that no aircraft flew: tables of the store's schema with chosen content."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from ftc_lab.campaigns.mark import Mark, write_mark
from ftc_lab.campaigns.model import Campaign
from ftc_lab.campaigns.samples import Sample, samples_of
from ftc_lab.campaigns.store import append_results, results_schema, write_draws

UAVS = (1, 2)
FACTORS = ("mass", "cl_alpha", "idle")


def campaign(variants: list[str], draws: int, /, **changes: Any) -> Campaign:
    """A campaign of uniform factors."""
    uniform = {"kind": "uniform", "low": 0.8, "high": 1.2}
    return Campaign.model_validate(
        {
            "name": "synthetic",
            "scenario": "paper/scenario1",
            "seed": 7,
            "draws": None if changes.get("design") == "grid" else draws,
            "factors": {name: {"key": "aircraft.mass_kg", "draw": uniform} for name in FACTORS},
            "variants": {name: {} for name in variants},
        }
        | changes
    )


def draws_table(variants: list[str], draws: int, seed: int = 7) -> pa.Table:
    """Planned flights: each draw by every variant, one after the other."""
    factors = np.random.default_rng(seed).uniform(0.8, 1.2, (draws, len(FACTORS)))
    draw = np.repeat(np.arange(draws), len(variants))
    return pa.table(
        {
            "row": np.arange(len(draw)),
            "variant": variants * draws,
            "draw": draw,
            "seed": 1000 + draw,
            **{f"factor.{name}": factors[draw, k] for k, name in enumerate(FACTORS)},
        }
    )


def results_table(
    draws: pa.Table, outcomes: Mapping[str, list[str]], figures: Mapping[str, Any] | None = None
) -> pa.Table:
    """Results of planned flights.

    Args:
        draws: The flights.
        outcomes: Of each variant's draws, in their order.
        figures: Whole columns that are not as by default; others grow with the first factor.
    """
    draw, variant = draws["draw"].to_pylist(), draws["variant"].to_pylist()
    outcome = [outcomes[name][k] for name, k in zip(variant, draw, strict=True)]
    n, mass = len(draw), draws[f"factor.{FACTORS[0]}"].to_numpy()
    noise = np.random.default_rng(1).uniform(0.0, 0.01, n)
    schema = results_schema(draws.schema, UAVS)
    columns: dict[str, Any] = {name: draws[name] for name in draws.column_names}
    for field in schema:
        if field.name in columns:
            continue
        if field.name == "outcome":
            columns[field.name] = outcome
        elif pa.types.is_string(field.type):
            columns[field.name] = ["" if o == "completed" else f"{o} | because" for o in outcome]
        elif pa.types.is_integer(field.type):
            columns[field.name] = (100.0 * mass).astype(int)
        elif field.name.endswith("lost_at_s"):
            columns[field.name] = [None] * n
        else:
            columns[field.name] = 10.0 * mass**2 + noise
    columns |= {"version": ["0.1.0"] * n, "digest": ["abc"] * n}
    columns |= dict(figures or {})
    return pa.table(columns, schema=schema)


def write_campaign(folder: Path, request: Campaign, draws: pa.Table, results: pa.Table) -> Path:
    """Write a folder as `gcs campaign` leaves it, in two files of results."""
    folder.mkdir(parents=True, exist_ok=True)
    scenario = {"uavs": [{"id": uav} for uav in UAVS]}
    write_mark(folder, Mark(request, "synthetic.yaml", scenario, list(UAVS), "0.1.0", "abc"))
    write_draws(folder, draws)
    half = results.num_rows // 2
    append_results(folder, results.slice(half))
    append_results(folder, results.slice(0, half))
    return folder


def samples(outcomes: Mapping[str, list[str]], **figures: Any) -> dict[str, Sample]:
    """The flights of a campaign with given outcomes, by variant."""
    names = list(outcomes)
    draws = draws_table(names, len(outcomes[names[0]]))
    return samples_of(results_table(draws, outcomes, figures), "memory")
