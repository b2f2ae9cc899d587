"""Disturbances d_v [m/s²] and d_ω [rad/s²]: per axis one sinusoid of simulation time."""

import math

import numpy as np

from mavlink_defs.runtime.jit import compiled
from sitl_plant.config import Disturbance
from sitl_plant.vec3 import Vec3

__all__ = ["disturbance_table", "disturbances"]


def disturbance_table(disturbance: Disturbance) -> np.ndarray:
    """Return the configured disturbance as an array of shape (6, 3).

    Rows: d_v x, y, z [m/s²], d_ω x, y, z [rad/s²], body axes. Columns: amplitude of the sine,
    amplitude of the cosine, angular frequency [rad/s].
    """
    axes = [
        getattr(part, axis)
        for part in (disturbance.acceleration_m_s2, disturbance.angular_acceleration_rad_s2)
        for axis in "xyz"
    ]
    return np.array([[wave.sin, wave.cos, wave.rate_rad_s] for wave in axes], dtype=np.float64)


@compiled
def disturbances(table: np.ndarray, t: float) -> tuple[Vec3, Vec3]:
    """Evaluate d_v and d_ω at time t [s]; `table` as `disturbance_table` returns it."""
    return (
        (_wave(table, 0, t), _wave(table, 1, t), _wave(table, 2, t)),
        (_wave(table, 3, t), _wave(table, 4, t), _wave(table, 5, t)),
    )


@compiled
def _wave(table: np.ndarray, row: int, t: float) -> float:
    angle = table[row, 2] * t
    value: float = table[row, 0] * math.sin(angle) + table[row, 1] * math.cos(angle)
    return value
