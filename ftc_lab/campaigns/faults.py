"""Drawn faults of actuators and of navigation sensors."""

import itertools
import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, TypeAlias

from pydantic import Discriminator, Field, Tag, model_validator

from ftc_lab.campaigns.distributions import Distribution, support
from gcs.scenario.settings import is_number
from mavlink_defs.config.models import AtMost, Loc, Model, Problems, SystemId, repeated
from mavlink_defs.config.quantity import whole
from mavlink_defs.constants import ACTUATORS, LAST_SYSTEM, Actuator
from mavlink_defs.faults.actuators import ACTUATOR_FAULTS
from mavlink_defs.faults.kinds import MAX_FREQUENCY_HZ, Kind, Target
from mavlink_defs.faults.sensors import MAX_INSTANCES, SENSOR_FAULTS, SENSOR_NAMES, SensorName
from sitl_plant.airframe.config import limits_in

LOSS = "loss"
_KINDS = {kind.name: kind for kind in ACTUATOR_FAULTS.kinds}
_SENSOR_KINDS = {kind.name: kind for kind in SENSOR_FAULTS.kinds}
if TYPE_CHECKING:
    DrawnKind: TypeAlias = str
    SensorKind: TypeAlias = str
else:
    DrawnKind, SensorKind = Literal[LOSS, *_KINDS], Literal[*_SENSOR_KINDS]

_Instance = Annotated[
    int, whole("", "Number of the sensor, from 1; 0: all.", ge=0, le=MAX_INSTANCES)
]


class _WithUavs(Model):
    uavs: Annotated[tuple[SystemId, ...], AtMost(LAST_SYSTEM)] = Field(
        default=(), description="UAVs that it may hit, as likely each; all of them by default."
    )


class _DrawnActuatorKeys(_WithUavs):
    actuators: Annotated[tuple[Actuator, ...], AtMost(len(ACTUATORS))] = Field(
        default=ACTUATORS, min_length=1, description="Actuators that it may hit, as likely each."
    )
    kinds: Annotated[dict[DrawnKind, Distribution], AtMost(1 + len(_KINDS))] = Field(
        min_length=1, description="Kinds of fault, as likely each, with their severity."
    )


class _DrawnSensorKeys(_WithUavs):
    sensors: Annotated[tuple[SensorName, ...], AtMost(len(SENSOR_NAMES))] = Field(
        min_length=1, description="Sensors that it may hit, as likely each."
    )
    instances: Annotated[tuple[_Instance, ...], AtMost(MAX_INSTANCES)] = Field(
        default=(0,), min_length=1, description="Numbers of the sensor, as likely each; 0: all."
    )
    kinds: Annotated[dict[SensorKind, Distribution | None], AtMost(len(_SENSOR_KINDS))] = Field(
        min_length=1,
        description="Kinds of fault, as likely each, with their value; null: it has none, or "
        "its default.",
    )


class _Drawn(Model):
    PARTS: ClassVar[tuple[str, ...]]  # keys of what it may hit; columns are their singulars
    VALUE: ClassVar[str]  # column of the value

    start_s: Distribution = Field(description="Onset [s of simulated time].")
    lasts_s: Distribution | None = Field(
        default=None, description="Length of the fault [s]; none: for good."
    )

    @model_validator(mode="after")
    def _fits_together(self) -> "_Drawn":
        Problems.check(self._found())
        return self

    def _found(self) -> Iterator[tuple[Loc, str]]:
        for key in ("uavs", *self.PARTS):
            yield from (((key, i), text) for i, text in repeated(getattr(self, key)))
        yield from self._kind_problems()
        yield from _outside(("start_s",), self.start_s, 0.0, math.inf, " s")
        yield from _outside(("lasts_s",), self.lasts_s, 1e-6, math.inf, " s")

    def _kind_problems(self) -> Iterator[tuple[Loc, str]]:
        raise NotImplementedError

    def _keys(self, drawn: Mapping[str, Any]) -> dict[str, Any]:
        """Return the keys of a drawn fault that its family does not change."""
        parts = [part.removesuffix("s") for part in self.PARTS]
        keys = {key: drawn[key] for key in ("uav", *parts, "start_s")}
        given = {key: drawn.get(key) for key in ("end_s", "frequency_hz")}
        return keys | {key: value for key, value in given.items() if value is not None}


def _outside(
    loc: Loc, drawn: Distribution | None, low: float, high: float, unit: str = ""
) -> Iterator[tuple[Loc, str]]:
    """Yield the values that a distribution can draw beyond a range."""
    for value in () if drawn is None else support(drawn):
        if not is_number(value) or not low <= value <= high:
            yield loc, f"draws {value!r}, expected within [{low:g}, {high:g}]{unit}"


