"""Axes of a sweep: keys of the scenario and the values that they take."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import yaml

from gcs.errors import BadInput
from gcs.lab.campaigns.distributions import cells
from mavlink_defs.config.models import repeated
from mavlink_defs.config.yaml_text import parse_yaml


@dataclass(frozen=True)
class Axis:
    """A key of the scenario, as in ``trigger.b2_deg`` or ``faults[0].uav``, and its values."""

    key: str
    values: tuple[Any, ...]


def parse_axes(texts: Iterable[str], option: str = "--set") -> list[Axis]:
    """Read axes written as ``KEY=VALUE,VALUE``; the values are YAML, as in a list in brackets.

    Args:
        texts: The axes.
        option: Their option on the command line, for messages.

    Raises:
        BadInput: A text is not of this form, or a key or a value is given twice.
    """
    axes: list[Axis] = []
    for text in texts:
        axis = _parse_axis(text, option)
        if axis.key in (other.key for other in axes):
            raise BadInput(
                f"{option} {axis.key} is given twice", "give all its values at once, with commas"
            )
        axes.append(axis)
    return axes


def _parse_axis(text: str, option: str) -> Axis:
    key, _, listed = (part.strip() for part in text.partition("="))
    try:
        values = parse_yaml(f"[{listed}]")
        found = repeated(cells(values))
    except (yaml.YAMLError, ValueError, TypeError, RecursionError):
        values = found = []
    if not key or not values:
        raise BadInput(
            f"{option} is {text!r}, expected KEY=VALUE,VALUE,...",
            f"as in {option} trigger.b2_deg=0.5,1 or "
            f"{option} 'controller.K1=[40, 40, 40], [50, 50, 50]'",
        )
    for _, problem in found:
        raise BadInput(f"{option} {key}: {problem}", "leave one of them out")
    return Axis(key, tuple(values))
