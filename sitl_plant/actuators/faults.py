"""Actuators and their faults, eqs. (13) and (19) of the paper.

Channels are in the order of FTC_ACTUATOR: aileron, elevator, rudder [rad], throttle [N].
A fault acts between the command that was received and the physics; the deflection or thrust
that results stays within the actuator's physical stops.
"""

import math
from typing import TypeAlias

import numpy as np

from mavlink_defs.constants import THROTTLE
from mavlink_defs.dialect import (
    FTC_FAULT_KIND_DRIFT,
    FTC_FAULT_KIND_HARDOVER,
    FTC_FAULT_KIND_INTERMITTENT,
)
from mavlink_defs.faults import MAX_FAULTS, Fault
from mavlink_defs.runtime.jit import compiled

_EMPTY = -1

FAULT = np.dtype(
    [
        ("actuator", "i8"),  # FTC_ACTUATOR, -1: slot empty (and every one behind it)
        ("rho", "f8"),  # remaining effectiveness
        ("value", "f8"),  # what the kind makes of it [rad or N]
        ("frequency", "f8"),  # of the value [Hz]
        ("start", "f8"),  # exclusive, simulation time [s]
        ("end", "f8"),  # inclusive, simulation time [s]
        ("code", "i8"),  # FTC_FAULT_KIND
    ]
)
"""A fault in SI units, its fields in the order of `Fault`."""

Controls: TypeAlias = tuple[float, float, float, float]
"""Aileron, elevator, rudder [rad], thrust [N]."""


def no_faults(aircraft_count: int) -> np.ndarray:
    """Return an empty fault table of dtype `FAULT`, shape (aircraft_count, MAX_FAULTS)."""
    table = np.zeros((aircraft_count, MAX_FAULTS), FAULT)
    table["actuator"] = _EMPTY
    return table


def add_fault(row: np.ndarray, fault: Fault, now_s: float) -> None:
    """Put a fault into one aircraft's row, where those stay that it `coexists_with`.

    Args:
        row: One aircraft's faults, dtype `FAULT`, shape (MAX_FAULTS,).
        fault: As the wire carries it: NaN start now, NaN end open.
        now_s: Simulation time [s].

    Raises:
        OverflowError: All slots are taken by other faults.
    """
    fault = fault.resolved(now_s)
    kept = [
        old.copy()
        for old in row[row["actuator"] != _EMPTY]
        if fault.coexists_with(old["actuator"], old["start"], old["end"], now_s)
    ]
    if len(kept) == MAX_FAULTS:
        raise OverflowError(f"all {MAX_FAULTS} fault slots are in use; clear some first")
    row["actuator"] = _EMPTY
    for i, old in enumerate(kept):
        row[i] = old
    value = fault.value if fault.actuator == THROTTLE else math.radians(fault.value)
    row[len(kept)] = fault._replace(value=value)


def in_wire_units(fault: Fault) -> Fault:
    """Return a fault, whose value is in SI units as in `FAULT`, in the units of the wire."""
    value = fault.value if fault.actuator == THROTTLE else math.degrees(fault.value)
    return fault._replace(value=value)


def clear_faults(row: np.ndarray, actuator: int) -> None:
    """Remove the faults of one actuator (-1: of all) from one aircraft's row."""
    keep = (row["actuator"] != _EMPTY) & (row["actuator"] != actuator) & (actuator != _EMPTY)
    kept = row[keep].copy()
    row["actuator"] = _EMPTY
    row[: len(kept)] = kept


@compiled
def offset(fault: np.void, t: float) -> float:
    """Return what the value of a fault adds, f(t) of (13), (19) [rad or N].

    Args:
        fault: An entry of dtype `FAULT`.
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
        fault: An entry of dtype `FAULT`.
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
        if fault["actuator"] < 0:
            break
        is_hardover = fault["code"] == FTC_FAULT_KIND_HARDOVER
        if is_hardover and fault["actuator"] == channel and acts(fault, t):
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
        actuator = fault["actuator"]
        if actuator < 0:
            break
        if fault["code"] == FTC_FAULT_KIND_HARDOVER or not acts(fault, interval_start):
            continue  # a hard-over is the servo's: see `servo_command`
        rho = fault["rho"]
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