class DrawnFault(_Drawn, _DrawnActuatorKeys):
    """One fault of one actuator, every part of it drawn.

    A severity is signed, in shares: of a loss, what the command loses (sign without meaning); of
    a bias or a stuck position, the value by the actuator's limit (a stuck throttle: its size).

    Attributes:
        frequency_hz: Frequency of the value, or of on and off [Hz]; none: constant.
    """

    PARTS: ClassVar[tuple[str, ...]] = ("actuators",)
    VALUE: ClassVar[str] = "severity"

    frequency_hz: Distribution | None = None

    def _found(self) -> Iterator[tuple[Loc, str]]:
        yield from super()._found()
        yield from _outside(("frequency_hz",), self.frequency_hz, 0.0, MAX_FREQUENCY_HZ, " Hz")

    def _kind_problems(self) -> Iterator[tuple[Loc, str]]:
        for name, values in self.kinds.items():
            yield from _outside(("kinds", name), values, -1.0, 1.0)

    def fault(self, drawn: Mapping[str, Any], aircraft: Mapping[str, Any]) -> dict[str, Any]:
        """Return a drawn fault as the scenario has it.

        Args:
            drawn: The columns of the fault, by the ends of their names.
            aircraft: Plain data of the aircraft that it hits.
        """
        keys, severity = self._keys(drawn), drawn["severity"]
        if drawn["kind"] == LOSS:
            return keys | {"effectiveness": 1.0 - abs(severity)}
        kind, actuator = _KINDS[drawn["kind"]], ACTUATOR_FAULTS.named(drawn["actuator"])
        low, high = kind.bounds(actuator, limits_in(aircraft))
        value = -severity * low if severity < 0.0 and low < 0.0 else abs(severity) * high
        return keys | {kind.key(actuator): value}


class DrawnSensorFault(_Drawn, _DrawnSensorKeys):
    """One fault of one navigation sensor, every part of it drawn.

    The value of a kind is in the unit of the sensor, as in a scenario's faults: a bias of a gyro
    in deg/s.
    """

    PARTS: ClassVar[tuple[str, ...]] = ("sensors", "instances")
    VALUE: ClassVar[str] = "value"

    @property
    def frequency_hz(self) -> None:
        """There is none but the value of an intermittent fault."""
        return

    def _kind_problems(self) -> Iterator[tuple[Loc, str]]:
        sensors = [SENSOR_FAULTS.named(name) for name in self.sensors]
        for i, sensor in enumerate(sensors):
            if max(self.instances) > 1 and not sensor.has_imus:
                yield ("instances",), f"expected 0 or 1, as there is one sensor of {sensor.name}"
            for name in self.kinds:
                if not _SENSOR_KINDS[name].fits(sensor):
                    yield ("sensors", i), f"{sensor.name} has no {name}"
        for name, values in self.kinds.items():
            if values is not None:
                yield from _value_problems(_SENSOR_KINDS[name], values, sensors)

    def fault(self, drawn: Mapping[str, Any], _: Mapping[str, Any]) -> dict[str, Any]:
        """Return a drawn fault as the scenario has it; arguments as of `DrawnFault.fault`."""
        kind, sensor = _SENSOR_KINDS[drawn["kind"]], SENSOR_FAULTS.named(drawn["sensor"])
        if not kind.has_value:
            return self._keys(drawn) | {"failure": kind.name}
        is_drawn = self.kinds[kind.name] is not None
        value = drawn["value"] if is_drawn else kind.default_of(sensor)
        return self._keys(drawn) | {kind.key(sensor): value}


def _value_problems(
    kind: Kind, values: Distribution, sensors: list[Target]
) -> Iterator[tuple[Loc, str]]:
    place, units = ("kinds", kind.name), {kind.unit_of(sensor) for sensor in sensors}
    if not kind.has_value:
        yield place, "expected null, as it has no value"
    elif len(units) > 1:
        listed = ", ".join(sorted(units))
        yield place, f"expected sensors of one unit with a value, got {listed}"
    else:
        unit = f" {units.pop()}".rstrip()
        outside = (_outside(place, values, *kind.bounds(sensor), unit) for sensor in sensors)
        yield from itertools.islice(itertools.chain.from_iterable(outside), 1)


def _part(fault: Any) -> str:
    """Return the tag of a drawn fault: whether a sensor or an actuator fails."""
    has_sensors = "sensors" in fault if isinstance(fault, dict) else hasattr(fault, "sensors")
    return "<sensor>" if has_sensors else "<actuator>"


AnyDrawnFault = Annotated[
    Annotated[DrawnFault, Tag("<actuator>")] | Annotated[DrawnSensorFault, Tag("<sensor>")],
    Discriminator(_part),
]
"""A drawn fault: of a sensor if it has the key `sensors`."""
