"""Dither and probe: small movements of a command that show whether an actuator follows.

They are the excitation that the regression needs (persistent excitation) where the flight has none.

A rudder at its stop, or an elevator stuck near its trim, moves nothing that the flight would
show: a suspect surface is moved to one side and back until it is seen to follow or not, a lost one
about its position.
"""

import math

import numpy as np

from mavlink_defs.constants import THROTTLE
from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import clamp


@compiled
def dithered(
    delta: float, j: int, stops: tuple[float, float], gains: np.void, state: np.void
) -> float:
    """Return the command of surface j [rad], moved to and fro if the surface is suspect.

    The side is the side of the law's own answer to the jump, or toward zero where the stop is near.

    Args:
        delta: Command of the law [rad].
        j: The surface, number as FTC_ACTUATOR.
        stops: Least and largest deflection [rad].
        gains: Parameters, record made of `DiagnosisParameters`.
        state: Record of dtype `DIAGNOSIS`.
    """
    actuator = state["actuators"][j]
    half = gains["dither_half_s"][j]
    if actuator["lost"] != 0:
        return delta
    actuator["dither"] = 0.0
    if actuator["suspect_s"] == 0.0 or actuator["dither_s"] == 0.0:
        return delta
    lowest, highest = stops
    delta = clamp(delta, lowest, highest)
    size, sign = gains["dither_rad"][j], actuator["dither_sign"]
    moved = delta + sign * size
    if moved < lowest or moved > highest:
        sign = -math.copysign(1.0, delta)
    if actuator["dither_s"] % (2.0 * half) < half:
        actuator["dither"] = sign * size
    return delta + float(actuator["dither"])


@compiled
def dithered_thrust(thrust: float, limit: float, gains: np.void, state: np.void) -> float:
    """Return the commanded thrust [N], moved up and down if the throttle is suspect.

    Args:
        thrust: Command of the law [N].
        limit: Largest thrust [N].
        gains: Parameters, record made of `DiagnosisParameters`.
        state: Record of dtype `DIAGNOSIS`.
    """
    throttle = state["actuators"][THROTTLE]
    throttle["dither"] = 0.0
    if throttle["lost"] == 0 and throttle["suspect_s"] > 0.0 and throttle["dither_s"] > 0.0:
        size: float = gains["throttle"]["dither_n"]
        thrust = clamp(thrust, size, limit - size)
        half = gains["throttle"]["dither_half_s"]
        is_first_half = throttle["dither_s"] % (2.0 * half) < half
        throttle["dither"] = size if is_first_half else -size
    return thrust + float(throttle["dither"])


@compiled
def probe(j: int, gains: np.void, state: np.void) -> float:
    """Return the square wave that is added to what the lost actuator j is sent [rad or N]."""
    size: float = gains["throttle"]["probe_n"] if j == THROTTLE else gains["probe_rad"][j]
    return size if state["age"] % (2.0 * gains["probe_s"]) < gains["probe_s"] else -size


@compiled
def probed(j: int, base: float, gains: np.void, state: np.void) -> float:
    """Return a command for the lost surface j: a position plus a movement [rad].

    At first it is moved far and fast, to find out whether it still has a share of its power.

    Args:
        j: The surface, number as FTC_ACTUATOR.
        base: The position [rad]: where it is stuck, or where it should be once it moves again.
        gains: Parameters, record made of `DiagnosisParameters`.
        state: Record of dtype `DIAGNOSIS`.
    """
    actuator = state["actuators"][j]
    move = probe(j, gains, state)
    actuator["dither"] = 0.0
    if actuator["decided_s"] < gains["trial_s"]:
        half = gains["dither_half_s"][j]
        size: float = gains["trial_rad"][j]
        move = size if actuator["decided_s"] % (2.0 * half) < half else -size
        actuator["dither"] = move
    return base + move
