"""Keys of a scenario and their values, as in ``--set KEY=VALUE,VALUE``."""

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from ftc_autopilot.plugins.loading import resolved
from gcs.console.errors import BadInput
from mavlink_defs.config.models import repeated
from mavlink_defs.config.yaml_text import parse_yaml

_EXACT = 2**53
"""Whole numbers up to this one are the same in a table, which has 64-bit floats."""


@dataclass(frozen=True)
class Axis:
    """A key of the scenario, as in ``trigger.b2_deg`` or ``faults[0].uav``, and its values."""

    key: str
    values: tuple[Any, ...]


def parse_axes(
    texts: Iterable[str], option: str = "--set", form: str = "KEY=VALUE,VALUE,..."
) -> list[Axis]:
    """Read axes written as ``KEY=VALUE,VALUE``; the values are YAML, as in a list in brackets.

    Args:
        texts: The axes.
        option: Their option on the command line, for messages.
        form: How one is written, for messages.

    Raises:
        BadInput: A text is not of this form, or a key or a value is given twice.
    """
    axes: list[Axis] = []
    for text in texts:
        axis = _parse_axis(text, option, form)
        if axis.key in (other.key for other in axes):
            raise BadInput(
                f"{option} {axis.key} is given twice", "give all its values at once, with commas"
            )
        axes.append(axis)
    return axes


def _parse_axis(text: str, option: str, form: str) -> Axis:
    key, _, listed = (part.strip() for part in text.partition("="))
    try:
        values = parse_yaml(f"[{listed}]")
        found = repeated(cells(values))
    except (yaml.YAMLError, ValueError, TypeError, RecursionError):
        values = found = []
    if not key or not values:
        several = "," in form
        raise BadInput(
            f"{option} is {text!r}, expected {form}",
            f"as in {option} trigger.b2_deg={'0.5,1' if several else '0.5'} or "
            f"{option} 'controller.K1=[40, 40, 40]{', [50, 50, 50]' if several else ''}'",
        )
    for _, problem in found:
        raise BadInput(f"{option} {key}: {problem}", "leave one of them out")
    return Axis(key, tuple(map(_from_here, values)))


def _from_here(value: Any) -> Any:
    """Return a value in which a file with a plug-in, FILE.py:CLASS, is named from the root."""
    if isinstance(value, dict):
        return {key: _from_here(inner) for key, inner in value.items()}
    return resolved(value, Path.cwd()) if isinstance(value, str) else value


def values_of(settings: Sequence[str], option: str = "--set") -> dict[str, Any]:
    """Return keys and values of settings with one value each, such as ``--set KEY=VALUE``.

    Raises:
        BadInput: A setting is not of that form, or has several values.
    """
    axes = parse_axes(settings, option, "KEY=VALUE")
    for axis in axes:
        if len(axis.values) > 1:
            raise BadInput(
                f"{option} {axis.key} has {len(axis.values)} values, expected one",
                "write a list in brackets; gcs sweep flies several values",
            )
    return {axis.key: axis.values[0] for axis in axes}


def plain(value: Any) -> Any:
    """Return a tree as a file has it: lists for tuples and arrays, numbers for NumPy's."""
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, Mapping):
        return {key: plain(inner) for key, inner in value.items()}
    return [plain(inner) for inner in value] if isinstance(value, list | tuple) else value


def label(value: Any) -> str:
    """Format a value on one line: text as it is, anything else as JSON.

    Raises:
        TypeError: It is nothing that JSON knows, such as a date.
    """
    return value if isinstance(value, str) else json.dumps(value)


def is_number(value: Any) -> bool:
    """Return whether a value is a number; true and false are none."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def cells(values: Sequence[Any]) -> list[float] | list[str]:
    """Return what a table has for each of several values: numbers if all are, or else texts.

    Raises:
        TypeError: A value is no plain data.
    """
    if all(is_number(value) and _is_exact(value) for value in values):
        return [float(value) for value in values]
    return [label(value) for value in values]


def _is_exact(value: float) -> bool:
    return abs(value) <= _EXACT or (isinstance(value, float) and math.isfinite(value))
