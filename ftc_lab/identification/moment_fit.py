"""Coefficients of moments and times, fitted to the rates of windows by least squares."""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ftc_lab.identification.fit import few_rows
from ftc_lab.identification.log_signals import LogSignals
from ftc_lab.identification.output_error import (
    GROUPS,
    LAGS,
    MOMENT_TERMS,
    SHIFTS,
    Linearised,
    MomentModel,
    RateMotion,
)
from ftc_lab.identification.segments import LogWindows

_EARLIEST_S, _LATEST_S = -0.1, 0.2  # times that are looked for
_USUAL_S = 0.1  # of a shift that the log does not show: it stays within some of this
_INSIDE = 1e-3  # of the bounds, in units of a usual time, from where a fit begins
_ENOUGH = (1e-3, 1e-4)  # change of squares, and of parameters, by which a fit by some weights ends


@dataclass(frozen=True)
class MomentFit:
    """The model, and its least squares problem where it is solved.

    Attributes:
        model: What fits best.
        columns: Derivatives of all rates, by their scale, by what is free, each of shape (k,).
        left: What is left over of them, shape (k,).
        group: Of each, shape (k,).
        share: Of the standard deviation of each rate that is left over, shape (3,).
    """

    model: MomentModel
    columns: dict[str, np.ndarray]
    left: np.ndarray
    group: np.ndarray
    share: np.ndarray


class _Unknowns(NamedTuple):
    """What is free, in units of its usual size, and between which bounds."""

    names: list[str]
    unit: np.ndarray
    least: np.ndarray
    most: np.ndarray

    def inside(self, x: np.ndarray) -> np.ndarray:
        """Return values a little inside of the bounds, where a fit can begin."""
        return np.asarray(np.clip(x, self.least + _INSIDE, self.most - _INSIDE))


def _unknowns(start: MomentModel, fixed: frozenset[str], *, exact: bool) -> _Unknowns:
    coefficients = [name for name in MOMENT_TERMS if name not in fixed]
    shifts = [] if exact else list(SHIFTS)
    unit = [max(abs(start.values[name]), 0.01) for name in coefficients]
    earliest = [0.0 if name in LAGS else _EARLIEST_S for name in shifts]
    endless = [math.inf] * len(coefficients)
    return _Unknowns(
        [*coefficients, *shifts],
        np.array([*unit, *(_USUAL_S for _ in shifts)]),
        np.array([*(-end for end in endless), *(at / _USUAL_S for at in earliest)]),
        np.array([*endless, *(_LATEST_S / _USUAL_S for _ in shifts)]),
    )


def fit_moments(
    signals: LogSignals, shots: LogWindows, start: MomentModel, fixed: frozenset[str]
) -> MomentFit:
    """Fit coefficients of moments and shifts to the rates of windows.

    Args:
        signals: The flight.
        shots: Windows of it over which rates are simulated.
        start: Where to begin.
        fixed: Coefficients that stay as they are; of a recording of ours all shifts do.
    """
    from scipy.optimize import least_squares

    motion, model = RateMotion(signals, shots), start
    unknown = _unknowns(start, fixed, exact=signals.exact)
    free, unit = unknown.names, unknown.unit
    prior = np.eye(len(free))[[name in SHIFTS for name in free]]

    def model_at(x: np.ndarray) -> MomentModel:
        found = dict(zip(free, (x * unit).tolist(), strict=True))
        return MomentModel(
            {name: found.get(name, value) for name, value in start.values.items()},
            {name: found.get(name, value) for name, value in start.shifts_s.items()},
            model.scale,
        )

    solved_at: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}

    def problem(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if x.tobytes() not in solved_at:
            few = [np.column_stack([prior, prior @ x])]
            for part in motion.linearised(model_at(x), free):
                rows = np.zeros((len(part.names) + 1, len(free) + 1))
                places = list(map(free.index, part.names))
                rows[:, [*places, -1]] = few_rows(part.rows) * np.append(unit[places], 1.0)
                few.append(rows)
            both = np.concatenate(few)
            solved_at.clear()
            solved_at[x.tobytes()] = both[:, -1], both[:, :-1]
        return solved_at[x.tobytes()]

    x = unknown.inside(np.array([{**start.values, **start.shifts_s}[name] for name in free]) / unit)
    for enough in _ENOUGH:
        solved = least_squares(
            lambda x: problem(x)[0],
            x,
            lambda x: problem(x)[1],
            bounds=(unknown.least, unknown.most),
            ftol=enough,
            xtol=enough,
        )
        solved_at.clear()
        x = unknown.inside(solved.x)
        rest = motion.linearised(model_at(solved.x), free)
        model = replace(model_at(x), scale=_sizes(rest) * model.scale)
    return _fit_of(motion, shots, model, free)


def _sizes(parts: list[Linearised]) -> np.ndarray:
    """Return the standard deviation of what is left over of each rate, shape (3,)."""
    found = np.empty(3)
    for axes, part in zip(GROUPS, parts, strict=True):
        found[axes] = np.sqrt(np.mean(part.left**2, axis=(0, 2)))
    return found


def _fit_of(
    motion: RateMotion, shots: LogWindows, model: MomentModel, free: list[str]
) -> MomentFit:
    """Return a model with the least squares problem about it."""
    parts = motion.linearised(model, free)
    columns = {name: list[np.ndarray]() for name in free}
    for part in parts:
        for name in free:
            none = np.zeros(part.left.shape)
            here = name in part.names
            columns[name].append(part.slopes[:, :, part.names.index(name)] if here else none)
    spread = np.std(motion.measured, axis=(1, 2))
    return MomentFit(
        model,
        {name: np.concatenate([one.ravel() for one in of]) for name, of in columns.items()},
        -np.concatenate([part.left.ravel() for part in parts]),
        np.concatenate([np.broadcast_to(shots.group, part.left.shape).ravel() for part in parts]),
        model.scale / spread,
    )
