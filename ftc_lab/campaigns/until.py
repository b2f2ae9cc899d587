"""The condition that may end a campaign early, as its folder knows it.

``until.json`` beside ``request.yaml`` names every condition that the campaign was flown with. Its
report then uses intervals that hold although the data decided when to stop.
"""

import json
from collections.abc import Callable
from pathlib import Path

from ftc_lab.campaigns.conditions import Condition, counted, parse_condition
from ftc_lab.campaigns.folder import open_folder
from ftc_lab.campaigns.model import Campaign
from ftc_lab.campaigns.plan import Plan
from ftc_lab.campaigns.samples import samples_of
from ftc_lab.campaigns.stopping import Verdict, judge, leading
from ftc_lab.campaigns.store import read_results
from gcs.console.errors import BadInput
from mavlink_defs.config.output_files import write_text
from mavlink_defs.config.user_files import open_file

_FILE = "until.json"


def stopping_condition(text: str, campaign: Campaign) -> Condition:
    """Read the condition of `--until` for a campaign.

    Raises:
        BadInput: It cannot be read, or the campaign's design permits no stopping.
    """
    condition = parse_condition(text, "--until")
    if campaign.design != "random":
        raise BadInput(
            f"--until requires independent draws, and the design is {campaign.design!r}",
            "write design: random, or leave --until out",
        )
    return condition


def begin_campaign(planned: Plan, folder: Path, until: str | None) -> Callable[[], bool]:
    """Make or open the folder of a campaign; arguments and errors as of `ftc_lab.run`.

    Returns:
        A function that returns whether the stored flights decide the condition.
    """
    campaign = planned.mark.campaign
    condition = None if until is None else stopping_condition(until, campaign)
    open_folder(folder, planned)
    if condition is not None:
        note_condition(folder, condition)
    return lambda: condition is not None and is_decided(folder, campaign, condition)


def note_condition(folder: Path, condition: Condition) -> None:
    """Note for ever that a campaign could be stopped by its results.

    Raises:
        OSError: The file cannot be written; it is named.
    """
    conditions = dict.fromkeys([*noted_conditions(folder), str(condition)])
    part = folder / f"{_FILE}.part"
    write_text(part, json.dumps(list(conditions)) + "\n")
    part.replace(folder / _FILE)


def noted_conditions(folder: Path) -> list[str]:
    """Return the conditions that a campaign was flown with, as users write them.

    Raises:
        BadInput: The file cannot be read.
    """
    try:
        with open_file(folder / _FILE) as file:
            texts = json.load(file)
        return [str(parse_condition(text, "--until")) for text in texts]
    except FileNotFoundError:
        return []
    except (OSError, ValueError, TypeError, AttributeError) as problem:
        raise BadInput(f"{folder / _FILE} cannot be read: {problem}") from problem


def is_decided(folder: Path, campaign: Campaign, condition: Condition) -> bool:
    """Return whether the stored flights decide a condition for every variant of a campaign.

    Raises:
        BadInput: The results cannot be read.
    """
    found = verdicts(folder, condition)
    decided = all(verdict.decided != "open" for verdict in found.values())
    return decided and len(found) == len(campaign.variants)


def verdicts(folder: Path, condition: Condition) -> dict[str, Verdict]:
    """Return what the stored flights say of a condition, for each variant that has some.

    Raises:
        BadInput: The results cannot be read.
    """
    table = read_results(folder, ["row", "variant", "draw", "outcome"])
    return {
        name: judge(condition, own.take(leading(own.draw)).outcome)
        for name, own in samples_of(table, folder).items()
    }


def verdict_lines(folder: Path, condition: Condition) -> list[str]:
    """Return a line on each variant, for people.

    Raises:
        BadInput: The results cannot be read.
    """
    return [
        f"{condition}: {found.decided} for {name}, {counted(condition.event)} in {found.count} "
        f"of its first {found.flights} draws"
        for name, found in verdicts(folder, condition).items()
    ]
