"""A fault of a navigation sensor with the keys of a scenario's `faults`."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Self

from pydantic import Field, create_model, model_validator

from mavlink_defs.config.models import Model, Problem, Problems
from mavlink_defs.config.quantity import quantity, whole
from mavlink_defs.fault_spec import WindowSpec
from mavlink_defs.sensor_fault_kinds import (
    AXIS_NAMES,
    SENSOR_FAULT_KINDS,
    SENSOR_NAMES,
    SENSOR_UNITS,
    Axis,
    Failure,
    SensorFaultKind,
    SensorName,
    SensorUnit,
    default_of,
)
from mavlink_defs.sensor_faults import SensorFault

MOST_INSTANCES = 8
"""Largest number that a sensor can have."""


class _WithoutValue(Model):
    sensor: SensorName = Field(description="The sensor that fails.")
    instance: int = whole(
        "", ge=0, le=MOST_INSTANCES, default=0, doc="Number of the sensor, from 1; 0: all of them."
    )
    failure: Failure | None = Field(
        default=None,
        description="What MAV_CMD_INJECT_FAILURE calls it; without a value, the default one.",
    )
    axis: Axis | None = Field(
        default=None, description="Axis that is wrong: of the body, of a GPS north, east, down."
    )


def _of_value(kind: SensorFaultKind) -> dict[str, tuple[object, object]]:
    """Return the fields of a kind's value by key: one for each unit that it can have."""
    fields: dict[str, tuple[object, object]] = {}
    for unit in SENSOR_UNITS.values():
        if not kind.fits(unit) or (key := kind.key(unit)) in fields:
            continue
        alike = [u for u in SENSOR_UNITS.values() if kind.fits(u) and kind.key(u) == key]
        low, high = min(kind.bounds(u)[0] for u in alike), max(kind.bounds(u)[1] for u in alike)
        whose = " or ".join(u.name for u in alike)
        doc = kind.doc if kind.is_shared else f"{kind.doc.rstrip('.')}: {whose}."
        of_value = quantity(kind.unit_of(unit), ge=low, le=high, default=None, doc=doc)
        fields[key] = (float | None, of_value)
    return fields


if TYPE_CHECKING:
    _WithValue = _WithoutValue
else:
    _WithValue = create_model(
        "_WithValue",
        __base__=_WithoutValue,
        **{
            key: field
            for kind in SENSOR_FAULT_KINDS.values()
            if kind.has_value
            for key, field in _of_value(kind).items()
        },
    )


class SensorFaultSpec(WindowSpec, _WithValue):
    """A fault of a navigation sensor: which, what MAVLink calls it, and how much.

    The failure may be left out where a value says it. The UAV is not part of it, and its window
    may be left open.
    """

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        Problems.check(self._problems())
        return self

    def _problems(self) -> Iterator[Problem]:
        unit, given = self.unit, list(self._values())
        fitting = {kind.key(unit): kind for kind in SENSOR_FAULT_KINDS.values() if kind.fits(unit)}
        for key, kind in given:
            if key not in fitting:
                other = (kind.key(unit),) if kind.fits(unit) else ()
                hint = "; did you mean '{0}'?" if other else ""
                yield Problem((key,), f"does not fit a sensor of {unit.name}{hint}", keys=other)
            elif self.failure not in {None, kind.failure}:
                text = f"does not go with a failure {self.failure!r}; it is one of {kind.failure!r}"
                yield Problem((key,), text)
            else:
                yield from self._value_problems(unit, key, kind)
        for key, _ in given[1:]:
            yield Problem((key,), "cannot be combined with '{0}'", keys=(given[0][0],))
        if not given and self.failure is None:
            yield Problem((), "expected a '{0}' or a value, got neither", keys=("failure",))
        if self.instance > 1 and not unit.has_imus:
            text = f"expected 0 or 1, as there is one sensor of {unit.name}, got {self.instance}"
            yield Problem(("instance",), text)
        if self.axis is not None and not (unit.axes and self._kind[0].wrongs):
            if unit.axes:
                text = (
                    f"expected none, as {self._kind[0].name} concerns all axes, got {self.axis!r}"
                )
            else:
                text = f"expected none, as {unit.name} has no axes, got {self.axis!r}"
            yield Problem(("axis",), text)
        yield from self.window_problems()

    def _value_problems(
        self, unit: SensorUnit, key: str, kind: SensorFaultKind
    ) -> Iterator[Problem]:
        low, high = kind.bounds(unit)
        if not low <= (value := getattr(self, key)) <= high:
            expected = f"[{low:g}, {high:g}] {kind.unit_of(unit)}".rstrip()
            yield Problem((key,), f"expected {expected}, got {value!r}")

    def _values(self) -> Iterator[tuple[str, SensorFaultKind]]:
        """Yield the keys whose value is given, and their kinds."""
        for kind in SENSOR_FAULT_KINDS.values():
            for key in _of_value(kind) if kind.has_value else ():
                if getattr(self, key) is not None:
                    yield key, kind

    @property
    def unit(self) -> SensorUnit:
        """The sensor that fails."""
        return SENSOR_UNITS[self.sensor]

    @property
    def _kind(self) -> tuple[SensorFaultKind, float]:
        found = next(self._values(), None)
        if found is not None:
            return found[1], getattr(self, found[0])
        return default_of(self.failure or "wrong", self.unit)

    def command(self) -> SensorFault:
        """Return the fault as MAV_CMD_FTC_SET_SENSOR_FAULT carries it."""
        kind, value = self._kind
        return SensorFault(
            sensor=1 + SENSOR_NAMES.index(self.sensor),
            code=kind.code,
            value=value,
            instance=self.instance,
            **self.window._asdict(),
            axis=0 if self.axis is None else 1 + AXIS_NAMES.index(self.axis),
        )
