"""Faults and diagnoses in words, for the terminal and the dashboard."""

import math
from collections.abc import Sequence

from mavlink_defs.constants import ACTUATORS, THROTTLE
from mavlink_defs.faults import Fault


def describe_fault(fault: Fault) -> str:
    """Return a fault in words: "rudder at 90 % + 1 deg in (19, 22] s"."""
    unit = "N" if fault.actuator == THROTTLE else "deg"
    wave = f" · cos 2π {fault.frequency_hz:g} Hz" if fault.frequency_hz else ""
    if fault.effectiveness == 0.0:
        what = f"stuck at {fault.value:g} {unit}{wave}"
    else:
        what = f"at {100.0 * fault.effectiveness:g} %"
        if fault.value:
            what += f" {'-' if fault.value < 0.0 else '+'} {abs(fault.value):g} {unit}{wave}"
    return f"{ACTUATORS[fault.actuator]} {what} {_window(fault)}"


def _window(fault: Fault) -> str:
    ends = f"{fault.end_s:g}] s" if math.isfinite(fault.end_s) else "until cleared"
    if math.isnan(fault.start_s):
        return f"from now, {ends}"
    if math.isfinite(fault.end_s):
        return f"in ({fault.start_s:g}, {ends}"
    return f"after {fault.start_s:g} s, {ends}"


def describe_diagnosis(phases: Sequence[float]) -> tuple[str, int]:
    """Return what a vehicle makes of its actuators, as text, and the worst FTC_PHASE of them.

    Args:
        phases: FTC_PHASE of each actuator, in the order of FTC_ACTUATOR.
    """
    worst = int(max(phases))
    names = " ".join(name for name, phase in zip(ACTUATORS, phases, strict=True) if phase == worst)
    return ("healthy", f"{names}?", f"{names} lost")[worst], worst
