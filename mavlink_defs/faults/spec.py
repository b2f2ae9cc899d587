"""Faults with the keys of a scenario's `faults`."""

import itertools
import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self, TypeAlias

from pydantic import Field, create_model, model_validator

from mavlink_defs.config.models import Model, Problem, Problems
from mavlink_defs.config.quantity import quantity, whole
from mavlink_defs.constants import Actuator
from mavlink_defs.faults import FAMILIES, sensors
from mavlink_defs.faults.actuators import ACTUATOR_FAULTS, BIAS, STUCK
from mavlink_defs.faults.fault import Fault
from mavlink_defs.faults.kinds import MAX_FREQUENCY_HZ, Family, Kind, Target
from mavlink_defs.faults.window import Window


class FaultSpec(Model):
    """A fault of one target: which, how, how much, and when.

    The UAV is not part of it, and its window may be left open.

    Attributes:
        start_s: Start in simulated time, exclusive; none: now.
        end_s: End in simulated time, inclusive; none: never.
    """

    FAMILY: ClassVar[Family]

    start_s: float | None = quantity("s", default=None, ge=0.0)
    end_s: float | None = quantity("s", default=None, gt=0.0)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        Problems.check(itertools.chain(self._value_problems(), self._problems(), self._late()))
        return self

    def _value_problems(self) -> Iterator[Problem]:
        target = self.target
        for kind, key in self._given:
            if kind.fits(target) and key == kind.key(target):
                yield from self._problems_of(kind, key)
                continue
            other = (kind.key(target),) if kind.fits(target) else ()
            hint = "; did you mean '{0}'?" if other else ""
            yield Problem((key,), f"does not fit {self._whose}{hint}", keys=other)
        for key, other_key in self._clashes():
            yield Problem((key,), "cannot be combined with '{0}'", keys=(other_key,))

    def _problems_of(self, kind: Kind, key: str) -> Iterator[Problem]:
        """Yield what is wrong with a value that fits."""
        low, high = kind.bounds(self.target)
        if math.isfinite(high) and not low <= (value := getattr(self, key)) <= high:
            expected = f"[{low:g}, {high:g}] {kind.unit_of(self.target)}".rstrip()
            yield Problem((key,), f"expected {expected}, got {value!r}")

    def _clashes(self) -> Iterator[tuple[str, str]]:
        """Yield keys of values that cannot be combined."""
        keys = [key for _, key in self._given]
        yield from ((key, keys[0]) for key in keys[1:])

    def _problems(self) -> Iterator[Problem]:
        """Yield what else is wrong."""
        if not self._given:
            yield Problem((), "expected a value, got none")

    def _late(self) -> Iterator[Problem]:
        """Yield that it ends before it starts."""
        if self.end_s is not None and self.start_s is not None and self.end_s <= self.start_s:
            text = f"expected > {{0}} = {self.start_s!r} s, got {self.end_s!r}"
            yield Problem(("end_s",), text, keys=("start_s",))

    @property
    def target(self) -> Target:
        """What fails."""
        return self.FAMILY.named(getattr(self, self.FAMILY.key))

    @property
    def _whose(self) -> str:
        return f"the {self.target.name}"

    @property
    def _given(self) -> list[tuple[Kind, str]]:
        """The kinds whose value is given, and its keys."""
        keys = ((kind, key) for kind in self.FAMILY.kinds for key in self.FAMILY.keys_of(kind))
        return [(kind, key) for kind, key in keys if getattr(self, key) is not None]

    @property
    def value(self) -> tuple[Kind, float] | None:
        """Its kind and its value; None if none is given."""
        found = next(iter(self._given), None)
        return found and (found[0], getattr(self, found[1]))

    @property
    def window(self) -> Window:
        """When it acts, as commands carry it."""
        return Window(
            start_s=math.nan if self.start_s is None else self.start_s,
            end_s=math.nan if self.end_s is None else self.end_s,
        )

    def command(self) -> Fault:
        """Return the fault as commands carry it."""
        kind, value = self.value or self._without_value()
        own = self._own(kind)
        return Fault(self.target, kind, value, *self.window, **own)

    def _without_value(self) -> tuple[Kind, float]:
        """Return the kind and the value if none is given."""
        return self.FAMILY.kinds[0], 0.0

    def _own(self, _: Kind) -> dict[str, Any]:
        """Return what its family has besides value and window."""
        return {}


def _values_of(family: Family) -> dict[str, Any]:
    """Return the fields of the values of a family's faults: of each kind one for each unit."""
    fields = {}
    for kind in family.kinds:
        for k, (key, targets) in enumerate(family.keys_of(kind).items()):
            low = min(kind.bounds(target)[0] for target in targets)
            high = max(kind.bounds(target)[1] for target in targets)
            limits = {"ge": low, "le": high} if math.isfinite(high) else {}
            doc = kind.docs[min(k, len(kind.docs) - 1)]
            if len(kind.docs) == 1 and "{" in kind.unit:
                doc = f"{doc.rstrip('.')}: {' or '.join(target.name for target in targets)}."
            unit = kind.unit_of(targets[0])
            fields[key] = (float | None, quantity(unit, **limits, default=None, doc=doc))
    return fields


class _ActuatorKeys(Model):
    actuator: Actuator = Field(description="The actuator that fails.")
    effectiveness: float | None = quantity(
        "",
        "Share of the command that remains; none: 1, or 0 where a value replaces it.",
        None,
        ge=0.0,
        le=1.0,
    )


