"""Faults as their families' commands, and MAV_CMD_INJECT_FAILURE, carry them."""

import math
from collections.abc import Sequence
from typing import Any

from mavlink_defs.faults import FAMILIES
from mavlink_defs.faults.fault import Fault
from mavlink_defs.faults.kinds import ANY_LIMITS, MAX_FREQUENCY_HZ, Family, FaultLimits, Target
from mavlink_defs.faults.sensors import AXIS_NAMES, FAILURES, Failure
from mavlink_defs.float32 import decimal_of_float32

_FEW = 4
_TOLERANCE = 1.0 + 1e-9  # a limit stored in radians may come back as 24.999999999999996 deg


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


def fault_from_params(
    family: Family, params: Sequence[float], limits: FaultLimits = ANY_LIMITS
) -> Fault:
    """Decode and check the seven parameters of the command that sets a fault.

    How many instances of a sensor there are, only the plant knows.

    Args:
        family: The family that the command is of.
        params: Parameters 1 to 7 as they came off the wire (float32 values).
        limits: Limits of the aircraft that the fault is for.

    Raises:
        InvalidParam: A parameter is not finite or out of range; the first one is named.
    """
    given: dict[str, Any] = dict(zip(family.params, map(decimal_of_float32, params), strict=True))
    target = family.target(given["number"])
    if target is None:
        raise _wrong(family, "number", given["number"], family.numbers)
    code = family.default_code if math.isnan(given["code"]) else given["code"]
    kind = family.kind(code, given.get("effectiveness", 0.0))
    if kind is None:
        raise _wrong(family, "code", given["code"], _codes(family))
    if not limits.has(target.name):
        text = f"{family.title}: the aircraft has no {target.name}"
        raise InvalidParam(1, family.key.capitalize(), text)
    if not kind.fits(target):
        text = f"{family.title}: {target.name} has no {kind.name}, did you mean bias or drift?"
        raise InvalidParam(1 + family.params.index("code"), "Kind", text)
    if not kind.has_value or math.isnan(given["value"]):
        given["value"] = kind.default_of(target)
    own = {name: value for name, value in given.items() if name in Fault._fields}
    fault = Fault(target, kind, **own)
    _check_values(fault, limits)
    _check_window(fault)
    return fault._replace(instance=int(fault.instance), axis=_checked_axis(fault))


def _check_values(fault: Fault, limits: FaultLimits) -> None:
    family, target, kind = fault.family, fault.target, fault.kind
    ranges = {"effectiveness": ((0.0, 1.0 if kind.partial else 0.0), "")}
    if kind.has_value:
        ranges["value"] = (kind.bounds(target, limits), kind.unit_of(target))
    ranges["frequency_hz"] = ((0.0, MAX_FREQUENCY_HZ), "Hz")
    for name, ((low, high), unit) in ranges.items():
        value = getattr(fault, name)
        if not low * _TOLERANCE <= value <= high * _TOLERANCE:
            expected = f"{low:g}" if low == high else f"{low:g} to {high:g} {unit}".rstrip()
            raise _wrong(family, name, value, expected, unit, kind.name)
    if kind.switches and fault.frequency_hz == 0.0:
        raise _wrong(family, "frequency_hz", 0.0, "more than 0 Hz", "Hz")
    if not _is_number(fault.instance):
        raise _wrong(family, "instance", fault.instance, "0 for all, or a number from 1 on")


def _check_window(fault: Fault) -> None:
    start_s, end_s = fault.start_s, fault.end_s
    if not math.isnan(start_s) and not 0.0 <= start_s < math.inf:
        raise _wrong(fault.family, "start_s", start_s, "NaN or at least 0 s", "s")
    earliest_s = 0.0 if math.isnan(start_s) else start_s
    if not math.isnan(end_s) and not end_s > earliest_s:
        raise _wrong(fault.family, "end_s", end_s, f"NaN or more than {earliest_s:g} s", "s")


def _checked_axis(fault: Fault) -> int:
    axes = len(AXIS_NAMES) if fault.target.axes and fault.kind.wrongs else 0
    if fault.axis not in range(1 + axes):
        expected = f"{'0 to 3' if axes else '0'} for {fault.kind.name} of {fault.target.name}"
        raise _wrong(fault.family, "axis", fault.axis, expected)
    return int(fault.axis)


def _wrong(
    family: Family, name: str, value: float, expected: str, unit: str = "", kind: str = ""
) -> InvalidParam:
    """Return the error of a parameter."""
    labels = {"number": family.key, "code": "kind", "value": family.value_label}
    label = labels.get(name, name.partition("_")[0]).capitalize().format(kind)
    text = f"{family.title}: {label} is {f'{value:g} {unit}'.rstrip()}, must be {expected}"
    return InvalidParam(1 + family.params.index(name), label, text)


def _codes(family: Family) -> str:
    """Return the numbers of its kinds as a text."""
    codes = sorted({kind.code for kind in family.kinds})
    return " or ".join(map(str, codes)) if len(codes) <= _FEW else f"0 to {codes[-1]}"


def _is_number(value: float) -> bool:
    return 0.0 <= value < math.inf and value % 1.0 == 0.0


def failure_from_params(params: Sequence[float]) -> tuple[Target, int, Failure | None] | None:
    """Decode MAV_CMD_INJECT_FAILURE of what is no actuator: target, FAILURE instance and type.

    Args:
        params: Parameters of the command as they came off the wire.

    Returns:
        None if the unit is none of these; a type of None is FAILURE_TYPE_OK.

    Raises:
        InvalidParam: Type or instance is out of range.
    """
    number, kind, instance = params[:3]
    targets = (target for family in FAMILIES[1:] for target in family.targets)
    target = next((one for one in targets if one.failure_unit == number), None)
    if target is None:
        return None
    if kind not in range(1 + len(FAILURES)):
        text = f"Failure: Type is {kind:g}, must be 0 (OK) to {len(FAILURES)} (intermittent)"
        raise InvalidParam(2, "Type", text)
    if not _is_number(instance):
        text = f"Failure: Instance is {instance:g}, must be 0 for all or a number from 1 on"
        raise InvalidParam(3, "Instance", text)
    return target, int(instance), FAILURES[int(kind) - 1] if kind else None
