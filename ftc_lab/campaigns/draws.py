"""The draws of a campaign: a design in the unit cube, turned into values.

Every draw has a stream of random numbers of its own, ``SeedSequence(seed, spawn_key=(draw,))``,
and all values are drawn before the first flight: neither workers nor their order change them.
"""

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ftc_lab.campaigns.distributions import Choice, Distribution, quantiles
from ftc_lab.campaigns.faults import DrawnFault, DrawnSensorFault
from ftc_lab.campaigns.model import Campaign
from gcs.console.errors import BadInput

if TYPE_CHECKING:
    import pyarrow as pa

MAX_FLIGHTS = 10_000_000
"""Flights that a campaign or a sweep may plan: all draws are made and kept before the first."""


@dataclass(frozen=True)
class Dimension:
    """One axis of the unit cube, and the column that it becomes.

    Attributes:
        column: Name of the column.
        levels: How many values a choice has; None of a continuous distribution.
        values: From uniform numbers in [0, 1), shape (n,), and the columns before it to values.
    """

    column: str
    levels: int | None
    values: Callable[[np.ndarray, dict[str, np.ndarray]], np.ndarray]


def dimensions(campaign: Campaign, uav_ids: Sequence[int]) -> list[Dimension]:
    """Return the axes that a campaign draws along: its factors, then its faults.

    Args:
        campaign: The campaign.
        uav_ids: System ids of the scenario's UAVs.
    """
    factors = (_drawn(f"factor.{name}", f.draw) for name, f in campaign.factors.items())
    faults = (_of_fault(f"fault.{name}", f, uav_ids) for name, f in campaign.faults.items())
    return [*factors, *itertools.chain.from_iterable(faults)]


def _drawn(column: str, distribution: Distribution) -> Dimension:
    levels = len(distribution.values) if isinstance(distribution, Choice) else None
    return Dimension(column, levels, lambda uniform, _: quantiles(distribution, uniform))


def _of_fault(
    column: str, fault: DrawnFault | DrawnSensorFault, uav_ids: Sequence[int]
) -> Iterator[Dimension]:
    yield _chosen(f"{column}.uav", fault.uavs or uav_ids)
    for part in fault.PARTS:
        yield _chosen(f"{column}.{part.removesuffix('s')}", getattr(fault, part))
    yield _chosen(f"{column}.kind", list(fault.kinds))
    yield _drawn(f"{column}.start_s", fault.start_s)
    if (lasts := fault.lasts_s) is not None:
        length = _drawn("", lasts)
        yield Dimension(
            f"{column}.end_s",
            length.levels,
            lambda uniform, drawn: drawn[f"{column}.start_s"] + length.values(uniform, drawn),
        )

    by_kind = {kind: by for kind, by in fault.kinds.items() if by is not None}

    def severity(uniform: np.ndarray, drawn: dict[str, np.ndarray]) -> np.ndarray:
        kinds = drawn[f"{column}.kind"]
        values = np.zeros(len(uniform))
        for kind, distribution in by_kind.items():
            values[kinds == kind] = quantiles(distribution, uniform[kinds == kind])
        return values

    sizes = {len(by.values) for by in by_kind.values() if isinstance(by, Choice)}
    yield Dimension(f"{column}.{fault.VALUE}", max(sizes, default=None), severity)
    if fault.frequency_hz is not None:
        yield _drawn(f"{column}.frequency_hz", fault.frequency_hz)


def _chosen(column: str, values: Sequence[Any]) -> Dimension:
    levels = np.array(values)

    def of(uniform: np.ndarray, _: dict[str, np.ndarray]) -> np.ndarray:
        index = np.minimum((uniform * len(levels)).astype(int), len(levels) - 1)
        return np.asarray(levels[index])

    return Dimension(column, len(levels), of)


def draw_table(campaign: Campaign, uav_ids: Sequence[int]) -> "pa.Table":
    """Return the planned flights: every draw, flown by every variant one after the other.

    Columns as in `ftc_lab.campaigns.store`.

    Raises:
        BadInput: They are more than `MAX_FLIGHTS`.
    """
    import pyarrow as pa

    axes = dimensions(campaign, uav_ids)
    if (flights := _draws(campaign, axes) * len(campaign.variants)) > MAX_FLIGHTS:
        raise BadInput(
            f"{flights:,} flights are planned, expected at most {MAX_FLIGHTS:,}",
            "take fewer draws, values or variants",
        )
    cube = _unit_cube(campaign, axes)
    drawn: dict[str, np.ndarray] = {}
    for k, axis in enumerate(axes):
        drawn[axis.column] = axis.values(cube[:, k], drawn)
    n, variants = len(cube), list(campaign.variants)
    seeds = np.array([_stream(campaign.seed, i).generate_state(1, np.uint64)[0] for i in range(n)])
    columns: dict[str, pa.Array] = {
        "row": pa.array(np.arange(n * len(variants))),
        "variant": pa.array(variants * n, pa.string()),
        "draw": pa.array(np.repeat(np.arange(n), len(variants))),
        "seed": pa.array(np.repeat((seeds >> np.uint64(1)).astype(np.int64), len(variants))),
    }
    for name, values in drawn.items():
        columns[name] = pa.array(np.repeat(values, len(variants)))
    for name, fault in campaign.faults.items():
        if fault.lasts_s is None:
            columns[f"fault.{name}.end_s"] = pa.nulls(n * len(variants), pa.float64())
    return pa.table(columns)


def _stream(seed: int, draw: int) -> np.random.SeedSequence:
    return np.random.SeedSequence(seed, spawn_key=(draw,))


def _draws(campaign: Campaign, axes: Sequence[Dimension]) -> int:
    match campaign.design:
        case "grid":
            return math.prod(axis.levels or 1 for axis in axes)
        case "saltelli":
            return (campaign.draws or 0) * (len(axes) + 2)
    return campaign.draws or 0


def _unit_cube(campaign: Campaign, axes: Sequence[Dimension]) -> np.ndarray:
    """Return the design, shape (draws, axes), in [0, 1)."""
    d, n = len(axes), campaign.draws or 0
    whole = np.random.default_rng(np.random.SeedSequence(campaign.seed))
    match campaign.design:
        case "grid":
            levels = [axis.levels or 1 for axis in axes]
            points = itertools.product(*((np.arange(k) + 0.5) / k for k in levels))
            return np.array(list(points))
        case "latin_hypercube":
            from scipy.stats import qmc

            return np.asarray(qmc.LatinHypercube(d, rng=whole).random(n))
        case "sobol":
            from scipy.stats import qmc

            return np.asarray(qmc.Sobol(d, rng=whole).random(n))
        case "saltelli":
            from SALib.sample import sobol

            problem = {"num_vars": d, "names": [a.column for a in axes], "bounds": [[0, 1]] * d}
            sampled = sobol.sample(problem, n, calc_second_order=False, seed=campaign.seed)
            return np.asarray(np.clip(sampled, 0.0, np.nextafter(1.0, 0.0)))
    rows = (np.random.default_rng(_stream(campaign.seed, i)).random(d) for i in range(n))
    return np.array(list(rows))
