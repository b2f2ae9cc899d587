"""Least squares of the aerodynamic coefficients, with confidence intervals.

Errors of one experiment are not independent: what the model does not have is wrong in all of its
windows alike. So the covariance is estimated by experiments, not by windows (Liang and Zeger,
"Longitudinal data analysis using generalized linear models", Biometrika 73, 1986).
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ftc_lab.identification.readings import Windows
from sitl_plant.airframe.config import TERMS

CONFIDENCE = 0.95
"""Of an interval."""
_WIDE = 0.3  # half of an interval by the value, from which on a recording says too little
_CONSTANT = 1e-6  # of a coefficient: less variation than this is rounding
_BLOCK = 256  # rows that are taken together
_ROUNDING = 1e-9  # singular values below this share of the largest are none


class CoefficientEstimate(NamedTuple):
    """A coefficient."""

    value: float
    half_width: float  # of its confidence interval; infinite if the flight does not show it
    is_nominal: bool = False  # at its nominal value


class Residual(NamedTuple):
    """What a force or moment has that the coefficients do not explain."""

    rms: float  # of the coefficient
    share: float  # of its standard deviation


class Fit(NamedTuple):
    """All coefficients, and what is left over of each force and moment."""

    estimates: dict[str, CoefficientEstimate]
    residuals: dict[str, Residual]


def fit(windows: Windows) -> Fit:
    """Fit every coefficient to what was measured."""
    estimates: dict[str, CoefficientEstimate] = {}
    residuals: dict[str, Residual] = {}
    for axis, regressors in TERMS.items():
        columns = {name: windows.regressors[of] for name, of in regressors.items()}
        measured = windows.coefficients[axis]
        found, left = fit_columns(columns, measured, windows.group)
        estimates |= found
        residuals[axis] = residual_of(left, measured)
    return Fit(estimates, residuals)


def residual_of(left: np.ndarray, measured: np.ndarray) -> Residual:
    """Return what is left over, as a size and as a share."""
    rms = float(np.sqrt(np.mean(left**2)))
    size = max(float(np.std(measured)), _CONSTANT * float(np.sqrt(np.mean(measured**2))))
    return Residual(rms, rms / size if size > 0.0 else 0.0)


def fit_columns(
    columns: dict[str, np.ndarray],
    measured: np.ndarray,
    group: np.ndarray,
    nominal: Mapping[str, float] | None = None,
) -> tuple[dict[str, CoefficientEstimate], np.ndarray]:
    """Fit columns to what was measured.

    Args:
        columns: By name, each of shape (m,).
        measured: Shape (m,).
        group: Of each row; errors of one group are not independent, shape (m,).
        nominal: Values that stay as they are where the flight does not show them: whose interval
            would be wider than 0.3 of the value. What is not in it is fitted.

    Returns:
        Estimates by name, in the order of the columns, and what is left over, shape (m,). Intervals
        have by how much a value moves if nothing stays nominal.
    """
    nominal, free = nominal or {}, dict(columns)
    estimates: dict[str, CoefficientEstimate] = {}
    of_all: dict[str, CoefficientEstimate] = {}
    while True:
        found, left = _solved(free, measured, group)
        of_all = of_all or found
        worst = max(free, key=lambda name: _width(found[name], nominal, name), default=None)
        if worst is None or _width(found[worst], nominal, worst) <= _WIDE:
            break
        measured = measured - nominal[worst] * free.pop(worst)
        estimates[worst] = CoefficientEstimate(
            nominal[worst], found[worst].half_width, is_nominal=True
        )
    if estimates:
        found = {name: widened(one, one.value - of_all[name].value) for name, one in found.items()}
    estimates |= found
    return {name: estimates[name] for name in columns}, left


def widened(one: CoefficientEstimate, by: float) -> CoefficientEstimate:
    """Return an estimate whose interval has a further, independent part."""
    return one._replace(half_width=math.hypot(one.half_width, by))


def _width(found: CoefficientEstimate, nominal: Mapping[str, float], name: str) -> float:
    if name not in nominal:
        return 0.0
    return found.half_width / max(abs(found.value), abs(nominal[name]), 1e-12)


def few_rows(rows: np.ndarray) -> np.ndarray:
    """Return few rows with the same products of columns as many, by QR of blocks of them.

    Of one block threads of the linear algebra would wait for each other, long on a busy machine.
    """
    whole = len(rows) // _BLOCK * _BLOCK
    blocks = rows[:whole].reshape(-1, _BLOCK, rows.shape[1])
    parts = np.asarray(np.linalg.qr(blocks, mode="r"))
    both = np.concatenate([parts.reshape(-1, rows.shape[1]), rows[whole:]])
    return np.asarray(np.linalg.qr(both, mode="r") if len(both) < 2 * _BLOCK else few_rows(both))


def _solved(
    free: dict[str, np.ndarray], y: np.ndarray, group: np.ndarray
) -> tuple[dict[str, CoefficientEstimate], np.ndarray]:
    """Return estimates by name, and the residuals of all rows."""
    from scipy.stats import t as students_t

    if not free:
        return {}, y
    A = np.column_stack(list(free.values()))
    size = np.sqrt(np.mean(A**2, axis=0))
    size[size == 0.0] = 1.0
    few = few_rows(np.column_stack([A / size, y]))
    U, singular, Vt = np.linalg.svd(few[:, :-1], full_matrices=False)
    is_seen = singular > _ROUNDING * max(float(singular[0]), 1e-300)
    back = Vt[is_seen].T / singular[is_seen]
    theta = back @ (U[:, is_seen].T @ few[:, -1])
    left = y - (A / size) @ theta
    groups = np.unique(group)
    by_group = np.stack([left[group == one] @ A[group == one] for one in groups]) / size
    scores = by_group @ back @ back.T
    freedom = max(len(groups) - len(free), 1)
    correction = len(groups) / freedom
    deviation = np.sqrt(correction * np.sum(scores**2, axis=0))
    unseen = (
        np.abs(Vt[~is_seen]).max(axis=0) > 1e-6 if not is_seen.all() else np.zeros(len(free), bool)
    )
    widths = students_t.ppf(0.5 + CONFIDENCE / 2.0, freedom) * deviation
    widths[unseen] = np.inf
    found = {
        name: CoefficientEstimate(float(value), float(width))
        for name, value, width in zip(free, theta / size, widths / size, strict=True)
    }
    return found, left
