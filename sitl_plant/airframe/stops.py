"""The ranges of the actuators, and the shares of them that are on the wire.

HIL_ACTUATOR_CONTROLS has a command as a share of the stop on its side: -1 is the least position,
1 the largest one, 0 is 0 whatever the stops are.
"""

import numpy as np

from mavlink_defs.constants import THROTTLE
from mavlink_defs.runtime.jit import compiled
from sitl_plant.airframe.aircraft import AircraftRecord
from sitl_plant.vec3 import clamp


@compiled
def range_of(aircraft: AircraftRecord, j: int) -> tuple[float, float]:
    """Return the least and the largest position of an actuator [rad, of the throttle N].

    Both are 0 for a surface that the aircraft has not.

    Args:
        aircraft: The aircraft.
        j: The actuator, number as FTC_ACTUATOR.
    """
    if j == THROTTLE:
        return 0.0, float(aircraft["thrust_limit"])
    return float(aircraft["stops"][j, 0]), float(aircraft["stops"][j, 1])


@compiled
def has_actuator(aircraft: AircraftRecord, j: int) -> bool:
    """Return whether an aircraft has an actuator, number as FTC_ACTUATOR."""
    lowest, highest = range_of(aircraft, j)
    return lowest < highest


@compiled
def stop_beside(position: float, lowest: float, highest: float) -> float:
    """Return how far the stop on the side of a position is from 0, in the unit of the range."""
    return -lowest if position < 0.0 else highest


@compiled
def share_of(position: float, lowest: float, highest: float) -> np.float32:
    """Return the share of a position, within its range, as the wire has it."""
    within = clamp(position, lowest, highest)
    stop = stop_beside(within, lowest, highest)
    if stop == 0.0:
        return np.float32(0.0)
    return np.float32(within / stop)


@compiled
def position_of(share: float, lowest: float, highest: float) -> float:
    """Return the position of a share of -1 to 1, in the unit of the range."""
    return float(share) * stop_beside(share, lowest, highest)
