"""Actuator faults as MAV_CMD_FTC_SET_FAULT carries them.

While a fault is active the aircraft applies
``effectiveness * commanded + value * cos(2 pi frequency (t - start))``. Units are those of
the command: deg for a surface, N for the throttle, s of simulation time.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

from mavlink_defs.constants import ACTUATORS, THROTTLE
from mavlink_defs.dialect import MAVLink_ftc_fault_message
from mavlink_defs.float32 import decimal_of_float32

MAX_FREQUENCY_HZ = 500.0

MAX_FAULTS = 16
"""Faults that one aircraft can hold at a time."""

_TOLERANCE = 1.0 + 1e-9  # a limit kept in radians may come back as 24.999999999999996 deg


@dataclass(frozen=True)
class Fault:
    """One fault of one actuator.

    Attributes:
        actuator: Index into `ACTUATORS`.
        effectiveness: Remaining effectiveness, 1 healthy to 0 stuck [-].
        value: Bias, or the stuck value when `effectiveness` is 0 [deg, or N for the throttle].
        frequency_hz: Frequency of the value; 0 for a constant one [Hz].
        start_s: Start in simulation time, exclusive; NaN for now [s].
        end_s: End in simulation time, inclusive; NaN for until cleared [s].
    """

    actuator: int
    effectiveness: float
    value: float
    frequency_hz: float
    start_s: float
    end_s: float

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
        )

    @classmethod
    def from_si(
        cls,
        actuator: int,
        effectiveness: float,
        value: float,
        frequency_hz: float,
        start_s: float,
        end_s: float,
    ) -> Self:
        """Return the fault whose `value` is given in rad, or N for the throttle."""
        value = value if actuator == THROTTLE else math.degrees(value)
        return cls(actuator, effectiveness, value, frequency_hz, start_s, end_s)

    def to_si(self) -> tuple[int, float, float, float, float, float]:
        """Return the arguments of `from_si`, value [rad, or N for the throttle]."""
        throttle = self.actuator == THROTTLE
        value = self.value if throttle else math.radians(self.value)
        return (
            self.actuator,
            self.effectiveness,
            value,
            self.frequency_hz,
            self.start_s,
            self.end_s,
        )

    def resolved(self, now_s: float) -> Self:
        """Return the fault as set at `now_s` [s]: NaN becomes now or, for the end, infinity."""
        return replace(
            self,
            start_s=now_s if math.isnan(self.start_s) else self.start_s,
            end_s=math.inf if math.isnan(self.end_s) else self.end_s,
        )

    def coexists_with(self, actuator: int, start_s: float, end_s: float, now_s: float) -> bool:
        """Return whether an earlier fault stays when this one is set.

        A fault that is over by now goes, and so does one of the same actuator that overlaps.

        Args:
            actuator: Of the earlier fault.
            start_s: Start of its window, exclusive [s].
            end_s: End of its window, inclusive [s].
            now_s: Simulation time at which this fault, which is `resolved`, is set [s].
        """
        overlaps = start_s < self.end_s and self.start_s < end_s
        return end_s > now_s and not (actuator == self.actuator and overlaps)


@dataclass(frozen=True)
class FaultLimits:
    """Largest magnitudes that the actuators of an aircraft can take."""

    surface_deg: float
    thrust_n: float


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


def fault_to_params(fault: Fault) -> tuple[float, ...]:
    """Return the seven parameters of the command that sets `fault`."""
    return (
        float(fault.actuator),
        fault.effectiveness,
        fault.value,
        fault.frequency_hz,
        fault.start_s,
        fault.end_s,
        0.0,
    )


def fault_from_params(params: Sequence[float], limits: FaultLimits) -> Fault:
    """Decode and check the seven parameters of MAV_CMD_FTC_SET_FAULT.

    Args:
        params: Parameters 1 to 7 as they came off the wire (float32 values).
        limits: Limits of the aircraft that the fault is for.

    Raises:
        InvalidParam: A parameter is not finite or out of range; the first one is named.
    """
    actuator, effectiveness, value, frequency, start, end = map(decimal_of_float32, params[:6])
    if actuator not in range(len(ACTUATORS)):
        raise _invalid(1, "Actuator", actuator, "0, 1, 2 or 3")
    _check(2, "Effectiveness", effectiveness, (0.0, 1.0))
    _check_value(int(actuator), effectiveness, value, limits)
    _check(4, "Frequency", frequency, (0.0, MAX_FREQUENCY_HZ), "Hz")
    if not math.isnan(start) and not 0.0 <= start < math.inf:
        raise _invalid(5, "Start", start, "NaN or at least 0 s", "s")
    earliest = 0.0 if math.isnan(start) else start
    if not math.isnan(end) and not end > earliest:
        raise _invalid(6, "End", end, f"NaN or more than {earliest:g} s", "s")
    return Fault(int(actuator), effectiveness, value, frequency, start, end)


def _check_value(actuator: int, effectiveness: float, value: float, limits: FaultLimits) -> None:
    if actuator != THROTTLE:
        _check(3, "Value", value, (-limits.surface_deg, limits.surface_deg), "deg")
    elif effectiveness == 0.0:  # stuck: the value is the thrust itself
        _check(3, "Value", value, (0.0, limits.thrust_n), "N")
    else:
        _check(3, "Value", value, (-limits.thrust_n, limits.thrust_n), "N")


def _check(
    index: int, name: str, value: float, bounds: tuple[float, float], unit: str = ""
) -> None:
    low, high = bounds
    if not low * _TOLERANCE <= value <= high * _TOLERANCE:  # false for NaN
        raise _invalid(index, name, value, f"{low:g} to {high:g} {unit}".rstrip(), unit)


def _invalid(index: int, name: str, value: float, expected: str, unit: str = "") -> InvalidParam:
    shown = f"{value:g} {unit}".rstrip()
    return InvalidParam(index, name, f"Fault: {name} is {shown}, must be {expected}")
