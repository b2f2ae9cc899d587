"""The mark of a campaign's folder: what was flown, and by which code.

`request.yaml` has the request, `scenario.yaml` beside it the base scenario with what it extends.
Both are YAML: the keys of JSON are texts, but keys of ``leader_access`` are numbers.
"""

from collections.abc import Sequence, Set
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ftc_lab.campaigns.model import Campaign
from gcs.console.errors import BadInput
from gcs.console.outputs import all_or_none
from gcs.scenario.settings import plain
from mavlink_defs.config.files import parse, read
from mavlink_defs.config.output_files import naming, write_text
from mavlink_defs.config.user_files import open_file
from mavlink_defs.config.yaml_text import yaml_of

SCHEMA = 2
"""Number of this layout; it changes when a reader of the old one would go wrong."""

MARK = "request.yaml"
"""File that marks the folder of a campaign."""

_SCENARIO = "scenario.yaml"
_PART = f"{MARK}.part"  # while it is being written


@dataclass(frozen=True)
class Mark:
    """What a folder was flown for.

    Attributes:
        campaign: The campaign.
        file: File of the base scenario, for messages.
        scenario: Plain data of the base scenario, with what it extends.
        uav_ids: System ids of all UAVs that fly in it.
        version: Version of the package.
        digest: Digest of the code that flies it.
        extended_from: Numbers of draws that it had before more were added, the first one first.
    """

    campaign: Campaign
    file: str
    scenario: dict[str, Any]
    uav_ids: Sequence[int]
    version: str
    digest: str
    extended_from: Sequence[int] = ()

    def to_yaml(self) -> str:
        """Return the content of `request.yaml`."""
        return yaml_of(
            {
                "schema": SCHEMA,
                "version": self.version,
                "digest": self.digest,
                "file": self.file,
                "uav_ids": list(self.uav_ids),
                **({"extended_from": list(self.extended_from)} if self.extended_from else {}),
                "campaign": plain(self.campaign.model_dump()),
            }
        )


def mark_of(folder: Path) -> Mark:
    """Read what a folder was flown for.

    Raises:
        BadInput: It is not the folder of a campaign, or one of another layout.
    """
    path = folder / MARK
    try:
        with open_file(path) as file:
            tree = parse(path, file.read().decode("utf-8"))
        if tree["schema"] == SCHEMA:
            return Mark(
                campaign=Campaign.model_validate(tree["campaign"]),
                file=tree["file"],
                scenario=read(folder / _SCENARIO),
                uav_ids=tree["uav_ids"],
                version=tree["version"],
                digest=tree["digest"],
                extended_from=tuple(tree.get("extended_from", ())),
            )
    except FileNotFoundError:
        raise BadInput(
            f"{folder} is not the folder of a campaign: it has no {MARK}",
            "gcs campaign and gcs sweep make one",
        ) from None
    except (OSError, ValueError, KeyError, TypeError) as problem:
        raise BadInput(f"{path} cannot be read: {problem}") from problem
    raise BadInput(
        f"{path} has layout {tree['schema']!r}, this version reads {SCHEMA}",
        "read it with the version that wrote it, which it names",
    )


def write_mark(folder: Path, mark: Mark) -> None:
    """Write `scenario.yaml`, and `request.yaml` so that it is there when both are complete.

    Raises:
        OSError: It cannot be written; it is named.
    """
    path, part, scenario = folder / MARK, folder / _PART, folder / _SCENARIO
    with all_or_none([part, scenario]):
        with naming(path):
            part.write_text(mark.to_yaml(), encoding="utf-8")
        write_text(scenario, yaml_of(mark.scenario))
        with naming(path):
            part.replace(path)


def unfinished(names: Set[str]) -> Set[str]:
    """Return which of the names in a folder belong to a mark that was not completely written.

    A `scenario.yaml` alone is somebody's.
    """
    return names & {_PART, _SCENARIO} if _PART in names else set()
