"""Plug-ins in configurations: a section whose name is not one of ours is checked by its class."""

from collections.abc import Callable, Iterable
from typing import Any, TypeVar

import numpy as np
from pydantic import ValidationError

from ftc_autopilot.plugins.loading import calling, is_by_file, registered
from mavlink_defs.config.files import problems_of
from mavlink_defs.config.models import Model, Problems
from mavlink_defs.runtime.foreign import PluginError

PLUGIN = "plugin"
"""Name of their part of a record."""
PLUGIN_TAG = "FILE.py:CLASS"
"""Tag of all plug-ins, which messages show beside our own names."""
ADDRESSES = (("step", "u8"), ("init", "u8"))
"""Fields of a record: the C functions of a plug-in; 0 for none."""

_M = TypeVar("_M", bound=Model)


def area(size: int) -> tuple[str, list[Any]]:
    """Return the field of a record in which a plug-in's own record begins; its size [bytes]."""
    return "own", [("numbers", "f8", (size // 8,))]


def is_plugin(name: object, group: str, own: Iterable[str]) -> bool:
    """Return whether a name is a plug-in's: FILE:CLASS, or an entry point of a group."""
    if not isinstance(name, str) or name in own:
        return False
    return is_by_file(name) or name in registered(group)


def model_of(key: str, load: Callable[[str], type[_M]]) -> Callable[[Any], Any]:
    """Return a validator that makes the model of a plug-in's section.

    Args:
        key: Of the section, with the name of the plug-in.
        load: Returns the class of a name.
    """

    def validated(value: Any) -> Any:
        if not isinstance(value, dict):
            return value
        try:
            model = load(value[key])
            with calling(model, "model_validate"):
                return _checked(model, value)
        except PluginError as problem:
            raise Problems([((key,), str(problem))]) from problem

    return validated


def _checked(model: type[_M], value: Any) -> _M:
    try:
        return model.model_validate(value)
    except ValidationError as problem:
        raise Problems(problems_of(model, problem)) from problem


def owned(record: Any, dtype: Any) -> Any:
    """Return the part of a plug-in of a record, or of an array of records of shape (1,).

    Args:
        record: Record, or array, with a field `own`, as of `PLUGIN_PARAMETERS`.
        dtype: What the part has.

    Returns:
        A record of that dtype, or an array of shape (1,), in the same memory.
    """
    numbers = record["own"]["numbers"]
    if not dtype.itemsize:
        return np.zeros(numbers.shape[:-1], dtype)[()]
    part = numbers[..., : -(-dtype.itemsize // 8)]
    found = part.view("u1")[..., : dtype.itemsize].view(dtype)
    return found[0] if found.ndim == 1 else found[:, 0]
