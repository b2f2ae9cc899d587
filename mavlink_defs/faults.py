"""Actuator faults as MAV_CMD_FTC_SET_FAULT carries them."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple, Self

from mavlink_defs.constants import ACTUATORS, Actuator
from mavlink_defs.dialect import MAVLink_ftc_fault_message
from mavlink_defs.fault_kinds import BIAS, CODES, MAX_FREQUENCY_HZ, FaultKind, FaultLimits, kind_of
from mavlink_defs.fault_window import Window
from mavlink_defs.float32 import decimal_of_float32

MAX_FAULTS = 16
"""Faults that one aircraft can hold at a time."""

_TOLERANCE = 1.0 + 1e-9  # a limit stored in radians may come back as 24.999999999999996 deg


class Fault(NamedTuple):
    """One fault of one actuator: the seven parameters of the command, in their order.

    Attributes:
        actuator: Index into `ACTUATORS`.
        effectiveness: Remaining effectiveness, 1 healthy to 0 stuck [-].
        value: What the kind makes of it [deg, or N for the throttle].
        frequency_hz: Frequency of the value; 0 for a constant one [Hz].
        start_s: Start in simulation time, exclusive; NaN for now [s].
        end_s: End in simulation time, inclusive; NaN for until cleared [s].
        code: FTC_FAULT_KIND.
    """

    actuator: int
    effectiveness: float
    value: float
    frequency_hz: float
    start_s: float
    end_s: float
    code: int = 0

    @classmethod
    def from_message(cls, message: MAVLink_ftc_fault_message) -> Self:
        """Decode an FTC_FAULT whose `count` is not 0; an open end is infinite."""
        return cls(
            actuator=message.actuator,
            effectiveness=decimal_of_float32(message.effectiveness),
            value=decimal_of_float32(message.value),
            frequency_hz=decimal_of_float32(message.frequency),
            start_s=decimal_of_float32(message.start),
            end_s=decimal_of_float32(message.end),
            code=message.kind,
        )

    @property
    def actuator_name(self) -> Actuator:
        """Name of the actuator."""
        return ACTUATORS[self.actuator]

    @property
    def target(self) -> str:
        """What fails: the name of the actuator."""
        return self.actuator_name

    @property
    def kind(self) -> FaultKind:
        """Its kind."""
        return kind_of(self.code, self.effectiveness)

    @property
    def window(self) -> Window:
        """When it acts."""
        return Window(self.start_s, self.end_s)

    def describe(self) -> str:
        """Return the fault as a text: "rudder at 50 % + 1 deg in (19, 22] s"."""
        kind = self.kind
        wave = kind.wave.format(self.frequency_hz) if self.frequency_hz else ""
        parts: list[str] = [self.actuator_name]
        if not kind.replaces:
            parts.append(f"at {100.0 * self.effectiveness:g} %")
        if self.value or kind is not BIAS:
            parts.append(kind.describe(self.value, f" {kind.unit(self.actuator_name)}", wave))
        return " ".join((*parts, str(self.window)))

    def as_dict(self, time_s: float | None) -> dict[str, Any]:
        """Return the fault as plain data; its end is None if it lasts until cleared.

        Args:
            time_s: Simulation time [s]; None if unknown.
        """
        return {
            "actuator": self.actuator_name,
            "effectiveness": self.effectiveness,
            self.kind.key(self.actuator_name): self.value,
            "frequency_hz": self.frequency_hz,
            **self.window.as_dict(time_s),
        }

    def resolved(self, now_s: float) -> Self:
        """Return the fault as set at `now_s` [s]: NaN becomes now or, for the end, infinity."""
        return self._replace(**self.window.resolved(now_s)._asdict())

    def coexists_with(self, actuator: int, start_s: float, end_s: float, now_s: float) -> bool:
        """Return whether an earlier fault stays when this one is set.

        A fault that is over by now goes, and so does one of the same actuator that overlaps.

        Args:
            actuator: Of the earlier fault.
            start_s: Start of its window, exclusive [s].
            end_s: End of its window, inclusive [s].
            now_s: Simulation time at which this fault, which is `resolved`, is set [s].
        """
        overlaps = self.window.overlaps(Window(start_s, end_s))
        return end_s > now_s and not (actuator == self.actuator and overlaps)


class InvalidParam(ValueError):  # noqa: N818 - it says what is wrong, as an answer does
    """A parameter of a command is out of range.

    Attributes:
        index: Number of the parameter, 1 to 7.
        name: Its label in the dialect.
        text: One sentence with name, value and expected range, short enough for a STATUSTEXT.
    """

    def __init__(self, index: int, name: str, text: str) -> None:
        super().__init__(index, name, text)
        self.index, self.name, self.text = index, name, text

    def __str__(self) -> str:
        return self.text


def fault_from_params(params: Sequence[float], limits: FaultLimits) -> Fault:
    """Decode and check the seven parameters of MAV_CMD_FTC_SET_FAULT.

    Args:
        params: Parameters 1 to 7 as they came off the wire (float32 values).
        limits: Limits of the aircraft that the fault is for.

    Raises:
        InvalidParam: A parameter is not finite or out of range; the first one is named.
    """
    actuator, effectiveness, value, frequency, start, end, code = map(decimal_of_float32, params)
    if actuator not in range(len(ACTUATORS)):
        raise _invalid(1, "Actuator", actuator, "0, 1, 2 or 3")
    if math.isnan(code):  # not given
        code = 0.0
    elif code not in CODES:
        raise _invalid(7, "Kind", code, " or ".join(map(str, sorted(CODES))))
    fault = Fault(int(actuator), effectiveness, value, frequency, start, end, int(code))
    name, kind = fault.actuator_name, fault.kind
    if not limits.has(name):
        raise InvalidParam(1, "Actuator", f"Fault: the aircraft has no {name}")
    _check(2, "Effectiveness", effectiveness, (0.0, 0.0 if kind.replaces else 1.0))
    _check(3, "Value", value, kind.bounds(name, limits), kind.unit(name))
    _check(4, "Frequency", frequency, (0.0, MAX_FREQUENCY_HZ), "Hz")
    if kind.switches and frequency == 0.0:
        raise _invalid(4, "Frequency", 0.0, "more than 0 Hz", "Hz")
    check_window("Fault", start, end)
    return fault


def check_window(fault: str, start_s: float, end_s: float) -> None:
    """Check the window of a fault, parameters 5 and 6 of its command; NaN leaves an end open.

    Args:
        fault: What it is called in a message.
        start_s: Start [s].
        end_s: End [s].

    Raises:
        InvalidParam: It starts before 0, or ends before it starts.
    """
    if not math.isnan(start_s) and not 0.0 <= start_s < math.inf:
        raise invalid_param(fault, 5, "Start", start_s, "NaN or at least 0 s", "s")
    earliest_s = 0.0 if math.isnan(start_s) else start_s
    if not math.isnan(end_s) and not end_s > earliest_s:
        raise invalid_param(fault, 6, "End", end_s, f"NaN or more than {earliest_s:g} s", "s")


def is_within(value: float, bounds: tuple[float, float]) -> bool:
    """Return whether a value is in its range, to the rounding of its unit; false for NaN."""
    low, high = bounds
    return low * _TOLERANCE <= value <= high * _TOLERANCE


def invalid_param(
    fault: str, index: int, name: str, value: float, expected: str, unit: str = ""
) -> InvalidParam:
    """Return the error of a parameter.

    Args:
        fault: What the fault is called.
        index: Number of the parameter, 1 to 7.
        name: Its label in the dialect.
        value: Its value [unit].
        expected: What is expected, with its unit.
        unit: Its unit.
    """
    shown = f"{value:g} {unit}".rstrip()
    return InvalidParam(index, name, f"{fault}: {name} is {shown}, must be {expected}")


def _check(
    index: int, name: str, value: float, bounds: tuple[float, float], unit: str = ""
) -> None:
    if not is_within(value, bounds):
        low, high = bounds
        expected = f"{low:g}" if low == high else f"{low:g} to {high:g} {unit}".rstrip()
        raise _invalid(index, name, value, expected, unit)


def _invalid(index: int, name: str, value: float, expected: str, unit: str = "") -> InvalidParam:
    return invalid_param("Fault", index, name, value, expected, unit)
