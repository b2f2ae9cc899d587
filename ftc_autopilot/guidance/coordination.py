"""What a UAV does for its formation: its slot, and corrections of its way along the path."""

from typing import NamedTuple

from sitl_plant.vec3 import Vec3

__all__ = ["Coordination"]


class Coordination(NamedTuple):
    """Where guidance is to fly, relative to the path, and with which corrections."""

    slot: Vec3  # ahead, to the right, up, of the point of the path that the formation is at [m]
    speed: float  # added to the ground speed along the path [m/s]
    right: float  # velocity added to the right of the path, which keeps UAVs apart [m/s]
    up: float  # the same upwards [m/s]
