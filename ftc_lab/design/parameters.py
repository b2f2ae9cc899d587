"""The parameters of a model for another aircraft, each with the rule that made it.

A number is multiplied by the ratio of its declared unit. The few that have a rule of their own are
in `ftc_lab.design.rules`.
"""

from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from ftc_autopilot.common.schedule import Schedule
from ftc_lab.design.similarity import Similarity
from mavlink_defs.config.quantity import Quantity, describe

_DIGITS = 4  # significant, of a number that was changed


class Line(NamedTuple):
    """A value of a scenario, and the rule that made it."""

    value: Any
    rule: str


Tree: TypeAlias = "dict[str, Line | Tree]"
Rule: TypeAlias = Callable[[Any], Line | None]
"""Makes the line of a value; None leaves the key out."""


def parameters_of(
    model: BaseModel,
    similar: Similarity,
    rule_of: Callable[[BaseModel, str, Quantity], Rule | None] = lambda *_: None,
) -> Tree:
    """Return every parameter of a model for the aircraft of a similarity.

    Args:
        model: With the values for the aircraft that the defaults were found on.
        similar: The units of the other one.
        rule_of: Returns the rule of a field's own, if it has one; model, name and declaration.
    """
    lines: Tree = {}
    for name, field in type(model).model_fields.items():
        value = getattr(model, name)
        if isinstance(value, BaseModel) and not isinstance(value, Schedule):
            lines[name] = parameters_of(value, similar, rule_of)
            continue
        declared = declaration(field)
        rule = rule_of(model, name, declared)
        line = by_unit(value, declared.unit, similar) if rule is None else rule(value)
        if line is not None:
            lines[name] = line
    return lines


def declaration(field: FieldInfo) -> Quantity:
    """Return what is declared of a field's numbers; of other fields, a pure number."""
    found = _declared(field.annotation) or describe(field)
    return found or Quantity("", None, None, None, None, field.description or "")


def _declared(annotation: Any) -> Quantity | None:
    """Return the first declaration of the numbers in a list or a schedule."""
    if isinstance(annotation, type) and issubclass(annotation, Schedule):
        (annotation,) = annotation.__pydantic_generic_metadata__["args"]
    for extra in getattr(annotation, "__metadata__", ()):
        if isinstance(extra, FieldInfo) and (found := describe(extra)) is not None:
            return found
    if get_origin(annotation) is None:
        return None
    return next(filter(None, map(_declared, get_args(annotation))), None)


def by_unit(value: Any, unit: str, similar: Similarity) -> Line | None:
    """Return a value times the ratio of its unit; None for a value that is not given."""
    if value is None:
        return None
    if isinstance(value, bool | int | str):
        return Line(value, "default")
    formula = similar.formula(unit)
    rule = f"{text_of(value)} × {formula}" if formula and value != 0.0 else "default"
    return Line(scaled(value, similar.factor(unit), similar.time), rule)


def scaled(value: Any, factor: Any, time: float) -> Any:
    """Return numbers times a factor, or times a list of factors; a schedule's times by `time`."""
    if isinstance(value, Schedule):
        windows = value.windows()
        if len(windows) == 1:
            return scaled(windows[0][1], factor, time)
        return [
            {
                **({} if until == float("inf") else {"until_s": rounded(until, time)}),
                "value": scaled(one, factor, time),
            }
            for until, one in windows
        ]
    if isinstance(value, list | tuple):
        factors = factor if isinstance(factor, list | tuple) else [factor] * len(value)
        return [rounded(x, f) for x, f in zip(value, factors, strict=True)]
    return rounded(value, factor)


def rounded(value: float, factor: float) -> float:
    """Return a value times a factor, of few digits; the value itself if that is 1."""
    return value if factor == 1.0 else float(f"{value * factor:.{_DIGITS}g}")


def text_of(value: Any) -> str:
    """Return numbers as a short text; of a schedule, of its first window."""
    if isinstance(value, Schedule):
        return f"{text_of(value.windows()[0][1])}{' ...' if len(value.windows()) > 1 else ''}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(text_of, value))}]"
    return f"{value:g}"
