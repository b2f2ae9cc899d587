"""Parameters as compiled code sees them: records whose fields are those of the models.

Numbers stay in the unit that the field's name says.
"""

import types
from typing import Any, Literal, get_args, get_origin

import numpy as np
from pydantic import BaseModel

from ftc_autopilot.control.schedule import TABLE, Schedule, schedule_table

__all__ = ["fill", "record_dtype"]


def record_dtype(model: type[BaseModel], base: type[BaseModel] = BaseModel) -> np.dtype:
    """The record that holds the numbers which a model has beyond those of a base class.

    A number is a number, a choice of texts its index, three numbers an array, a schedule its
    table, a model a record. A text without a choice is left out.
    """
    own = {n: f for n, f in model.model_fields.items() if n not in base.model_fields}
    fields = ((name, _dtype(field.annotation)) for name, field in own.items())
    return np.dtype([(name, *dtype) for name, dtype in fields if dtype is not None])


def _dtype(annotation: Any) -> tuple[Any, ...] | None:
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
    """Write a model's numbers into a record of `record_dtype` of its class."""
    for name in record.dtype.names or ():
        value, annotation = getattr(model, name), type(model).model_fields[name].annotation
        if isinstance(value, Schedule):
            record[name] = schedule_table(value)
        elif isinstance(value, BaseModel):
            fill(record[name], value)
        elif isinstance(value, str):
            record[name] = get_args(annotation).index(value)
        else:
            record[name] = value
