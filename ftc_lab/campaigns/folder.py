"""Beginning a campaign's folder, or continuing in one."""

import hashlib
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from ftc_lab.campaigns.mark import MARK, Mark, mark_of, unfinished, write_mark
from ftc_lab.campaigns.plan import Plan
from ftc_lab.campaigns.store import alone_in, planned_rows, read_draws, write_draws
from gcs.console.errors import BadInput
from gcs.console.outputs import make_folder
from gcs.scenario.settings import plain
from mavlink_defs.config.models import shown
from mavlink_defs.config.yaml_text import yaml_of

_OTHER = "choose another folder with --out"
_NONE = object()
"""Stands for a key that is not there."""
_SHOWN = 8
"""Differences that are listed; further ones are counted."""


def default_folder(mark: Mark, kind: str = "campaign") -> Path:
    """Return a folder below `runs`, the same one for the same campaign and code."""
    request = mark.to_yaml() + yaml_of(mark.scenario)
    digest = hashlib.sha256(request.encode()).hexdigest()[:8]
    name = re.sub(r"[^\w.-]+", "-", mark.campaign.name)
    return Path("runs") / f"{kind}-{name}-{digest}"


def open_folder(folder: Path, plan: Plan) -> None:
    """Make the folder of a campaign with its draws, or open the one of the same campaign.

    More draws than it has are added to them, if the design begins with those that it has.

    Raises:
        BadInput: It holds something else, another campaign, or was flown by other code; or it
            cannot be made.
    """
    make_folder(folder)
    try:
        names = {path.name for path in folder.iterdir()}
    except OSError as problem:
        raise BadInput(
            f"cannot make the folder {folder}: {problem.strerror}", "choose another with --out"
        ) from problem
    if MARK in names:
        _continue(folder, plan)
    elif names - unfinished(names):
        raise BadInput(
            f"the folder {folder} holds something that is not a campaign or sweep",
            "choose another with --out, or remove it",
        )
    else:
        write_mark(folder, plan.mark)
    if "draws.parquet" not in names or planned_rows(folder) < plan.draws.num_rows:
        write_draws(folder, plan.draws)


def _continue(folder: Path, plan: Plan) -> None:
    """Check that a folder is of the same campaign, and note draws that are added to its own."""
    there = mark_of(folder)
    _check_same(folder, there, plan.mark)
    before, draws = there.campaign.draws or 0, plan.mark.campaign.draws or 0
    if draws < before:
        raise BadInput(
            f"the campaign in {folder} has {before} draws, and {draws} are asked for: draws can be "
            "added, not taken away",
            f"continue it with --draws {before} or more, or {_OTHER}",
        )
    if (folder / "draws.parquet").exists():
        stored = read_draws(folder)
        if not plan.draws.slice(0, stored.num_rows).equals(stored):
            raise BadInput(_other_draws(folder, plan, before), _OTHER)
    if draws > before:
        with alone_in(folder):
            write_mark(folder, replace(plan.mark, extended_from=(*there.extended_from, before)))


def _other_draws(folder: Path, plan: Plan, before: int) -> str:
    campaign = plan.mark.campaign
    if campaign.draws not in (None, before):
        return (
            f"the campaign in {folder} cannot be continued from {before} to {campaign.draws} "
            f"draws: a {campaign.design} design of {campaign.draws} does not begin with one of "
            f"{before}"
        )
    return (
        f"the draws in {folder} differ from the draws of this campaign: another version of "
        "numpy or scipy drew them"
    )


def _check_same(folder: Path, there: Mark, ours: Mark) -> None:
    """Check that both are one campaign by one code, but for the number of draws.

    Raises:
        BadInput: They are not; every difference is named.
    """
    trees = (plain(mark.campaign.model_dump(exclude={"draws"})) for mark in (there, ours))
    found = [
        *_differences(*trees),
        *(f"base scenario: {each}" for each in _differences(there.scenario, ours.scenario)),
    ]
    if found:
        left = len(found) - _SHOWN
        more = [f"{left} more differences"] if left > 0 else []
        listed = "".join(f"\n  {each}" for each in [*found[:_SHOWN], *more])
        raise BadInput(f"the folder {folder} belongs to another campaign:{listed}", _OTHER)
    if there.digest != ours.digest:
        raise BadInput(
            f"the flights in {folder} were flown by ftc-sitl {there.version} with digest "
            f"{there.digest}; this is {ours.version} with {ours.digest}",
            f"{_OTHER}: a table holds flights of one version only",
        )


def _differences(there: Any, ours: Any, place: str = "") -> Iterator[str]:
    """Yield what differs between two trees of plain data, by place, with both values."""
    if isinstance(there, dict) and isinstance(ours, dict):
        for key in dict.fromkeys([*there, *ours]):
            inner = f"{place}.{key}" if place else str(key)
            old, new = there.get(key, _NONE), ours.get(key, _NONE)
            if old is _NONE and isinstance(new, dict) and new:
                old = {}
            if new is _NONE and isinstance(old, dict) and old:
                new = {}
            yield from _differences(old, new, inner)
    elif isinstance(there, list) and isinstance(ours, list) and len(there) == len(ours):
        for i, (old, new) in enumerate(zip(there, ours, strict=True)):
            yield from _differences(old, new, f"{place}[{i}]")
    elif ours is _NONE:
        yield f"{place} is missing, the folder has {shown(there)}"
    elif there is _NONE:
        yield f"{place} is {shown(ours)}, the folder has none"
    elif there != ours:
        yield f"{place} is {shown(ours)}, the folder has {shown(there)}"
