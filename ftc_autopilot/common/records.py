"""Parameters as compiled code sees them: records with the fields of the models, in SI units.

Angles are configured in degrees and converted here, once: a field ``b2_deg`` [deg] of a model is
``b2_rad`` [rad] in the record.
"""

import math
import re
import types
from typing import Any, Literal, get_args, get_origin

import numpy as np
from pydantic import BaseModel

from ftc_autopilot.common.schedule import TABLE, Schedule, schedule_table

_DEGREE = math.radians(1.0)


def in_si(field: str) -> tuple[str, float]:
    """Return a model field's name in a record, and the factor of its numbers there."""
    name = re.sub(r"_deg(?=_|$)", "_rad", field)
    return name, 1.0 if name == field else _DEGREE


def record_dtype(model: type[BaseModel], base: type[BaseModel] = BaseModel) -> np.dtype:
    """Return the record of the numbers that a model has in addition to a base class.

    A number is a number, a choice of texts its index, three numbers an array, a schedule its
    table, a model a record; a number that may be none is NaN then. A text without a choice is left
    out.
    """
    own = {n: f for n, f in model.model_fields.items() if n not in base.model_fields}
    fields = ((in_si(name)[0], _dtype(field.annotation)) for name, field in own.items())
    return np.dtype([(name, *dtype) for name, dtype in fields if dtype is not None])


def _dtype(annotation: Any) -> tuple[Any, ...] | None:
    if annotation == float | None:
        return ("f8",)
    if get_origin(annotation) is Literal:
        return ("i8",) if len(get_args(annotation)) > 1 else None
    if get_origin(annotation) is tuple:
        return ("f8", (len(get_args(annotation)),))
    if isinstance(annotation, type) and not isinstance(annotation, types.GenericAlias):
        if issubclass(annotation, Schedule):
            return ("f8", TABLE)
        if issubclass(annotation, BaseModel):
            return (record_dtype(annotation),)
        if annotation is str:
            return None
        if annotation in {int, bool}:
            return ("i8",)
        if annotation is float:
            return ("f8",)
    raise TypeError(f"a compiled law cannot have a parameter of type {annotation}")


def fill(record: np.void, model: BaseModel) -> None:
    """Write a model's numbers in SI units into a record of `record_dtype` of its class."""
    for field, info in type(model).model_fields.items():
        name, factor = in_si(field)
        if name not in (record.dtype.names or ()):
            continue
        value = getattr(model, field)
        if isinstance(value, Schedule):
            record[name] = schedule_table(value)
            record[name][:, 1:] *= factor
        elif isinstance(value, BaseModel):
            fill(record[name], value)
        elif isinstance(value, str):
            record[name] = get_args(info.annotation).index(value)
        else:
            record[name] = np.multiply(math.nan if value is None else value, factor)
