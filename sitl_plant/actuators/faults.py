"""What faults of actuators do, eqs. (13) and (19) of the paper.

Channels are in the order of FTC_ACTUATOR: aileron, elevator, rudder [rad], throttle [N].
A fault acts between the command that was received and the physics; the deflection or thrust
that results stays within the actuator's physical stops.
"""

import math
from typing import TypeAlias

import numpy as np

from mavlink_defs.dialect import (
    FTC_FAULT_KIND_DRIFT,
    FTC_FAULT_KIND_HARDOVER,
    FTC_FAULT_KIND_INTERMITTENT,
)
from mavlink_defs.runtime.jit import compiled

Controls: TypeAlias = tuple[float, float, float, float]
"""Aileron, elevator, rudder [rad], thrust [N]."""


@compiled
def offset(fault: np.void, t: float) -> float:
    """Return what the value of a fault adds, f(t) of (13), (19) [rad or N].

    Args:
        fault: An entry of dtype `mavlink_defs.faults.table.FAULT`.
        t: Time [s].
    """
    since = t - fault["start"]
    if fault["code"] == FTC_FAULT_KIND_INTERMITTENT:
        return float(fault["value"])
    wave: float = fault["value"] * math.cos(2.0 * math.pi * fault["frequency"] * since)
    if fault["code"] == FTC_FAULT_KIND_DRIFT:
        wave *= since
    return wave


@compiled
def acts(fault: np.void, interval_start: float) -> bool:
    """Return whether a fault acts within the integration interval that begins at a time [s].

    Args:
        fault: An entry of dtype `mavlink_defs.faults.table.FAULT`.
        interval_start: Start of the interval [s].
    """
    if not fault["start"] <= interval_start < fault["end"]:
        return False
    periods = (interval_start - fault["start"]) * fault["frequency"]
    in_first_half: bool = periods % 1.0 < 0.5
    return in_first_half or fault["code"] != FTC_FAULT_KIND_INTERMITTENT


@compiled
def servo_command(command: float, channel: int, faults: np.ndarray, t: float) -> float:
    """Return what a servo follows: the command, or what runs it away, in a hard-over.

    Args:
        command: Received for the channel.
        channel: The channel.
        faults: One aircraft's faults, dtype `FAULT`, shape (MAX_FAULTS,).
        t: Start of the period [s].
    """
    for i in range(len(faults)):
        fault = faults[i]
        if fault["target"] < 0:
            break
        is_hardover = fault["code"] == FTC_FAULT_KIND_HARDOVER
        if is_hardover and fault["target"] == channel and acts(fault, t):
            command = offset(fault, t)
    return command


@compiled
def apply_faults(
    commanded: Controls, t: float, interval_start: float, faults: np.ndarray, aircraft: np.void
) -> Controls:
    """Return what the actuators do under faults, eqs. (13) and (19): ρ · commanded + f(t).

    A fault is switched on and off at the ends of integration intervals, so that no interval
    contains a jump: it acts within the whole interval that begins at `interval_start` if its
    window (start, end] contains the interval's interior; so do the halves of an intermittent one.

    Args:
        commanded: Commands received last.
        t: Time of f [s], inside the interval.
        interval_start: Start of the integration interval [s].
        faults: One aircraft's faults, dtype `FAULT`, shape (MAX_FAULTS,).
        aircraft: Record of dtype `sitl_plant.airframe.aircraft.AIRCRAFT`.
    """
    da, de, dr, thrust = commanded
    for i in range(len(faults)):
        fault = faults[i]
        actuator = fault["target"]
        if actuator < 0:
            break
        if fault["code"] == FTC_FAULT_KIND_HARDOVER or not acts(fault, interval_start):
            continue  # a hard-over is the servo's: see `servo_command`
        rho = fault["effectiveness"]
        f = offset(fault, t)
        if actuator == 0:
            da = rho * da + f
        elif actuator == 1:
            de = rho * de + f
        elif actuator == 2:
            dr = rho * dr + f
        else:
            thrust = rho * thrust + f
    stops = aircraft["stops"]
    return (
        min(max(da, stops[0, 0]), stops[0, 1]),
        min(max(de, stops[1, 0]), stops[1, 1]),
        min(max(dr, stops[2, 0]), stops[2, 1]),
        min(max(thrust, 0.0), aircraft["thrust_limit"]),
    )
