"""Disturbances d_v [m/s²] and d_ω [rad/s²]: per axis one sinusoid of simulation time."""

import math
from typing import TypeAlias

import numpy as np

from mavlink_defs.runtime.jit import compiled
from sitl_plant.air.config import Disturbance
from sitl_plant.vec3 import Vec3

Disturbances: TypeAlias = tuple[Vec3, Vec3]
"""d_v [m/s²] and d_ω [rad/s²] at one time, body axes."""


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
def disturbances(table: np.ndarray, t: float) -> Disturbances:
    """Evaluate d_v and d_ω at time t [s]; `table` as `disturbance_table` returns it."""
    at = _phase(table, 0, t, (0.0, 1.0))
    x = _wave(table, 0, at)
    at = _phase(table, 1, t, at)
    y = _wave(table, 1, at)
    at = _phase(table, 2, t, at)
    z = _wave(table, 2, at)
    at = _phase(table, 3, t, at)
    roll = _wave(table, 3, at)
    at = _phase(table, 4, t, at)
    pitch = _wave(table, 4, at)
    at = _phase(table, 5, t, at)
    return (x, y, z), (roll, pitch, _wave(table, 5, at))


@compiled
def disturbances_over(
    now: Disturbances, table: np.ndarray, t: float, dt: float
) -> tuple[Disturbances, Disturbances, Disturbances]:
    """Return d_v and d_ω at the start, in the middle and at the end of a period.

    Args:
        now: Those at its start.
        table: As `disturbance_table` returns it.
        t: Start of the period [s].
        dt: Its length [s].
    """
    return now, disturbances(table, t + 0.5 * dt), disturbances(table, t + dt)


@compiled
def _phase(
    table: np.ndarray, row: int, t: float, before: tuple[float, float]
) -> tuple[float, float]:
    """Return sine and cosine of a row's angle: what the row before has if its rate is the same."""
    if row > 0 and table[row, 2] == table[row - 1, 2]:
        return before
    angle = table[row, 2] * t
    return math.sin(angle), math.cos(angle)


@compiled
def _wave(table: np.ndarray, row: int, at: tuple[float, float]) -> float:
    value: float = table[row, 0] * at[0] + table[row, 1] * at[1]
    return value
