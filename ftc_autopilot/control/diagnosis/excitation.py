"""Dither and probe: small movements of a command that show whether an actuator follows.

They are the excitation that the regression needs (persistent excitation) where the flight has none.

A rudder at its stop, or an elevator stuck near its trim, moves nothing that the flight would
show: a suspect surface is moved to one side and back until it is seen to follow or not, a lost one
about its position.
"""

import math

import numpy as np

from mavlink_defs.constants import RUDDER
from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import clamp

_HALF_PERIOD_S, _RUDDER_HALF_PERIOD_S = 0.035, 0.05


@compiled
def dithered(delta: float, j: int, stop: float, gains: np.void, state: np.void) -> float:
    """Return the command of surface j [rad], moved to and fro if the surface is suspect.

    The side is the side of the law's own answer to the jump, or toward zero where the stop is near.

    Args:
        delta: Command of the law [rad].
        j: The surface, number as FTC_ACTUATOR.
        stop: Largest deflection [rad].
        gains: Parameters, record made of `DiagnosisParameters`.
        state: Record of dtype `DIAGNOSIS`.
    """
    actuator = state["actuators"][j]
    half = _RUDDER_HALF_PERIOD_S if j == RUDDER else _HALF_PERIOD_S
    if actuator["lost"] != 0 or actuator["suspect_s"] == 0.0 or actuator["dither_s"] == 0.0:
        return delta
    delta = clamp(delta, -stop, stop)
    size, sign = gains["dither_rad"][j], actuator["dither_sign"]
    if abs(delta + sign * size) > stop:
        sign = -math.copysign(1.0, delta)
    if actuator["dither_s"] % (2.0 * half) < half:
        delta += sign * size
    return delta


@compiled
def probe(j: int, gains: np.void, state: np.void) -> float:
    """Return the square wave that is added to what the lost surface j is sent [rad]."""
    size: float = gains["probe_rad"][j]
    return size if state["age"] % (2.0 * gains["probe_s"]) < gains["probe_s"] else -size


@compiled
def probed(j: int, gains: np.void, state: np.void) -> float:
    """Return a command for the lost surface j: its position plus the probe [rad]."""
    command: float = state["actuators"][j]["stuck"] + probe(j, gains, state)
    return command
