"""What is read of a flight, and the windows over which the equations of motion are integrated.

Over a window of W seconds, J Δω/W + mean(ω × J ω) is the mean moment, whatever the noise of one
reading; the coefficients times the mean of what they belong to have to make it.
"""

from dataclasses import dataclass

import numpy as np

from sitl_plant.simulators.base import Body

WINDOW_S = 0.01
"""Length of a window [s]."""


@dataclass(frozen=True)
class Readings:
    """Readings at equal intervals; n of them, in pieces without a gap.

    Attributes:
        dt: Interval [s].
        v: Velocity through the air, body axes [m/s], shape (n, 3).
        omega: Angular velocity [rad/s], shape (n, 3).
        force: Specific force [m/s²], shape (n, 3).
        delta: Aileron, elevator, rudder [rad], shape (n, 3).
        thrust: Along x [N], shape (n,).
        piece: Number of the piece, shape (n,).
        group: Number of the experiment, shape (n,): errors of one are not independent.
    """

    dt: float
    v: np.ndarray
    omega: np.ndarray
    force: np.ndarray
    delta: np.ndarray
    thrust: np.ndarray
    piece: np.ndarray
    group: np.ndarray


@dataclass(frozen=True)
class Windows:
    """Means over windows, m of them.

    Attributes:
        regressors: What coefficients are multiplied by, each of shape (m,): "1", "alpha", ...
        coefficients: Measured C_L, C_D, C_Y, C_l, C_m, C_n as "cL", ..., each of shape (m,).
        group: Number of the experiment, shape (m,).
    """

    regressors: dict[str, np.ndarray]
    coefficients: dict[str, np.ndarray]
    group: np.ndarray


def windows_of(readings: Readings, body: Body) -> Windows:
    """Return the windows of readings, those that fit into a piece."""
    span = max(round(WINDOW_S / readings.dt), 1)
    starts = _starts(readings.piece, span)
    weights = np.full(span + 1, 1.0 / span)
    weights[[0, -1]] *= 0.5  # trapezoidal rule
    rows = starts[:, None] + np.arange(span + 1)

    def mean(values: np.ndarray) -> np.ndarray:
        return np.tensordot(values[rows], weights, axes=(1, 0))

    J = inertia_of(body)
    turning = (readings.omega[rows[:, -1]] - readings.omega[rows[:, 0]]) / (span * readings.dt)
    gyroscopic = np.cross(readings.omega, readings.omega @ J)
    moment = turning @ J + np.stack([mean(column) for column in gyroscopic.T], axis=1)
    V = np.linalg.norm(readings.v, axis=1)
    qS = 0.5 * body.air_density_kg_m3 * V**2 * body.wing_area_m2
    by = mean(qS)
    coefficients = {name: mean(force) / by for name, force in _forces(readings, body).items()}
    b, c = body.wing_span_m, body.mean_chord_m
    for name, length, part in (("cl", b, 0), ("cm", c, 1), ("cn", b, 2)):
        coefficients[name] = moment[:, part] / (by * length)
    regressors = {
        name: mean(qS * values) / by for name, values in _regressors(readings, body, V).items()
    }
    return Windows(regressors, coefficients, readings.group[starts])


def inertia_of(body: Body) -> np.ndarray:
    """Return the inertia [kg m²], shape (3, 3)."""
    J = body.inertia_kg_m2
    return np.array([[J.Jxx, 0.0, -J.Jxz], [0.0, J.Jyy, 0.0], [-J.Jxz, 0.0, J.Jzz]])


def _starts(piece: np.ndarray, span: int) -> np.ndarray:
    """Return the first readings of windows side by side."""
    found: list[np.ndarray] = []
    edges = np.flatnonzero(np.diff(piece)) + 1
    for begin, end in zip([0, *edges], [*edges, len(piece)], strict=True):
        found.append(np.arange(begin, end - span, span))
    return np.concatenate(found) if found else np.zeros(0, np.int64)


def angles_of(v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return α and β [rad] of velocities, shape (n, 3)."""
    return np.arctan2(v[:, 2], v[:, 0]), np.arcsin(v[:, 1] / np.linalg.norm(v, axis=1))


def _forces(readings: Readings, body: Body) -> dict[str, np.ndarray]:
    """Return lift, drag and side force [N] of each reading, the thrust taken off."""
    x, y, z = (readings.force * body.mass_kg).T
    return wind_axes(x - readings.thrust, y, z, *angles_of(readings.v))


def wind_axes(
    x: np.ndarray, y: np.ndarray, z: np.ndarray, alpha: np.ndarray, beta: np.ndarray
) -> dict[str, np.ndarray]:
    """Return lift, drag and side force of a force in body axes, at angles α and β [rad]."""
    ca, sa, cb, sb = np.cos(alpha), np.sin(alpha), np.cos(beta), np.sin(beta)
    return {
        "cL": x * sa - z * ca,
        "cD": -(x * ca * cb + y * sb + z * sa * cb),
        "cY": -x * ca * sb + y * cb - z * sa * sb,
    }


def _regressors(readings: Readings, body: Body, V: np.ndarray) -> dict[str, np.ndarray]:
    alpha, beta = angles_of(readings.v)
    by_span, by_chord = body.wing_span_m / (2.0 * V), body.mean_chord_m / (2.0 * V)
    p, q, r = readings.omega.T
    da, de, dr = readings.delta.T
    return {
        "1": np.ones_like(V),
        "alpha": alpha,
        "alpha2": alpha**2,
        "beta": beta,
        "beta2": beta**2,
        "p": p * by_span,
        "q": q * by_chord,
        "r": r * by_span,
        "da": da,
        "de": de,
        "de2": de**2,
        "dr": dr,
    }
