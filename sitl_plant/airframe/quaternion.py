"""Attitudes as MAVLink has them: quaternions."""

import math

from sitl_plant.vec3 import Vec3


def quaternion(attitude: Vec3) -> tuple[float, float, float, float]:
    """Return body to NED, scalar first, from roll, pitch, yaw [rad]."""
    roll, pitch, yaw = attitude
    cr, sr = math.cos(roll / 2.0), math.sin(roll / 2.0)
    cp, sp = math.cos(pitch / 2.0), math.sin(pitch / 2.0)
    cy, sy = math.cos(yaw / 2.0), math.sin(yaw / 2.0)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )
