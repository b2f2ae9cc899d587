"""What `gcs design` says of an aircraft that may not be in a file yet, law by law."""

from collections.abc import Mapping

from ftc_autopilot.control.laws import KINDS
from ftc_lab.design.airframe import airframe_of
from ftc_lab.design.rules import Conditions
from ftc_lab.design.scenario import design_of, plain, tree_of
from gcs.console.errors import BadInput
from gcs.scenario.model import scenario_of
from mavlink_defs.config.models import ConfigError
from sitl_plant.airframe.config import Aircraft

_NAME = "the aircraft"


def answers_of(aircraft: Aircraft) -> dict[str, str | None]:
    """Return by law why `gcs design` refuses an aircraft at its cruise; None if it does not."""
    return {law: _refusal(aircraft, law) for law in KINDS}


def _refusal(aircraft: Aircraft, law: str) -> str | None:
    try:
        design = design_of(airframe_of(_NAME, aircraft), law, Conditions())
        own = {"aircraft": aircraft.model_dump(exclude_none=True)}
        scenario_of("the design", plain(tree_of(design)) | own)
    except (BadInput, ConfigError) as problem:
        return str(problem)
    return None


def laws_of(answers: Mapping[str, str | None]) -> list[str]:
    """Return the laws that a flight is derived with."""
    return [law for law, refusal in answers.items() if refusal is None]


def sentences_of(answers: Mapping[str, str | None]) -> list[str]:
    """Return what `gcs design` says, in sentences; refusals of the same reason in one."""
    by_reason: dict[str, list[str]] = {}
    for law, refusal in answers.items():
        if refusal is not None:
            by_reason.setdefault(refusal, []).append(law)
    lines = []
    if laws := laws_of(answers):
        how = f" with --law {', '.join(laws)}" if by_reason else ""
        lines.append(f"`gcs design`{how} derives a flight from it")
    for reason, laws in by_reason.items():
        which = "" if len(laws) == len(answers) else f" with --law {', '.join(laws)}"
        lines.append(f"`gcs design`{which} refuses it: {reason}")
    return lines
