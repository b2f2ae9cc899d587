"""Choosing and ordering runs, by what ``gcs runs --json`` has of them."""

import difflib
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from gcs.console.errors import BadInput
from gcs.results.quantities import QUANTITIES
from gcs.results.runs.run import KINDS, OUTCOMES, Run

KEYS = (
    *(name for name in Run.__dataclass_fields__ if name != "iae"),
    *(f"iae_{name}" for name in QUANTITIES),
)
"""What conditions and orders can name."""
NUMBERS = {"uavs", "flights", "planned", "completed", "duration_s", "messages", "events", "saving"}
NUMBERS |= {f"iae_{name}" for name in QUANTITIES}
_CHOICES: Mapping[str, Sequence[str]] = {"kind": KINDS, "outcome": OUTCOMES}
_SEVERAL = {"law", "trigger"}
"""Of which a sweep, or a campaign with variants, has more than one."""
_COMPARED: Mapping[str, Callable[[Any, Any], bool]] = {
    "=": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
_CONDITION = re.compile(r"\s*([\w.]+)\s*(!=|<=|>=|=|<|>|~)\s*(.*?)\s*", re.DOTALL)
_EXAMPLE = "as in --where law=surviving, --where 'saving<0.9' or --where changes~b2_deg"


@dataclass(frozen=True)
class RunCondition:
    """A condition on one attribute of a run.

    Attributes:
        key: One of `KEYS`.
        sign: ``=``, ``!=``, ``<``, ``<=``, ``>``, ``>=``, or ``~`` for "contains".
        value: A number of a number, or else a text; texts are compared as they sort.
    """

    key: str
    sign: str
    value: float | str

    def holds(self, run: Run) -> bool:
        """Return whether it holds; what a run does not have fulfils only ``!=``."""
        own = _value(run, self.key)
        if own is None:
            return self.sign == "!="
        if self.key in _SEVERAL and self.sign in {"=", "!="}:
            return (self.value in str(own).split(", ")) == (self.sign == "=")
        if self.sign == "~":
            return str(self.value).casefold() in str(own).casefold()
        return _COMPARED[self.sign](own, self.value)


def conditions_of(texts: Sequence[str]) -> list[RunCondition]:
    """Read conditions written as ``KEY=VALUE``.

    Raises:
        BadInput: A text is not of that form.
    """
    return [_condition(text) for text in texts]


def _condition(text: str) -> RunCondition:
    found = _CONDITION.fullmatch(text)
    if found is None:
        raise BadInput(f"--where is {text!r}, expected KEY=VALUE or KEY<VALUE", _EXAMPLE)
    key, sign, value = _known(found[1], "--where"), found[2], found[3]
    choices = _CHOICES.get(key, ())
    if sign in {"=", "!="} and choices:
        value = value.replace(" ", "_")  # as the list shows it
        if value not in choices:
            raise BadInput(f"--where {key}: expected one of {', '.join(choices)}, got {value!r}")
    if key not in NUMBERS or sign == "~":
        return RunCondition(key, sign, value)
    try:
        return RunCondition(key, sign, float(value))
    except ValueError:
        raise BadInput(f"--where {key}: expected a number, got {value!r}", _EXAMPLE) from None


def order_of(text: str) -> tuple[str, bool]:
    """Read an order: a key, after a minus sign for the largest, or the last, first.

    Raises:
        BadInput: There is no such key.
    """
    return _known(text.removeprefix("-"), "--sort"), text.startswith("-")


def chosen(
    runs: Sequence[Run], conditions: Sequence[RunCondition], order: str = "-time"
) -> list[Run]:
    """Return the runs that fulfil all conditions, in an order; what lacks its key comes last.

    Raises:
        BadInput: There is no such order.
    """
    key, descending = order_of(order)
    kept = [run for run in runs if all(one.holds(run) for one in conditions)]
    known = [run for run in kept if _value(run, key) is not None]
    known.sort(key=lambda run: (_value(run, key), run.name), reverse=descending)
    return known + [run for run in kept if _value(run, key) is None]


def _known(key: str, option: str) -> str:
    if key in KEYS:
        return key
    close = difflib.get_close_matches(key, KEYS, n=1)
    meant = f"; did you mean {close[0]!r}?" if close else ""
    raise BadInput(f"{option}: unknown key {key!r}{meant}", f"it can be {', '.join(KEYS)}")


def _value(run: Run, key: str) -> Any:
    if key.startswith("iae_"):
        return run.iae.get(key.removeprefix("iae_"))
    value = getattr(run, key)
    return ", ".join(value) if isinstance(value, tuple) else value
