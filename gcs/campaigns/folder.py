"""Beginning a campaign's folder, or going on in one."""

import hashlib
import re
from pathlib import Path

from gcs.campaigns.mark import MARK, Mark, mark_of, unfinished, write_mark
from gcs.campaigns.plan import Plan
from gcs.campaigns.store import read_draws, write_draws
from gcs.errors import BadInput
from mavlink_defs.config.yaml_text import yaml_of

__all__ = ["default_folder", "open_folder"]


def default_folder(mark: Mark, kind: str = "campaign") -> Path:
    """Return a folder below `runs`, the same one for the same campaign and code."""
    request = mark.to_yaml() + yaml_of(mark.scenario)
    digest = hashlib.sha256(request.encode()).hexdigest()[:8]
    name = re.sub(r"[^\w.-]+", "-", mark.campaign.name)
    return Path("runs") / f"{kind}-{name}-{digest}"


def open_folder(folder: Path, plan: Plan) -> None:
    """Make the folder of a campaign with its draws, or open the one of the same campaign.

    Raises:
        BadInput: It holds something else, another campaign, or was flown by other code; or it
            cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        names = {path.name for path in folder.iterdir()}
    except OSError as problem:
        raise BadInput(
            f"cannot make the folder {folder}: {problem.strerror}", "choose another with --out"
        ) from problem
    if MARK in names:
        _check_same(folder, mark_of(folder), plan.mark)
    elif names - unfinished(names):
        raise BadInput(
            f"the folder {folder} holds something that is not a campaign or sweep",
            "choose another with --out, or remove it",
        )
    else:
        write_mark(folder, plan.mark)
    if "draws.parquet" not in names:
        write_draws(folder, plan.draws)
    elif not read_draws(folder).equals(plan.draws):
        raise BadInput(
            f"the draws in {folder} are others than those of this campaign: another version of "
            "numpy or scipy drew them",
            "choose another folder with --out",
        )


def _check_same(folder: Path, there: Mark, ours: Mark) -> None:
    other = "choose another folder with --out"
    if (there.campaign, there.scenario) != (ours.campaign, ours.scenario):
        raise BadInput(f"the folder {folder} is of another campaign, or of other values", other)
    if there.digest != ours.digest:
        raise BadInput(
            f"the flights in {folder} were flown by ftc-sitl {there.version} with digest "
            f"{there.digest}; this is {ours.version} with {ours.digest}",
            f"{other}: one table is of one code",
        )