class _SensorKeys(Model):
    sensor: sensors.SensorName = Field(description="The sensor that fails.")
    instance: int = whole(
        "", "Number of the sensor, from 1; 0: all of them.", 0, ge=0, le=sensors.MAX_INSTANCES
    )
    failure: sensors.Failure | None = Field(
        default=None,
        description="What MAV_CMD_INJECT_FAILURE calls it; without a value, the default one.",
    )
    axis: sensors.Axis | None = Field(
        default=None, description="Axis that is wrong: of the body, of a GPS north, east, down."
    )


if TYPE_CHECKING:
    _ActuatorValues: TypeAlias = _ActuatorKeys
    _SensorValues: TypeAlias = _SensorKeys
else:
    _ActuatorValues, _SensorValues = (
        create_model("_WithValue", __base__=keys, **_values_of(family))
        for keys, family in ((_ActuatorKeys, ACTUATOR_FAULTS), (_SensorKeys, sensors.SENSOR_FAULTS))
    )


class _WithFrequency(_ActuatorValues):
    frequency_hz: float = quantity(
        "Hz",
        "Frequency of the value, or of on and off; 0: constant.",
        0.0,
        ge=0.0,
        le=MAX_FREQUENCY_HZ,
    )


class ActuatorFaultSpec(FaultSpec, _WithFrequency):
    """An actuator fault (13), (19): applied = effectiveness * commanded + value.

    What the value is, its kind says: a bias on the remaining command, or the position of a stuck
    actuator. The UAV is not part of it, and its window may be left open.
    """

    FAMILY: ClassVar[Family] = ACTUATOR_FAULTS

    def _clashes(self) -> Iterator[tuple[str, str]]:
        fitting = [key for kind, key in self._given if key == kind.key(self.target)]
        return itertools.pairwise(fitting)

    def _problems(self) -> Iterator[Problem]:
        keys = {kind.name: kind.key(self.target) for kind in self.FAMILY.kinds}
        kinds = [kind for kind, key in self._given if key == keys[kind.name]]
        if replacing := [(keys[kind.name],) for kind in kinds if not kind.partial]:
            if self.effectiveness:
                text = f"expected 0 or none with '{{0}}', got {self.effectiveness!r}"
                yield Problem(("effectiveness",), text, keys=replacing[0])
        elif BIAS in kinds and self.effectiveness == 0.0:
            text = "nothing is left to be biased; did you mean '{0}'?"
            yield Problem((keys[BIAS.name],), text, keys=(keys[STUCK.name],))
        elif not self._given and self.effectiveness is None:
            *others, last = (f"'{{{i}}}'" for i in range(1 + len(keys)))
            text = f"expected {', '.join(others)} or {last}, got none of them"
            yield Problem((), text, keys=("effectiveness", *keys.values()))
        for kind in kinds:
            if kind.switches and self.frequency_hz == 0.0:
                text = "expected > 0 Hz with '{0}', got 0.0"
                yield Problem(("frequency_hz",), text, keys=(keys[kind.name],))

    def _without_value(self) -> tuple[Kind, float]:
        return (STUCK if self.effectiveness == 0.0 else BIAS), 0.0

    def _own(self, kind: Kind) -> dict[str, Any]:
        healthy = 1.0 if kind.partial else 0.0
        left = healthy if self.effectiveness is None else self.effectiveness
        return {"effectiveness": left, "frequency_hz": self.frequency_hz}


class SensorFaultSpec(FaultSpec, _SensorValues):
    """A fault of a navigation sensor: which, what MAVLink calls it, and how much.

    The failure may be left out where a value says it. The UAV is not part of it, and its window
    may be left open.
    """

    FAMILY: ClassVar[Family] = sensors.SENSOR_FAULTS

    @property
    def _whose(self) -> str:
        return f"a sensor of {self.sensor}"

    def _problems_of(self, kind: Kind, key: str) -> Iterator[Problem]:
        if self.failure in {None, kind.failure}:
            yield from super()._problems_of(kind, key)
        else:
            text = f"does not go with a failure {self.failure!r}; it is one of {kind.failure!r}"
            yield Problem((key,), text)

    def _problems(self) -> Iterator[Problem]:
        sensor = self.target
        if not self._given and self.failure is None:
            yield Problem((), "expected a '{0}' or a value, got neither", keys=("failure",))
        if self.instance > 1 and not sensor.has_imus:
            text = f"expected 0 or 1, as there is one sensor of {sensor.name}, got {self.instance}"
            yield Problem(("instance",), text)
        kind, _ = self.value or self._without_value()
        if self.axis is not None and not (sensor.axes and kind.wrongs):
            why = f"{kind.name} concerns all axes" if sensor.axes else f"{sensor.name} has no axes"
            yield Problem(("axis",), f"expected none, as {why}, got {self.axis!r}")

    def _without_value(self) -> tuple[Kind, float]:
        found = sensors.SENSOR_FAULTS.default(self.failure or "wrong", self.target)
        assert found is not None  # every sensor can fail in every way of FAILURE_TYPE
        return found

    def _own(self, _: Kind) -> dict[str, Any]:
        axis = 0 if self.axis is None else 1 + sensors.AXIS_NAMES.index(self.axis)
        return {"instance": self.instance, "axis": axis}


def _spec_of(family: Family) -> type[FaultSpec]:
    """Return the model of the faults of a family that has no keys but values and a window."""
    names: Any = Literal[*(target.name for target in family.targets)]
    fields: dict[str, Any] = {
        family.key: (names, Field(description=f"The {family.key} that fails.")),
        **_values_of(family),
    }
    model = create_model(f"{family.key.title()}FaultSpec", __base__=FaultSpec, **fields)
    model.FAMILY = family
    return model


_OWN: Mapping[str, type[FaultSpec]] = {"actuator": ActuatorFaultSpec, "sensor": SensorFaultSpec}

SPECS = {family.key: _OWN.get(family.key) or _spec_of(family) for family in FAMILIES}
"""The model of the faults of each family, by its key."""
