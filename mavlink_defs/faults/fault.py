"""One fault: as a text, as plain data and as messages carry it."""

import math
from typing import Any, NamedTuple, Self

from mavlink_defs.dialect import MAVLink_ftc_fault_message
from mavlink_defs.faults import FAMILIES, FAMILY_OF
from mavlink_defs.faults.actuators import BIAS
from mavlink_defs.faults.kinds import Family, Kind, Target
from mavlink_defs.faults.sensors import AXIS_NAMES
from mavlink_defs.faults.window import Window
from mavlink_defs.float32 import decimal_of_float32


class Fault(NamedTuple):
    """One fault of one target; what its family does not have is 0.

    Attributes:
        target: What fails.
        kind: How.
        value: What the kind makes of it, in its unit.
        start_s: Start in simulation time, exclusive; NaN for now [s].
        end_s: End in simulation time, inclusive; NaN for until cleared [s].
        effectiveness: Remaining effectiveness, 1 healthy to 0 stuck [-].
        frequency_hz: Frequency of the value; 0 for a constant one [Hz].
        instance: Number of the sensor from 1; 0 for all.
        axis: FTC_AXIS.
    """

    target: Target
    kind: Kind
    value: float = 0.0
    start_s: float = math.nan
    end_s: float = math.nan
    effectiveness: float = 0.0
    frequency_hz: float = 0.0
    instance: int = 0
    axis: int = 0

    @classmethod
    def from_message(cls, message: MAVLink_ftc_fault_message) -> Self | None:
        """Decode an FTC_FAULT whose `count` is not 0; an open end is infinite.

        Returns:
            None if target, kind or axis are unknown.
        """
        others = (family for family in FAMILIES[1:] if getattr(message, family.key))
        family = next(others, FAMILIES[0])
        effectiveness = decimal_of_float32(message.effectiveness)
        target = family.target(getattr(message, family.key))
        kind = family.kind(message.kind, effectiveness)
        unknown_axis = family.has("axis") and message.axis > len(AXIS_NAMES)
        if target is None or kind is None or unknown_axis:
            return None
        own: dict[str, Any] = {
            "effectiveness": effectiveness,
            "frequency_hz": decimal_of_float32(message.frequency),
            "instance": message.instance,
            "axis": message.axis,
        }
        value, start_s, end_s = map(decimal_of_float32, (message.value, message.start, message.end))
        given = {name: value for name, value in own.items() if family.has(name)}
        return cls(target, kind, value, start_s, end_s)._replace(**given)

    def message(self, time_s: float) -> MAVLink_ftc_fault_message:
        """Return it as FTC_FAULT at a simulation time [s]; its place in the list is left out."""
        numbers = {f.key: self.number if f is self.family else 0 for f in FAMILIES}
        return MAVLink_ftc_fault_message(
            effectiveness=self.effectiveness,
            value=self.value,
            frequency=self.frequency_hz,
            start=self.start_s,
            end=self.end_s,
            index=0,
            count=0,
            active=int(self.window.contains(time_s)),
            kind=self.code,
            instance=self.instance,
            axis=self.axis,
            **numbers,
        )

    @property
    def family(self) -> Family:
        """The family of its target."""
        return FAMILY_OF[self.target.name]

    @property
    def number(self) -> int:
        """Number of its target on the wire."""
        return self.family.number_of(self.target)

    @property
    def actuator(self) -> int:
        """`number`: its name of before, kept for one version."""
        return self.number

    @property
    def code(self) -> int:
        """Number of its kind on the wire."""
        return self.kind.code

    @property
    def params(self) -> tuple[float, ...]:
        """The seven parameters of the command that sets it."""
        return tuple(getattr(self, name) if name else 0.0 for name in self.family.params)

    @property
    def window(self) -> Window:
        """When it acts."""
        return Window(self.start_s, self.end_s)

    @property
    def whose(self) -> str:
        """What fails: "rudder", "gyro 1", or "airspeed" of which there is one."""
        name = self.target.name
        return f"{name} {self.instance}" if self.target.has_imus and self.instance else name

    def describe(self) -> str:
        """Return the fault as a text: "rudder at 50 % + 1 deg in (19, 22] s"."""
        return " ".join((*self.parts(), str(self.window)))

    def parts(self) -> tuple[str, str]:
        """Return what fails, and how, as texts: "gyro 1 x", "+3 deg/s"."""
        kind = self.kind
        axis = f" {AXIS_NAMES[self.axis - 1]}" if self.axis else ""
        how = [f"at {100.0 * self.effectiveness:g} %"] if kind.partial else []
        if self.value or kind != BIAS:
            wave = kind.wave.format(self.frequency_hz) if self.frequency_hz else ""
            unit = f" {kind.unit_of(self.target)}".rstrip()
            how.append(kind.describe(self.value, unit, wave))
        return f"{self.whose}{axis}", " ".join(how)

    def as_dict(self, time_s: float | None) -> dict[str, Any]:
        """Return the fault as plain data; its end is None if it lasts until cleared.

        Args:
            time_s: Simulation time [s]; None if unknown.
        """
        kind, family = self.kind, self.family
        data: dict[str, Any] = {family.key: self.target.name}
        data |= {name: getattr(self, name) for name in _BEFORE if family.has(name)}
        if kind.failure:
            data["failure"] = kind.failure
        if kind.has_value:
            data[kind.key(self.target)] = self.value
        if family.has("frequency_hz"):
            data["frequency_hz"] = self.frequency_hz
        if self.axis:
            data["axis"] = AXIS_NAMES[self.axis - 1]
        return data | self.window.as_dict(time_s)

    def resolved(self, now_s: float) -> Self:
        """Return the fault as set at `now_s` [s]: NaN becomes now or, for the end, infinity."""
        return self._replace(**self.window.resolved(now_s)._asdict())

    def covers(self, other: "Fault") -> bool:
        """Return whether all that fails by the other one fails by this one, at whatever time."""
        return self.target == other.target and self.instance in {0, other.instance}

    def stays(self, new: "Fault", now_s: float) -> bool:
        """Return whether it stays when another one is set.

        One that is over goes, and so does one that the other one covers and overlaps in time.

        Args:
            new: The other one, `resolved`.
            now_s: Simulation time at which it is set [s].
        """
        replaced = new.covers(self) and new.window.overlaps(self.window)
        return self.end_s > now_s and not replaced


_BEFORE = ("instance", "effectiveness")  # what plain data have before the value
