"""Events that may happen in a flight, and conditions on their probability.

Users write conditions as in "p(attitude_lost) < 0.05 at 95 %".
"""

import re
from typing import Literal, TypeVar

import numpy as np
from pydantic import ValidationError

from ftc_lab.campaigns.store import OUTCOMES
from gcs.console.errors import BadInput
from mavlink_defs.config.files import problems_of
from mavlink_defs.config.models import Model
from mavlink_defs.config.quantity import quantity

EVENTS = ("success", "failure", *OUTCOMES[1 : OUTCOMES.index("failed")])
"""Events with a probability: flown to the end with attitude and heading kept; anything else; or
an outcome as bad as this or worse, because a worse one hides it."""

M = TypeVar("M", bound=Model)

_SHAPE = re.compile(
    r"p\s*\(\s*(?P<event>[^()]*?)\s*\)\s*(?P<relation>[^\w\s.+-]+)\s*(?P<probability>\S+)"
    r"\s+at\s+(?P<confidence_percent>\S+?)\s*%"
)
_EXAMPLE = "p(attitude_lost) < 0.05 at 95 %"


class Condition(Model):
    """A probability below or above a bound, to be shown with a confidence.

    Attributes:
        probability: Bound of the probability.
        confidence_percent: Confidence to be reached.
    """

    event: Literal[EVENTS]  # type: ignore[valid-type]  # the names are listed in one place
    relation: Literal["<", ">"]
    probability: float = quantity("", gt=0.0, lt=1.0)
    confidence_percent: float = quantity("%", ge=50.0, lt=100.0)

    @property
    def error(self) -> float:
        """Permitted probability of a wrong statement."""
        return 1.0 - self.confidence_percent / 100.0

    def __str__(self) -> str:
        return (
            f"p({self.event}) {self.relation} {self.probability:g} at {self.confidence_percent:g} %"
        )


def parse_condition(text: str, option: str) -> Condition:
    """Read a condition.

    Args:
        text: In the form "p(EVENT) < NUMBER at NUMBER %", or with >.
        option: Name of the option for messages.

    Raises:
        BadInput: Everything that is wrong with it.
    """
    found = _SHAPE.fullmatch(text.strip())
    if found is None:
        raise BadInput(
            f"{option} is {text!r}, expected 'p(EVENT) < NUMBER at NUMBER %'",
            f"write it as in {option} {_EXAMPLE!r}; events are {', '.join(EVENTS)}",
        )
    return parsed(Condition, found.groupdict(), text, option)


def parsed(model: type[M], parts: dict[str, str], text: str, option: str) -> M:
    """Check the parts of a condition; numbers may be among them as texts.

    Raises:
        BadInput: Everything that is wrong with them.
    """
    tree = {key: _number(part) for key, part in parts.items() if part is not None}
    try:
        return model.model_validate(tree)
    except ValidationError as problem:
        lines = [f"{option} {text!r}: {each}" for each in problems_of(model, problem)]
        raise BadInput("\n".join(lines), f"write it as in {option} {_EXAMPLE!r}") from None


def _number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def severity(outcome: np.ndarray) -> np.ndarray:
    """Return the place of each outcome in `OUTCOMES`, 0 the best, shape (flights,).

    Raises:
        ValueError: An outcome is unknown.
    """
    names, where = np.unique(outcome, return_inverse=True)
    if unknown := set(names) - set(OUTCOMES):
        raise ValueError(f"no outcome of a flight: {', '.join(sorted(unknown))}")
    return np.array([OUTCOMES.index(name) for name in names], dtype=int)[where]


def counted(event: str) -> str:
    """Return what one of `EVENTS` counts: "success", "attitude_lost or worse"."""
    return event if event in {"success", "failure"} else f"{event} or worse"


def happened(event: str, outcome: np.ndarray) -> np.ndarray:
    """Return in which flights one of `EVENTS` happened, bool, shape (flights,)."""
    place = severity(outcome)
    if event == "success":
        return np.asarray(place == 0)
    return np.asarray(place >= (1 if event == "failure" else OUTCOMES.index(event)))
