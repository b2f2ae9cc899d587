"""Parameters that change in time: windows in YAML, a small table in compiled code."""

import math
from typing import Annotated, Any, Generic, TypeVar

import numpy as np
from pydantic import ConfigDict, Discriminator, Field, RootModel, Tag, model_validator

from mavlink_defs.config.models import AtMost, Loc, Model, Problems
from mavlink_defs.config.quantity import quantity
from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import Vec3

MAX_WINDOWS = 8
"""Most windows of a schedule."""

TABLE = (MAX_WINDOWS, 4)
"""Shape of a schedule's table; per window: last time [s], then the value, one number or three."""

T = TypeVar("T")


class TimedValue(Model, Generic[T]):
    """A value and the last instant at which it is in force."""

    until_s: float | None = quantity(
        "s", "Last instant, on the clock of the mission; none: for ever.", None, gt=0.0
    )
    value: T = Field(description="Value until then, in the unit of the parameter.")


def _form(value: object) -> str:
    """Return the tag of a list of windows, or of a plain value (also a list of numbers)."""
    windows = isinstance(value, list | tuple) and any(
        isinstance(v, dict | TimedValue) for v in value
    )
    return "<windows>" if windows else "<value>"


class Schedule(
    RootModel[
        Annotated[
            Annotated[T, Tag("<value>")]
            | Annotated[tuple[TimedValue[T], ...], AtMost(MAX_WINDOWS, "window"), Tag("<windows>")],
            Discriminator(_form),
        ]
    ],
    Generic[T],
):
    """A parameter that changes in time: a plain value, or a list of windows.

    In YAML ``[{until_s: 14, value: 0.5}, {value: 1}]`` is 0.5 for t <= 14 s, then 1.
    """

    model_config = ConfigDict(frozen=True)

    def windows(self) -> tuple[tuple[float, Any], ...]:
        """Return last instant [s] and value of each window in order; the last is without end."""
        if not isinstance(self.root, tuple) or not isinstance(self.root[0], TimedValue):
            return ((math.inf, self.root),)
        return tuple(
            (math.inf if window.until_s is None else window.until_s, window.value)
            for window in self.root
        )

    @model_validator(mode="after")
    def _times_increase(self) -> "Schedule[T]":
        times = [until for until, _ in self.windows()]
        last = len(times) - 1
        problems: list[tuple[Loc, str]] = []
        for i, until in enumerate(times):
            if i == last and until != math.inf:
                problems.append(
                    ((i, "until_s"), f"expected none in the last window, got {until!r}")
                )
            elif i < last and until == math.inf:
                problems.append(((i, "until_s"), "missing; only the last window has no end"))
            if i > 0 and until <= times[i - 1] < math.inf:
                text = f"expected > {times[i - 1]!r} s, the end of the window before, got {until!r}"
                problems.append(((i, "until_s"), text))
        Problems.check(problems)
        return self


def schedule(default: object, *, doc: str | None = None) -> Any:
    """Declare a field of type `Schedule` with its default as YAML would give it."""
    return Field(default=default, validate_default=True, description=doc)


def schedule_table(windows: "Schedule[Any]") -> np.ndarray:
    """Return a schedule as compiled code reads it, shape `TABLE`."""
    table = np.full(TABLE, math.inf)
    for i, (until, value) in enumerate(windows.windows()):
        table[i, 0] = until
        table[i, 1:] = value
    return table


@compiled
def scheduled(table: np.ndarray, t: float) -> Vec3:
    """Return the value of a schedule at time t [s]; each window includes its last instant."""
    i = 0
    while table[i, 0] < t:
        i += 1
    return table[i, 1], table[i, 2], table[i, 3]
