"""The laws of a campaign on the same draws: what a simpler one does better is bold."""

from collections.abc import Iterator, Mapping, Sequence
from functools import reduce
from typing import NamedTuple

import numpy as np

from ftc_autopilot.plugins.loading import without_code
from ftc_lab.campaigns.conditions import happened
from ftc_lab.campaigns.findings import Findings
from ftc_lab.campaigns.flights import variant_trees
from ftc_lab.campaigns.samples import Sample, figures_of, same_draws
from ftc_lab.reports.laws import LawRow, Value
from gcs.results.quantities import IAE_UNITS, QUANTITIES, UNITS
from gcs.results.rivals import ADD_SIMPLER, flight_of, law_of, simplicity
from gcs.results.runs.details import leaves

_FIGURES = {
    **{f"iae_filtered_{name}": f"IAE of {name} [{IAE_UNITS[name]}]" for name in QUANTITIES},
    **{f"max_error_{name}": f"largest error of {name} [{UNITS[name]}]" for name in QUANTITIES},
    "straight_cross_track_m": "farthest beside straights of the path [m]",
    "turn_cross_track_m": "farthest beside its turns [m]",
    "height_max_m": "largest height error [m]",
    "messages": "messages",
}
"""Figures that laws are compared by, with their names."""
_EVENTS = {
    "failure": "flights that failed",
    "attitude_lost": "flights that lost the attitude, or worse",
}
_LAW_KEYS = {"controller", "controller.kind"}


class SameFlights(NamedTuple):
    """Variants that fly the same but for law and trigger.

    Attributes:
        laws: Law of each variant, the simplest first.
        draws: How many draws all of them have flown.
        rows: Figures of these draws, a cell for each variant.
    """

    laws: Mapping[str, str]
    draws: int
    rows: Sequence[LawRow]


def same_flights(findings: Findings) -> list[SameFlights]:
    """Return the variants of a campaign that can be compared, together with their figures."""
    groups = [group for group in _groups(findings) if len(set(group.values())) > 1]
    return [found for group in groups if (found := _compared(findings, group)).draws]


def hint(findings: Findings) -> str:
    """Return how to add a simpler law, if some variants have none to compare with; else ""."""
    alone = [
        name
        for group in _groups(findings)
        for name, law in group.items()
        if simplicity(law) == min(map(simplicity, group.values())) > 0
    ]
    if not alone:
        return ""
    return f"No simpler law flew the same as {', '.join(alone)}; to add one, {ADD_SIMPLER}"


def between(old: Findings, new: Findings) -> Iterator[tuple[str, SameFlights]]:
    """Yield the variants that two campaigns fly by different laws, on the same draws.

    Columns are named old and new.
    """
    keys = [_keys(findings) for findings in (old, new)]
    for name, before in old.counted.items():
        if not all(name in one for one in keys):
            continue
        first, second = (one[name] for one in keys)
        if law_of(first) == law_of(second) or flight_of(first) != flight_of(second):
            continue
        pair = same_draws(before, new.counted[name])
        if pair is not None:
            laws = {"old": law_of(first), "new": law_of(second)}
            rows = list(_rows(dict(zip(laws, pair, strict=True))))
            yield name, SameFlights(laws, len(pair[0]), rows)


def _groups(findings: Findings) -> list[dict[str, str]]:
    """Return the laws of variants with flights, by variant, of those that fly the same."""
    groups: dict[frozenset[tuple[str, str]], dict[str, str]] = {}
    for name, keys in _keys(findings).items():
        groups.setdefault(flight_of(keys), {})[name] = law_of(keys)
    return [dict(sorted(g.items(), key=lambda one: simplicity(one[1]))) for g in groups.values()]


def _keys(findings: Findings) -> dict[str, dict[str, str]]:
    """Return every key of the scenario of each variant with flights.

    None if the law itself is drawn: a variant has many then.
    """
    mark = findings.mark
    if any((factor.key or name) in _LAW_KEYS for name, factor in mark.campaign.factors.items()):
        return {}
    with without_code():
        trees, filled, _ = variant_trees(mark.campaign, mark.file, mark.scenario)
    return {name: dict(leaves(filled.get(name, trees[name]), "")) for name in findings.counted}


def _compared(findings: Findings, laws: Mapping[str, str]) -> SameFlights:
    counted = {name: findings.counted[name] for name in laws}
    common = reduce(np.intersect1d, [own.draw for own in counted.values()])
    own = {
        name: each.take(np.flatnonzero(np.isin(each.draw, common)))
        for name, each in counted.items()
    }
    return SameFlights(laws, len(common), list(_rows(own)) if len(common) else [])


def _rows(flights: Mapping[str, Sample]) -> Iterator[LawRow]:
    for event, title in _EVENTS.items():
        counts = {name: int(happened(event, own.outcome).sum()) for name, own in flights.items()}
        yield LawRow([title], {name: [Value(str(n), float(n))] for name, n in counts.items()})
    known = figures_of(next(iter(flights.values())).source.schema)
    for name, title in _FIGURES.items():
        if not any(one.rpartition(".")[2] == name for one in known):
            continue  # a campaign of an earlier version
        digits = 0 if name == "messages" else 2
        costs = {variant: own.cost(name) for variant, own in flights.items()}
        cells = {
            variant: [Value.of(float(of(each)), digits) for of in (np.median, np.max)]
            for variant, each in costs.items()
            if np.isfinite(each).any()  # a foreign autopilot tells no references, say
        }
        if cells:
            yield LawRow([f"{title}: median, most"], cells)
