"""Drawn faults of navigation sensors."""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

from pydantic import Field, model_validator

from ftc_lab.campaigns.distributions import Distribution, support
from gcs.scenario.settings import is_number
from mavlink_defs.config.models import AtMost, Loc, Model, Problems, SystemId, repeated
from mavlink_defs.config.quantity import whole
from mavlink_defs.constants import LAST_SYSTEM
from mavlink_defs.sensor_fault_kinds import (
    SENSOR_FAULT_KINDS,
    SENSOR_NAMES,
    SENSOR_UNITS,
    SensorName,
)
from mavlink_defs.sensor_fault_spec import MOST_INSTANCES

if TYPE_CHECKING:
    SensorKind: TypeAlias = str
else:
    SensorKind = Literal[*SENSOR_FAULT_KINDS]

_Instance = Annotated[
    int, whole("", ge=0, le=MOST_INSTANCES, doc="Number of the sensor, from 1; 0: all.")
]


class DrawnSensorFault(Model):
    """One fault of one navigation sensor, every part of it drawn.

    The value of a kind is in the unit of the sensor, as in a scenario's faults: a bias of a gyro
    in deg/s.
    """

    uavs: Annotated[tuple[SystemId, ...], AtMost(LAST_SYSTEM)] = Field(
        default=(), description="UAVs that it may hit, as likely each; all of them by default."
    )
    sensors: Annotated[tuple[SensorName, ...], AtMost(len(SENSOR_NAMES))] = Field(
        min_length=1, description="Sensors that it may hit, as likely each."
    )
    instances: Annotated[tuple[_Instance, ...], AtMost(MOST_INSTANCES)] = Field(
        default=(0,), min_length=1, description="Numbers of the sensor, as likely each; 0: all."
    )
    kinds: Annotated[dict[SensorKind, Distribution | None], AtMost(len(SENSOR_FAULT_KINDS))] = (
        Field(
            min_length=1,
            description="Kinds of fault, as likely each, with their value; null: it has none, or "
            "its default.",
        )
    )
    start_s: Distribution = Field(description="Onset [s of simulated time].")
    lasts_s: Distribution | None = Field(
        default=None, description="Length of the fault [s]; none: for good."
    )

    @property
    def frequency_hz(self) -> None:
        """There is none but the value of an intermittent fault."""
        return

    @model_validator(mode="after")
    def _fits_together(self) -> "DrawnSensorFault":
        Problems.check(self._problems())
        return self

    def _problems(self) -> Iterator[tuple[Loc, str]]:
        for key in ("uavs", "sensors", "instances"):
            yield from (((key, i), text) for i, text in repeated(getattr(self, key)))
        for i, name in enumerate(self.sensors):
            if max(self.instances) > 1 and not SENSOR_UNITS[name].has_imus:
                yield ("instances",), f"expected 0 or 1, as there is one sensor of {name}"
            for kind_name in self.kinds:
                if not SENSOR_FAULT_KINDS[kind_name].fits(SENSOR_UNITS[name]):
                    yield ("sensors", i), f"{name} has no {kind_name}"
        for kind_name, values in self.kinds.items():
            yield from self._kind_problems(kind_name, values)
        limits = {"start_s": (self.start_s, 0.0), "lasts_s": (self.lasts_s, 1e-6)}
        for key, (drawn, low) in limits.items():
            for value in () if drawn is None else support(drawn):
                if not is_number(value) or not low <= value:
                    yield (key,), f"draws {value!r}, expected within [{low:g}, inf] s"

    def _kind_problems(self, name: str, values: Distribution | None) -> Iterator[tuple[Loc, str]]:
        kind = SENSOR_FAULT_KINDS[name]
        if values is None:
            return
        if not kind.has_value:
            yield ("kinds", name), "expected null, as it has no value"
            return
        units = {kind.unit_of(SENSOR_UNITS[sensor]) for sensor in self.sensors}
        if len(units) > 1:
            listed = ", ".join(sorted(units))
            yield ("kinds", name), f"expected sensors of one unit with a value, got {listed}"
            return
        for sensor in self.sensors:
            low, high = kind.bounds(SENSOR_UNITS[sensor])
            for value in support(values):
                if not is_number(value) or not low <= value <= high:
                    text = f"draws {value!r}, expected within [{low:g}, {high:g}] {units.pop()}"
                    yield ("kinds", name), text.rstrip()
                    return

    def fault(self, drawn: Mapping[str, Any]) -> dict[str, Any]:
        """Return a drawn fault as the scenario has it.

        Args:
            drawn: The columns of the fault, by the ends of their names.
        """
        kind, unit = SENSOR_FAULT_KINDS[drawn["kind"]], SENSOR_UNITS[drawn["sensor"]]
        keys = {key: drawn[key] for key in ("uav", "sensor", "instance", "start_s")}
        if drawn["end_s"] is not None:
            keys["end_s"] = drawn["end_s"]
        if self.kinds[kind.name] is not None:
            return keys | {kind.key(unit): drawn["value"]}
        if kind.name == unit.wrong[0]:
            return keys | {kind.key(unit): unit.wrong[1]}
        return keys | ({kind.key(unit): kind.default} if kind.has_value else {"failure": kind.name})
