"""A campaign's folder as an entry of the list of what was flown."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from ftc_autopilot.control.laws import LAWS
from ftc_autopilot.control.laws.base import LawParameters
from ftc_autopilot.control.laws.proposed import Proposed
from ftc_lab.campaigns.mark import MARK, Mark, mark_of
from ftc_lab.campaigns.store import planned_rows, read_results
from ftc_lab.campaigns.until import noted_conditions
from gcs.console.errors import BadInput
from gcs.results.flight_mark import is_locked
from gcs.results.quantities import QUANTITIES
from gcs.results.runs.run import utc
from gcs.scenario.settings import label

_KINDS = {"controller.kind", "trigger.mode"}
_NO_MEDIANS = dict.fromkeys(("events", "messages", "saving")) | {"iae": {}}
"""Of a sweep over kinds: a median over two laws says nothing of either."""
_NAMED = 4
"""Factors of a campaign that are named; further ones are counted."""


def facts_of(folder: Path) -> dict[str, Any]:
    """Return the attributes of `gcs.results.runs.run.Run` that a campaign's folder has.

    Raises:
        BadInput: It is no campaign, or its files cannot be read.
    """
    mark = mark_of(folder)
    try:
        planned = planned_rows(folder)
    except BadInput:
        planned = 0  # it was ended while it was planned
    laws = [named or Proposed().kind for named in _named(mark, "controller", "kind")]
    figures: dict[str, Any] = {"flights": 0, "completed": 0}
    if planned:
        figures = _figures(folder, mark)
    counts: dict[str, int] = figures.pop("outcomes", {})
    flights = figures["flights"]
    settled = planned and (flights >= planned or noted_conditions(folder))
    lost = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in counts.items())
    text = f"{figures['completed']} of {flights} flights completed" + (f"; {lost}" if lost else "")
    if is_locked(folder / MARK):
        outcome = "under_way"
    else:
        outcome = "completed" if settled else "unfinished"
        text += "" if settled else f", {planned - flights} to fly"
    written = datetime.fromtimestamp((folder / MARK).stat().st_mtime, UTC)
    return {
        "kind": "sweep" if mark.campaign.design == "grid" else "campaign",
        "time": utc(written),
        "title": mark.campaign.name,
        "scenario": mark.campaign.scenario,
        "changes": _changes(mark),
        "law": ", ".join(dict.fromkeys(laws)),
        "trigger": ", ".join(dict.fromkeys(_triggers(mark, laws))),
        "faults": (*_faults(mark), *mark.campaign.faults),
        "uavs": len(mark.uav_ids),
        "planned": planned,
        "outcome": outcome,
        "reason": text,
        "version": mark.version,
        "digest": mark.digest,
        **figures,
        **(_NO_MEDIANS if _swept(mark).keys() & _KINDS else {}),
    }


def _figures(folder: Path, mark: Mark) -> dict[str, Any]:
    """Return how many flights ended, and the figures of those that completed."""
    import pyarrow.compute as pc

    iaes = {name: [f"uav{uav}.iae_{name}" for uav in mark.uav_ids] for name in QUANTITIES}
    shared = ["outcome", "duration_s", "events", "messages", "saving"]
    table = read_results(folder, [*shared, *(c for columns in iaes.values() for c in columns)])
    outcomes = Counter(table.column("outcome").to_pylist())
    completed = outcomes.pop("completed", 0)
    kept = table.filter(pc.equal(table.column("outcome"), "completed"))

    def values(columns: Iterable[str]) -> np.ndarray:
        found = [kept.column(name).to_numpy().astype(float) for name in columns]
        known = np.concatenate(found) if found else np.empty(0)
        return np.asarray(known[np.isfinite(known)])

    def median(column: str) -> float | None:
        known = values([column])
        return float(np.median(known)) if len(known) else None

    events, messages = median("events"), median("messages")
    return {
        "flights": table.num_rows,
        "completed": completed,
        "outcomes": dict(outcomes.most_common()),
        "duration_s": median("duration_s"),
        "events": None if events is None else round(events),
        "messages": None if messages is None else round(messages),
        "saving": median("saving"),
        "iae": {
            name: float(known.max()) if len(known := values(columns)) else None
            for name, columns in iaes.items()
        },
    }


def _changes(mark: Mark) -> tuple[str, ...]:
    """Return what a campaign varies: the values of a grid, the names of other factors."""
    campaign = mark.campaign
    if campaign.design == "grid":
        varied = [f"{key}={','.join(map(label, values))}" for key, values in _swept(mark).items()]
    else:
        names = list(campaign.factors)
        more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
        varied = [f"draws {', '.join(names[:_NAMED])}{more}"] if names else []
        varied.append(f"{campaign.draws} draws")
    variants = list(campaign.variants)
    return (*varied, *([f"variants {', '.join(variants)}"] if len(variants) > 1 else []))


def _named(mark: Mark, section: str, key: str) -> list[str]:
    """Return the kind of a section in each variant, or the swept ones; "" where none is named."""

    def own(tree: Mapping[str, Any], otherwise: str) -> str:
        part = tree.get(section)
        return str(part.get(key, otherwise)) if isinstance(part, Mapping) else otherwise

    base = own(mark.scenario, "")
    kinds = _swept(mark).get(f"{section}.{key}") or [
        own(tree, base) for tree in mark.campaign.variants.values()
    ]
    return list(map(str, kinds))


def _triggers(mark: Mark, laws: Sequence[str]) -> Iterator[str]:
    """Yield the trigger of each variant: the law's own where none is named."""
    modes = _named(mark, "trigger", "mode")
    is_swept = _swept(mark).keys() & _KINDS
    for mode, law in product(modes, laws) if is_swept else zip(modes, laws, strict=True):
        yield mode or LAWS.get(law, LawParameters).TRIGGER


def _faults(mark: Mark) -> Iterator[str]:
    """Yield the faults of the base scenario, as its keys say them."""
    for fault in mark.scenario.get("faults") or ():
        uav, *keys = (f"{key}={label(value)}" for key, value in fault.items())
        yield f"{uav}: {', '.join(keys)}"


def _swept(mark: Mark) -> dict[str, Sequence[Any]]:
    """Return the values of each key that a sweep varies; none of a campaign."""
    if mark.campaign.design != "grid":
        return {}
    return {
        factor.key or name: getattr(factor.draw, "values", ())
        for name, factor in mark.campaign.factors.items()
    }
